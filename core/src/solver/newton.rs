//! Newton-Krylov iteration for `f(t, y) = 0`: large displacements, implicit steps, steady states.
//!
//! Each iteration solves `-J d = f` by a Krylov method, `J = df/dy`, and moves the state to `y + s d`, with the first of
//! `s = 1, 1/2, 1/4, ...` for which the residual decreases, or, for forces ([`Rhs::is_force`]), the work along `d`:
//!
//! ```text
//! |f(y + s d)| <= (1 - 1e-4 s) |f(y)|   or   -0.8 <= f(y + s d) . d / f(y) . d <= 1
//! ```
//!
//! For forces with an energy `E` the second condition holds up to the minimum along `d`, where `dE/ds = -f . d` is zero, and
//! not far beyond. Plastic flow needs it: the first tangent of a step is elastic, and the flow that begins raises the norm of
//! the forces while the energy falls; near the limit load the energy falls along the whole step.
//!
//! The tangent of metal that flows without hardening is singular: a direction that nothing resists is followed far beyond the
//! minimum, where the metal flows back. Models mix a fraction of their tangent at rest into it ([`At::damping`]), which bounds the
//! steps; it falls as long as full steps are accepted, so that the convergence of Newton's method is kept. It begins high: metal
//! that a weld heats and cools flows in other places than before, and the first tangents do not know where. Forces with a
//! damped tangent keep an error of its order, so that their linear systems are not solved much better than that.
//!
//! The sign suits restoring forces and diffusion: for them `-J` is positive (semi-)definite and conjugate gradients may be
//! chosen. Where that holds only for `-diag(w) J`, the system is multiplied by the weights of [`Rhs::weights`].
//!
//! Sources: Knoll & Keyes (2004), J. Comput. Phys. 193, 357-397; line search by the work: Matthies & Strang (1979), Int. J.
//! Numer. Methods Eng. 14, 1613-1626, who require 0.8 of the work on both sides; accuracy of the linear solves after Eisenstat & Walker (1996), SIAM J. Sci. Comput. 17, 16-32, choice 2.

#[cfg(test)]
mod tests;

use super::error::SolverError;
use super::krylov::{Hints, Krylov, KrylovMethod, KrylovOptions};
use super::reducer::Reducer;
use super::rhs::{At, Rhs};
use super::vector::update;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a Newton iteration works, and when it stops: at `|f| <= relative |f at start| + absolute`, or where `f` is as small
/// as its rounding ([`Rhs::rounding`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NewtonOptions {
    /// Residual relative to that of the initial guess (-).
    pub relative_tolerance: f64,
    /// Residual in its own unit.
    pub absolute_tolerance: f64,
    /// Newton iterations after which the solver gives up.
    pub max_iterations: usize,
    /// Krylov method for the linear systems.
    pub krylov: KrylovMethod,
    /// Krylov iterations after which one linear system is given up.
    pub max_krylov_iterations: usize,
    /// The function is linear in the state (plus a constant): one linear system is solved to
    /// the full tolerance, and differences of rates are taken over large distances.
    pub linear: bool,
}

impl Default for NewtonOptions {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-8,
            absolute_tolerance: 0.0,
            max_iterations: 50,
            krylov: KrylovMethod::BiCgStab,
            max_krylov_iterations: 10_000,
            linear: false,
        }
    }
}

/// Report of a Newton iteration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NewtonReport {
    /// Newton iterations spent.
    pub iterations: usize,
    /// Krylov iterations spent, all together.
    pub krylov_iterations: usize,
    /// Evaluations of the function and products with its tangent.
    pub evaluations: usize,
    /// Norm of the residual at the end, in its own unit.
    pub residual: f64,
}

/// A Newton-Krylov solver with its work vectors, which are allocated once.
#[derive(Debug, Clone)]
pub struct Newton {
    /// How to work and when to stop.
    pub options: NewtonOptions,
    krylov: Krylov,
    value: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    trial_value: Vec<f64>,
    diagonal: Vec<f64>,
    weights: Vec<f64>,
}

/// Fraction of the full step below which a line search gives up.
const SHORTEST_STEP: f64 = 1.0 / 1_048_576.0;

/// Damping of the tangent at the start; it falls to a quarter with each full step. A weld takes half of the iterations that
/// it takes with 0.1.
const FIRST_DAMPING: f64 = 0.7;

/// Damping of the tangent after a step that was shortened.
const DAMPING: f64 = 0.1;

/// Least accuracy of the linear systems of forces over the damping of their tangent.
const ACCURACY_OF_DAMPED: f64 = 0.3;

/// Fraction of the work along a direction that may remain beyond the point where it is zero.
const WORK_BEYOND: f64 = 0.8;

/// A step that a line search accepts.
struct Accepted {
    /// Fraction of the full step.
    fraction: f64,
    /// Norm of the residual behind it.
    residual: f64,
}

impl Newton {
    /// A solver that sizes its work vectors at first use.
    pub fn new(options: NewtonOptions) -> Self {
        Self {
            options,
            krylov: Krylov::new(options.krylov, KrylovOptions::default()),
            value: Vec::new(),
            step: Vec::new(),
            trial: Vec::new(),
            trial_value: Vec::new(),
            diagonal: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// Brings `rhs` at the given time (or load factor) to zero; `state` holds the initial
    /// guess on entry, and after an error the best state so far.
    ///
    /// `hints` describe the tangent, but for its diagonal, which `rhs` provides. A residual along the null
    /// space (a free body under forces that do not balance) cannot be removed and is reported as no
    /// convergence.
    ///
    /// # Errors
    /// No convergence, errors of [`Krylov::solve`] and of the model.
    pub fn solve(
        &mut self,
        rhs: &mut dyn Rhs,
        time: f64,
        state: &mut [f64],
        hints: Hints,
    ) -> Result<NewtonReport, SolverError> {
        self.start(rhs, state.len());
        let points = &rhs.points();
        rhs.rate(time, state, &mut self.value)?;
        points.bring(&mut self.value);
        weigh(&self.weights, &mut self.value);
        let mut report = NewtonReport {
            residual: points.norm(&self.value),
            evaluations: 1,
            ..Default::default()
        };
        let options = self.options;
        let asked = options.relative_tolerance * report.residual + options.absolute_tolerance;
        let mut forcing: f64 = 0.1;
        let mut damping = FIRST_DAMPING;
        loop {
            let at = At {
                time,
                state,
                damping,
            };
            let tolerance = asked + rhs.rounding(at);
            if !report.residual.is_finite() {
                let iteration = report.iterations;
                return Err(SolverError::NotFinite {
                    what: "the residual",
                    iteration,
                });
            }
            if report.residual <= tolerance {
                return Ok(report);
            }
            let not_converged = |report: NewtonReport, advice| SolverError::NotConverged {
                method: "Newton's method",
                iterations: report.iterations,
                residual: report.residual,
                tolerance,
                advice,
            };
            if report.iterations == options.max_iterations {
                return Err(not_converged(
                    report,
                    "take a smaller step or a better initial guess",
                ));
            }
            // The linear system need not be solved better than the tolerance; the factor below 1 leaves room for
            // rounding and nonlinearity.
            self.krylov.options.relative_tolerance = if options.linear {
                0.9 * tolerance / report.residual
            } else {
                forcing.max(0.5 * tolerance / report.residual)
            };
            self.find_direction(rhs, at, points, hints, &mut report)?;
            let before = report.residual;
            let found = self.search_line(rhs, at, points, &mut report)?.ok_or_else(|| {
                not_converged(
                    report,
                    "no step along the Newton direction lowers the residual: loads that do not balance, a tolerance below rounding, or a kink of the model",
                )
            })?;
            report.residual = found.residual;
            damping = match found.fraction < 1.0 {
                true => DAMPING,
                false => 0.25 * damping,
            };
            state.copy_from_slice(&self.trial);
            std::mem::swap(&mut self.value, &mut self.trial_value);
            report.iterations += 1;
            let floor = match rhs.is_force() {
                true => (ACCURACY_OF_DAMPED * damping).clamp(1e-6, 0.1),
                false => 1e-6,
            };
            // the residual may have risen
            forcing = (0.9 * (report.residual / before).powi(2)).clamp(floor, 0.1);
        }
    }

    /// Sizes the work vectors for so many unknowns.
    fn start(&mut self, rhs: &dyn Rhs, unknowns: usize) {
        self.weights.clear();
        self.weights.extend_from_slice(rhs.weights().unwrap_or(&[]));
        for vector in [
            &mut self.value,
            &mut self.step,
            &mut self.trial,
            &mut self.trial_value,
            &mut self.diagonal,
        ] {
            vector.resize(unknowns, 0.0);
        }
        self.krylov.method = self.options.krylov;
        self.krylov.options.max_iterations = self.options.max_krylov_iterations;
    }

    /// Solves `-J d = f` for the direction `d`.
    fn find_direction(
        &mut self,
        rhs: &mut dyn Rhs,
        at: At,
        points: &Reducer,
        hints: Hints,
        report: &mut NewtonReport,
    ) -> Result<(), SolverError> {
        let Self {
            options,
            krylov,
            value,
            step,
            trial,
            diagonal,
            weights,
            ..
        } = self;
        let has_diagonal = rhs.tangent_diagonal(at, diagonal)?;
        points.bring(diagonal);
        update(diagonal, [], |entry, []| -entry);
        if has_diagonal {
            weigh(weights, diagonal);
        }
        let hints = Hints {
            diagonal: has_diagonal.then_some(&**diagonal),
            ..hints
        };
        let mut difference = Difference {
            points,
            linear: options.linear,
            weights,
            value,
            trial,
        };
        step.fill(0.0);
        let linear_report = krylov.solve(
            |direction, out| {
                report.evaluations += 1;
                if rhs.tangent(at, direction, out)? {
                    points.bring(out);
                    weigh(weights, out);
                } else {
                    difference.evaluate(rhs, at, direction, out)?;
                }
                update(out, [], |entry, []| -entry);
                Ok(())
            },
            value,
            step,
            points,
            hints,
        )?;
        report.krylov_iterations += linear_report.iterations;
        Ok(())
    }

    /// Finds a step along the direction; `trial` and `trial_value` then hold the new state and its value. Returns the
    /// residual, `None` where no step is accepted.
    fn search_line(
        &mut self,
        rhs: &mut dyn Rhs,
        at: At,
        points: &Reducer,
        report: &mut NewtonReport,
    ) -> Result<Option<Accepted>, SolverError> {
        let Self {
            value,
            step,
            trial,
            trial_value,
            weights,
            ..
        } = self;
        let work = rhs.is_force().then(|| points.dot(value, step));
        let mut fraction = 1.0;
        while fraction >= SHORTEST_STEP {
            update(trial, [at.state, step], |_, [y, d]| y + fraction * d);
            rhs.rate(at.time, trial, trial_value)?;
            points.bring(trial_value);
            report.evaluations += 1;
            weigh(weights, trial_value);
            let residual = points.norm(trial_value);
            let works_less =
                |work| (-WORK_BEYOND..=1.0).contains(&(points.dot(trial_value, step) / work));
            let decreases = residual <= (1.0 - 1e-4 * fraction) * report.residual;
            if decreases || work.is_some_and(works_less) {
                return Ok(Some(Accepted { fraction, residual }));
            }
            fraction *= 0.5;
        }
        Ok(None)
    }
}

/// Multiplies by the weights, if there are any.
fn weigh(weights: &[f64], vector: &mut [f64]) {
    if !weights.is_empty() {
        update(vector, [weights], |value, [w]| value * w);
    }
}

/// The difference quotient that replaces a tangent.
struct Difference<'a> {
    points: &'a Reducer,
    /// The function is linear in the state.
    linear: bool,
    weights: &'a [f64],
    /// `f(y)`, multiplied by the weights.
    value: &'a [f64],
    /// Work vector.
    trial: &'a mut [f64],
}

impl Difference<'_> {
    /// `out = (f(y + e v) - f(y)) / e`, multiplied by the weights, an approximation of `J v` with
    /// `e |v| = sqrt(eps) (scale + |y|)` and an error of the order of `sqrt(eps)`. For a function linear in the state the
    /// only error is rounding, and `e` is large.
    fn evaluate(
        &mut self,
        rhs: &mut dyn Rhs,
        at: At,
        direction: &[f64],
        out: &mut [f64],
    ) -> Result<(), SolverError> {
        let length = self.points.norm(direction);
        if length == 0.0 {
            out.fill(0.0);
            return Ok(());
        }
        let relative = if self.linear {
            1.0
        } else {
            f64::EPSILON.sqrt()
        };
        let e = relative * (rhs.scale() + self.points.norm(at.state)) / length;
        update(self.trial, [at.state, direction], |_, [y, v]| y + e * v);
        rhs.rate(at.time, self.trial, out)?;
        self.points.bring(out);
        weigh(self.weights, out);
        update(out, [self.value], |moved, [value]| (moved - value) / e);
        Ok(())
    }
}
