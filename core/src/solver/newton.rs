//! Newton-Krylov iteration for `f(t, y) = 0`: large displacements, implicit steps, steady states.
//!
//! Each iteration solves `-J d = f` by a Krylov method, `J = df/dy`, and moves the state to `y + s d`, with the first of
//! `s = 1, 1/2, 1/4, ...` for which the residual decreases, or, for forces ([`Rhs::is_force`]), the work along `d`:
//!
//! ```text
//! |f(y + s d)| <= (1 - 1e-4 s) |f(y)|   or   -0.8 <= f(y + s d) . d / f(y) . d <= 1
//! ```
//!
//! For forces with an energy `E` the second is a step down to its minimum along `d`, where `dE/ds = -f . d` is zero, or not
//! far beyond. Plastic flow needs it: the first tangent of a step is elastic, and the flow that begins raises the norm of
//! the forces while the energy falls; near the limit load it falls along the whole step. The sign is that of a restoring force or of diffusion: for
//! them `-J` is positive (semi-)definite and conjugate gradients may be chosen. Where that holds
//! only for `-diag(w) J`, the system is multiplied by the weights of [`Rhs::weights`].
//!
//! Sources: Knoll & Keyes (2004), J. Comput. Phys. 193, 357-397; line search by the work: Matthies & Strang (1979), Int. J.
//! Numer. Methods Eng. 14, 1613-1626, who ask for 0.8 of the work on both sides; accuracy of the linear solves after Eisenstat & Walker (1996), SIAM J. Sci. Comput. 17, 16-32, choice 2.

use super::error::SolverError;
use super::krylov::{Hints, Krylov, KrylovMethod, KrylovOptions};
use super::reduce::{dot, norm};
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

/// What a Newton iteration did.
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
const SHORTEST_STEP: f64 = 1.0 / 1024.0;

/// Part of the work along a direction that may be left beyond the point where it is zero.
const WORK_BEYOND: f64 = 0.8;

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
    /// No convergence, those of [`Krylov::solve`], and errors of the model.
    pub fn solve(
        &mut self,
        rhs: &mut dyn Rhs,
        time: f64,
        state: &mut [f64],
        hints: Hints,
    ) -> Result<NewtonReport, SolverError> {
        let Self {
            options,
            krylov,
            value,
            step,
            trial,
            trial_value,
            diagonal,
            weights,
        } = self;
        weights.clear();
        weights.extend_from_slice(rhs.weights().unwrap_or(&[]));
        for vector in [
            &mut *value,
            &mut *step,
            &mut *trial,
            &mut *trial_value,
            &mut *diagonal,
        ] {
            vector.resize(state.len(), 0.0);
        }
        krylov.method = options.krylov;
        krylov.options.max_iterations = options.max_krylov_iterations;

        rhs.rate(time, state, value)?;
        weigh(weights, value);
        let mut report = NewtonReport {
            residual: norm(value),
            evaluations: 1,
            ..Default::default()
        };
        let asked = options.relative_tolerance * report.residual + options.absolute_tolerance;
        let mut forcing: f64 = 0.1;
        loop {
            let tolerance = asked + rhs.rounding(At { time, state });
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
            let not_converged = |advice| SolverError::NotConverged {
                method: "Newton's method",
                iterations: report.iterations,
                residual: report.residual,
                tolerance,
                advice,
            };
            if report.iterations == options.max_iterations {
                return Err(not_converged(
                    "take a smaller step or a better initial guess",
                ));
            }

            let at = At { time, state };
            let has_diagonal = rhs.tangent_diagonal(at, diagonal)?;
            update(diagonal, [], |entry, []| -entry);
            if has_diagonal {
                weigh(weights, diagonal);
            }
            let hints = Hints {
                diagonal: has_diagonal.then_some(&**diagonal),
                ..hints
            };
            // The linear system need not be solved better than the tolerance; the factor below 1 leaves room for
            // rounding and nonlinearity.
            krylov.options.relative_tolerance = if options.linear {
                0.9 * tolerance / report.residual
            } else {
                forcing.max(0.5 * tolerance / report.residual)
            };
            step.fill(0.0);
            let linear = options.linear;
            let linear_report = krylov.solve(
                |direction, out| {
                    report.evaluations += 1;
                    if rhs.tangent(at, direction, out)? {
                        weigh(weights, out);
                    } else {
                        let work = (&mut trial[..], &value[..], &mut *out);
                        difference(rhs, at, direction, (linear, weights), work)?;
                    }
                    update(out, [], |entry, []| -entry);
                    Ok(())
                },
                value,
                step,
                hints,
            )?;
            report.krylov_iterations += linear_report.iterations;

            let before = report.residual;
            let work = rhs.is_force().then(|| dot(value, step));
            let mut fraction = 1.0;
            report.residual = loop {
                update(trial, [state, step], |_, [y, d]| y + fraction * d);
                rhs.rate(time, trial, trial_value)?;
                report.evaluations += 1;
                weigh(weights, trial_value);
                let residual = norm(trial_value);
                let works_less =
                    |work| (-WORK_BEYOND..=1.0).contains(&(dot(trial_value, step) / work));
                if residual <= (1.0 - 1e-4 * fraction) * before || work.is_some_and(works_less) {
                    break residual;
                }
                fraction *= 0.5;
                if fraction < SHORTEST_STEP {
                    return Err(not_converged(
                        "no step along the Newton direction lowers the residual: loads that do not balance, a tolerance below rounding, or a kink of the model",
                    ));
                }
            };
            state.copy_from_slice(trial);
            std::mem::swap(value, trial_value);
            report.iterations += 1;
            // the residual may have risen
            forcing = (0.9 * (report.residual / before).powi(2)).clamp(1e-6, 0.1);
        }
    }
}

/// Multiplies by the weights, if there are any.
fn weigh(weights: &[f64], vector: &mut [f64]) {
    if !weights.is_empty() {
        update(vector, [weights], |value, [w]| value * w);
    }
}

/// `out = (f(y + e v) - f(y)) / e`, an approximation of `J v` with `e |v| = sqrt(eps) (scale + |y|)` and an error
/// of the order of `sqrt(eps)`. For a function linear in the state the only error is rounding, and `e` is large.
///
/// `(work, value, out)`: work vector, `f(y)`, result, the latter two multiplied by the weights.
fn difference(
    rhs: &mut dyn Rhs,
    at: At,
    direction: &[f64],
    (linear, weights): (bool, &[f64]),
    (work, value, out): (&mut [f64], &[f64], &mut [f64]),
) -> Result<(), SolverError> {
    let length = norm(direction);
    if length == 0.0 {
        out.fill(0.0);
        return Ok(());
    }
    let relative = if linear { 1.0 } else { f64::EPSILON.sqrt() };
    let e = relative * (rhs.scale() + norm(at.state)) / length;
    update(work, [at.state, direction], |_, [y, v]| y + e * v);
    rhs.rate(at.time, work, out)?;
    weigh(weights, out);
    update(out, [value], |moved, [value]| (moved - value) / e);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::rhs;

    /// A bar whose springs harden, `N(e) = e + e^3`, held at the left, pulled by `p` at the right.
    fn hardening_bar(p: f64) -> impl Rhs {
        rhs(move |_, u, force| {
            force.fill(0.0);
            for i in 0..u.len() {
                let e = u[i] - if i == 0 { 0.0 } else { u[i - 1] };
                force[i] -= e + e * e * e;
                if i > 0 {
                    force[i - 1] += e + e * e * e;
                }
            }
            *force.last_mut().unwrap() += p;
            Ok(())
        })
    }

    #[test]
    fn all_krylov_methods_find_the_nonlinear_equilibrium() {
        for krylov in [
            KrylovMethod::ConjugateGradient,
            KrylovMethod::BiCgStab,
            KrylovMethod::Gmres,
        ] {
            let mut newton = Newton::new(NewtonOptions {
                krylov,
                relative_tolerance: 1e-11,
                ..Default::default()
            });
            let mut u = vec![0.0; 50];
            // e + e^3 = 10 for e = 2
            let report = newton
                .solve(&mut hardening_bar(10.0), 0.0, &mut u, Hints::default())
                .unwrap();
            for (i, u) in u.iter().enumerate() {
                // residual 1e-10 on a chain whose flexibility is at most 50
                assert!((u - 2.0 * (i + 1) as f64).abs() < 1e-8, "{krylov:?}");
            }
            assert!(report.iterations < 20, "{report:?}");
            assert!(report.krylov_iterations >= report.iterations, "{report:?}");
        }
    }

    #[test]
    fn a_linear_function_takes_one_iteration() {
        let mut bar = rhs(|_, u, force| {
            for i in 0..u.len() {
                let left = if i == 0 { 0.0 } else { u[i - 1] };
                let right = if i + 1 == u.len() { 1.0 } else { u[i + 1] };
                force[i] = left - 2.0 * u[i] + right;
            }
            Ok(())
        });
        let krylov = KrylovMethod::ConjugateGradient;
        let mut newton = Newton::new(NewtonOptions {
            krylov,
            linear: true,
            ..Default::default()
        });
        let mut u = vec![0.0; 99];
        let report = newton
            .solve(&mut bar, 0.0, &mut u, Hints::default())
            .unwrap();
        assert_eq!(report.iterations, 1);
        for (i, u) in u.iter().enumerate() {
            // relative residual 1e-8 times the condition number, about 4000
            assert!((u - (i + 1) as f64 / 100.0).abs() < 4e-5);
        }
    }

    #[test]
    fn the_line_search_rescues_a_start_from_which_full_steps_diverge() {
        // atan has full steps of growing size from |y| > 1.392
        let mut function = rhs(|_, y, value| {
            value[0] = -y[0].atan();
            Ok(())
        });
        let mut y = [20.0];
        Newton::new(NewtonOptions::default())
            .solve(&mut function, 0.0, &mut y, Hints::default())
            .unwrap();
        assert!(y[0].abs() < 1e-7);
    }

    /// A spring of stiffness 1 that is pulled, behind it a spring that holds the end of a lever: it yields at the force 1 and
    /// hardens by 0.1. The state is the displacement at the load and the angle of the lever.
    struct YieldingLever {
        load: f64,
        is_force: bool,
    }

    impl YieldingLever {
        const ARM: f64 = 100.0;

        /// Derivatives of the extensions of both springs by the state.
        const EXTENSIONS: [[f64; 2]; 2] = [[1.0, -Self::ARM], [0.0, Self::ARM]];

        /// Force and stiffness of both springs; the stiffness at the kink is that below it.
        fn springs(state: &[f64]) -> [(f64, f64); 2] {
            let [pulled, held] = Self::EXTENSIONS.map(|[x, angle]| x * state[0] + angle * state[1]);
            let yields = held > 1.0 + 1e-12;
            let holding = match yields {
                true => (1.0 + 0.1 * (held - 1.0), 0.1),
                false => (held, 1.0),
            };
            [(pulled, 1.0), holding]
        }

        fn minus_sum(tensions: [f64; 2], out: &mut [f64]) {
            for (i, out) in out.iter_mut().enumerate() {
                let springs = Self::EXTENSIONS.iter().zip(tensions);
                *out = -springs.map(|(e, tension)| e[i] * tension).sum::<f64>();
            }
        }
    }

    impl Rhs for YieldingLever {
        fn rate(&mut self, _: f64, state: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
            Self::minus_sum(Self::springs(state).map(|(tension, _)| tension), force);
            force[0] += self.load;
            Ok(())
        }

        fn tangent(&mut self, at: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
            let extensions = Self::EXTENSIONS.map(|e| e[0] * v[0] + e[1] * v[1]);
            let springs = Self::springs(at.state);
            let tensions = [0, 1].map(|spring| springs[spring].1 * extensions[spring]);
            Self::minus_sum(tensions, out);
            Ok(true)
        }

        fn is_force(&self) -> bool {
            self.is_force
        }
    }

    /// The tangent of the state at which the spring is about to yield is elastic. What it does not bear after that acts on the
    /// lever as a moment, so that the norm of the forces rises in all but the shortest steps; the energy falls.
    #[test]
    fn yielding_is_brought_to_equilibrium_by_the_work() {
        let solve = |is_force| {
            let mut lever = YieldingLever {
                load: 1.2,
                is_force,
            };
            let mut newton = Newton::new(NewtonOptions {
                krylov: KrylovMethod::ConjugateGradient,
                ..Default::default()
            });
            let mut state = [2.0, 1.0 / YieldingLever::ARM];
            let report = newton.solve(&mut lever, 0.0, &mut state, Hints::default());
            (report, state)
        };
        let (report, state) = solve(true);
        assert!(report.expect("an equilibrium").iterations <= 10);
        let expected = [3.0 + 1.2, 3.0 / YieldingLever::ARM];
        for (found, expected) in state.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{state:?}");
        }
        assert!(solve(false).0.is_err(), "the norm alone finds no step");
    }

    #[test]
    fn a_function_without_zero_is_reported() {
        let mut function = rhs(|_, y, value| {
            value[0] = -1.0 - y[0] * y[0];
            Ok(())
        });
        let error = Newton::new(NewtonOptions::default())
            .solve(&mut function, 0.0, &mut [0.5], Hints::default())
            .unwrap_err();
        assert!(matches!(error, SolverError::NotConverged { .. }), "{error}");
    }
}
