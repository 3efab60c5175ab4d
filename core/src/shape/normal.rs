//! The true surface of a shape in front of a face of a cell.
//!
//! Cells make steps of curved and inclined surfaces, and the area of the steps does not approach that of the surface. A cell
//! face with the normal e counts with the area of its projection onto the surface, `A (e . n) s`: n is the normal of the
//! nearest part of the surface that faces the same side, s the factor by which the projection along the normals of a curved
//! part stretches areas (`R / r` for each curved direction of a cylinder or sphere). Projections of neighbouring faces
//! lie side by side, so that the sum over a closed surface is the area of the shape, but for its edges.

use nalgebra::{Vector2, Vector3};

use super::{Cylinder, Difference, EllipticalCylinder, EllipticalFrame, Extrusion, Rotate, Shape};

/// A position on the surface of a shape.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePart {
    /// The nearest position of this part, m.
    pub foot: Vector3<f64>,
    /// Outward unit normal there.
    pub normal: Vector3<f64>,
    /// Area on the surface over the area at the given position, projected along the normals.
    pub stretch: f64,
    /// Whether the part is curved, so that its normal changes from place to place.
    pub curved: bool,
    /// Which part of the surface it is, such as a side of a box, below [`Shape::parts`].
    pub part: usize,
}

/// A position near the surface, and the direction in which the surface is sought.
#[derive(Clone, Copy, Debug)]
pub struct Facing {
    /// A position near the surface, m.
    pub at: Vector3<f64>,
    /// Unit vector that points out of the body there.
    pub outward: Vector3<f64>,
    /// Parts farther away than this may be left out, m.
    pub reach: f64,
    /// 1, 2 or 3: a curvature across the plane of a 2D body stretches nothing.
    pub dimension: usize,
}

/// Largest factor by which an area is stretched: near the axis of a cylinder the projection has no meaning.
const MOST_STRETCH: f64 = 2.0;

/// A part at right angles to a cell face gives no area.
pub(super) const LEAST_COSINE: f64 = 1e-6;

type Visit<'a> = &'a mut dyn FnMut(SurfacePart);

impl Shape {
    /// Number of parts of the surface.
    pub fn parts(&self) -> usize {
        match self {
            Shape::Box(_) => 6,
            Shape::Cylinder(_) | Shape::EllipticalCylinder(_) => 3,
            Shape::Sphere(_) | Shape::HalfSpace(_) | Shape::Stl(_) => 1,
            Shape::Extrusion(e) => e.polygon.len() + 2,
            Shape::Union(shapes) => shapes.iter().map(Shape::parts).sum(),
            Shape::Difference(d) => d.from.parts() + d.subtract.parts(),
            Shape::Rotate(r) => r.shape.parts(),
        }
    }

    /// The nearest part of the surface that faces outwards where a cell face does, else the nearest one; `None` where none
    /// lies within reach.
    pub fn facing(&self, facing: &Facing) -> Option<SurfacePart> {
        let mut best: Option<(bool, f64, SurfacePart)> = None;
        self.visit_parts(facing, &mut |part| {
            let distance = (part.foot - facing.at).norm();
            let faces = part.normal.dot(&facing.outward) > LEAST_COSINE;
            let is_better = match best {
                None => true,
                Some((others, least, _)) => (faces, -distance) > (others, -least),
            };
            if distance <= facing.reach && is_better {
                best = Some((faces, distance, part));
            }
        });
        best.map(|(_, _, part)| part)
    }

    /// Calls `visit` with the nearest position on each part of the surface.
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        let at = facing.at;
        match self {
            Shape::Box(b) => {
                let (min, max) = (Vector3::from(b.min), Vector3::from(b.max));
                let inside = at.sup(&min).inf(&max);
                for side in 0..6 {
                    let (axis, upper) = (side / 2, side % 2 == 1);
                    let mut foot = inside;
                    foot[axis] = if upper { max[axis] } else { min[axis] };
                    let mut normal = Vector3::zeros();
                    normal[axis] = if upper { 1.0 } else { -1.0 };
                    visit(flat(foot, normal, side));
                }
            }
            Shape::Cylinder(c) => c.visit_parts(facing, visit),
            Shape::EllipticalCylinder(c) => c.visit_parts(facing, visit),
            Shape::Sphere(s) => {
                let relative = at - Vector3::from(s.centre);
                let distance = relative.norm();
                if distance > 0.0 {
                    let normal = relative / distance;
                    let curved = facing.dimension.saturating_sub(1) as i32;
                    let stretch = (s.radius / distance).min(MOST_STRETCH).powi(curved);
                    visit(SurfacePart {
                        foot: Vector3::from(s.centre) + normal * s.radius,
                        normal,
                        stretch,
                        curved: true,
                        part: 0,
                    });
                }
            }
            Shape::HalfSpace(h) => {
                let normal = Vector3::from(h.normal).normalize();
                let above = (at - Vector3::from(h.point)).dot(&normal);
                visit(flat(at - normal * above, normal, 0));
            }
            Shape::Extrusion(e) => e.visit_parts(facing, visit),
            Shape::Stl(s) => {
                s.nearest_facing(facing).into_iter().for_each(visit);
            }
            Shape::Union(shapes) => {
                let mut first = 0;
                for (i, shape) in shapes.iter().enumerate() {
                    let others = shapes.iter().enumerate().filter(|(j, _)| *j != i);
                    shape.visit_parts(facing, &mut |part| {
                        let mut others = others.clone();
                        if !others.any(|(_, other)| other.covers(&part, facing)) {
                            visit(part.numbered_from(first));
                        }
                    });
                    first += shape.parts();
                }
            }
            Shape::Difference(d) => d.visit_parts(facing, visit),
            Shape::Rotate(r) => r.visit_parts(facing, visit),
        }
    }

    /// Whether a position on the surface of another shape lies inside this one.
    fn covers(&self, part: &SurfacePart, facing: &Facing) -> bool {
        self.contains(&part.foot, -1e-6 * facing.reach)
    }
}

impl SurfacePart {
    fn numbered_from(self, first: usize) -> SurfacePart {
        SurfacePart {
            part: first + self.part,
            ..self
        }
    }
}

fn flat(foot: Vector3<f64>, normal: Vector3<f64>, part: usize) -> SurfacePart {
    SurfacePart {
        foot,
        normal,
        stretch: 1.0,
        curved: false,
        part,
    }
}

/// The factor of a curvature along `along` (a unit vector) in a body of this dimension.
fn in_plane(stretch: f64, along: &Vector3<f64>, dimension: usize) -> f64 {
    let stretch = stretch.min(MOST_STRETCH);
    match dimension {
        2 => 1.0 + (stretch - 1.0) * (1.0 - along.z * along.z),
        _ => stretch,
    }
}

impl Cylinder {
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        let (start, end) = (Vector3::from(self.start), Vector3::from(self.end));
        let axis = (end - start).normalize();
        let length = (end - start).norm();
        let relative = facing.at - start;
        let along = relative.dot(&axis);
        let radial = relative - axis * along;
        let distance = radial.norm();
        if distance > 0.0 {
            let normal = radial / distance;
            let stretch = self.radius / distance;
            visit(SurfacePart {
                foot: start + axis * along.clamp(0.0, length) + normal * self.radius,
                normal,
                stretch: in_plane(stretch, &axis.cross(&normal), facing.dimension),
                curved: true,
                part: 0,
            });
        }
        let within = radial * (self.radius / distance).min(1.0);
        let within = if distance > 0.0 { within } else { radial };
        visit(flat(start + within, -axis, 1));
        visit(flat(end + within, axis, 2));
    }
}

impl EllipticalCylinder {
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        let EllipticalFrame {
            along,
            across: [first, second],
            semi_axes: [a, b],
            length,
        } = self.frame();
        let start = Vector3::from(self.start);
        let relative = facing.at - start;
        let height = relative.dot(&along);
        let across = [relative.dot(&first), relative.dot(&second)];
        let EllipsePoint {
            at: foot,
            normal,
            curvature,
        } = nearest_on_ellipse(across, [a, b]);
        let in_space = |v: Vector2<f64>| first * v.x + second * v.y;
        let normal3 = in_space(normal);
        let outside = (Vector2::from(across) - foot).dot(&normal);
        let stretch = 1.0 / (1.0 + curvature * outside).max(1.0 / MOST_STRETCH);
        visit(SurfacePart {
            foot: start + along * height.clamp(0.0, length) + in_space(foot),
            normal: normal3,
            stretch: in_plane(stretch, &along.cross(&normal3), facing.dimension),
            curved: true,
            part: 0,
        });
        let scale = (across[0] / a).hypot(across[1] / b).max(1.0);
        let within = in_space(Vector2::from(across) / scale);
        visit(flat(start + within, -along, 1));
        visit(flat(start + along * length + within, along, 2));
    }
}

/// A point on an ellipse.
struct EllipsePoint {
    at: Vector2<f64>,
    /// Outward normal.
    normal: Vector2<f64>,
    /// 1/m.
    curvature: f64,
}

/// The nearest point on an ellipse with these semi-axes.
fn nearest_on_ellipse(at: [f64; 2], [a, b]: [f64; 2]) -> EllipsePoint {
    let place = |t: f64| Vector2::new(a * t.cos(), b * t.sin());
    let at = Vector2::from(at);
    // Newton's method for the angle at which the tangent is at right angles to the way there
    let mut t = (a * at.y).atan2(b * at.x);
    for _ in 0..20 {
        let (tangent, bend) = (Vector2::new(-a * t.sin(), b * t.cos()), -place(t));
        let away = place(t) - at;
        let slope = away.dot(&tangent);
        let curvature = tangent.norm_squared() + away.dot(&bend);
        let step = slope / curvature.max(0.25 * tangent.norm_squared());
        t -= step;
        if step.abs() < 1e-12 {
            break;
        }
    }
    let tangent = Vector2::new(-a * t.sin(), b * t.cos());
    EllipsePoint {
        at: place(t),
        normal: Vector2::new(tangent.y, -tangent.x).normalize(),
        curvature: a * b / tangent.norm().powi(3),
    }
}

impl Extrusion {
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        let [u, v] = self.plane();
        let axis = self.axis.index();
        let at = Vector2::new(facing.at[u], facing.at[v]);
        let along = facing.at[axis].clamp(self.from, self.to);
        let in_space = |across: Vector2<f64>, along: f64| {
            let mut position = Vector3::zeros();
            (position[u], position[v], position[axis]) = (across.x, across.y, along);
            position
        };
        // the corners go round to the left where the area is positive
        let doubled_area: f64 = self.edges().map(|[a, b]| a.perp(&b)).sum();
        for (part, [a, b]) in self.edges().enumerate() {
            let edge = b - a;
            let fraction = ((at - a).dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
            let normal = Vector2::new(edge.y, -edge.x) * doubled_area.signum() / edge.norm();
            let foot = in_space(a + edge * fraction, along);
            visit(flat(foot, in_space(normal, 0.0), part));
        }
        let edges = self.polygon.len();
        for (part, (end, sign)) in [(self.from, -1.0), (self.to, 1.0)].into_iter().enumerate() {
            let foot = in_space(at, end);
            if self.contains(&foot, 1e-6 * facing.reach) {
                visit(flat(foot, in_space(Vector2::zeros(), sign), edges + part));
            }
        }
    }
}

impl Difference {
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        self.from.visit_parts(facing, &mut |part| {
            if !self.subtract.covers(&part, facing) {
                visit(part);
            }
        });
        let first = self.from.parts();
        let inwards = Facing {
            outward: -facing.outward,
            ..*facing
        };
        self.subtract.visit_parts(&inwards, &mut |part| {
            if self.from.contains(&part.foot, 1e-6 * facing.reach) {
                let normal = -part.normal;
                visit(SurfacePart { normal, ..part }.numbered_from(first));
            }
        });
    }
}

impl Rotate {
    fn visit_parts(&self, facing: &Facing, visit: Visit<'_>) {
        let rotation = self.rotation();
        let about = Vector3::from(self.about);
        let before = Facing {
            at: self.before(&facing.at),
            outward: rotation.inverse() * facing.outward,
            ..*facing
        };
        self.shape.visit_parts(&before, &mut |part| {
            visit(SurfacePart {
                foot: about + rotation * (part.foot - about),
                normal: rotation * part.normal,
                ..part
            });
        });
    }
}
