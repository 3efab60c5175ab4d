//! The pressure with which nothing accumulates anywhere, by conjugate gradients.

use perimelt_core::family::Mirrored;
use perimelt_core::solver::{
    Hints, Krylov, KrylovMethod, KrylovOptions, NullSpace, Reducer, SolverError,
};
use perimelt_core::{Family, SlotField};

use super::kernels::{Diagonal, Spread};

/// Solves `sum_j 2 b beta_ij (q_i - q_j) = r` for `q = dt (p - p')`, with its work arrays.
#[derive(Debug)]
pub(super) struct PressureSolver {
    krylov: Krylov,
    /// A closed container leaves the level of the pressure free.
    level: NullSpace,
    diagonal: Vec<[f64; 1]>,
    /// `dt` times the pressure that is too much, Pa s.
    pub(super) surplus: Vec<f64>,
    /// The same, and search directions, by slot.
    slots: SlotField,
}

/// Excess of a fluid at rest, 1/s, whose speed is too small for a tolerance.
const AT_REST: f64 = 1e-100;

/// Bonds over which the pressure acts.
#[derive(Clone, Copy)]
pub(super) struct PressureBonds<'a> {
    pub(super) family: &'a Family,
    /// `2 / a`, 1/m.
    pub(super) laplacian: f64,
    /// By slot, kg/m³; infinite where nothing flows.
    pub(super) density: &'a SlotField,
}

impl PressureSolver {
    pub(super) fn new(points: usize) -> Self {
        let options = KrylovOptions {
            relative_tolerance: 0.0,
            ..KrylovOptions::default()
        };
        PressureSolver {
            krylov: Krylov::new(KrylovMethod::ConjugateGradient, options),
            level: NullSpace::constant(points, &Reducer::alone(points)),
            diagonal: vec![[0.0]; points],
            surplus: vec![0.0; points],
            slots: SlotField::default(),
        }
    }

    /// Finds the surplus that makes an `excess` of volume flow out of the points (1/s), up to a root mean square of `tolerance`
    /// (1/s). Returns the number of iterations.
    pub(super) fn solve(
        &mut self,
        bonds: PressureBonds<'_>,
        excess: &[[f64; 1]],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let PressureBonds {
            family,
            laplacian,
            density,
        } = bonds;
        let points = excess.len() as f64;
        self.krylov.options.absolute_tolerance = tolerance.max(AT_REST) * points.sqrt();
        family.sum(&Diagonal { laplacian }, [density], &mut self.diagonal);
        // points without a bond over which the pressure acts have no excess either
        let closed = self.diagonal.iter_mut().filter(|[sum]| *sum == 0.0);
        closed.for_each(|sum| *sum = [1.0]);
        self.surplus.fill(0.0);
        let slots = &mut self.slots;
        let apply = |q: &[f64], out: &mut [f64]| {
            slots.load(family, q, Mirrored::Scalar);
            let (sums, _) = out.as_chunks_mut::<1>();
            family.sum(&Spread { laplacian }, [slots, density], sums);
            Ok(())
        };
        let hints = Hints {
            diagonal: Some(self.diagonal.as_flattened()),
            null_space: Some(&self.level),
            ..Hints::default()
        };
        let excess = excess.as_flattened();
        let alone = Reducer::alone(excess.len());
        let report = self
            .krylov
            .solve(apply, excess, &mut self.surplus, &alone, hints)?;
        Ok(report.iterations)
    }
}
