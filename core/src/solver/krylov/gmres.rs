//! GMRES with restarts for nonsymmetric matrices, preconditioned from the right. It needs the fewest products with
//! the matrix of all Krylov methods, and stores one vector for each.

use super::{Iteration, KrylovReport, System, WorkVectors};
use crate::solver::error::SolverError;
use crate::solver::vector::update;

/// Largest number of vectors between restarts.
const RESTART: usize = 100;

pub(super) struct Gmres;

/// The least-squares problem of GMRES for the factors of the basis vectors, made triangular by rotations.
struct LeastSquares {
    columns: Vec<Vec<f64>>,
    rotations: Vec<[f64; 2]>,
    side: Vec<f64>,
}

impl LeastSquares {
    fn new(residual: f64) -> Self {
        LeastSquares {
            columns: Vec::new(),
            rotations: Vec::new(),
            side: vec![residual],
        }
    }

    /// Adds a column: components along the basis vectors, and the norm of the rest. Returns the new residual; `None` for a
    /// column of zeros.
    fn push(&mut self, mut column: Vec<f64>, rest: f64) -> Option<f64> {
        let k = self.columns.len();
        for (row, [c, s]) in self.rotations.iter().enumerate() {
            let [upper, lower] = [column[row], column[row + 1]];
            column[row] = c * upper + s * lower;
            column[row + 1] = c * lower - s * upper;
        }
        let length = column[k].hypot(rest);
        if length == 0.0 {
            return None;
        }
        let [c, s] = [column[k] / length, rest / length];
        column[k] = length;
        self.rotations.push([c, s]);
        self.columns.push(column);
        self.side.push(-s * self.side[k]);
        self.side[k] *= c;
        Some(self.side[k + 1].abs())
    }

    /// The factors of the basis vectors.
    fn solve(mut self) -> Vec<f64> {
        for k in (0..self.columns.len()).rev() {
            self.side[k] /= self.columns[k][k];
            for row in 0..k {
                self.side[row] -= self.columns[k][row] * self.side[k];
            }
        }
        self.side.truncate(self.columns.len());
        self.side
    }
}

impl Iteration for Gmres {
    const NAME: &str = "GMRES";
    const ADVICE: &str = "allow more iterations or a larger tolerance, take a smaller time step, \
                          or give the diagonal of the matrix as preconditioner";

    /// Iterates until convergence or a restart.
    fn advance(
        &mut self,
        system: &mut System,
        work: &mut WorkVectors,
        solution: &mut [f64],
        before: KrylovReport,
    ) -> Result<KrylovReport, SolverError> {
        let points = system.points;
        let mut report = before;
        if report.iterations > 0 {
            system.start(work, solution)?;
            report.residual = points.norm(&work.residual);
        }
        let WorkVectors {
            residual: r,
            direction: sum,
            preconditioned: z,
            image: w,
            basis,
            ..
        } = work;
        let mut problem = LeastSquares::new(report.residual);
        update(w, [r], |_, [r]| r / report.residual);
        while report.residual > system.tolerance
            && problem.columns.len() < RESTART
            && report.iterations < system.options.max_iterations
        {
            let k = problem.columns.len();
            if basis.len() == k {
                basis.push(Vec::new());
            }
            basis[k].clone_from(w);
            system.hints.precondition(&basis[k], points, z);
            (system.apply)(z, w)?;
            system.hints.project(w);
            let mut column = Vec::with_capacity(k + 1);
            for v in &basis[..=k] {
                let along = points.dot(v, w);
                update(w, [v], |w, [v]| w - along * v);
                column.push(along);
            }
            let rest = points.norm(w);
            report.residual = problem.push(column, rest).ok_or_else(|| {
                Self::not_converged(
                    system,
                    report,
                    "the matrix may be singular: pass its null space or hold the body",
                )
            })?;
            // zero when the solution is exact
            update(w, [], |w, []| if rest > 0.0 { w / rest } else { 0.0 });
            report.iterations += 1;
        }
        if report.residual.is_finite() {
            sum.fill(0.0);
            for (v, factor) in basis.iter().zip(problem.solve()) {
                update(sum, [v], |sum, [v]| sum + factor * v);
            }
            system.hints.precondition(sum, points, z);
            update(solution, [z], |x, [z]| x + z);
        }
        Ok(report)
    }
}
