//! How far the surface of a body lies from its outermost points.

use nalgebra::Vector3;

use super::Fact;
use crate::body::{Body, SurfaceCell};

/// Distance of the surface of a body from its outermost points, as the sums over families make it for the field that is exchanged
/// through the surface.
///
/// A field with a flux through the surface is linear far below it. At the outermost points it deviates from that line by what it
/// changes over this many spacings along the normal (docs/theory/surfaces.md, "Bonds longer than a spacing").
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceDepths {
    /// Deviation at surfaces with these normals behind which no points are mirrored.
    pub bare: [f64; SurfaceDepths::NORMALS.len()],
    /// Where points are, at faces of the box around the body.
    pub mirrored: f64,
    /// Whether points are mirrored behind each face ([`Face::ALL`](crate::Face::ALL)).
    pub is_mirrored: [bool; 6],
}

impl SurfaceDepths {
    /// Directions of [`SurfaceDepths::bare`], which stand for those with other signs and orders of their components, too.
    pub const NORMALS: [[i32; 3]; 6] = [
        [1, 0, 0],
        [2, 1, 0],
        [1, 1, 0],
        [2, 1, 1],
        [2, 2, 1],
        [1, 1, 1],
    ];

    /// Distance of the surface from the point of a cell face, in spacings. Behind a step or the wall of a hole nothing is mirrored,
    /// whichever way it faces.
    pub fn at(&self, body: &Body, cell: &SurfaceCell) -> f64 {
        let point = cell.point as usize;
        let is_mirrored =
            self.is_mirrored[cell.face as usize] && body.lies_in_face(point, cell.face);
        let deviation = match (is_mirrored, cell.step_of) {
            (true, _) => self.mirrored,
            (false, None) => self.bare[0],
            (false, Some(normal)) => self.inclined(normal, body.dimension),
        };
        // with long horizons the outermost points may be warmer than the surface
        (0.5 * cell.cosine() - deviation).clamp(0.0, 1.5)
    }

    /// Deviation at a surface with a unit normal: linear between the [`SurfaceDepths::NORMALS`] in the ratios of its components.
    fn inclined(&self, normal: Vector3<f64>, dimension: usize) -> f64 {
        let mut sizes = normal.map(f64::abs);
        (dimension..3).for_each(|axis| sizes[axis] = 0.0);
        sizes.as_mut_slice().sort_by(|a, b| b.total_cmp(a));
        let (second, third) = (sizes[1] / sizes[0], sizes[2] / sizes[0]);
        // shares of (1, 0, 0), (1, 1, 0) and (1, 1, 1), twice, with the other normals half way between them
        let [x, xy, xyz] = [1.0 - second, second - third, third].map(|share| 2.0 * share);
        let weights = match (x >= 1.0, xy >= 1.0, xyz >= 1.0) {
            (true, ..) => [x - 1.0, xy, 0.0, xyz, 0.0, 0.0],
            (_, true, _) => [0.0, x, xy - 1.0, 0.0, xyz, 0.0],
            (.., true) => [0.0, 0.0, 0.0, x, xy, xyz - 1.0],
            _ => [0.0, 1.0 - xyz, 0.0, 1.0 - xy, 1.0 - x, 0.0],
        };
        let parts = weights.iter().zip(&self.bare).map(|(w, c)| w * c);
        parts.sum()
    }
}

impl Fact for SurfaceDepths {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linear in the ratios of the components, so that a field that is linear in them is found everywhere.
    #[test]
    fn deviations_between_the_normals_are_linear_in_the_ratios_of_components() {
        let of = |[a, b, c]: [f64; 3]| 0.3 + 0.5 * b / a - 0.7 * c / a;
        let depths = SurfaceDepths {
            bare: SurfaceDepths::NORMALS.map(|n| of(n.map(f64::from))),
            ..SurfaceDepths::default()
        };
        for n in [
            [1.0, 0.0, 0.0],
            [1.0, 0.4, 0.0],
            [1.0, 0.8, 0.0],
            [1.0, 0.3, 0.2],
            [1.0, 0.7, 0.1],
            [1.0, 0.9, 0.2],
            [1.0, 0.7, 0.4],
            [1.0, 0.9, 0.8],
            [1.0, 1.0, 1.0],
        ] {
            let turned = Vector3::new(-n[1], n[2], n[0]).normalize();
            let found = depths.inclined(turned, 3);
            assert!((found - of(n)).abs() < 1e-12, "{n:?}: {found} {}", of(n));
        }
    }
}
