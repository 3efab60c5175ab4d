//! Coarse space for networks of springs: multilinear displacements on a coarse grid.
//!
//! The diagonal of the stiffness preconditions interactions between neighbours. Deformations that extend over
//! the whole body then need as many Krylov iterations as there are neighbourhoods along it. The grid solves
//! for them directly; both together make the number of iterations independent of the size of the body and of
//! jumps in stiffness: two-level additive Schwarz, see Toselli & Widlund, Domain Decomposition Methods (2005),
//! chapter 3. Displacements are multilinear within a cell, so that a uniform strain has its exact energy.

mod banded;
mod grid;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use rayon::prelude::*;

use banded::{Banded, BandedSums};
use grid::CORNERS;
pub use grid::CoarseGrid;

use crate::parallel::ParallelLoop;
use crate::solver::Reducer;
use crate::solver::exact::Halves;

/// Fraction of the coarse displacement that is applied: the diagonal corrects smooth displacements, too.
const DAMPING: f64 = 0.6;

/// Points that one task moves.
const CHUNK: usize = 512;

/// Largest entry of the stiffness of a point between two nodes over the stiffness of its springs: both ends of each spring count, weights are one at
/// most, up to rounding.
const MOST_OF_SPRINGS: f64 = 3.0;

/// Number of cells whose stiffness is held in memory at once.
const BATCH: usize = 64;

/// A spring from a point to another point or to its mirror image. Springs between two points have transposed stiffnesses.
#[derive(Clone, Copy, Debug)]
pub struct Spring {
    /// Force on the point by the displacement of the other end relative to it, by rows.
    pub stiffness: [[f64; 3]; 3],
    /// The point at the other end, or the point whose image is there.
    pub to: usize,
    /// Factors on the displacement of `to`: those of its image, or one.
    pub scale: [f64; 3],
}

impl Spring {
    /// Adds the stiffness of a spring between the same points.
    pub fn stiffen(&mut self, stiffness: &[[f64; 3]; 3]) {
        for (sum, row) in self.stiffness.iter_mut().zip(stiffness) {
            (0..3).for_each(|axis| sum[axis] += row[axis]);
        }
    }

    /// Stiffness of a spring along a unit vector, force over extension; a fraction of it also resists motion `across`.
    pub fn axial(stiffness: f64, along: [f64; 3], across: f64) -> [[f64; 3]; 3] {
        std::array::from_fn(|a| {
            std::array::from_fn(|b| {
                let both = (1.0 - across) * along[a] * along[b];
                stiffness * if a == b { both + across } else { both }
            })
        })
    }
}

/// Displacements of the nodes of a coarse grid, and the factors of the stiffness between them.
#[derive(Clone, Debug)]
pub struct CoarseSpace {
    grid: Arc<CoarseGrid>,
    factor: Banded,
}

impl CoarseSpace {
    /// The space on a grid for springs whose stiffness is that of the system to be solved: the `springs` of each point of the grid, between the points and
    /// with the signs for which it was made, and none more than `times` as stiff as there.
    ///
    /// Collective; the same in all processes that share the points, to the bit, and for any number of them: the stiffness of a cell is the
    /// sum over rows of points, those of a group, which add up exactly.
    pub fn new(
        grid: Arc<CoarseGrid>,
        times: f64,
        points: &Reducer,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
    ) -> Option<Self> {
        let (rows, band) = grid.size();
        let most = points.largest_group() * MOST_OF_SPRINGS * grid.stiffest * times;
        let fixed = grid.fixed_point(most);
        let mut sums = BandedSums::new(rows, band);
        for cells in grid.members.chunks(BATCH) {
            let blocks = cells.par_iter().map(|m| grid.stiffness(m, fixed, &springs));
            let blocks: Vec<_> = blocks.collect();
            for (members, block) in cells.iter().zip(&blocks) {
                grid.add(members, block, &mut sums);
            }
        }
        let factor = sums.total(fixed, points).factors()?;
        Some(CoarseSpace { grid, factor })
    }

    /// Adds the coarse displacement under `residual` to `out`, three components for each point.
    pub(super) fn add_correction(&self, residual: &[f64], points: &Reducer, out: &mut [f64]) {
        let (grid, dimension) = (&self.grid, self.grid.dimension());
        let corners = 1 << dimension;
        let fixed = grid.fixed_point(points.largest_group() * points.max_abs(residual));
        let (forces, _) = residual.as_chunks::<3>();
        let sums = grid.members.par_iter().map(|members| {
            let mut sums = [[0.0; 3 * CORNERS]; 2];
            let mut of_row = [[0.0; 3]; CORNERS];
            for row in grid.rows(members) {
                for &point in row {
                    let (free, force) = (&grid.free[point as usize], &forces[point as usize]);
                    let [x, y, z] = [0, 1, 2].map(|axis| free[axis] * force[axis]);
                    let weights = &grid.weights[point as usize];
                    for (sum, weight) in of_row.iter_mut().zip(weights).take(corners) {
                        sum[0] += weight * x;
                        sum[1] += weight * y;
                        sum[2] += weight * z;
                    }
                }
                fixed.add(
                    of_row.as_flattened_mut(),
                    sums.each_mut().map(|s| &mut s[..]),
                );
            }
            sums
        });
        let sums: Vec<_> = sums.collect();
        let mut nodes = Halves::zeros(grid.size().0);
        for (members, sums) in grid.members.iter().zip(&sums) {
            let first = grid.first_node(members[0] as usize);
            for corner in 0..corners {
                let node = grid.corner_node(first, corner);
                for axis in 0..dimension {
                    let parts = sums.map(|sums| sums[3 * corner + axis]);
                    nodes.add_to(dimension * node + axis, parts);
                }
            }
        }
        let mut nodes = fixed.total(nodes, points);
        self.factor.solve(&mut nodes);
        let moved: Vec<[f64; 3]> = nodes
            .chunks_exact(dimension)
            .map(|node| [0, 1, 2].map(|axis| node.get(axis).copied().unwrap_or(0.0)))
            .collect();
        let corner_nodes = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| grid.corner_node(0, corner));
        let (vectors, _) = out.as_chunks_mut::<3>();
        let vectors = vectors.par_iter_mut().enumerate().with_min_len(CHUNK);
        vectors.for_all(|(point, out)| {
            let around = &moved[grid.first_node(point)..];
            let [mut x, mut y, mut z] = *out;
            let weights = grid.weights[point].iter().zip(corner_nodes);
            for (weight, node) in weights.take(corners) {
                let (part, node) = (DAMPING * weight, &around[node]);
                x += part * node[0];
                y += part * node[1];
                z += part * node[2];
            }
            for (axis, value) in [x, y, z].into_iter().enumerate() {
                if grid.free[point][axis] != 0.0 {
                    out[axis] = value;
                }
            }
        });
    }
}
