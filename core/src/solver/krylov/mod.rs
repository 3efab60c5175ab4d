//! Linear systems `A x = b` by Krylov methods, with `A` known only by its action.
//!
//! Source: Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), algorithms
//! 9.1 (preconditioned conjugate gradients), 7.7 and 9.5 (BiCGStab and GMRES, preconditioned from the
//! right so that the residual tested is that of the system itself).
//!
//! Preconditioned by the diagonal and, for elastic bodies, by a [`CoarseSpace`]. Singular systems need their
//! [`NullSpace`].

mod bicgstab;
mod coarse;
mod conjugate_gradient;
mod gmres;
mod null_space;
#[cfg(test)]
mod tests;

use bicgstab::BiCgStab;
use conjugate_gradient::ConjugateGradient;
use gmres::Gmres;

pub use coarse::{CoarseGrid, CoarseSpace, Spring};
pub use null_space::NullSpace;

use super::error::{SolverError, same_length};
use super::reducer::Reducer;
use super::vector::{quotient, update};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which Krylov method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KrylovMethod {
    /// Symmetric positive (semi-)definite matrices: one product with `A` per iteration.
    ConjugateGradient,
    /// Any matrix: two products with `A` per iteration, convergence not monotone. Tolerates functions
    /// with kinks, such as melting, whose differences depend on the direction.
    BiCgStab,
    /// Any matrix: one product with `A` and one stored vector per iteration. For expensive products and good
    /// preconditioners.
    Gmres,
}

/// When a Krylov iteration stops: at `|b - A x| <= relative |b| + absolute`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct KrylovOptions {
    /// Residual relative to the right-hand side (-).
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

/// Report of a Krylov iteration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KrylovReport {
    /// Iterations spent.
    pub iterations: usize,
    /// Norm of the residual, in the unit of the right-hand side, as updated by the
    /// recurrence (it drifts from `|b - A x|` by rounding only).
    pub residual: f64,
}

/// Properties of the matrix that speed up the iteration.
#[derive(Debug, Clone, Copy, Default)]
pub struct Hints<'a> {
    /// Diagonal of the matrix, used as preconditioner; positive for conjugate gradients.
    pub diagonal: Option<&'a [f64]>,
    /// Vectors that the matrix maps to zero, for instance the rigid modes of a free body.
    /// Right-hand side and corrections are kept orthogonal to them, so the component of
    /// the initial guess along them stays as it is. For the other methods the range of the matrix
    /// must be orthogonal to them too, as it is for a symmetric matrix.
    pub null_space: Option<&'a NullSpace>,
    /// Displacements of a coarse grid: preconditions together with the diagonal.
    pub coarse: Option<&'a CoarseSpace>,
}

impl Hints<'_> {
    /// `out = P (D^-1 + coarse) residual`.
    fn precondition(&self, residual: &[f64], points: &Reducer, out: &mut [f64]) {
        match self.diagonal {
            Some(diagonal) => update(out, [residual, diagonal], |_, parts| quotient(parts)),
            None => out.copy_from_slice(residual),
        }
        if let Some(coarse) = self.coarse {
            coarse.add_correction(residual, points, out);
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
/// Work vectors are updated in parallel and reduced by a [`Reducer`], so that the
/// result has the same bits for any number of threads and processes (if the operator's has).
#[derive(Debug, Clone)]
pub struct Krylov {
    /// Which method.
    pub method: KrylovMethod,
    /// When to stop.
    pub options: KrylovOptions,
    work: WorkVectors,
}

#[derive(Debug, Clone, Default)]
struct WorkVectors {
    residual: Vec<f64>,
    direction: Vec<f64>,
    preconditioned: Vec<f64>,
    image: Vec<f64>,
    // used by BiCGStab only
    shadow: Vec<f64>,
    second_image: Vec<f64>,
    /// Used by GMRES; as many as it needed so far.
    basis: Vec<Vec<f64>>,
}

impl Krylov {
    /// A solver that sizes its work vectors at first use.
    pub fn new(method: KrylovMethod, options: KrylovOptions) -> Self {
        Self {
            method,
            options,
            work: WorkVectors::default(),
        }
    }

    /// Solves `A x = rhs`; `solution` holds the initial guess on entry.
    ///
    /// `apply(x, out)` writes `A x` into `out`, which holds unspecified numbers on entry. `points`: those to which the entries of vectors belong;
    /// `apply` gives those of other processes, too.
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
        points: &Reducer,
        hints: Hints,
    ) -> Result<KrylovReport, SolverError> {
        let n = rhs.len();
        same_length("the initial guess", n, solution.len())?;
        if let Some(diagonal) = hints.diagonal {
            same_length("the diagonal", n, diagonal.len())?;
            let mut own = points.own(diagonal).iter();
            if let Some(&value) = own.find(|d| **d == 0.0 || !d.is_finite()) {
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
        let work = &mut self.work;
        let system = System {
            apply: &mut apply,
            rhs,
            points,
            hints,
            options: self.options,
            tolerance: 0.0,
        };
        match self.method {
            KrylovMethod::ConjugateGradient => {
                system.solve(ConjugateGradient::default(), work, solution)
            }
            KrylovMethod::BiCgStab => system.solve(BiCgStab::default(), work, solution),
            KrylovMethod::Gmres => system.solve(Gmres, work, solution),
        }
    }
}

impl WorkVectors {
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

/// Writes `A x` into its second argument.
type Apply<'a> = dyn FnMut(&[f64], &mut [f64]) -> Result<(), SolverError> + 'a;

/// A linear system.
struct System<'a> {
    apply: &'a mut Apply<'a>,
    rhs: &'a [f64],
    points: &'a Reducer,
    hints: Hints<'a>,
    options: KrylovOptions,
    /// Norm of the residual at which the iteration has converged.
    tolerance: f64,
}

/// The iteration of a Krylov method.
trait Iteration {
    const NAME: &str;

    /// Advice where the iteration does not converge.
    const ADVICE: &str;

    /// Improves `solution` from the residual in `work`. `before` is the report of the iterations so far; returns that
    /// afterwards.
    fn advance(
        &mut self,
        system: &mut System,
        work: &mut WorkVectors,
        solution: &mut [f64],
        before: KrylovReport,
    ) -> Result<KrylovReport, SolverError>;

    /// The error of an iteration that stops at this report.
    fn not_converged(system: &System, report: KrylovReport, advice: &'static str) -> SolverError {
        SolverError::NotConverged {
            method: Self::NAME,
            iterations: report.iterations,
            residual: report.residual,
            tolerance: system.tolerance,
            advice,
        }
    }
}

impl System<'_> {
    /// Computes the residual of `solution`, and the tolerance.
    fn start(&mut self, work: &mut WorkVectors, solution: &[f64]) -> Result<(), SolverError> {
        let WorkVectors {
            residual, image, ..
        } = work;
        residual.copy_from_slice(self.rhs);
        self.hints.project(residual);
        let KrylovOptions {
            relative_tolerance,
            absolute_tolerance,
            ..
        } = self.options;
        self.tolerance = relative_tolerance * self.points.norm(residual) + absolute_tolerance;
        if self.points.any(solution.iter().any(|x| *x != 0.0)) {
            (self.apply)(solution, image)?;
            update(residual, [image], |r, [image]| r - image);
            self.hints.project(residual);
        }
        Ok(())
    }

    /// Iterates until the residual is below the tolerance.
    fn solve<M: Iteration>(
        mut self,
        mut method: M,
        work: &mut WorkVectors,
        solution: &mut [f64],
    ) -> Result<KrylovReport, SolverError> {
        self.start(work, solution)?;
        let mut report = KrylovReport {
            iterations: 0,
            residual: self.points.norm(&work.residual),
        };
        loop {
            if !report.residual.is_finite() {
                return Err(SolverError::NotFinite {
                    what: "the residual",
                    iteration: report.iterations,
                });
            }
            if report.residual <= self.tolerance {
                return Ok(report);
            }
            if report.iterations == self.options.max_iterations {
                return Err(M::not_converged(&self, report, M::ADVICE));
            }
            report = method.advance(&mut self, work, solution, report)?;
        }
    }
}
