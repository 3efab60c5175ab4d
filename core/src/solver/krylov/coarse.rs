//! A coarse space for networks of springs: the corners of a coarse grid move, and points between them.
//!
//! What neighbours do to each other the diagonal of the stiffness knows; that far ends of a body pull
//! and bend each other takes Krylov methods as many iterations as there are neighbourhoods between them.
//! A grid with cells as wide as half a neighbourhood, or a few, knows it at once, and both together precondition a body
//! whatever its size, and stiff parts beside soft ones: two-level additive Schwarz, see Toselli & Widlund,
//! Domain Decomposition Methods (2005), chapter 3. Displacements are multilinear within a cell, so that a
//! uniform strain has the energy that it should.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::solver::reduce::dot;

/// Multiplications for the factors of a coarse matrix at most, a few tenths of a second: cells are as wide
/// as that takes.
const MOST_WORK: usize = 600_000_000;

/// Width of a cell at least, in neighbourhoods. With whole ones a fifth to a third more iterations are needed.
const LEAST_WIDTH: f64 = 0.5;

/// Below this the diagonal does as well.
const LEAST_NODES: usize = 12;

/// Share by which the coarse matrix is stiffened along its diagonal: a free body has motions that
/// nothing resists, and so do nodes with few points around.
const STIFFENING: f64 = 1e-8;

/// Share of the coarse displacement that corrects: the diagonal corrects smooth displacements too.
const SHARE: f64 = 0.6;

/// Cells that a spring spans at most along an axis: where neighbourhoods differ in size, cells are as wide
/// as this takes.
const MOST_REACH: f64 = 3.0;

/// Cells whose stiffness is in memory at once.
const BATCH: usize = 64;

/// A spring from a point to another, or to a mirror image.
#[derive(Clone, Copy, Debug)]
pub struct Spring {
    /// Force over extension.
    pub stiffness: f64,
    /// Share of it against motion across the spring (-).
    pub across: f64,
    /// Unit vector.
    pub along: [f64; 3],
    /// The point at the other end, or whose image is there.
    pub to: usize,
    /// Factors on its displacement: those of the image, or one.
    pub scale: [f64; 3],
}

/// Displacements of the nodes of a coarse grid, and the factors of the stiffness between them.
#[derive(Clone, Debug)]
pub struct CoarseSpace {
    grid: Grid,
    factor: Banded,
}

/// Points in the cells of a grid.
#[derive(Clone, Debug)]
struct Grid {
    dimension: usize,
    nodes: usize,
    /// From a node to the next along each axis.
    stride: [usize; 3],
    /// Cells that springs span at most along an axis.
    reach: usize,
    /// Rows between those that springs tie at most.
    band: usize,
    /// The cell of each point along each axis.
    cell: Vec<[usize; 3]>,
    /// How far each point follows the corners of its cell; bit `axis` of a corner is set at its upper side.
    shares: Vec<[f64; CORNERS]>,
    /// One or, for held components, zero.
    free: Vec<[f64; 3]>,
    /// The points of each cell that has some.
    members: Vec<Vec<u32>>,
}

/// Corners of a cell in three dimensions.
const CORNERS: usize = 8;

impl CoarseSpace {
    /// The space for points at `position` (m) with the `springs` of each, whose stiffness is that of the
    /// system to be solved. `free` holds zero for held components. `None` for bodies of few cells.
    pub fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        free: Vec<[f64; 3]>,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
    ) -> Option<Self> {
        let reach_of = |point: usize| {
            let mut reach: f64 = 0.0;
            springs(point, &mut |spring| {
                reach = reach.max((position[spring.to] - position[point]).amax());
            });
            reach
        };
        let reaches: Vec<f64> = (0..position.len()).into_par_iter().map(reach_of).collect();
        let longest = reaches.iter().copied().fold(0.0, f64::max);
        let shortest = reaches.into_iter().fold(longest, f64::min);
        let grid = Grid::new(position, dimension, [shortest, longest], free)?;
        let mut matrix = Banded::new(dimension * grid.nodes, grid.band);
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
        let (grid, dimension) = (&self.grid, self.grid.dimension);
        let (forces, _) = residual.as_chunks::<3>();
        let sums = grid.members.par_iter().map(|members| {
            let mut sums = [[0.0; 3]; CORNERS];
            for &point in members {
                let point = point as usize;
                for (sum, share) in sums.iter_mut().zip(grid.shares[point]) {
                    for axis in 0..dimension {
                        sum[axis] += share * grid.free[point][axis] * forces[point][axis];
                    }
                }
            }
            sums
        });
        let sums: Vec<_> = sums.collect();
        let mut nodes = vec![0.0; dimension * grid.nodes];
        for (members, sums) in grid.members.iter().zip(&sums) {
            let first = grid.first_node(members[0] as usize);
            for (corner, sum) in sums.iter().enumerate().take(1 << dimension) {
                let node = first + grid.node(std::array::from_fn(|axis| corner >> axis & 1));
                (0..dimension).for_each(|axis| nodes[dimension * node + axis] += sum[axis]);
            }
        }
        self.factor.solve(&mut nodes);
        let (vectors, _) = out.as_chunks_mut::<3>();
        vectors.par_iter_mut().enumerate().for_each(|(point, out)| {
            let first = grid.first_node(point);
            for (corner, share) in grid.shares[point].iter().enumerate().take(1 << dimension) {
                let node = first + grid.node(std::array::from_fn(|axis| corner >> axis & 1));
                for axis in 0..dimension {
                    out[axis] +=
                        SHARE * share * grid.free[point][axis] * nodes[dimension * node + axis];
                }
            }
        });
    }
}

impl Grid {
    fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        [shortest, longest]: [f64; 2],
        free: Vec<[f64; 3]>,
    ) -> Option<Self> {
        let first = *position.first()?;
        let (low, high) = position
            .iter()
            .fold((first, first), |(low, high), x| (low.inf(x), high.sup(x)));
        let extent = high - low;
        // with a margin for rounding
        let mut size = 1.002 * (LEAST_WIDTH * shortest).max(longest / MOST_REACH);
        if size == 0.0 {
            return None;
        }
        loop {
            let cells: [usize; 3] = std::array::from_fn(|axis| match axis < dimension {
                true => ((extent[axis] / size) as usize).max(1),
                false => 0,
            });
            // steps along the longest axis are the longest: that makes the narrowest band
            let mut axes = [0, 1, 2];
            axes.sort_by_key(|axis| cells[*axis]);
            let (mut stride, mut nodes) = ([0; 3], 1);
            for axis in axes {
                stride[axis] = nodes;
                nodes *= cells[axis] + 1;
            }
            let reach = (1.001 * longest / size).ceil() as usize;
            let diagonal: usize = stride[..dimension].iter().sum();
            let band = dimension * ((reach + 1) * diagonal + 1) - 1;
            if dimension * nodes * band * band > MOST_WORK {
                size *= 1.05;
                continue;
            }
            if nodes < LEAST_NODES {
                return None;
            }
            let place = |x: &Vector3<f64>, axis: usize| {
                let share = (x[axis] - low[axis]) / extent[axis].max(f64::MIN_POSITIVE);
                share * cells[axis] as f64
            };
            let cell_at = |x: &Vector3<f64>| -> [usize; 3] {
                let last = |axis: usize| cells[axis].saturating_sub(1);
                std::array::from_fn(|axis| (place(x, axis) as usize).min(last(axis)))
            };
            let cell: Vec<[usize; 3]> = position.iter().map(cell_at).collect();
            let shares = |(x, cell): (_, &[usize; 3])| {
                std::array::from_fn(|corner| {
                    let along = |axis: usize| {
                        let within = place(x, axis) - cell[axis] as f64;
                        if corner >> axis & 1 == 1 {
                            within
                        } else {
                            1.0 - within
                        }
                    };
                    (0..dimension).map(along).product()
                })
            };
            let mut grid = Grid {
                dimension,
                nodes,
                stride,
                reach,
                band,
                shares: position.iter().zip(&cell).map(shares).collect(),
                cell,
                free,
                members: vec![Vec::new(); nodes],
            };
            for point in 0..position.len() {
                let first = grid.first_node(point);
                grid.members[first].push(point as u32);
            }
            grid.members.retain(|members| !members.is_empty());
            return Some(grid);
        }
    }

    /// Number of a node, or of steps between two.
    fn node(&self, at: [usize; 3]) -> usize {
        (0..3).map(|axis| at[axis] * self.stride[axis]).sum()
    }

    fn first_node(&self, point: usize) -> usize {
        self.node(self.cell[point])
    }

    /// Place of a corner of a cell in the window of another, `shift` cells from there.
    fn in_window(&self, corner: usize, shift: [isize; 3]) -> usize {
        let along =
            |axis: usize| (shift[axis] + self.reach as isize) as usize + (corner >> axis & 1);
        let axes = (0..self.dimension).rev();
        axes.fold(0, |place, axis| self.window() * place + along(axis))
    }

    /// Nodes along an axis that springs of the points of a cell tie.
    fn window(&self) -> usize {
        2 * self.reach + 2
    }

    /// Forces on the corners of the cell of `members` by displacements of the nodes in its window, by corner
    /// and node.
    fn stiffness(
        &self,
        members: &[u32],
        springs: impl Fn(usize, &mut dyn FnMut(Spring)),
    ) -> Vec<[[f64; 3]; 3]> {
        let corners = 1 << self.dimension;
        let window = self.window().pow(self.dimension as u32);
        let to_corner = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| self.in_window(corner, [0; 3]));
        let mut block = vec![[[0.0; 3]; 3]; corners * window];
        let mut on_point = vec![[[0.0; 3]; 3]; window];
        for &point in members {
            let point = point as usize;
            on_point.fill([[0.0; 3]; 3]);
            let mut follow = |other: usize, shift: [isize; 3], mut stiffness: [[f64; 3]; 3]| {
                for row in &mut stiffness {
                    (0..3).for_each(|axis| row[axis] *= self.free[other][axis]);
                }
                let from = self.in_window(0, shift);
                let shares = self.shares[other].iter().zip(to_corner).take(corners);
                for (share, corner) in shares {
                    accumulate(
                        &mut on_point[from + corner - to_corner[0]],
                        [*share; 3],
                        &stiffness,
                    );
                }
            };
            let mut own = [[0.0; 3]; 3];
            springs(point, &mut |spring| {
                let cells = [point, spring.to].map(|point| self.cell[point]);
                let shift: [isize; 3] = std::array::from_fn(|axis| {
                    cells[1][axis].wrapping_sub(cells[0][axis]) as isize
                });
                let stiffness: [[f64; 3]; 3] = std::array::from_fn(|a| {
                    std::array::from_fn(|b| {
                        let both = (1.0 - spring.across) * spring.along[a] * spring.along[b];
                        spring.stiffness * if a == b { both + spring.across } else { both }
                    })
                });
                accumulate(&mut own, [1.0; 3], &stiffness);
                let end = |row: [f64; 3]| std::array::from_fn(|b| -spring.scale[b] * row[b]);
                follow(spring.to, shift, stiffness.map(end));
            });
            follow(point, [0; 3], own);
            let shares = self.shares[point]
                .iter()
                .zip(block.chunks_exact_mut(window));
            for (share, block) in shares {
                let factors = self.free[point].map(|free| share * free);
                let nodes = block.iter_mut().zip(&on_point);
                nodes.for_each(|(sum, stiffness)| accumulate(sum, factors, stiffness));
            }
        }
        block
    }

    /// Adds the stiffness of a cell to the rows of its corners.
    fn add(&self, members: &[u32], block: &[[[f64; 3]; 3]], matrix: &mut Banded) {
        let dimension = self.dimension;
        let first = self.first_node(members[0] as usize);
        let before = self.reach * self.stride[..dimension].iter().sum::<usize>();
        let window = self.window().pow(dimension as u32);
        for (index, stiffness) in block.iter().enumerate() {
            let (corner, place) = (index / window, index % window);
            let node = first + self.node(std::array::from_fn(|axis| corner >> axis & 1));
            let along = |axis: usize| place / self.window().pow(axis as u32) % self.window();
            let after = (0..dimension).map(|axis| along(axis) * self.stride[axis]);
            // nodes outside of the grid have no part
            let Some(other) = (first + after.sum::<usize>()).checked_sub(before) else {
                continue;
            };
            for (a, row) in stiffness.iter().enumerate().take(dimension) {
                for (b, value) in row.iter().enumerate().take(dimension) {
                    if *value != 0.0 {
                        matrix.add(dimension * node + a, dimension * other + b, *value);
                    }
                }
            }
        }
    }
}

/// Adds a matrix to another, row by row times a factor.
#[inline(always)]
fn accumulate(sum: &mut [[f64; 3]; 3], factors: [f64; 3], matrix: &[[f64; 3]; 3]) {
    for ((sum, factor), row) in sum.iter_mut().zip(factors).zip(matrix) {
        (0..3).for_each(|axis| sum[axis] += factor * row[axis]);
    }
}

/// A symmetric matrix of entries near its diagonal, or its factor by Cholesky: `L L^T`.
///
/// By hand, since it is short: nalgebra has dense ones only.
#[derive(Clone, Debug)]
struct Banded {
    band: usize,
    /// Of each row the diagonal and what is left of it.
    rows: Vec<f64>,
}

impl Banded {
    fn new(rows: usize, band: usize) -> Self {
        Banded {
            band,
            rows: vec![0.0; rows * (band + 1)],
        }
    }

    fn len(&self) -> usize {
        self.rows.len() / (self.band + 1)
    }

    /// First column of a row, and its entries from there to the diagonal.
    fn row(&self, row: usize) -> (usize, &[f64]) {
        let first = row.saturating_sub(self.band);
        let end = (row + 1) * (self.band + 1);
        (first, &self.rows[end - 1 - (row - first)..end])
    }

    /// Adds to an entry, if it is left of the diagonal or on it.
    fn add(&mut self, row: usize, column: usize, value: f64) {
        if column <= row {
            self.rows[(row + 1) * (self.band + 1) - 1 - (row - column)] += value;
        }
    }

    /// `L`, with the diagonal stiffened; `None` where that does not make it positive definite.
    fn factors(mut self) -> Option<Self> {
        for row in 0..self.len() {
            let end = (row + 1) * (self.band + 1);
            self.rows[end - 1] = match self.rows[end - 1] {
                0.0 => 1.0,
                diagonal => diagonal * (1.0 + STIFFENING),
            };
            let first = row.saturating_sub(self.band);
            let start = end - 1 - (row - first);
            for column in first..row {
                let (from, other) = self.row(column);
                let before = dot(
                    &self.rows[start..][..column - first],
                    &other[first - from..column - from],
                );
                let diagonal = other[column - from];
                let entry = &mut self.rows[start + column - first];
                *entry = (*entry - before) / diagonal;
            }
            let left = &self.rows[start..end - 1];
            let pivot = self.rows[end - 1] - dot(left, left);
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            self.rows[end - 1] = pivot.sqrt();
        }
        Some(self)
    }

    /// Solves `L L^T x = b` in place.
    fn solve(&self, b: &mut [f64]) {
        for row in 0..b.len() {
            let (first, entries) = self.row(row);
            let (diagonal, left) = entries.split_last().expect("a row has its diagonal");
            b[row] = (b[row] - dot(left, &b[first..row])) / diagonal;
        }
        for row in (0..b.len()).rev() {
            let (first, entries) = self.row(row);
            let (diagonal, left) = entries.split_last().expect("a row has its diagonal");
            b[row] /= diagonal;
            let value = b[row];
            let before = b[first..row].iter_mut().zip(left);
            before.for_each(|(b, entry)| *b -= value * entry);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{Hints, Krylov, KrylovMethod, KrylovOptions, NullSpace};

    /// Points of a lattice, each with springs to the 26 around it; the first half of those softer.
    struct Beam {
        position: Vec<Vector3<f64>>,
        springs: Vec<Vec<Spring>>,
        free: Vec<[f64; 3]>,
    }

    impl Beam {
        fn new(cells: [i64; 3], softness: f64, is_held: impl Fn(&Vector3<f64>) -> bool) -> Self {
            let all = (0..cells[2]).flat_map(|k| {
                let plane = (0..cells[1]).flat_map(move |j| (0..cells[0]).map(move |i| [i, j, k]));
                plane.collect::<Vec<_>>()
            });
            let cell: Vec<[i64; 3]> = all.collect();
            let number = |c: [i64; 3]| {
                let inside = (0..3).all(|a| (0..cells[a]).contains(&c[a]));
                inside.then(|| ((c[2] * cells[1] + c[1]) * cells[0] + c[0]) as usize)
            };
            let springs = cell.iter().map(|c| {
                let around = (0..27).filter(|s| *s != 13);
                let ends = around.filter_map(|s| {
                    let step = [s % 3 - 1, s / 3 % 3 - 1, s / 9 - 1];
                    let other = std::array::from_fn(|a| c[a] + step[a]);
                    let length = step.map(|s| (s * s) as f64).iter().sum::<f64>().sqrt();
                    let soft = 2 * c[0] < cells[0] && 2 * other[0] < cells[0];
                    Some(Spring {
                        stiffness: if soft { softness } else { 1.0 },
                        across: 0.0,
                        along: step.map(|s| s as f64 / length),
                        to: number(other)?,
                        scale: [1.0; 3],
                    })
                });
                ends.collect()
            });
            let position: Vec<Vector3<f64>> = cell
                .iter()
                .map(|c| Vector3::from(c.map(|c| c as f64)))
                .collect();
            Beam {
                springs: springs.collect(),
                free: position
                    .iter()
                    .map(|x| [if is_held(x) { 0.0 } else { 1.0 }; 3])
                    .collect(),
                position,
            }
        }

        fn apply(&self, u: &[f64], out: &mut [f64]) {
            let at = |point: usize| Vector3::from_column_slice(&u[3 * point..3 * point + 3]);
            for point in 0..self.position.len() {
                let mut force = Vector3::zeros();
                for spring in &self.springs[point] {
                    let along = Vector3::from(spring.along);
                    let change = at(point) - at(spring.to);
                    force += spring.stiffness * along.dot(&change) * along;
                }
                for axis in 0..3 {
                    let free = self.free[point][axis];
                    out[3 * point + axis] = free * force[axis] + (1.0 - free) * u[3 * point + axis];
                }
            }
        }

        fn solve(&self, load: &[f64], coarse: bool, free: bool) -> (usize, Vec<f64>) {
            let springs = |point: usize, receive: &mut dyn FnMut(Spring)| {
                self.springs[point].iter().for_each(|s| receive(*s));
            };
            let space = CoarseSpace::new(&self.position, 3, self.free.clone(), springs)
                .expect("a long beam has many patches");
            let modes = |m: usize| -> Vec<f64> {
                let axis = Vector3::ith_axis(m % 3).into_inner();
                let motion = |x: &Vector3<f64>| if m < 3 { axis } else { axis.cross(x) };
                self.position
                    .iter()
                    .flat_map(|x| <[f64; 3]>::from(motion(x)))
                    .collect()
            };
            let null_space = NullSpace::new((0..if free { 6 } else { 0 }).map(modes).collect());
            let diagonal = |i: usize| {
                let springs = self.springs[i / 3].iter();
                let sum: f64 = springs.map(|s| s.stiffness * s.along[i % 3].powi(2)).sum();
                if self.free[i / 3][i % 3] == 0.0 {
                    1.0
                } else {
                    sum
                }
            };
            let diagonal: Vec<f64> = (0..load.len()).map(diagonal).collect();
            let options = KrylovOptions {
                relative_tolerance: 1e-9,
                ..KrylovOptions::default()
            };
            let mut solution = vec![0.0; load.len()];
            let hints = Hints {
                diagonal: Some(&diagonal),
                null_space: Some(&null_space),
                coarse: coarse.then_some(&space),
            };
            let report = Krylov::new(KrylovMethod::ConjugateGradient, options)
                .solve(
                    |u, out| {
                        self.apply(u, out);
                        Ok(())
                    },
                    load,
                    &mut solution,
                    hints,
                )
                .unwrap();
            (report.iterations, solution)
        }
    }

    fn tip_load(beam: &Beam, balanced: bool) -> Vec<f64> {
        let last = beam.position.len() - 1;
        let mut load = vec![0.0; 3 * beam.position.len()];
        load[3 * last + 2] = 1.0;
        if balanced {
            load[2] = 0.5;
            load[3 * (last / 2) + 2] = -1.5;
        }
        load
    }

    #[test]
    fn a_slender_beam_takes_far_fewer_iterations_and_bends_the_same() {
        for softness in [1.0, 1e-3] {
            let beam = Beam::new([60, 3, 3], softness, |x| x.x < 0.5);
            let load = tip_load(&beam, false);
            let (without, expected) = beam.solve(&load, false, false);
            let (with, bent) = beam.solve(&load, true, false);
            assert!(5 * with < without, "{with} against {without}");
            let size = expected.iter().fold(0.0f64, |s, u| s.max(u.abs()));
            let differ = bent.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            assert!(differ.fold(0.0, f64::max) < 1e-4 * size);
        }
    }

    #[test]
    fn a_free_beam_keeps_out_of_its_rigid_motions() {
        let beam = Beam::new([60, 3, 3], 1.0, |_| false);
        let mut load = tip_load(&beam, true);
        let (without, _) = beam.solve(&load, false, true);
        let (with, bent) = beam.solve(&load, true, true);
        assert!(5 * with < without, "{with} against {without}");
        beam.apply(&bent.clone(), &mut load);
        assert!(bent.iter().step_by(3).sum::<f64>().abs() < 1e-6);
    }

    #[test]
    fn a_compact_body_has_no_coarse_space() {
        let beam = Beam::new([4, 4, 4], 1.0, |_| false);
        let none = |_: usize, _: &mut dyn FnMut(Spring)| {};
        assert!(CoarseSpace::new(&beam.position, 3, beam.free, none).is_none());
    }
}
