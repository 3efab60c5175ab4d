//! Outward normals at the points of a body, from the current positions of their neighbours.

use nalgebra::Vector3;
use perimelt_core::Body;
use perimelt_core::cell_list::CellList;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

/// Radius of the neighbourhood, in spacings.
const NEAR: f64 = 1.6;

/// Least length of the sum of the vectors to neighbours, over their number and the spacing, of a point at a surface. It is 0.6
/// and 0.38 at flat surfaces in 2D and 3D, and not zero inside irregular bodies.
const SURFACE: f64 = 0.15;

/// The neighbours of the points of a body in the reference configuration.
#[derive(Debug, Default)]
pub(super) struct Neighbourhoods {
    start: Vec<u32>,
    other: Vec<u32>,
    /// Spacing by point, m.
    spacing: Vec<f64>,
}

impl Neighbourhoods {
    /// Adds a body; its points are numbered after those of the bodies before it.
    pub(super) fn add(&mut self, body: &Body) {
        let first = self.spacing.len() as u32;
        let positions = &body.points.position;
        let reach: Vec<f64> = body.points.spacing.iter().map(|s| NEAR * s).collect();
        let cells = CellList::new(positions, &reach);
        if self.start.is_empty() {
            self.start.push(0);
        }
        for (i, x) in positions.iter().enumerate() {
            let own = self.other.len();
            let other = &mut self.other;
            cells.visit_near(x, reach[i], |j| {
                if i != j && (positions[j] - x).norm_squared() < reach[i] * reach[i] {
                    other.push(first + j as u32);
                }
            });
            self.other[own..].sort_unstable();
            self.start.push(self.other.len() as u32);
        }
        self.spacing.extend(&body.points.spacing);
    }

    /// Outward unit normals for the current positions (m), zero inside the bodies, and the deviation of the surface
    /// from flat, which is larger at edges and corners.
    pub(super) fn normals(
        &self,
        positions: &[Vector3<f64>],
        normals: &mut Vec<(Vector3<f64>, f64)>,
    ) {
        let normal = |i: usize| {
            let others = &self.other[self.start[i] as usize..self.start[i + 1] as usize];
            let towards = |j: &u32| positions[*j as usize] - positions[i];
            let inwards: Vector3<f64> = others.iter().map(towards).sum();
            let scale = self.spacing[i] * others.len() as f64;
            match inwards.norm() {
                length if length > SURFACE * scale => (-inwards / length, length / scale),
                _ => (Vector3::zeros(), f64::INFINITY),
            }
        };
        let points = (0..positions.len()).into_par_iter().with_min_len(1024);
        points.map(normal).fill(normals);
    }
}
