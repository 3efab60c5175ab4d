//! Sweeps over cells and corners: gradients of the displacement, and forces of the cells on their corners.
//!
//! Cells write their state, corners gather it from the cells around in a fixed order: each result is written once, whatever
//! the number of threads.

use nalgebra::{Matrix3, Matrix6, Vector6};
use perimelt_core::body::NO_POINT;

use super::super::classical::{COMPONENTS, Point, symmetric};
use super::corners::{CORNERS, sign};

/// Products of the sides of a corner along these axes (bits) are displacements without a mean and without a gradient.
pub(super) const MODES: [usize; 4] = [0b11, 0b110, 0b101, 0b111];

/// Number of [`MODES`] in a dimension.
pub(super) fn modes(dimension: usize) -> usize {
    [0, 1, 4][dimension - 1]
}

/// Value of a mode at a corner.
#[inline(always)]
pub(super) fn mode_at(mode: usize, corner: usize) -> f64 {
    let below = (MODES[mode] & !corner).count_ones();
    if below % 2 == 1 { -1.0 } else { 1.0 }
}

/// Amplitudes of the modes by axis, m.
pub(super) type Amplitudes = [[f64; 3]; MODES.len()];

/// Force density of a cell on its corner q, but for `g U_q`: `slope s_q - mean`, with the sides s of the corner, N/m³.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellState<const D: usize> {
    pub(super) slope: [[f64; D]; D],
    /// g times the mean displacement.
    pub(super) mean: [f64; D],
}

impl<const D: usize> CellState<D> {
    pub(super) const ZERO: Self = CellState {
        slope: [[0.0; D]; D],
        mean: [0.0; D],
    };
}

/// `sum_q U_q s_q` by rows, and `sum_q U_q`, m.
#[inline(always)]
pub(super) fn sums<const D: usize>(
    displacement: &[[f64; 3]],
    corners: &[u32; CORNERS],
) -> ([[f64; D]; D], [f64; D]) {
    let (mut slope, mut sum) = ([[0.0; D]; D], [0.0; D]);
    for (q, &corner) in corners.iter().enumerate().take(1 << D) {
        let u = &displacement[corner as usize];
        for a in 0..D {
            sum[a] += u[a];
            (0..D).for_each(|b| slope[a][b] += sign(q, b) * u[a]);
        }
    }
    (slope, sum)
}

/// Amplitudes of the modes of a displacement (m) at the corners of a cell.
pub(super) fn amplitudes<const D: usize>(
    displacement: &[[f64; 3]],
    corners: &[u32; CORNERS],
) -> Amplitudes {
    let mut amplitudes = Amplitudes::default();
    for (mode, amplitude) in amplitudes.iter_mut().enumerate().take(modes(D)) {
        for (q, &corner) in corners.iter().enumerate().take(1 << D) {
            let factor = mode_at(mode, q) / f64::from(1 << D);
            (0..D).for_each(|a| amplitude[a] += factor * displacement[corner as usize][a]);
        }
    }
    amplitudes
}

/// Isotropic elasticity of changes, Pa.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elastic {
    pub(super) lame: f64,
    pub(super) shear: f64,
}

/// Geometry of the cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// m.
    pub(super) spacing: f64,
    /// `phi_q = weight s_q`, 1/m.
    pub(super) weight: f64,
}

impl Cell {
    pub(super) fn new(spacing: f64, dimension: usize) -> Self {
        Cell {
            spacing,
            weight: 1.0 / (f64::from(1 << (dimension - 1)) * spacing),
        }
    }

    /// H from [`sums`].
    pub(super) fn gradient<const D: usize>(&self, slope: &[[f64; D]; D]) -> Matrix3<f64> {
        let mut gradient = Matrix3::zeros();
        for (a, row) in slope.iter().enumerate() {
            for (b, sum) in row.iter().enumerate() {
                gradient[(a, b)] = self.weight * sum;
            }
        }
        gradient
    }

    /// State of a cell by [`sums`], with springs g (N/m⁵).
    #[inline(always)]
    pub(super) fn elastic_state<const D: usize>(
        &self,
        (slope, sum): ([[f64; D]; D], [f64; D]),
        elastic: Elastic,
        spring: f64,
    ) -> CellState<D> {
        let Elastic { lame, shear } = elastic;
        let weight = self.weight;
        let (square, arm) = (weight * weight, 0.5 * self.spacing * weight * spring);
        let mut trace = 0.0;
        (0..D).for_each(|a| trace += slope[a][a]);
        let mut state = CellState::ZERO;
        for a in 0..D {
            (0..D).for_each(|b| {
                let symmetric = slope[a][b] + slope[b][a];
                state.slope[a][b] = square * shear * symmetric - arm * slope[a][b];
            });
            state.slope[a][a] += square * lame * trace;
            state.mean[a] = spring / f64::from(1 << D) * sum[a];
        }
        state
    }

    /// Slope by the `relief` of a point that flows: the derivative of a stress by the strain (xx, yy, zz, xy, yz, zx), Pa.
    #[inline(always)]
    pub(super) fn relief<const D: usize>(
        &self,
        slope: &[[f64; D]; D],
        relief: &Matrix6<f64>,
    ) -> [[f64; D]; D] {
        let strain = Point::strain(&self.gradient(slope), false);
        let stress = relief * Vector6::from(COMPONENTS.map(|at| strain[at]));
        self.slope(&Matrix3::zeros(), &symmetric(&stress.into()), 0.0)
    }

    /// Force on a corner by the displacement of another one relative to it, by rows, N/m⁵.
    pub(super) fn coupling<const D: usize>(
        &self,
        [q, r]: [usize; 2],
        elastic: Elastic,
        spring: f64,
    ) -> [[f64; 3]; 3] {
        let Elastic { lame, shear } = elastic;
        let square = self.weight * self.weight;
        let alike: f64 = (0..D).map(|a| sign(q, a) * sign(r, a)).sum();
        let isotropic = square * shear * alike - spring * (1.0 + alike) / f64::from(1 << D);
        let mut coupling = [[0.0; 3]; 3];
        for (a, row) in coupling.iter_mut().enumerate().take(D) {
            for (b, entry) in row.iter_mut().enumerate().take(D) {
                let volume = lame * sign(q, a) * sign(r, b) + shear * sign(q, b) * sign(r, a);
                *entry = -square * volume - if a == b { isotropic } else { 0.0 };
            }
        }
        coupling
    }

    /// State of a cell with a gradient and a stress, but for its mean.
    #[inline(always)]
    pub(super) fn slope<const D: usize>(
        &self,
        gradient: &Matrix3<f64>,
        stress: &Matrix3<f64>,
        spring: f64,
    ) -> [[f64; D]; D] {
        let arm = 0.5 * self.spacing * spring;
        let mut slope = [[0.0; D]; D];
        for (a, row) in slope.iter_mut().enumerate() {
            for (b, entry) in row.iter_mut().enumerate() {
                *entry = self.weight * stress[(a, b)] - arm * gradient[(a, b)];
            }
        }
        slope
    }
}

/// Sum of the force densities of the cells around a corner, but for the springs times its displacement, N/m³.
#[inline(always)]
pub(super) fn gather<const D: usize>(states: &[CellState<D>], points: &[u32; CORNERS]) -> [f64; D] {
    let mut force = [0.0; D];
    for (q, &point) in points.iter().enumerate().take(1 << D) {
        if point == NO_POINT {
            continue;
        }
        let state = &states[point as usize];
        for (a, force) in force.iter_mut().enumerate() {
            let mut sum = -state.mean[a];
            (0..D).for_each(|b| sum += sign(q, b) * state.slope[a][b]);
            *force += sum;
        }
    }
    force
}
