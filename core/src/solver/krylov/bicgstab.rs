//! BiCGStab for nonsymmetric matrices, preconditioned from the right.

use super::{Hints, KrylovOptions, KrylovReport, Work};
use crate::solver::error::SolverError;
use crate::solver::reduce::{dot, norm};
use crate::solver::vector::update;

/// Below this cosine between residual and shadow residual the recurrence has broken down.
const BREAKDOWN: f64 = 1e-12;

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
        image: v,
        shadow,
        second_image: t,
        ..
    } = work;

    shadow.copy_from_slice(r);
    p.copy_from_slice(r);
    let mut rho = dot(shadow, r);
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
                method: "BiCGStab",
                iterations: iteration,
                residual,
                tolerance,
                advice: "allow more iterations, ask for less, take a smaller time step, or give the diagonal of the matrix as preconditioner",
            });
        }
        hints.precondition(p, z);
        apply(z, v)?;
        let shadow_image = dot(shadow, v);
        if shadow_image.abs() <= BREAKDOWN * norm(shadow) * norm(v) {
            // restart from the present residual; a steepest-descent-like step follows
            if rho == residual * residual {
                return Err(SolverError::NotConverged {
                    method: "BiCGStab",
                    iterations: iteration,
                    residual,
                    tolerance,
                    advice: "the recurrence broke down: the matrix may be singular; pass its null space or hold the body",
                });
            }
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            rho = residual * residual;
            continue;
        }
        let alpha = rho / shadow_image;
        update(solution, [z], |x, [z]| x + alpha * z);
        update(r, [v], |r, [v]| r - alpha * v);

        hints.precondition(r, z);
        apply(z, t)?;
        let tt = dot(t, t);
        // the first half step may already have met the solution exactly
        let omega = if tt > 0.0 { dot(t, r) / tt } else { 0.0 };
        update(solution, [z], |x, [z]| x + omega * z);
        update(r, [t], |r, [t]| r - omega * t);
        hints.project(r);

        let rho_next = dot(shadow, r);
        if omega == 0.0 || rho_next.abs() <= BREAKDOWN * norm(shadow) * norm(r) {
            shadow.copy_from_slice(r);
            p.copy_from_slice(r);
            rho = dot(r, r);
        } else {
            let beta = rho_next / rho * alpha / omega;
            update(p, [r, v], |p, [r, v]| r + beta * (p - omega * v));
            rho = rho_next;
        }
    }
    unreachable!("the loop ends by convergence or at the iteration limit")
}
