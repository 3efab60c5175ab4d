//! The nearest triangle of an STL surface that faces a given side.

use nalgebra::Vector3;

use super::{Stl, Surface};
use crate::shape::normal::LEAST_COSINE;
use crate::shape::{Facing, SurfacePart};

impl Stl {
    /// The nearest position within reach on a triangle that faces outwards where a cell face does, else on any triangle.
    pub(in crate::shape) fn nearest_facing(&self, facing: &Facing) -> Option<SurfacePart> {
        self.surface.as_ref()?.nearest_facing(facing)
    }
}

impl Surface {
    fn nearest_facing(&self, facing: &Facing) -> Option<SurfacePart> {
        let (low, _) = self.bounds;
        let (at, reach) = (facing.at, facing.reach);
        let across = [at.y - low.y, at.z - low.z];
        let near = self
            .columns
            .range(across.map(|c| c - reach), across.map(|c| c + reach));
        let mut best: Option<(bool, f64, SurfacePart)> = None;
        for cell in self.columns.cells(near) {
            for &triangle in self.columns.in_cell(cell) {
                let corners = self.corners(triangle);
                let along = corners.map(|c| c.x - at.x);
                if along.iter().all(|x| *x > reach) || along.iter().all(|x| *x < -reach) {
                    continue;
                }
                let [a, b, c] = corners;
                let normal = (b - a).cross(&(c - a));
                let doubled_area = normal.norm();
                if doubled_area == 0.0 {
                    continue;
                }
                let normal = normal / doubled_area;
                let faces = normal.dot(&facing.outward) > LEAST_COSINE;
                let foot = nearest_on_triangle(&at, &corners);
                let distance = (foot - at).norm();
                let is_better = match &best {
                    None => true,
                    Some((others, least, _)) => (faces, -distance) > (*others, -least),
                };
                if is_better && distance <= reach {
                    let part = SurfacePart {
                        foot,
                        normal,
                        stretch: 1.0,
                        curved: false,
                        part: 0,
                    };
                    best = Some((faces, distance, part));
                }
            }
        }
        best.map(|(_, _, part)| part)
    }
}

/// The nearest position on a triangle (m), by the regions of its barycentric coordinates (Ericson, Real-Time Collision
/// Detection, 2005, section 5.1.5).
fn nearest_on_triangle(at: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let (ab, ac, ap) = (b - a, c - a, at - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = at - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = at - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}
