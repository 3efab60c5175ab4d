//! The coarse grid: its cells, the points in them, and the stiffness between its nodes.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::Spring;
use super::banded::BandedSums;
use crate::solver::Reducer;
use crate::solver::exact::{FixedPoint, Halves};

/// Largest number of multiplications for the factors of a coarse matrix, a few tenths of a second. Cells are
/// widened until the factors take less.
const MOST_WORK: usize = 600_000_000;

/// Largest number of multiplications for the factors for each spring: as many as some ten iterations take. Finer cells
/// cost more than the iterations that they save.
const WORK_FOR_SPRING: usize = 500;

/// Number of multiplications that are always allowed, some milliseconds.
const FREE_WORK: usize = 30_000_000;

/// Smallest width of a cell in neighbourhoods. Cells half as wide save a tenth of the iterations, and cost more than that where
/// the stiffness changes with every solution, as with temperature.
const LEAST_WIDTH: f64 = 1.5;

/// With fewer nodes than these the diagonal alone does as well.
const LEAST_NODES: usize = 12;

/// Largest number of cells that a spring spans along an axis. Where neighbourhoods differ in size, cells are
/// widened to meet it.
const MOST_REACH: f64 = 3.0;

const ZERO: [[f64; 3]; 3] = [[0.0; 3]; 3];

/// Corners of a cell in three dimensions.
pub(super) const CORNERS: usize = 8;

/// The springs of a point.
#[derive(Clone, Copy, Debug, Default)]
struct Neighbourhood {
    reach: f64,
    springs: f64,
    /// Sum of the largest entries of their stiffnesses.
    stiffness: f64,
}

/// Size of a network of springs.
#[derive(Clone, Copy, Debug)]
struct Network {
    /// Number of springs, those from each of their ends.
    springs: usize,
    /// Smallest half-width of a neighbourhood.
    shortest: f64,
    /// Largest half-width of a neighbourhood.
    longest: f64,
}

/// Cells and nodes of a grid of a given width.
#[derive(Clone, Debug)]
struct Layout {
    dimension: usize,
    /// Lower corner and extent of the grid.
    low: Vector3<f64>,
    extent: Vector3<f64>,
    /// Number of cells along each axis.
    cells: [usize; 3],
    nodes: usize,
    /// Difference of the numbers of two nodes that are neighbours along each axis.
    stride: [usize; 3],
    /// Largest number of cells that springs span along an axis.
    reach: usize,
    /// Largest distance between two rows of the matrix that springs connect.
    band: usize,
}

/// The cells of a coarse grid, and points of a network of springs in them.
#[derive(Clone, Debug)]
pub struct CoarseGrid {
    layout: Layout,
    /// The cell of each point along each axis.
    cell: Vec<[usize; 3]>,
    /// Multilinear weights of the corners of the cell of each point; bit `axis` of a corner's number is set at
    /// its upper side.
    pub(super) weights: Vec<[f64; CORNERS]>,
    /// One or, for held components, zero.
    pub(super) free: Vec<[f64; 3]>,
    /// The points of this process in each cell that has any.
    pub(super) members: Vec<Vec<u32>>,
    /// The group of each point of this process.
    group: Vec<u32>,
    /// Largest number of terms of a sum over the rows of points of cells around a node.
    terms: f64,
    /// Largest sum of the largest entries of the stiffnesses of the springs of a point.
    pub(super) stiffest: f64,
}

impl Layout {
    /// The finest layout over `position` whose factors are affordable; `None` if it has few nodes.
    fn fitting(
        position: &[Vector3<f64>],
        dimension: usize,
        &Network {
            springs,
            shortest,
            longest,
        }: &Network,
        points: &Reducer,
    ) -> Option<Self> {
        let most_work = (WORK_FOR_SPRING * springs).clamp(FREE_WORK, MOST_WORK);
        let first = *position.first()?;
        let (low, high) = position
            .iter()
            .fold((first, first), |(low, high), x| (low.inf(x), high.sup(x)));
        let (low, high) = (low.map(|x| points.min(x)), high.map(|x| points.max(x)));
        // with a margin for rounding
        let mut size = 1.002 * (LEAST_WIDTH * shortest).max(longest / MOST_REACH);
        if size == 0.0 {
            return None;
        }
        loop {
            let layout = Layout::of_width(size, dimension, [low, high - low], longest);
            if dimension * layout.nodes * layout.band * layout.band <= most_work {
                return (layout.nodes >= LEAST_NODES).then_some(layout);
            }
            size *= 1.05;
        }
    }

    /// The layout of cells of width `size`; `longest` is the length of the longest spring.
    fn of_width(
        size: f64,
        dimension: usize,
        [low, extent]: [Vector3<f64>; 2],
        longest: f64,
    ) -> Self {
        let cells: [usize; 3] = std::array::from_fn(|axis| match axis < dimension {
            true => ((extent[axis] / size) as usize).max(1),
            false => 0,
        });
        // the largest stride along the longest axis makes the narrowest band
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|axis| cells[*axis]);
        let (mut stride, mut nodes) = ([0; 3], 1);
        for axis in axes {
            stride[axis] = nodes;
            nodes *= cells[axis] + 1;
        }
        let reach = (1.001 * longest / size).ceil() as usize;
        let diagonal: usize = stride[..dimension].iter().sum();
        Layout {
            dimension,
            low,
            extent,
            cells,
            nodes,
            stride,
            reach,
            band: dimension * ((reach + 1) * diagonal + 1) - 1,
        }
    }

    /// Coordinate along an axis in cells.
    fn place(&self, x: &Vector3<f64>, axis: usize) -> f64 {
        let fraction = (x[axis] - self.low[axis]) / self.extent[axis].max(f64::MIN_POSITIVE);
        fraction * self.cells[axis] as f64
    }

    fn cell_at(&self, x: &Vector3<f64>) -> [usize; 3] {
        let last = |axis: usize| self.cells[axis].saturating_sub(1);
        std::array::from_fn(|axis| (self.place(x, axis) as usize).min(last(axis)))
    }

    /// Multilinear weights of the corners of `cell` at `x`.
    fn weights(&self, x: &Vector3<f64>, cell: &[usize; 3]) -> [f64; CORNERS] {
        std::array::from_fn(|corner| {
            let along = |axis: usize| {
                let within = self.place(x, axis) - cell[axis] as f64;
                if corner >> axis & 1 == 1 {
                    within
                } else {
                    1.0 - within
                }
            };
            (0..self.dimension).map(along).product()
        })
    }
}

impl CoarseGrid {
    /// The finest affordable grid for `points` at `position` (m) with the `springs` of each. `free` is zero for held components, else one. `None` for
    /// bodies of few cells. Collective.
    pub fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        free: Vec<[f64; 3]>,
        points: &Reducer,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
    ) -> Option<Self> {
        let neighbourhood = |point: usize| {
            let mut found = Neighbourhood::default();
            springs(point, &mut |spring| {
                let distance = (position[spring.to] - position[point]).amax();
                let rows = spring.stiffness.as_flattened().iter();
                found.reach = found.reach.max(distance);
                found.springs += 1.0;
                found.stiffness += rows.fold(0.0, |most, k| k.abs().max(most));
            });
            found
        };
        let neighbourhoods = (0..points.owned()).into_par_iter().map(neighbourhood);
        let neighbourhoods: Vec<Neighbourhood> = neighbourhoods.collect();
        // points without springs, such as those whose material is not deposited yet, have no neighbourhood
        let reaches = neighbourhoods.iter().map(|n| n.reach);
        let reaches = reaches.filter(|reach| *reach > 0.0);
        let longest = points.max(reaches.clone().fold(0.0, f64::max));
        let stiffest = neighbourhoods.iter().map(|n| n.stiffness);
        let stiffest = points.max(stiffest.fold(0.0, f64::max));
        let [count] = points.sum_points(|point| [neighbourhoods[point].springs]);
        let network = Network {
            springs: count as usize,
            shortest: points.min(reaches.fold(longest, f64::min)),
            longest,
        };
        let layout = Layout::fitting(position, dimension, &network, points)?;
        let cell: Vec<[usize; 3]> = position.iter().map(|x| layout.cell_at(x)).collect();
        let weights = position.iter().zip(&cell);
        let mut grid = CoarseGrid {
            weights: weights.map(|(x, cell)| layout.weights(x, cell)).collect(),
            cell,
            free,
            members: vec![Vec::new(); layout.nodes],
            group: points.group_of_points(),
            terms: 0.0,
            stiffest,
            layout,
        };
        for point in 0..points.owned() {
            let first = grid.first_node(point);
            grid.members[first].push(point as u32);
        }
        let count = grid
            .members
            .iter()
            .map(|members| grid.rows(members).count());
        let mut count: Vec<i64> = count.map(|count| count as i64).collect();
        if let Some(transport) = points.processes().transport() {
            transport.sum(&mut count);
        }
        let most = count.into_iter().max().unwrap_or_default();
        grid.terms = CORNERS as f64 * most as f64;
        grid.members.retain(|members| !members.is_empty());
        Some(grid)
    }

    pub(super) fn dimension(&self) -> usize {
        self.layout.dimension
    }

    /// The points of a cell in rows: those that stand in a group of points, which one process owns.
    pub(super) fn rows<'a>(&'a self, members: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
        members.chunk_by(|a, b| self.group[*a as usize] == self.group[*b as usize])
    }

    /// Number of rows of the matrix, and its band.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.layout.dimension * self.layout.nodes, self.layout.band)
    }

    /// Number of the node at a corner of the cell whose first node is `first`.
    pub(super) fn corner_node(&self, first: usize, corner: usize) -> usize {
        first + self.node(std::array::from_fn(|axis| corner >> axis & 1))
    }

    /// Number of a node, or the difference of the numbers of two.
    fn node(&self, at: [usize; 3]) -> usize {
        (0..3).map(|axis| at[axis] * self.layout.stride[axis]).sum()
    }

    /// The lowest node of the cell of a point.
    pub(super) fn first_node(&self, point: usize) -> usize {
        self.node(self.cell[point])
    }

    /// Index of a corner of a cell in the window of another cell, `shift` cells away.
    fn in_window(&self, corner: usize, shift: [isize; 3]) -> usize {
        let along = |axis: usize| {
            (shift[axis] + self.layout.reach as isize) as usize + (corner >> axis & 1)
        };
        let axes = (0..self.layout.dimension).rev();
        axes.fold(0, |place, axis| self.window() * place + along(axis))
    }

    /// Number of nodes along an axis that the springs of the points of a cell connect.
    fn window(&self) -> usize {
        2 * self.layout.reach + 2
    }

    /// Forces on the corners of the cell of `members` under unit displacements of the nodes in its window, by
    /// node, corner, row and column.
    pub(super) fn stiffness(
        &self,
        members: &[u32],
        fixed: FixedPoint,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)),
    ) -> Halves {
        let corners = 1 << self.layout.dimension;
        let window = self.window().pow(self.layout.dimension as u32);
        let to_corner = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| self.in_window(corner, [0; 3]));
        let mut sums = Halves::zeros(9 * corners * window);
        let mut block = vec![ZERO; corners * window];
        let mut is_reached = vec![false; window];
        let mut on_point = vec![ZERO; window];
        let mut add_point = |point: usize, block: &mut [_], is_reached: &mut [bool]| {
            let mut follow = |other: usize, shift: [isize; 3], mut stiffness: [[f64; 3]; 3]| {
                for row in &mut stiffness {
                    (0..3).for_each(|axis| row[axis] *= self.free[other][axis]);
                }
                let from = self.in_window(0, shift);
                let weights = self.weights[other].iter().zip(to_corner).take(corners);
                for (weight, corner) in weights {
                    accumulate(
                        &mut on_point[from + corner - to_corner[0]],
                        [*weight; 3],
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
                let stiffness = spring.stiffness;
                accumulate(&mut own, [1.0; 3], &stiffness);
                let end = |row: [f64; 3]| std::array::from_fn(|b| -spring.scale[b] * row[b]);
                follow(spring.to, shift, stiffness.map(end));
            });
            follow(point, [0; 3], own);
            let factors = self.weights[point].map(|weight| self.free[point].map(|f| weight * f));
            let nodes = on_point.iter_mut().zip(block.chunks_exact_mut(corners));
            let nodes = nodes.zip(is_reached);
            // springs reach few nodes of the window
            for ((stiffness, block), is_reached) in nodes.filter(|((s, _), _)| **s != ZERO) {
                let sums = block.iter_mut().zip(factors);
                sums.for_each(|(sum, factors)| accumulate(sum, factors, stiffness));
                *stiffness = ZERO;
                *is_reached = true;
            }
        };
        for row in self.rows(members) {
            for &point in row {
                add_point(point as usize, &mut block, &mut is_reached);
            }
            let of_nodes = block.chunks_exact_mut(corners).zip(&mut is_reached);
            for (node, (terms, is_reached)) in of_nodes.enumerate() {
                if std::mem::take(is_reached) {
                    let terms = terms.as_flattened_mut().as_flattened_mut();
                    let first = node * terms.len();
                    fixed.add(terms, sums.entries(first..first + terms.len()));
                }
            }
        }
        sums
    }

    /// Adds the stiffness of a cell to the rows of its corners.
    pub(super) fn add(&self, members: &[u32], block: &Halves, matrix: &mut BandedSums) {
        let dimension = self.layout.dimension;
        let first = self.first_node(members[0] as usize);
        let before = self.layout.reach * self.layout.stride[..dimension].iter().sum::<usize>();
        let corners = 1 << dimension;
        for index in 0..corners * self.window().pow(dimension as u32) {
            let (place, corner) = (index / corners, index % corners);
            let node = self.corner_node(first, corner);
            let along = |axis: usize| place / self.window().pow(axis as u32) % self.window();
            let after = (0..dimension).map(|axis| along(axis) * self.layout.stride[axis]);
            // the window may reach beyond the grid
            let Some(other) = (first + after.sum::<usize>()).checked_sub(before) else {
                continue;
            };
            for (a, b) in (0..dimension).flat_map(|a| (0..dimension).map(move |b| (a, b))) {
                let parts = block.at(9 * index + 3 * a + b);
                if parts != [0.0; 2] {
                    matrix.add([dimension * node + a, dimension * other + b], parts);
                }
            }
        }
    }

    /// The rounding of sums over the rows of points of cells, of which none is larger than `largest`.
    pub(super) fn fixed_point(&self, largest: f64) -> FixedPoint {
        FixedPoint::new(largest, self.terms)
    }
}

/// Adds a matrix to another, row by row times a factor.
#[inline(always)]
fn accumulate(sum: &mut [[f64; 3]; 3], factors: [f64; 3], matrix: &[[f64; 3]; 3]) {
    for ((sum, factor), row) in sum.iter_mut().zip(factors).zip(matrix) {
        (0..3).for_each(|axis| sum[axis] += factor * row[axis]);
    }
}
