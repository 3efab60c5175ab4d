//! BiCGStab for nonsymmetric matrices, preconditioned from the right.

use super::{Iteration, KrylovReport, System, WorkVectors};
use crate::solver::error::SolverError;
use crate::solver::vector::update;

/// Below this cosine between residual and shadow residual the recurrence has broken down.
const BREAKDOWN: f64 = 1e-12;

#[derive(Default)]
pub(super) struct BiCgStab {
    /// Product of the residual and the shadow residual.
    rho: f64,
}

impl Iteration for BiCgStab {
    const NAME: &str = "BiCGStab";
    const ADVICE: &str = "allow more iterations or a larger tolerance, take a smaller time step, \
                          or give the diagonal of the matrix as preconditioner";

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
            image: v,
            shadow,
            second_image: t,
            ..
        } = work;
        let points = system.points;
        let KrylovReport {
            iterations,
            residual,
        } = before;
        if iterations == 0 {
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            self.rho = points.dot(shadow, r);
        }
        let iterations = iterations + 1;
        system.hints.precondition(p, points, z);
        (system.apply)(z, v)?;
        let shadow_image = points.dot(shadow, v);
        if shadow_image.abs() <= BREAKDOWN * points.norm(shadow) * points.norm(v) {
            // restart from the present residual; a steepest-descent-like step follows
            if self.rho == residual * residual {
                return Err(Self::not_converged(
                    system,
                    before,
                    "the recurrence broke down: the matrix may be singular; pass its null space or hold the body",
                ));
            }
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            self.rho = residual * residual;
            return Ok(KrylovReport {
                iterations,
                residual,
            });
        }
        let alpha = self.rho / shadow_image;
        update(solution, [z], |x, [z]| x + alpha * z);
        update(r, [v], |r, [v]| r - alpha * v);

        system.hints.precondition(r, points, z);
        (system.apply)(z, t)?;
        let tt = points.dot(t, t);
        // the first half step may already have met the solution exactly
        let omega = if tt > 0.0 { points.dot(t, r) / tt } else { 0.0 };
        update(solution, [z], |x, [z]| x + omega * z);
        update(r, [t], |r, [t]| r - omega * t);
        system.hints.project(r);

        let rho = points.dot(shadow, r);
        let residual = points.norm(r);
        if omega == 0.0 || rho.abs() <= BREAKDOWN * points.norm(shadow) * residual {
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            self.rho = points.dot(r, r);
        } else {
            let beta = rho / self.rho * alpha / omega;
            update(p, [r, v], |p, [r, v]| r + beta * (p - omega * v));
            self.rho = rho;
        }
        Ok(KrylovReport {
            iterations,
            residual,
        })
    }
}
