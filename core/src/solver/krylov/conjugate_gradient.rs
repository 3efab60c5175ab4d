//! Preconditioned conjugate gradients.
//!
//! Reasons against the implementation of faer (`faer::matrix_free`, 0.24):
//! - Measured on 58^3 = 195,112 unknowns and a seven-point operator of 1.7 to 2.4 ms, on
//!   one core: 3.8 ms per iteration here, 10 ms with faer (BiCGStab 9.3 and 19.5 ms).
//!   Its vector work is a chain of general products of n x 1 matrices that runs on one
//!   thread, since its parallel form takes a thread pool and an order of summation of its own.
//! - Its operator takes `&self` and cannot fail; a model function here may do both: change
//!   its own work vectors, and report the end of a property table.
//! - At its iteration limit it reports the residual of the initial guess.
//! - A null space could be projected out in its preconditioner only, which leaves the
//!   drift of the residual into it.

use super::{Hints, KrylovOptions, KrylovReport, Work};
use crate::solver::error::SolverError;
use crate::solver::reduce::{dot, norm};
use crate::solver::vector::update;

pub(super) fn solve(
    work: &mut Work,
    options: KrylovOptions,
    apply: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), SolverError>,
    rhs: &[f64],
    solution: &mut [f64],
    hints: Hints,
) -> Result<KrylovReport, SolverError> {
    let tolerance = work.start(options, apply, rhs, solution, hints)?;
    let Work {
        residual: r,
        direction: p,
        preconditioned: z,
        image,
        ..
    } = work;

    let mut curvature_of_preconditioner = 0.0;
    for iteration in 0.. {
        let residual = norm(r);
        if !residual.is_finite() {
            return Err(SolverError::NotFinite {
                what: "the residual",
                iteration,
            });
        }
        if residual <= tolerance {
            return Ok(KrylovReport {
                iterations: iteration,
                residual,
            });
        }
        if iteration == options.max_iterations {
            return Err(SolverError::NotConverged {
                method: "the conjugate gradient method",
                iterations: iteration,
                residual,
                tolerance,
                advice: "allow more iterations, ask for less, or give the diagonal of the matrix as preconditioner",
            });
        }
        hints.precondition(r, z);
        let rz = dot(r, z);
        if rz <= 0.0 {
            return Err(SolverError::NotPositiveDefinite {
                iteration,
                curvature: rz,
            });
        }
        if iteration == 0 {
            p.copy_from_slice(z);
        } else {
            let beta = rz / curvature_of_preconditioner;
            update(p, [z], |p, [z]| z + beta * p);
        }
        curvature_of_preconditioner = rz;

        apply(p, image)?;
        let curvature = dot(p, image);
        if curvature <= 0.0 {
            return Err(SolverError::NotPositiveDefinite {
                iteration,
                curvature,
            });
        }
        let alpha = rz / curvature;
        update(solution, [p], |x, [p]| x + alpha * p);
        update(r, [image], |r, [image]| r - alpha * image);
        // rounding lets the residual creep back into the null space, where no step can remove it
        hints.project(r);
    }
    unreachable!("the loop ends by convergence or at the iteration limit")
}
