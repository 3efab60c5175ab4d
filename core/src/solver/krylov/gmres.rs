//! GMRES with restarts for nonsymmetric matrices, preconditioned from the right. It needs the fewest products with
//! the matrix of all Krylov methods, and stores one vector for each.

use super::{Hints, KrylovOptions, KrylovReport, Work};
use crate::solver::error::SolverError;
use crate::solver::reduce::{dot, norm};
use crate::solver::vector::update;

/// Largest number of vectors between restarts.
const RESTART: usize = 100;

pub(super) fn solve(
    work: &mut Work,
    options: KrylovOptions,
    apply: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), SolverError>,
    rhs: &[f64],
    solution: &mut [f64],
    hints: Hints,
) -> Result<KrylovReport, SolverError> {
    let tolerance = work.start(options, apply, rhs, solution, hints)?;
    let not_converged = |iterations, residual, advice| SolverError::NotConverged {
        method: "GMRES",
        iterations,
        residual,
        tolerance,
        advice,
    };
    let mut iterations = 0;
    loop {
        let Work {
            residual: r,
            direction: sum,
            preconditioned: z,
            image: w,
            basis,
            ..
        } = &mut *work;
        let start = norm(r);
        // triangular system of the least-squares problem: columns, the rotations that made them, right-hand side
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut rotations: Vec<[f64; 2]> = Vec::new();
        let mut side = vec![start];
        let mut residual = start;
        update(w, [r], |_, [r]| r / start);
        while residual > tolerance && columns.len() < RESTART && iterations < options.max_iterations
        {
            let k = columns.len();
            if basis.len() == k {
                basis.push(Vec::new());
            }
            basis[k].clone_from(w);
            hints.precondition(&basis[k], z);
            apply(z, w)?;
            hints.project(w);
            let mut column = Vec::with_capacity(k + 1);
            for v in &basis[..=k] {
                let along = dot(v, w);
                update(w, [v], |w, [v]| w - along * v);
                column.push(along);
            }
            let next = norm(w);
            for (row, [c, s]) in rotations.iter().enumerate() {
                let [upper, lower] = [column[row], column[row + 1]];
                column[row] = c * upper + s * lower;
                column[row + 1] = c * lower - s * upper;
            }
            let length = column[k].hypot(next);
            if length == 0.0 {
                return Err(not_converged(
                    iterations,
                    residual,
                    "the matrix may be singular: pass its null space or hold the body",
                ));
            }
            let [c, s] = [column[k] / length, next / length];
            column[k] = length;
            rotations.push([c, s]);
            columns.push(column);
            side.push(-s * side[k]);
            side[k] *= c;
            residual = side[k + 1].abs();
            // zero when the solution is exact
            update(w, [], |w, []| if next > 0.0 { w / next } else { 0.0 });
            iterations += 1;
        }
        if !residual.is_finite() {
            return Err(SolverError::NotFinite {
                what: "the residual",
                iteration: iterations,
            });
        }
        for k in (0..columns.len()).rev() {
            side[k] /= columns[k][k];
            for row in 0..k {
                side[row] -= columns[k][row] * side[k];
            }
        }
        sum.fill(0.0);
        for (v, factor) in basis.iter().zip(&side).take(columns.len()) {
            update(sum, [v], |sum, [v]| sum + factor * v);
        }
        hints.precondition(sum, z);
        update(solution, [z], |x, [z]| x + z);
        if residual <= tolerance {
            return Ok(KrylovReport {
                iterations,
                residual,
            });
        }
        if iterations == options.max_iterations {
            return Err(not_converged(
                iterations,
                residual,
                "allow more iterations, ask for less, take a smaller time step, or give the diagonal of the matrix as preconditioner",
            ));
        }
        work.start(options, apply, rhs, solution, hints)?;
    }
}
