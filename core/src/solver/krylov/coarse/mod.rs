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

use nalgebra::Vector3;
use rayon::prelude::*;

use banded::Banded;
use grid::{CORNERS, CoarseGrid, Network};

use crate::parallel::ParallelLoop;

/// Fraction of the coarse displacement that is applied: the diagonal corrects smooth displacements, too.
const DAMPING: f64 = 0.6;

/// Points that one task moves.
const CHUNK: usize = 512;

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
    grid: CoarseGrid,
    factor: Banded,
}

impl CoarseSpace {
    /// The space for points at `position` (m) with the `springs` of each, whose stiffness is that of the
    /// system to be solved. `free` is zero for held components, else one. `None` for bodies of few cells.
    pub fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        free: Vec<[f64; 3]>,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
    ) -> Option<Self> {
        let neighbourhood = |point: usize| {
            let (mut reach, mut count) = (0.0_f64, 0);
            springs(point, &mut |spring| {
                reach = reach.max((position[spring.to] - position[point]).amax());
                count += 1;
            });
            (reach, count)
        };
        let neighbourhoods = (0..position.len()).into_par_iter().map(neighbourhood);
        let neighbourhoods: Vec<(f64, usize)> = neighbourhoods.collect();
        // points without springs, such as those whose material is not deposited yet, have no neighbourhood
        let reaches = neighbourhoods.iter().map(|(reach, _)| *reach);
        let reaches = reaches.filter(|reach| *reach > 0.0);
        let longest = reaches.clone().fold(0.0, f64::max);
        let network = Network {
            springs: neighbourhoods.iter().map(|(_, count)| count).sum(),
            shortest: reaches.fold(longest, f64::min),
            longest,
        };
        let grid = CoarseGrid::new(position, dimension, &network, free)?;
        let (rows, band) = grid.size();
        let mut matrix = Banded::new(rows, band);
        for cells in grid.members.chunks(BATCH) {
            let blocks = cells.par_iter().map(|m| grid.stiffness(m, &springs));
            let blocks: Vec<_> = blocks.collect();
            for (members, block) in cells.iter().zip(&blocks) {
                grid.add(members, block, &mut matrix);
            }
        }
        let factor = matrix.factors()?;
        Some(CoarseSpace { grid, factor })
    }

    /// Adds the coarse displacement under `residual` to `out`, three components for each point.
    pub(super) fn add_correction(&self, residual: &[f64], out: &mut [f64]) {
        let (grid, dimension) = (&self.grid, self.grid.dimension());
        let corners = 1 << dimension;
        let (forces, _) = residual.as_chunks::<3>();
        let sums = grid.members.par_iter().map(|members| {
            let mut sums = [[0.0; 3]; CORNERS];
            for &point in members {
                let (free, force) = (&grid.free[point as usize], &forces[point as usize]);
                let [x, y, z] = [0, 1, 2].map(|axis| free[axis] * force[axis]);
                let weights = &grid.weights[point as usize];
                for (sum, weight) in sums.iter_mut().zip(weights).take(corners) {
                    sum[0] += weight * x;
                    sum[1] += weight * y;
                    sum[2] += weight * z;
                }
            }
            sums
        });
        let sums: Vec<_> = sums.collect();
        let mut nodes = vec![0.0; grid.size().0];
        for (members, sums) in grid.members.iter().zip(&sums) {
            let first = grid.first_node(members[0] as usize);
            for (corner, sum) in sums.iter().enumerate().take(corners) {
                let node = grid.corner_node(first, corner);
                (0..dimension).for_each(|axis| nodes[dimension * node + axis] += sum[axis]);
            }
        }
        self.factor.solve(&mut nodes);
        let moved: Vec<[f64; 3]> = nodes
            .chunks_exact(dimension)
            .map(|node| [0, 1, 2].map(|axis| node.get(axis).copied().unwrap_or(0.0)))
            .collect();
        let corner_nodes = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| grid.corner_node(0, corner));
        let (vectors, _) = out.as_chunks_mut::<3>();
        let points = vectors.par_iter_mut().enumerate().with_min_len(CHUNK);
        points.for_all(|(point, out)| {
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
