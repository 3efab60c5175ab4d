//! Extrusions: a polygon drawn out along an axis.

use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bounds, distance_from_segment};
use crate::axis::Axis;

/// A polygon drawn out along an axis, such as a plate with a V-groove or a rolled section.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Extrusion {
    /// Corners of the cross-section in their order, either way round, m. They have the two coordinates other than that of
    /// the axis, in the order x, y, z: `[x, z]` for `axis = "y"`.
    pub polygon: Vec<[f64; 2]>,
    /// Axis along which the polygon is drawn out; default z.
    #[serde(default = "axis_z")]
    pub axis: Axis,
    /// Lower end along the axis, m.
    pub from: f64,
    /// Upper end along the axis, m.
    pub to: f64,
}

fn axis_z() -> Axis {
    Axis::Z
}

/// Twice the signed area of the triangle a, b, c, m²; positive where they turn to the left.
fn turn(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// Whether two segments have a common position.
fn meet([a, b]: [Vector2<f64>; 2], [c, d]: [Vector2<f64>; 2]) -> bool {
    let opposite = |p: f64, q: f64| p > 0.0 && q < 0.0 || p < 0.0 && q > 0.0;
    let crosses = opposite(turn(a, b, c), turn(a, b, d)) && opposite(turn(c, d, a), turn(c, d, b));
    let touches = |p, segment| distance_from_segment(p, segment) == 0.0;
    crosses || touches(a, [c, d]) || touches(b, [c, d]) || touches(c, [a, b]) || touches(d, [a, b])
}

impl Extrusion {
    /// Axes of the coordinates of the polygon.
    pub(super) fn plane(&self) -> [usize; 2] {
        match self.axis {
            Axis::X => [1, 2],
            Axis::Y => [0, 2],
            Axis::Z => [0, 1],
        }
    }

    /// The edges in order, m.
    pub(super) fn edges(&self) -> impl Iterator<Item = [Vector2<f64>; 2]> {
        let next = self.polygon.iter().cycle().skip(1);
        let edge = |(a, b): (&[f64; 2], &[f64; 2])| [Vector2::from(*a), Vector2::from(*b)];
        self.polygon.iter().zip(next).map(edge)
    }

    pub(super) fn contains(&self, position: &Vector3<f64>, tolerance: f64) -> bool {
        let along = position[self.axis.index()];
        if !(along >= self.from - tolerance && along <= self.to + tolerance) {
            return false;
        }
        let [u, v] = self.plane();
        let at = Vector2::new(position[u], position[v]);
        let mut inside = false;
        for [a, b] in self.edges() {
            if distance_from_segment(at, [a, b]) <= tolerance.abs() {
                return tolerance >= 0.0;
            }
            // a ray along the first coordinate; an edge has its lower, not its upper end
            let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
            let crosses = low.y <= at.y && at.y < high.y && turn(low, high, at) > 0.0;
            inside ^= crosses;
        }
        inside
    }

    pub(super) fn bounds(&self) -> Option<Bounds> {
        let corners = self.polygon.iter().map(|c| Vector2::from(*c));
        let ends = corners.map(|c| (c, c));
        let (low, high) = ends.reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))?;
        let [u, v] = self.plane();
        let corner = |at: Vector2<f64>, along: f64| {
            let mut corner = Vector3::zeros();
            (corner[u], corner[v], corner[self.axis.index()]) = (at.x, at.y, along);
            corner
        };
        Some((corner(low, self.from), corner(high, self.to)))
    }

    pub(super) fn mistake(&self) -> Option<String> {
        let count = self.polygon.len();
        if count < 3 {
            return Some(format!(
                "the polygon has {count} corners, at least 3 are needed"
            ));
        }
        if let Some(corner) = self.polygon.iter().flatten().find(|c| !c.is_finite()) {
            return Some(format!(
                "a corner of the polygon has the coordinate {corner}"
            ));
        }
        if !(self.from.is_finite() && self.to.is_finite() && self.from <= self.to) {
            let (from, to) = (self.from, self.to);
            return Some(format!(
                "the extrusion ends at {to} m, below its start at {from} m"
            ));
        }
        let edges: Vec<_> = self.edges().collect();
        if let Some(i) = edges.iter().position(|[a, b]| a == b) {
            return Some(format!("corner {} of the polygon is repeated", i + 1));
        }
        for (i, edge) in edges.iter().enumerate() {
            let [a, b] = *edge;
            let corner = i + 1;
            let after = edges[(i + 1) % count][1];
            if turn(a, b, after) == 0.0 && (b - a).dot(&(after - b)) < 0.0 {
                let corner = (i + 1) % count + 1;
                return Some(format!("the polygon folds back at corner {corner}"));
            }
            // the edges before and after share a corner with this one
            let others = edges.iter().enumerate().skip(i + 2);
            let mut others = others.filter(|(j, _)| (j + 1) % count != i);
            if let Some((j, _)) = others.find(|(_, other)| meet(*edge, **other)) {
                let other = j + 1;
                return Some(format!(
                    "the edges that start at corners {corner} and {other} of the polygon intersect"
                ));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::shape::Shape;

    fn extrusion(text: &str) -> Extrusion {
        toml::from_str(text).expect("an extrusion")
    }

    /// A plate of 6 mm x 3 mm with a groove of 60 degrees down to 1 mm.
    fn groove() -> Extrusion {
        let half = 2e-3 * 30_f64.to_radians().tan();
        Extrusion {
            polygon: vec![
                [-3e-3, 0.0],
                [3e-3, 0.0],
                [3e-3, 3e-3],
                [half, 3e-3],
                [0.0, 1e-3],
                [-half, 3e-3],
                [-3e-3, 3e-3],
            ],
            axis: Axis::Y,
            from: 1e-3,
            to: 5e-3,
        }
    }

    #[test]
    fn a_grooved_plate_has_its_volume_and_bounds() {
        let groove = groove();
        assert_eq!(groove.mistake(), None);
        let (min, max) = groove.bounds().expect("bounded");
        assert_eq!(min, Vector3::new(-3e-3, 1e-3, 0.0));
        assert_eq!(max, Vector3::new(3e-3, 5e-3, 3e-3));
        let shape = Shape::Extrusion(groove);
        let body = Body::fill("plate", &shape, 3, 4e-5, 1.0).expect("points");
        let volume: f64 = body.points.volume.iter().sum();
        // a plate less a triangle as wide as 4 mm tan 30 degrees and 2 mm high
        let exact = 4e-3 * (18e-6 - 4e-6 * 30_f64.to_radians().tan());
        assert!((volume / exact - 1.0).abs() < 2e-3, "{volume} {exact}");
    }

    #[test]
    fn the_surface_belongs_to_the_solid_and_not_to_what_is_cut_off() {
        let groove = groove();
        let corner = Vector3::new(0.0, 3e-3, 1e-3);
        assert!(groove.contains(&corner, 1e-9));
        assert!(!groove.contains(&corner, -1e-9));
        // on the level of a corner, beside and between the flanks
        let at = |x: f64, z: f64| groove.contains(&Vector3::new(x, 3e-3, z), 0.0);
        assert!(at(1e-4, 1e-3) && at(-1e-4, 1e-3) && at(2.9e-3, 2.9e-3) && !at(0.0, 1.1e-3));
        assert!(!at(3.1e-3, 1e-3) && !groove.contains(&Vector3::new(2e-3, 5.1e-3, 1e-3), 0.0));
    }

    #[test]
    fn polygons_that_bound_no_area_are_refused() {
        for (polygon, told) in [
            ("[[0, 0], [1, 0]]", "has 2 corners"),
            (
                "[[0, 0], [1, 0], [1, 0], [0, 1]]",
                "corner 2 of the polygon is repeated",
            ),
            ("[[0, 0], [2, 0], [1, 0]]", "folds back at corner 2"),
            (
                "[[0, 0], [1, 1], [1, 0], [0, 1]]",
                "start at corners 1 and 3",
            ),
            (
                "[[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]]",
                "start at corners 1 and 3",
            ),
            ("[[0, 0], [1, 0], [0, nan]]", "coordinate NaN"),
        ] {
            let wrong = extrusion(&format!("polygon = {polygon}\nfrom = 0\nto = 1"));
            let mistake = wrong.mistake().expect("no area");
            assert!(mistake.contains(told), "{polygon}: {mistake}");
        }
        let ends = extrusion("polygon = [[0, 0], [1, 0], [0, 1]]\nfrom = 1\nto = 0");
        assert!(
            ends.mistake()
                .is_some_and(|m| m.contains("below its start"))
        );
    }
}
