//! Outward normals at the points of a body, from the current positions of their neighbours.

use nalgebra::Vector3;
use perimelt_core::Body;
use perimelt_core::cell_list::CellList;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use rayon::prelude::*;

/// Radius of the neighbourhood, in spacings.
pub(super) const NEAR: f64 = 1.6;

/// Least length of the sum of the vectors to neighbours, over their number and the spacing, of a point at a surface. It is 0.6
/// and 0.38 at flat surfaces in 2D and 3D, and not zero inside irregular bodies.
const SURFACE: f64 = 0.15;

/// The neighbours of the points of a body that this process owns, in the reference configuration.
#[derive(Debug)]
pub(super) struct Neighbourhoods {
    start: Vec<u32>,
    other: Vec<u32>,
    /// Spacing by point, m.
    spacing: Vec<f64>,
}

impl Neighbourhoods {
    pub(super) fn new(body: &Body, reducer: &Reducer) -> Self {
        let positions = &body.points.position;
        let reach: Vec<f64> = body.points.spacing.iter().map(|s| NEAR * s).collect();
        let cells = CellList::new(positions, &reach);
        let (mut start, mut other) = (vec![0], Vec::new());
        for (i, x) in positions[..reducer.owned()].iter().enumerate() {
            let own = other.len();
            cells.visit_near(x, reach[i], |j| {
                if i != j && (positions[j] - x).norm_squared() < reach[i] * reach[i] {
                    other.push(j as u32);
                }
            });
            // the same order in all processes
            other[own..].sort_unstable_by_key(|j| reducer.number(*j as usize));
            start.push(other.len() as u32);
        }
        Neighbourhoods {
            start,
            other,
            spacing: body.points.spacing.to_vec(),
        }
    }

    /// The points whose positions are read.
    pub(super) fn points(&self) -> impl Iterator<Item = usize> {
        self.other.iter().map(|point| *point as usize)
    }

    /// Outward unit normals for the current positions (m), zero inside the bodies, and the deviation of the surface
    /// from flat, which is larger at edges and corners.
    pub(super) fn normals(&self, positions: &[Vector3<f64>], normals: &mut [[f64; 4]]) {
        let points = normals.par_iter_mut().enumerate().with_min_len(1024);
        points.for_all(|(i, normal)| {
            let others = &self.other[self.start[i] as usize..self.start[i + 1] as usize];
            let towards = |j: &u32| positions[*j as usize] - positions[i];
            let inwards: Vector3<f64> = others.iter().map(towards).sum();
            let scale = self.spacing[i] * others.len() as f64;
            *normal = match inwards.norm() {
                length if length > SURFACE * scale => {
                    let [x, y, z] = (-inwards / length).into();
                    [x, y, z, length / scale]
                }
                _ => [0.0, 0.0, 0.0, f64::INFINITY],
            };
        });
    }
}
