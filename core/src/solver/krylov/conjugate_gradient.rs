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

use super::{Iteration, KrylovReport, System, WorkVectors};
use crate::solver::error::SolverError;
use crate::solver::vector::update;

#[derive(Default)]
pub(super) struct ConjugateGradient {
    /// Product of the residual and the preconditioned residual in the last iteration.
    last_product: f64,
}

impl Iteration for ConjugateGradient {
    const NAME: &str = "the conjugate gradient method";
    const ADVICE: &str = "allow more iterations or a larger tolerance, or give the diagonal of the matrix as preconditioner";

    fn advance(
        &mut self,
        system: &mut System,
        work: &mut WorkVectors,
        solution: &mut [f64],
        before: KrylovReport,
    ) -> Result<KrylovReport, SolverError> {
        let WorkVectors {
            residual: r,
            direction: p,
            preconditioned: z,
            image,
            ..
        } = work;
        let iteration = before.iterations;
        system.hints.precondition(r, system.points, z);
        let rz = system.points.dot(r, z);
        if rz <= 0.0 {
            return Err(SolverError::NotPositiveDefinite {
                iteration,
                curvature: rz,
            });
        }
        if iteration == 0 {
            p.copy_from_slice(z);
        } else {
            let beta = rz / self.last_product;
            update(p, [z], |p, [z]| z + beta * p);
        }
        self.last_product = rz;

        (system.apply)(p, image)?;
        let curvature = system.points.dot(p, image);
        if curvature <= 0.0 {
            return Err(SolverError::NotPositiveDefinite {
                iteration,
                curvature,
            });
        }
        let alpha = rz / curvature;
        update(solution, [p], |x, [p]| x + alpha * p);
        update(r, [image], |r, [image]| r - alpha * image);
        // rounding adds components in the null space to the residual, which no step can remove
        system.hints.project(r);
        Ok(KrylovReport {
            iterations: iteration + 1,
            residual: system.points.norm(r),
        })
    }
}
