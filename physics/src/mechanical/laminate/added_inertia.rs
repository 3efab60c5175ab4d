//! Inertia that is added to motions across thin layers, so that their waves do not limit the step of a plate.
//!
//! Selective mass scaling \[Olovsson2005\]: the mass `M` of a column of points above each other becomes
//!
//! ```text
//! M + dt²/4 K'',   K'' = sum_n g_n b_n b_n^T
//! ```
//!
//! with dt the largest step and `b_n` the second difference across the layers n - 1, n and n + 1, in x, y and z alike. It is zero for displacements that
//! are linear across the thickness: translations, rotations and the bending of plates keep their inertia, and the sums of forces and
//! moments are kept. Motion is stable if `dt²/4` times the stiffness without K'' is no more than M (docs/theory/laminates.md, "Stable step and equilibrium").

use nalgebra::{DMatrix, DVector};
use perimelt_core::body::Sizes;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::sum_points;
use rayon::prelude::*;

use super::LayerSolid;
use super::interface::Interface;

/// Components that are solved together.
const LANES: usize = 32;
/// Pieces of the columns that threads may share.
const PIECES: usize = 64;

type Lane = [f64; LANES];

/// The stiffness of layers in a stack against each other.
#[derive(Debug, Default)]
pub(super) struct Stack {
    /// Distances of the layers, m.
    distances: Vec<f64>,
    /// Thickness of each layer, m.
    thickness: Vec<f64>,
    /// Least density of each layer, kg/m³.
    density: Vec<f64>,
}

/// Springs between layers, by interface, N/m³.
pub(super) struct Springs {
    /// Against shear.
    pub(super) shear: Vec<f64>,
    /// Against opening.
    pub(super) opening: Vec<f64>,
}

impl Stack {
    pub(super) fn new(layers: &[LayerSolid], interfaces: &[Interface], density: &[f64]) -> Self {
        let points = density.len() / layers.len();
        let least = |of_layer: &[f64]| of_layer.iter().copied().fold(f64::INFINITY, f64::min);
        Stack {
            distances: interfaces.iter().map(|i| i.crossing.distance).collect(),
            thickness: layers.iter().map(|layer| layer.thickness).collect(),
            density: density.chunks(points).map(least).collect(),
        }
    }

    /// Second differences over the distances, 1/m, by inner layer: the coefficients of the layer below, of its own and of that above.
    fn differences(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.distances.windows(2).map(|pair| {
            let [below, above] = [1.0 / pair[0], 1.0 / pair[1]];
            [below, -below - above, above]
        })
    }

    /// `g` of each inner layer, Pa m: a share of the stiffness of the interfaces beside it.
    fn stiffness(&self, springs: &Springs, share: f64) -> Vec<f64> {
        let largest = springs.shear.iter().zip(&springs.opening);
        let moduli = largest.zip(&self.distances);
        let moduli: Vec<f64> = moduli.map(|((s, o), d)| s.max(*o) * d * d).collect();
        let inner = moduli.windows(2);
        inner
            .map(|pair| share * 0.5 * (pair[0] + pair[1]))
            .collect()
    }

    /// Squares of the largest frequencies of a column, for shear and for opening, that are left beside the added inertia of a share.
    pub(super) fn largest_squares(&self, springs: &Springs, share: f64) -> [f64; 2] {
        let added = self.added(&self.stiffness(springs, share));
        [&springs.shear, &springs.opening].map(|springs| {
            let left = self.between_layers(springs) - &added;
            left.symmetric_eigenvalues().max()
        })
    }

    /// Relative inertia that a share of one adds to the first wave of opening across the layers, over the square of half of the step, 1/s².
    pub(super) fn inertia_of_first_wave(&self, springs: &Springs) -> f64 {
        let waves = self.between_layers(&springs.opening).symmetric_eigen();
        let mut order: Vec<usize> = (0..waves.eigenvalues.len()).collect();
        order.sort_by(|a, b| waves.eigenvalues[*a].total_cmp(&waves.eigenvalues[*b]));
        // the first mode is the translation
        let Some(first) = order.get(1) else {
            return 0.0;
        };
        let first = waves.eigenvectors.column(*first);
        let added = self.added(&self.stiffness(springs, 1.0));
        first.dot(&(added * first))
    }

    /// Stiffness of springs between layers over their masses, 1/s².
    fn between_layers(&self, springs: &[f64]) -> DMatrix<f64> {
        self.over_masses(springs.iter().map(|_| [-1.0, 1.0]), springs)
    }

    /// K'' over the masses of layers, 1/s².
    fn added(&self, stiffness: &[f64]) -> DMatrix<f64> {
        self.over_masses(self.differences(), stiffness)
    }

    /// `sum_n k_n b_n b_n^T` over the masses of layers, with the coefficients `b_n` from the layer n on.
    fn over_masses<const N: usize>(
        &self,
        coefficients: impl Iterator<Item = [f64; N]>,
        stiffness: &[f64],
    ) -> DMatrix<f64> {
        let masses = self.thickness.iter().zip(&self.density);
        let roots: Vec<f64> = masses.map(|(t, rho)| (t * rho).sqrt()).collect();
        let mut matrix = DMatrix::zeros(roots.len(), roots.len());
        for (first, (of_layers, stiffness)) in coefficients.zip(stiffness).enumerate() {
            let mut row = DVector::zeros(roots.len());
            (0..N).for_each(|n| row[first + n] = of_layers[n] / roots[first + n]);
            matrix.ger(*stiffness, &row, &row, 1.0);
        }
        matrix
    }

    /// The added inertia of a share, for steps of any size.
    pub(super) fn added_inertia(&self, springs: &Springs, share: f64) -> AddedInertia {
        AddedInertia {
            differences: self.differences().collect(),
            stiffness: self.stiffness(springs, share),
            inverse_thickness: self.thickness.iter().map(|t| 1.0 / t).collect(),
            ..AddedInertia::default()
        }
    }
}

/// Inertia that is added to the columns of a laminate.
#[derive(Debug, Default)]
pub(super) struct AddedInertia {
    /// [`Stack::differences`].
    differences: Vec<[f64; 3]>,
    /// `g` of each inner layer, Pa m.
    stiffness: Vec<f64>,
    /// By layer, 1/m.
    inverse_thickness: Vec<f64>,
    /// `dt²/4 g`, kg, by inner layer; empty before the step is known.
    inertia: Vec<f64>,
    /// Diagonals of `dt²/4 K''` by layer, kg/m²: the main one, and the coefficients of the two layers above.
    diagonals: Vec<[f64; 3]>,
    /// Forces against second differences, N, by lane of columns and inner layer.
    forces: Vec<Lane>,
    /// Working memory of each piece.
    work: Vec<Vec<Row>>,
}

/// A row of the factors of the matrix of a lane of columns.
#[derive(Clone, Debug)]
struct Row {
    inverse_pivot: Lane,
    above: [Lane; 2],
    /// The right side, later the acceleration.
    value: Lane,
}

const NO_ROW: Row = Row {
    inverse_pivot: [0.0; LANES],
    above: [[0.0; LANES]; 2],
    value: [0.0; LANES],
};

impl AddedInertia {
    /// Takes the largest step, s.
    pub(super) fn set_step(&mut self, step: f64) {
        let layers = self.inverse_thickness.len();
        let factor = 0.25 * step * step;
        self.inertia = self.stiffness.iter().map(|g| factor * g).collect();
        self.diagonals = vec![[0.0; 3]; layers];
        for (first, (b, inertia)) in self.differences.iter().zip(&self.inertia).enumerate() {
            for low in 0..3 {
                for high in low..3 {
                    self.diagonals[first + low][high - low] += inertia * b[low] * b[high];
                }
            }
        }
        self.work = vec![vec![NO_ROW; layers]; PIECES];
    }

    /// Kinetic energy of the added inertia, J, by velocities (m/s) and the volumes of points (m³).
    pub(super) fn kinetic_energy(&self, velocity: &[f64], volume: &Sizes) -> f64 {
        let Some(inverse_thickness) = self.inverse_thickness.first() else {
            return 0.0;
        };
        let points = volume.len() / self.inverse_thickness.len();
        let [sum] = sum_points(points, |point| {
            let of_layer =
                |layer: usize, axis: usize| velocity[3 * (layer * points + point) + axis];
            let differences = self.differences.iter().zip(&self.inertia).enumerate();
            let energy = differences.map(|(first, (b, inertia))| {
                let square = |axis: usize| {
                    let second: f64 = (0..3).map(|n| b[n] * of_layer(first + n, axis)).sum();
                    second * second
                };
                0.5 * inertia * (square(0) + square(1) + square(2))
            });
            [volume[point] * inverse_thickness * energy.sum::<f64>()]
        });
        sum
    }

    /// `dt²/4 g` of an inner layer, kg.
    #[cfg(test)]
    pub(super) fn inertia_of(&self, inner: usize) -> f64 {
        self.inertia[inner]
    }

    /// Subtracts what the added inertia takes from a force density of points, N/m³; `inverse_density` (m³/kg) is zero where components are held.
    pub(super) fn subtract(&mut self, inverse_density: &[f64], force: &mut [f64]) {
        let inner = self.inertia.len();
        if inner == 0 {
            return;
        }
        let components = force.len() / self.inverse_thickness.len();
        let lanes = components.div_ceil(LANES);
        let mut forces = std::mem::take(&mut self.forces);
        let mut work = std::mem::take(&mut self.work);
        forces.resize(lanes * inner, [0.0; LANES]);
        let of_piece = lanes.div_ceil(PIECES);
        let pieces = forces.par_chunks_mut(of_piece * inner).zip(&mut work);
        let column = Column {
            inertia: self,
            inverse_density,
            force,
            components,
        };
        pieces.enumerate().for_all(|(piece, (forces, rows))| {
            for (lane, forces) in forces.chunks_mut(inner).enumerate() {
                column.solve((piece * of_piece + lane) * LANES, rows, forces);
            }
        });
        let layers = force.chunks_mut(components).enumerate();
        for (layer, of_layer) in layers {
            let of_differences = layer.saturating_sub(2)..inner.min(layer + 1);
            let lanes = of_layer.par_chunks_mut(LANES).zip(forces.par_chunks(inner));
            lanes.with_min_len(128).for_all(|(out, forces)| {
                for n in of_differences.clone() {
                    let scale = self.inverse_thickness[layer] * self.differences[n][layer - n];
                    for (out, force) in out.iter_mut().zip(&forces[n]) {
                        *out -= scale * force;
                    }
                }
            });
        }
        self.forces = forces;
        self.work = work;
    }
}

/// What the accelerations of columns follow from.
struct Column<'a> {
    inertia: &'a AddedInertia,
    inverse_density: &'a [f64],
    force: &'a [f64],
    /// Components of a layer.
    components: usize,
}

impl Column<'_> {
    /// Forces against the second differences of the accelerations of a lane of columns, by Gaussian elimination; rows are those of the
    /// equation of motion over the mass, so that held components have no acceleration.
    fn solve(&self, first: usize, rows: &mut [Row], forces: &mut [Lane]) {
        let own = self.inertia;
        let load = |values: &[f64], layer: usize| {
            let values = &values[layer * self.components..][first..self.components];
            let mut lane = [0.0; LANES];
            let count = values.len().min(LANES);
            lane[..count].copy_from_slice(&values[..count]);
            lane
        };
        for layer in 0..rows.len() {
            let inverse = load(self.inverse_density, layer);
            let force = load(self.force, layer);
            let scale = own.inverse_thickness[layer];
            let [main, first, second] = own.diagonals[layer];
            let (before, rest) = rows.split_at_mut(layer);
            let back = |back: usize| layer.checked_sub(back);
            let below = [1, 2].map(|n| back(n).map_or(0.0, |layer| own.diagonals[layer][n]));
            let [one, two] = [1, 2].map(|n| back(n).map_or(&NO_ROW, |layer| &before[layer]));
            let row = &mut rest[0];
            for lane in 0..LANES {
                let inverse_mass = inverse[lane] * scale;
                let of_two = inverse_mass * below[1] * two.inverse_pivot[lane];
                let left = inverse_mass * below[0] - of_two * two.above[0][lane];
                let of_one = left * one.inverse_pivot[lane];
                let pivot = 1.0 + inverse_mass * main
                    - of_two * two.above[1][lane]
                    - of_one * one.above[0][lane];
                row.inverse_pivot[lane] = 1.0 / pivot;
                row.above[0][lane] = inverse_mass * first - of_one * one.above[1][lane];
                row.above[1][lane] = inverse_mass * second;
                row.value[lane] = inverse[lane] * force[lane]
                    - of_two * two.value[lane]
                    - of_one * one.value[lane];
            }
        }
        let [mut one, mut two] = [[0.0; LANES]; 2];
        for (layer, row) in rows.iter_mut().enumerate().rev() {
            for lane in 0..LANES {
                let above = row.above[0][lane] * one[lane] + row.above[1][lane] * two[lane];
                row.value[lane] = (row.value[lane] - above) * row.inverse_pivot[lane];
            }
            if let (Some(b), Some(inertia)) = (own.differences.get(layer), own.inertia.get(layer)) {
                for lane in 0..LANES {
                    let second = b[0] * row.value[lane] + b[1] * one[lane] + b[2] * two[lane];
                    forces[layer][lane] = inertia * second;
                }
            }
            [one, two] = [row.value, one];
        }
    }
}
