//! Linear systems `A x = b` by Krylov methods, with `A` known only by its action.
//!
//! Source: Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), algorithms
//! 9.1 (preconditioned conjugate gradients) and 7.7 (BiCGStab, here preconditioned from
//! the right so that the residual tested is that of the system itself).
//!
//! Not for systems that are nearly singular without a [`NullSpace`], nor for matrices so
//! ill conditioned that their diagonal is no preconditioner at all: there is no other.

mod bicgstab;
mod conjugate_gradient;
mod null_space;

pub use null_space::NullSpace;

use super::error::{SolverError, same_length};
use super::vector::update;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which Krylov method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KrylovMethod {
    /// Symmetric positive (semi-)definite matrices: one product with `A` per iteration.
    ConjugateGradient,
    /// Any matrix: two products with `A` per iteration, convergence not monotone.
    BiCgStab,
}

/// When a Krylov iteration stops: at `|b - A x| <= relative |b| + absolute`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct KrylovOptions {
    /// Residual relative to the right-hand side [-].
    pub relative_tolerance: f64,
    /// Residual in the unit of the right-hand side.
    pub absolute_tolerance: f64,
    /// Iterations after which the solver gives up.
    pub max_iterations: usize,
}

impl Default for KrylovOptions {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-10,
            absolute_tolerance: 0.0,
            max_iterations: 10_000,
        }
    }
}

/// What a Krylov iteration did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KrylovReport {
    /// Iterations spent.
    pub iterations: usize,
    /// Norm of the residual, in the unit of the right-hand side, as updated by the
    /// recurrence (it drifts from `|b - A x|` by rounding only).
    pub residual: f64,
}

/// What is known of the matrix besides its action.
#[derive(Debug, Clone, Copy, Default)]
pub struct Hints<'a> {
    /// Diagonal of the matrix, used as preconditioner; positive for conjugate gradients.
    pub diagonal: Option<&'a [f64]>,
    /// Vectors that the matrix maps to zero, for instance rigid motions of a free body.
    /// Right-hand side and corrections are kept orthogonal to them, so the component of
    /// the initial guess along them stays as it is. For BiCGStab the range of the matrix
    /// must be orthogonal to them too, as it is for a symmetric matrix.
    pub null_space: Option<&'a NullSpace>,
}

impl Hints<'_> {
    /// `out = P D^-1 residual`.
    fn precondition(&self, residual: &[f64], out: &mut [f64]) {
        match self.diagonal {
            Some(diagonal) => update(out, [residual, diagonal], |_, [r, d]| r / d),
            None => out.copy_from_slice(residual),
        }
        self.project(out);
    }

    fn project(&self, vector: &mut [f64]) {
        if let Some(null_space) = self.null_space {
            null_space.project(vector);
        }
    }
}

/// A Krylov solver with its work vectors, which are allocated once.
///
/// Work vectors are updated in parallel and reduced by [`super::reduce`], so that the
/// result has the same bits for any number of threads (if the operator's has).
#[derive(Debug, Clone)]
pub struct Krylov {
    /// Which method.
    pub method: KrylovMethod,
    /// When to stop.
    pub options: KrylovOptions,
    work: Work,
}

#[derive(Debug, Clone, Default)]
struct Work {
    residual: Vec<f64>,
    direction: Vec<f64>,
    preconditioned: Vec<f64>,
    image: Vec<f64>,
    // of BiCGStab only
    shadow: Vec<f64>,
    second_image: Vec<f64>,
}

impl Krylov {
    /// A solver that sizes its work vectors at first use.
    pub fn new(method: KrylovMethod, options: KrylovOptions) -> Self {
        Self {
            method,
            options,
            work: Work::default(),
        }
    }

    /// Solves `A x = rhs`; `solution` holds the initial guess on entry.
    ///
    /// `apply(x, out)` writes `A x` into `out`, which holds unspecified numbers on entry.
    ///
    /// # Errors
    /// No convergence, a matrix that is not positive definite (conjugate gradients),
    /// numbers that are not finite, vectors of different lengths, a zero in the diagonal,
    /// and errors of `apply`.
    pub fn solve(
        &mut self,
        mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<(), SolverError>,
        rhs: &[f64],
        solution: &mut [f64],
        hints: Hints,
    ) -> Result<KrylovReport, SolverError> {
        let n = rhs.len();
        same_length("the initial guess", n, solution.len())?;
        if let Some(diagonal) = hints.diagonal {
            same_length("the diagonal", n, diagonal.len())?;
            if let Some(&value) = diagonal.iter().find(|d| **d == 0.0 || !d.is_finite()) {
                return Err(SolverError::OutOfRange {
                    what: "an entry of the diagonal",
                    value,
                    range: "finite and not zero",
                });
            }
        }
        if let Some(null_space) = hints.null_space {
            same_length(
                "a vector of the null space",
                n,
                null_space.dimension().unwrap_or(n),
            )?;
        }
        self.work.resize(n, self.method);
        match self.method {
            KrylovMethod::ConjugateGradient => conjugate_gradient::solve(
                &mut self.work,
                self.options,
                &mut apply,
                rhs,
                solution,
                hints,
            ),
            KrylovMethod::BiCgStab => bicgstab::solve(
                &mut self.work,
                self.options,
                &mut apply,
                rhs,
                solution,
                hints,
            ),
        }
    }
}

impl Work {
    fn resize(&mut self, n: usize, method: KrylovMethod) {
        for vector in [
            &mut self.residual,
            &mut self.direction,
            &mut self.preconditioned,
            &mut self.image,
        ] {
            vector.resize(n, 0.0);
        }
        if method == KrylovMethod::BiCgStab {
            self.shadow.resize(n, 0.0);
            self.second_image.resize(n, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::reduce::sum;
    use rayon::prelude::*;

    type Outcome = Result<(), SolverError>;

    /// `-y_(i-1) + (2 + shift) y_i - (1 + wind) y_(i+1)` with zero beyond the ends.
    fn chain(shift: f64, wind: f64) -> impl Fn(&[f64], &mut [f64]) -> Outcome + Sync + Copy {
        move |x, out| {
            out.par_iter_mut().enumerate().for_each(|(i, out)| {
                let left = if i == 0 { 0.0 } else { x[i - 1] };
                let right = x.get(i + 1).copied().unwrap_or(0.0);
                *out = (2.0 + shift) * x[i] - left - (1.0 + wind) * right;
            });
            Ok(())
        }
    }

    fn ring(x: &[f64], out: &mut [f64]) -> Outcome {
        let n = x.len();
        for i in 0..n {
            out[i] = 2.0 * x[i] - x[(i + 1) % n] - x[(i + n - 1) % n];
        }
        Ok(())
    }

    fn solver(method: KrylovMethod) -> Krylov {
        Krylov::new(method, KrylovOptions::default())
    }

    #[test]
    fn both_methods_recover_a_known_solution() {
        let n = 500;
        let exact: Vec<f64> = (0..n).map(|i| (i as f64 * 0.37).sin()).collect();
        let diagonal = vec![2.1; n];
        for (method, wind) in [
            (KrylovMethod::ConjugateGradient, 0.0),
            (KrylovMethod::BiCgStab, 0.0),
            (KrylovMethod::BiCgStab, -0.5),
        ] {
            for diagonal in [None, Some(&diagonal[..])] {
                let (mut b, mut x) = (vec![0.0; n], vec![1.0; n]);
                chain(0.1, wind)(&exact, &mut b).unwrap();
                let hints = Hints {
                    diagonal,
                    null_space: None,
                };
                let report = solver(method)
                    .solve(chain(0.1, wind), &b, &mut x, hints)
                    .unwrap();
                assert!(report.iterations > 5);
                for (x, exact) in x.iter().zip(&exact) {
                    // relative residual 1e-10 times |b|, about 20, over the smallest eigenvalue 0.1
                    assert!((x - exact).abs() < 2e-8, "{method:?}");
                }
            }
        }
    }

    #[test]
    fn a_diagonal_of_wide_range_is_worth_its_preconditioner() {
        let n = 200;
        let diagonal: Vec<f64> = (0..n).map(|i| 10f64.powi((i % 9) as i32)).collect();
        let apply = |x: &[f64], out: &mut [f64]| {
            update(out, [x, &diagonal], |_, [x, d]| d * x);
            Ok(())
        };
        for method in [KrylovMethod::ConjugateGradient, KrylovMethod::BiCgStab] {
            let mut x = vec![0.0; n];
            let hints = Hints {
                diagonal: Some(&diagonal),
                null_space: None,
            };
            let report = solver(method)
                .solve(apply, &vec![1.0; n], &mut x, hints)
                .unwrap();
            assert_eq!(report.iterations, 1, "{method:?}");
        }
    }

    #[test]
    fn a_singular_matrix_is_solved_beside_its_null_space() {
        let n = 101;
        let constant = NullSpace::constant(n);
        let hints = Hints {
            diagonal: None,
            null_space: Some(&constant),
        };
        for method in [KrylovMethod::ConjugateGradient, KrylovMethod::BiCgStab] {
            // the constant part of the load has no answer and is ignored
            let b: Vec<f64> = (0..n).map(|i| (i as f64).cos() + 7.0).collect();
            let mut x = vec![3.0; n];
            let mut krylov = solver(method);
            krylov.solve(ring, &b, &mut x, hints).unwrap();
            let mut residual = vec![0.0; n];
            ring(&x, &mut residual).unwrap();
            let mean = sum(&b) / n as f64;
            for (r, b) in residual.iter().zip(&b) {
                // tolerance 1e-10 of a right-hand side of norm 7
                assert!((r - (b - mean)).abs() < 1e-9, "{method:?}");
            }
            // the mean of the guess stays: rounding of 101 values up to 300
            assert!(
                (sum(&x) / n as f64 - 3.0).abs() < 1e-11,
                "{method:?}: {}",
                sum(&x)
            );
        }
    }

    #[test]
    fn dependent_modes_are_dropped() {
        let modes = vec![
            vec![1.0, 1.0, 1.0],
            vec![2.0, 2.0, 2.0],
            vec![0.0, 1.0, 2.0],
        ];
        let null_space = NullSpace::new(modes);
        let mut v = vec![1.0, 5.0, 3.0];
        null_space.project(&mut v);
        // what is left is the part along (1, -2, 1), which is (-6 / 6) of it
        for (v, exact) in v.iter().zip([-1.0, 2.0, -1.0]) {
            assert!((v - exact).abs() < 1e-14);
        }
    }

    #[test]
    fn wrong_matrices_and_limits_are_reported() {
        let minus = |x: &[f64], out: &mut [f64]| {
            update(out, [x], |_, [x]| -x);
            Ok(())
        };
        let mut cg = solver(KrylovMethod::ConjugateGradient);
        let error = cg
            .solve(minus, &[1.0; 4], &mut [0.0; 4], Hints::default())
            .unwrap_err();
        assert!(
            matches!(error, SolverError::NotPositiveDefinite { .. }),
            "{error}"
        );
        for method in [KrylovMethod::ConjugateGradient, KrylovMethod::BiCgStab] {
            let mut krylov = solver(method);
            krylov.options.max_iterations = 3;
            let error = krylov.solve(
                chain(0.0, 0.0),
                &[1.0; 500],
                &mut [0.0; 500],
                Hints::default(),
            );
            assert!(
                matches!(error, Err(SolverError::NotConverged { iterations: 3, .. })),
                "{method:?}"
            );
            let nan = |_: &[f64], out: &mut [f64]| {
                out.fill(f64::NAN);
                Ok(())
            };
            let error = krylov.solve(nan, &[1.0; 4], &mut [0.0; 4], Hints::default());
            assert!(
                matches!(error, Err(SolverError::NotFinite { .. })),
                "{method:?}"
            );
            let error = krylov.solve(ring, &[1.0; 4], &mut [0.0; 3], Hints::default());
            assert!(
                matches!(error, Err(SolverError::Length { .. })),
                "{method:?}"
            );
            // a singular matrix and a load outside its range: no answer, and no endless loop
            krylov.options.max_iterations = 1000;
            assert!(
                krylov
                    .solve(ring, &[1.0; 8], &mut [0.0; 8], Hints::default())
                    .is_err()
            );
        }
    }

    #[test]
    fn solutions_have_the_same_bits_for_any_number_of_threads() {
        let n = 100_000;
        let b: Vec<f64> = (0..n).map(|i| (i as f64 * 0.1).sin()).collect();
        let constant = NullSpace::constant(n);
        for method in [KrylovMethod::ConjugateGradient, KrylovMethod::BiCgStab] {
            let solve = |threads| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| {
                    let mut x = vec![0.0; n];
                    let hints = Hints {
                        diagonal: None,
                        null_space: Some(&constant),
                    };
                    solver(method)
                        .solve(chain(0.5, 0.0), &b, &mut x, hints)
                        .unwrap();
                    x.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                })
            };
            assert!(solve(1) == solve(2), "{method:?}");
        }
    }
}
