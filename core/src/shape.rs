//! Shapes: constructive geometry for bodies and regions.
//!
//! A shape answers one question, whether a position lies inside it, and knows its
//! bounding box. Bodies are the cell centres of a lattice that lie inside a shape;
//! regions are the points of a body that do.

mod extrusion;
mod normal;
mod stl;
mod volume;

use std::path::Path;

use nalgebra::{Rotation3, SVector, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use extrusion::Extrusion;
pub use normal::{Facing, SurfacePart};
pub use stl::{Defects, Format, FormatError, Stl, StlError};

/// A solid shape. All lengths in metres.
///
/// In a case file: `shape.box = { min = [0, 0, 0], max = [0.1, 0.05, 0.01] }`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Axis-aligned box from `min` to `max`, in m.
    Box(BoxShape),
    /// Circular cylinder between the centres of its two end faces, in m.
    Cylinder(Cylinder),
    /// Elliptical cylinder between the centres of its two end faces (an elliptical hole, with
    /// `difference`), in m.
    EllipticalCylinder(EllipticalCylinder),
    /// Sphere (a disc in 2D bodies), in m.
    Sphere(Sphere),
    /// All positions below a plane: those with `(x - point) . normal <= 0`.
    HalfSpace(HalfSpace),
    /// A polygon drawn out along an axis, in m.
    Extrusion(Extrusion),
    /// The solid in an STL file.
    Stl(Stl),
    /// Everything inside at least one of the shapes.
    Union(Vec<Shape>),
    /// Everything inside `from` and outside `subtract`.
    Difference(Difference),
    /// A shape turned about an axis.
    Rotate(Rotate),
}

/// Axis-aligned box.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxShape {
    /// Corner with the smallest coordinates, m.
    pub min: [f64; 3],
    /// Corner with the largest coordinates, m.
    pub max: [f64; 3],
}

/// Circular cylinder.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// Centre of one end face, m.
    pub start: [f64; 3],
    /// Centre of the other end face, m.
    pub end: [f64; 3],
    /// Radius, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

/// Elliptical cylinder.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EllipticalCylinder {
    /// Centre of one end face, m.
    pub start: [f64; 3],
    /// Centre of the other end face, m.
    pub end: [f64; 3],
    /// One semi-axis of the ellipse as a vector at right angles to the cylinder, m.
    pub semi_axis: [f64; 3],
    /// Length of the other semi-axis, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub other: f64,
}

/// Directions and lengths of an elliptical cylinder.
struct EllipticalFrame {
    /// Unit vector along the cylinder.
    along: Vector3<f64>,
    /// Unit vectors along the semi-axes.
    across: [Vector3<f64>; 2],
    /// Lengths of the semi-axes, m.
    semi_axes: [f64; 2],
    /// m.
    length: f64,
}

impl EllipticalCylinder {
    fn frame(&self) -> EllipticalFrame {
        let axis = Vector3::from(self.end) - Vector3::from(self.start);
        let semi_axis = Vector3::from(self.semi_axis);
        let (along, first) = (axis.normalize(), semi_axis.normalize());
        EllipticalFrame {
            along,
            across: [first, along.cross(&first)],
            semi_axes: [semi_axis.norm(), self.other],
            length: axis.norm(),
        }
    }

    fn contains(&self, position: &Vector3<f64>, tolerance: f64) -> bool {
        let frame = self.frame();
        let ([first, second], [a, b]) = (frame.across, frame.semi_axes);
        if a.min(b) + tolerance <= 0.0 {
            return false;
        }
        let relative = position - Vector3::from(self.start);
        let height = relative.dot(&frame.along);
        let scaled = |direction: Vector3<f64>, semi_axis: f64| {
            relative.dot(&direction) / (semi_axis + tolerance)
        };
        let inside = scaled(first, a).powi(2) + scaled(second, b).powi(2) <= 1.0;
        inside && height >= -tolerance && height <= frame.length + tolerance
    }

    fn bounds(&self) -> Bounds {
        let frame = self.frame();
        let ([first, second], [a, b]) = (frame.across, frame.semi_axes);
        let reach = Vector3::from_fn(|i, _| (a * first[i]).hypot(b * second[i]));
        let (start, end) = (Vector3::from(self.start), Vector3::from(self.end));
        (start.inf(&end) - reach, start.sup(&end) + reach)
    }

    fn mistake(&self) -> Option<String> {
        if self.start == self.end {
            return Some("the cylinder has no length".into());
        }
        let (axis, semi_axis) = (
            Vector3::from(self.end) - Vector3::from(self.start),
            Vector3::from(self.semi_axis),
        );
        if semi_axis.norm() <= 0.0 || self.other <= 0.0 {
            return Some("a semi-axis of the ellipse has no length".into());
        }
        let skew = axis.dot(&semi_axis).abs() > 1e-6 * axis.norm() * semi_axis.norm();
        skew.then(|| "the semi-axis is not at right angles to the cylinder".into())
    }
}

/// Sphere.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Radius, m.
    pub radius: f64,
}

/// Half-space.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the bounding plane, m.
    pub point: [f64; 3],
    /// Outward normal of the plane; need not be of unit length.
    pub normal: [f64; 3],
}

/// One shape less another.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The shape to cut from.
    pub from: Box<Shape>,
    /// The shape that is cut away.
    pub subtract: Box<Shape>,
}

/// A shape turned about an axis by the right-hand rule.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotate {
    /// The shape before it is turned.
    pub shape: Box<Shape>,
    /// Direction of the axis, of any length; default z.
    #[serde(default = "upward")]
    pub axis: [f64; 3],
    /// Angle, rad.
    pub angle: f64,
    /// A point of the axis, m; default the origin.
    #[serde(default)]
    pub about: [f64; 3],
}

fn upward() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl Rotate {
    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Unit::new_normalize(self.axis.into()), self.angle)
    }

    /// A position (m) before the shape was turned.
    fn before(&self, position: &Vector3<f64>) -> Vector3<f64> {
        let about = Vector3::from(self.about);
        about + self.rotation().inverse() * (position - about)
    }

    /// The box around the turned box of the shape.
    fn bounds(&self) -> Option<Bounds> {
        let (min, max) = self.shape.bounds()?;
        let about = Vector3::from(self.about);
        let rotation = self.rotation();
        let corner = |index: usize| {
            let corner = Vector3::from_fn(|a, _| if index >> a & 1 == 0 { min[a] } else { max[a] });
            about + rotation * (corner - about)
        };
        let corners = (0..8).map(|index| (corner(index), corner(index)));
        corners.reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
    }

    fn mistake(&self) -> Option<String> {
        if self.axis == [0.0; 3] {
            return Some("the axis of the rotation is zero".into());
        }
        self.shape.mistake()
    }
}

/// Corners of an axis-aligned bounding box, m.
pub type Bounds = (Vector3<f64>, Vector3<f64>);

impl Shape {
    /// Reads the files that the shape names, whose paths start from `folder`; before this, what they describe contains
    /// nothing.
    ///
    /// # Errors
    /// [`StlError`].
    pub fn load(&mut self, folder: &Path) -> Result<(), StlError> {
        match self {
            Shape::Stl(s) => s.load(folder),
            Shape::Union(shapes) => shapes.iter_mut().try_for_each(|s| s.load(folder)),
            Shape::Difference(d) => d.from.load(folder).and_then(|()| d.subtract.load(folder)),
            Shape::Rotate(r) => r.shape.load(folder),
            Shape::Box(_)
            | Shape::Cylinder(_)
            | Shape::EllipticalCylinder(_)
            | Shape::Sphere(_)
            | Shape::HalfSpace(_)
            | Shape::Extrusion(_) => Ok(()),
        }
    }

    /// Whether `position` (m) lies inside or, within `tolerance` (m), on the surface.
    pub fn contains(&self, position: &Vector3<f64>, tolerance: f64) -> bool {
        match self {
            Shape::Box(b) => (0..3).all(|a| {
                position[a] >= b.min[a] - tolerance && position[a] <= b.max[a] + tolerance
            }),
            Shape::Cylinder(c) => {
                let (start, axis) = (
                    Vector3::from(c.start),
                    Vector3::from(c.end) - Vector3::from(c.start),
                );
                let length = axis.norm();
                let relative = position - start;
                let along = relative.dot(&axis) / length;
                let radial = (relative.norm_squared() - along * along).max(0.0).sqrt();
                along >= -tolerance && along <= length + tolerance && radial <= c.radius + tolerance
            }
            Shape::EllipticalCylinder(c) => c.contains(position, tolerance),
            Shape::Sphere(s) => (position - Vector3::from(s.centre)).norm() <= s.radius + tolerance,
            Shape::HalfSpace(h) => {
                let normal = Vector3::from(h.normal).normalize();
                (position - Vector3::from(h.point)).dot(&normal) <= tolerance
            }
            Shape::Extrusion(e) => e.contains(position, tolerance),
            Shape::Stl(s) => s.contains(position, tolerance),
            Shape::Union(shapes) => shapes.iter().any(|s| s.contains(position, tolerance)),
            Shape::Difference(d) => {
                d.from.contains(position, tolerance) && !d.subtract.contains(position, -tolerance)
            }
            Shape::Rotate(r) => r.shape.contains(&r.before(position), tolerance),
        }
    }

    /// Bounding box, or `None` for shapes without bounds (half-spaces).
    pub fn bounds(&self) -> Option<Bounds> {
        match self {
            Shape::Box(b) => Some((b.min.into(), b.max.into())),
            Shape::Cylinder(c) => {
                let (start, end) = (Vector3::from(c.start), Vector3::from(c.end));
                let axis = (end - start).normalize();
                let reach = axis.map(|a| c.radius * (1.0 - a * a).max(0.0).sqrt());
                Some((start.inf(&end) - reach, start.sup(&end) + reach))
            }
            Shape::EllipticalCylinder(c) => Some(c.bounds()),
            Shape::Sphere(s) => {
                let (centre, reach) = (Vector3::from(s.centre), Vector3::repeat(s.radius));
                Some((centre - reach, centre + reach))
            }
            Shape::HalfSpace(_) => None,
            Shape::Extrusion(e) => e.bounds(),
            Shape::Stl(s) => s.bounds(),
            Shape::Union(shapes) => shapes
                .iter()
                .map(Shape::bounds)
                .reduce(|a, b| Some((a?.0.inf(&b?.0), a?.1.sup(&b?.1))))
                .flatten(),
            Shape::Difference(d) => d.from.bounds(),
            Shape::Rotate(r) => r.bounds(),
        }
    }

    /// The first number of this shape that cannot be, as a sentence.
    pub fn mistake(&self) -> Option<String> {
        match self {
            Shape::Box(b) => (0..3).find(|&a| b.max[a] < b.min[a]).map(|a| {
                format!(
                    "the box has max {} below min {} along {}",
                    b.max[a],
                    b.min[a],
                    ["x", "y", "z"][a]
                )
            }),
            Shape::Cylinder(c) if c.start == c.end => Some("the cylinder has no length".into()),
            Shape::Cylinder(Cylinder { radius, .. }) | Shape::Sphere(Sphere { radius, .. })
                if *radius <= 0.0 =>
            {
                Some(format!("the radius {radius} is not positive"))
            }
            Shape::EllipticalCylinder(c) => c.mistake(),
            Shape::HalfSpace(h) if h.normal == [0.0; 3] => Some("the normal is zero".into()),
            Shape::Extrusion(e) => e.mistake(),
            Shape::Stl(s) => s.mistake(),
            Shape::Union(shapes) => shapes.iter().find_map(Shape::mistake),
            Shape::Difference(d) => d.from.mistake().or_else(|| d.subtract.mistake()),
            Shape::Rotate(r) => r.mistake(),
            _ => None,
        }
    }
}

/// Distance of a position from the segment between a and b, m.
fn distance_from_segment<const N: usize>(at: SVector<f64, N>, [a, b]: [SVector<f64, N>; 2]) -> f64 {
    let along = b - a;
    let fraction = (at - a).dot(&along) / along.norm_squared();
    // a segment without length has the fraction NaN, which `clamp` keeps
    let fraction = if fraction.is_nan() { 0.0 } else { fraction };
    (at - a - along * fraction.clamp(0.0, 1.0)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(radius: f64) -> Shape {
        Shape::Sphere(Sphere {
            centre: [0.0; 3],
            radius,
        })
    }

    #[test]
    fn difference_excludes_the_inner_sphere_but_keeps_its_surface() {
        let shell = Shape::Difference(Difference {
            from: sphere(2.0).into(),
            subtract: sphere(1.0).into(),
        });
        for (x, inside) in [(0.5, false), (1.0, true), (1.5, true), (2.5, false)] {
            assert_eq!(
                shell.contains(&Vector3::new(x, 0.0, 0.0), 1e-9),
                inside,
                "x = {x}"
            );
        }
    }

    #[test]
    fn oblique_cylinder_lies_within_its_bounds() {
        let cylinder = Shape::Cylinder(Cylinder {
            start: [0.0; 3],
            end: [3.0, 4.0, 0.0],
            radius: 1.0,
        });
        let (min, max) = cylinder.bounds().expect("a cylinder is bounded");
        assert!((min - Vector3::new(-0.8, -0.6, -1.0)).norm() < 1e-12);
        assert!((max - Vector3::new(3.8, 4.6, 1.0)).norm() < 1e-12);
        assert!(cylinder.contains(&Vector3::new(1.5 - 0.79, 2.0 + 0.59, 0.0), 0.0));
        assert!(!cylinder.contains(&Vector3::new(1.5 - 0.81, 2.0 + 0.61, 0.0), 0.0));
    }

    #[test]
    fn an_elliptical_hole_has_its_semi_axes_and_bounds() {
        let ellipse = EllipticalCylinder {
            start: [1.0, 0.0, 0.0],
            end: [1.0, 0.0, 2.0],
            semi_axis: [0.3, 0.4, 0.0],
            other: 0.25,
        };
        let shape = Shape::EllipticalCylinder(ellipse.clone());
        for (x, y, inside) in [(0.29, 0.39, true), (0.31, 0.41, false), (-0.19, 0.14, true)] {
            let at = Vector3::new(1.0 + x, y, 1.0);
            assert_eq!(shape.contains(&at, 0.0), inside, "{x} {y}");
        }
        assert!(!shape.contains(&Vector3::new(1.0, 0.0, 2.1), 1e-9));
        assert!(!shape.contains(&Vector3::new(1.0, 0.0, 1.0), -0.3));
        let (min, max) = shape.bounds().expect("bounded");
        assert!(
            (max - Vector3::new(1.0 + 0.3_f64.hypot(0.2), 0.4_f64.hypot(0.15), 2.0)).norm() < 1e-12
        );
        assert_eq!(min.z, 0.0);
        let skew = EllipticalCylinder {
            semi_axis: [0.3, 0.0, 0.1],
            ..ellipse
        };
        assert!(Shape::EllipticalCylinder(skew).mistake().is_some());
    }

    #[test]
    fn a_turned_box_contains_what_the_box_contained() {
        let shape: Shape = toml::from_str(
            "rotate = { shape.box = { min = [0, 0, 0], max = [2, 1, 1] }, angle = 0.5235987755982988, about = [2, 0, 0] }",
        )
        .expect("a shape");
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        // the corner at the origin goes round (2, 0), clockwise below y = 0
        let corner = Vector3::new(2.0 - 2.0 * cos, -2.0 * sin, 0.5);
        let inwards = Vector3::new(cos - sin, sin + cos, 0.0);
        assert!(shape.contains(&(corner + inwards * 1e-3), 0.0));
        assert!(!shape.contains(&(corner - inwards * 1e-3), 0.0));
        let (min, max) = shape.bounds().expect("bounded");
        assert!((min - Vector3::new(2.0 - 2.0 * cos - sin, -2.0 * sin, 0.0)).norm() < 1e-12);
        assert!((max - Vector3::new(2.0, cos, 1.0)).norm() < 1e-12);
        let none: Shape = toml::from_str(
            "rotate = { shape.sphere = { centre = [0, 0, 0], radius = 1 }, angle = 1, axis = [0, 0, 0] }",
        )
        .expect("a shape");
        assert!(none.mistake().is_some_and(|m| m.contains("axis")));
    }

    #[test]
    fn a_union_with_a_half_space_has_no_bounds() {
        let half = Shape::HalfSpace(HalfSpace {
            point: [0.0; 3],
            normal: [0.0, 0.0, 2.0],
        });
        assert!(half.contains(&Vector3::new(9.0, 9.0, -1.0), 0.0));
        assert!(Shape::Union(vec![sphere(1.0), half]).bounds().is_none());
    }
}
