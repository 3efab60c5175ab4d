//! Implicit steps for `y' = f(t, y)`: implicit Euler and Crank-Nicolson.
//!
//! ```text
//! z = y + dt ((1 - theta) f(t, y) + theta f(t + dt, z))            solved for z by Newton-Krylov
//! y_new = y + dt ((1 - theta) f(t, y) + theta f(t + dt, z))        flux form
//! ```
//!
//! The second line seems to repeat the first, but `z` meets it only to the
//! tolerance of the iteration. The right side of the second line is a rate: when the entries of `f` add up to
//! zero (or to the supplied heat), the sum of the state changes by that and by rounding,
//! however loose the tolerance. `y_new` differs from `z` by the residual, within the tolerance.
//!
//! Newton's method solves for the unknowns of [`Rhs::unknowns`]. Example, heat with phase change: far above the explicit
//! limit the flow of heat dominates, which is nearly linear in the temperature. As a function of the enthalpy, which is the
//! state, its slope jumps wherever a point starts or ends to melt, and Newton's method fails at so many kinks. The Jacobian
//! is not symmetric in general, hence BiCGStab.

use super::error::{SolverError, positive};
use super::krylov::Hints;
use super::newton::{Newton, NewtonOptions, NewtonReport};
use super::reduce::{are_equal, norm, sum_points};
use super::rhs::{At, Rhs};
use super::vector::update;

/// Theta method with its work vectors; unconditionally stable.
///
/// The relative tolerance of the Newton iteration is relative to the increment of the step.
#[derive(Debug, Clone)]
pub struct Implicit {
    theta: f64,
    newton: Newton,
    old_rate: Vec<f64>,
    history: Vec<f64>,
    candidate: Vec<f64>,
    work: StepVectors,
}

/// Unknowns, the state that belongs to them, its derivative by them ([`Rhs::state`]), and a direction.
#[derive(Debug, Clone, Default)]
struct StepVectors {
    unknowns: Vec<f64>,
    state: Vec<f64>,
    slope: Vec<f64>,
    direction: Vec<f64>,
}

impl Implicit {
    /// Implicit Euler: first order, damps every mode; the safe choice for large steps.
    pub fn euler(options: NewtonOptions) -> Self {
        Self::with_theta(1.0, options)
    }

    /// Crank-Nicolson: second order; steps far above the explicit limit let stiff modes
    /// oscillate with slow decay, so start from smooth data.
    pub fn crank_nicolson(options: NewtonOptions) -> Self {
        Self::with_theta(0.5, options)
    }

    fn with_theta(theta: f64, options: NewtonOptions) -> Self {
        Self {
            theta,
            newton: Newton::new(options),
            old_rate: Vec::new(),
            history: Vec::new(),
            candidate: Vec::new(),
            work: StepVectors::default(),
        }
    }

    /// Advances `state` from `time` by `dt` (s). After an error the state is as it was.
    ///
    /// # Errors
    /// A step that is not positive, and the errors of [`Newton::solve`].
    pub fn step(
        &mut self,
        rhs: &mut dyn Rhs,
        time: f64,
        dt: f64,
        state: &mut [f64],
    ) -> Result<NewtonReport, SolverError> {
        positive("the time step [s]", dt)?;
        let Self {
            theta,
            newton,
            old_rate,
            history,
            candidate,
            work,
        } = self;
        for vector in [
            &mut *old_rate,
            &mut *history,
            &mut *candidate,
            &mut work.state,
            &mut work.slope,
            &mut work.direction,
        ] {
            vector.resize(state.len(), 0.0);
        }
        let (old, new) = ((1.0 - *theta) * dt, *theta * dt);
        if old > 0.0 {
            rhs.rate(time, state, old_rate)?;
        } else {
            old_rate.fill(0.0);
        }
        update(history, [state, old_rate], |_, [y, f]| y + old * f);
        rhs.unknowns(state, candidate);
        work.unknowns.clear();

        let mut equation = StepEquation {
            rhs,
            history,
            weight: new,
            work,
        };
        let mut report = newton.solve(&mut equation, time + dt, candidate, Hints::default())?;

        // from here on the memory of `history` holds the new rate
        rhs.state(candidate, &mut work.state, &mut work.slope);
        rhs.rate(time + dt, &work.state, history)?;
        report.evaluations += if old > 0.0 { 2 } else { 1 };
        update(state, [old_rate, history], |y, [f_old, f_new]| {
            y + (old * f_old + new * f_new)
        });
        Ok(report)
    }

    /// Writes the estimated error of the last step, from `time` by `dt` (s), into `error`, with one more rate; `[before,
    /// after]`: the states before and after the step.
    ///
    /// The error of implicit Euler is half the change of the rate times the step. The error of Crank-Nicolson is the
    /// difference from Simpson's rule over the cubic through both states with both rates, `-dt^3 d3y/dt3 / 12`.
    ///
    /// # Errors
    /// Errors of the model.
    pub fn error(
        &mut self,
        rhs: &mut dyn Rhs,
        time: f64,
        dt: f64,
        [before, after]: [&[f64]; 2],
        error: &mut [f64],
    ) -> Result<(), SolverError> {
        let Self {
            theta,
            old_rate,
            history: new_rate,
            candidate,
            work,
            ..
        } = self;
        if *theta == 1.0 {
            rhs.rate(time, before, old_rate)?;
            update(error, [old_rate, new_rate], |_, [f0, f1]| {
                0.5 * dt * (f1 - f0)
            });
            return Ok(());
        }
        let middle = &mut *candidate;
        update(
            middle,
            [before, after, old_rate, new_rate],
            |_, [y0, y1, f0, f1]| 0.5 * (y0 + y1) + 0.125 * dt * (f0 - f1),
        );
        rhs.rate(time + 0.5 * dt, middle, &mut work.direction)?;
        let rates = [&**old_rate, &work.direction, new_rate];
        update(error, rates, |_, [f0, f, f1]| {
            dt / 3.0 * (f0 - 2.0 * f + f1)
        });
        Ok(())
    }
}

/// `history + weight f(t, z(s)) - z(s)`, to be brought to zero by the unknowns `s`.
struct StepEquation<'a> {
    rhs: &'a mut dyn Rhs,
    history: &'a [f64],
    weight: f64,
    work: &'a mut StepVectors,
}

impl StepEquation<'_> {
    /// Finds the state, unless the unknowns are unchanged, as in all products with one tangent.
    fn find_state(&mut self, unknowns: &[f64]) {
        let work = &mut *self.work;
        if !are_equal(&work.unknowns, unknowns) {
            work.unknowns.clear();
            work.unknowns.extend_from_slice(unknowns);
            self.rhs.state(unknowns, &mut work.state, &mut work.slope);
        }
    }
}

impl Rhs for StepEquation<'_> {
    fn rate(&mut self, time: f64, unknowns: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        let weight = self.weight;
        self.find_state(unknowns);
        self.rhs.rate(time, &self.work.state, rate)?;
        update(rate, [self.history, &self.work.state], |f, [history, z]| {
            history - z + weight * f
        });
        Ok(())
    }

    fn scale(&self) -> f64 {
        self.rhs.scale()
    }

    /// Rounding error of the residual: of the state, which is computed from the unknowns, plus that of the rate times the
    /// step. The rate dominates for steps far above the explicit limit. The unknowns are those of the last evaluation.
    fn rounding(&self, at: At) -> f64 {
        let StepVectors { state, slope, .. } = &*self.work;
        let [squares] = sum_points(state.len(), |i| [(slope[i] * at.state[i]).powi(2)]);
        4.0 * f64::EPSILON * (norm(state) + squares.sqrt())
            + self.weight * self.rhs.rounding(At { state, ..at })
    }

    fn tangent(&mut self, at: At, direction: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
        let weight = self.weight;
        self.find_state(at.state);
        let StepVectors {
            state,
            slope,
            direction: of_state,
            ..
        } = &mut *self.work;
        update(of_state, [direction, slope], |_, [v, slope]| slope * v);
        let offered = self.rhs.tangent(At { state, ..at }, of_state, out)?;
        update(out, [of_state], |jv, [v]| weight * jv - v);
        Ok(offered)
    }

    fn tangent_diagonal(&mut self, at: At, out: &mut [f64]) -> Result<bool, SolverError> {
        let weight = self.weight;
        self.find_state(at.state);
        let StepVectors { state, slope, .. } = &*self.work;
        let offered = self.rhs.tangent_diagonal(At { state, ..at }, out)?;
        update(out, [slope], |diagonal, [slope]| {
            slope * (weight * diagonal - 1.0)
        });
        Ok(offered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::reduce::{max_abs, sum};
    use crate::solver::rhs;
    use crate::solver::test_problems::{decay, insulated_bar, order_of_convergence};

    fn tight() -> NewtonOptions {
        NewtonOptions {
            relative_tolerance: 1e-11,
            ..Default::default()
        }
    }

    #[test]
    fn implicit_euler_is_of_first_and_crank_nicolson_of_second_order() {
        for (mut method, expected) in [
            (Implicit::euler(tight()), 1.0),
            (Implicit::crank_nicolson(tight()), 2.0),
        ] {
            let order = order_of_convergence(|f, time, dt, y| {
                method.step(f, time, dt, y).unwrap();
            });
            // the next term of the error is about dt relative to the first
            assert!((order - expected).abs() < 0.03, "{order}");
        }
    }

    /// `y' = -y`: `y - y_exact` after one step.
    #[test]
    fn the_estimated_error_is_that_of_the_step() {
        for mut method in [Implicit::euler(tight()), Implicit::crank_nicolson(tight())] {
            let (dt, mut decay) = (0.01, decay());
            let (mut y, mut error) = ([1.0], [0.0]);
            method.step(&mut decay, 0.0, dt, &mut y).unwrap();
            method
                .error(&mut decay, 0.0, dt, [&[1.0], &y], &mut error)
                .unwrap();
            let exact = y[0] - (-dt).exp();
            // the next term is about dt relative to the first
            assert!((error[0] / exact - 1.0).abs() < 0.02, "{error:?} {exact}");
        }
    }

    #[test]
    fn a_cosine_decays_as_the_method_says() {
        // the cosine is an eigenvector of the insulated bar, lambda = -4 sin^2(pi k / 2n)
        let (n, k, dt) = (200, 3, 400.0);
        let angle = std::f64::consts::PI * k as f64 / n as f64;
        let z = -4.0 * (angle / 2.0).sin().powi(2) * dt;
        for (mut method, factor) in [
            (Implicit::euler(tight()), 1.0 / (1.0 - z)),
            (
                Implicit::crank_nicolson(tight()),
                (1.0 + z / 2.0) / (1.0 - z / 2.0),
            ),
        ] {
            let start: Vec<f64> = (0..n).map(|i| (angle * (i as f64 + 0.5)).cos()).collect();
            let mut y = start.clone();
            method.step(&mut insulated_bar(), 0.0, dt, &mut y).unwrap();
            for (y, start) in y.iter().zip(&start) {
                // the tolerance of the step
                assert!((y - factor * start).abs() < 1e-9);
            }
        }
    }

    /// Decay at a rate of its own for each component.
    struct Decays([f64; 3]);

    impl Rhs for Decays {
        fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
            update(rate, [state, &self.0], |_, [y, k]| -k * y);
            Ok(())
        }

        fn tangent(&mut self, _: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
            update(out, [v, &self.0], |_, [v, k]| -k * v);
            Ok(true)
        }

        fn tangent_diagonal(&mut self, _: At, out: &mut [f64]) -> Result<bool, SolverError> {
            update(out, [&self.0], |_, [k]| -k);
            Ok(true)
        }
    }

    #[test]
    fn the_diagonal_is_that_of_the_tangent() {
        let mut equation = StepEquation {
            rhs: &mut Decays([1.0, 20.0, 0.3]),
            history: &[0.0; 3],
            weight: 0.7,
            work: &mut StepVectors {
                unknowns: Vec::new(),
                state: vec![0.0; 3],
                slope: vec![0.0; 3],
                direction: vec![0.0; 3],
            },
        };
        let at = At {
            time: 0.0,
            state: &[1.0; 3],
            damping: 0.0,
        };
        let (mut diagonal, mut column) = ([0.0; 3], [0.0; 3]);
        assert!(equation.tangent_diagonal(at, &mut diagonal).unwrap());
        for i in 0..3 {
            let mut unit = [0.0; 3];
            unit[i] = 1.0;
            assert!(equation.tangent(at, &unit, &mut column).unwrap());
            assert_eq!(column[i], diagonal[i]);
        }
    }

    #[test]
    fn a_loose_tolerance_still_keeps_the_sum_to_rounding() {
        // a Stefan problem in enthalpy: temperature stays at 0 for 0 < h < 50
        let temperature = |h: f64| if h < 0.0 { h } else { (h - 50.0).max(0.0) };
        let mut melting = rhs(|_, h, rate| {
            rate.fill(0.0);
            for i in 1..h.len() {
                let flow = temperature(h[i - 1]) - temperature(h[i]);
                rate[i - 1] -= flow;
                rate[i] += flow;
            }
            Ok(())
        });
        let n = 300;
        let mut h: Vec<f64> = (0..n)
            .map(|i| if i < 40 { 1000.0 } else { -20.0 })
            .collect();
        let before = sum(&h);
        let mut method = Implicit::euler(NewtonOptions {
            relative_tolerance: 1e-3,
            ..Default::default()
        });
        for step in 0..20 {
            method
                .step(&mut melting, step as f64, 20.0, &mut h)
                .unwrap();
        }
        assert!(
            h.iter().any(|h| (0.0..50.0).contains(h)),
            "something is melting"
        );
        assert!(max_abs(&h) < 1000.0);
        // 20 roundings of 300 entries up to 1000, at random, on a sum of 34,800
        assert!(
            (sum(&h) / before - 1.0).abs() < 1e-14,
            "{:e}",
            sum(&h) / before - 1.0
        );
    }

    #[test]
    fn a_steady_state_stays_as_it_is() {
        let mut y = vec![1500.0; 100];
        let report = Implicit::crank_nicolson(tight())
            .step(&mut insulated_bar(), 0.0, 1e6, &mut y)
            .unwrap();
        assert_eq!((report.iterations, y), (0, vec![1500.0; 100]));
    }

    /// The insulated bar with a large coefficient, cooled at its first point: nearly one temperature, whose differences are
    /// few roundings apart.
    struct StiffBar;

    const STIFFNESS: f64 = 1e6;
    const COOLING: f64 = 2.0;

    impl Rhs for StiffBar {
        fn rate(&mut self, time: f64, y: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
            insulated_bar().rate(time, y, rate)?;
            update(rate, [], |r, []| STIFFNESS * r);
            rate[0] -= COOLING * (y[0] - 300.0);
            Ok(())
        }

        fn tangent(&mut self, at: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
            self.rate(at.time, v, out)?;
            out[0] -= COOLING * 300.0;
            Ok(true)
        }

        fn tangent_diagonal(&mut self, _: At, out: &mut [f64]) -> Result<bool, SolverError> {
            out.fill(-2.0 * STIFFNESS);
            Ok(true)
        }

        fn rounding(&self, at: At) -> f64 {
            4.0 * f64::EPSILON * 4.0 * STIFFNESS * norm(at.state)
        }
    }

    #[test]
    fn steps_far_above_the_explicit_limit_converge_down_to_the_steady_state() {
        // dt = 10 is 2e7 times the explicit limit, 1 / (2 STIFFNESS)
        let (n, dt) = (20, 10.0);
        for start in [1000.0, 300.0 + 1e-6, 300.0 + 1e-12, 300.0] {
            let mut y = vec![start; n];
            let mut lumped = start - 300.0;
            let mut method = Implicit::euler(NewtonOptions::default());
            for step in 0..60 {
                method
                    .step(&mut StiffBar, step as f64 * dt, dt, &mut y)
                    .unwrap();
                lumped /= 1.0 + COOLING * dt / n as f64;
                // differences within the bar, in each step; and the residual of each step, which may be as large as its
                // rounding and halves in every later step
                let differences = (step + 1) as f64 * n as f64 * COOLING / STIFFNESS;
                let at = At {
                    time: 0.0,
                    state: &y,
                    damping: 0.0,
                };
                let residual = dt * StiffBar.rounding(at) / (n as f64).sqrt();
                let bound = differences * lumped + 2.0 * residual;
                for y in &y {
                    assert!((y - 300.0 - lumped).abs() < bound, "{step}: {y} {lumped}");
                }
            }
        }
    }

    /// `y' = -y`, with its tangent.
    #[derive(Default)]
    struct CountedDecay {
        calls: usize,
    }

    impl Rhs for CountedDecay {
        fn rate(&mut self, _: f64, y: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
            self.calls += 1;
            update(rate, [y], |_, [y]| -y);
            Ok(())
        }

        fn tangent(&mut self, _: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
            self.calls += 1;
            update(out, [v], |_, [v]| -v);
            Ok(true)
        }
    }

    #[test]
    fn evaluations_of_the_rate_and_products_with_its_tangent_are_counted() {
        for mut method in [Implicit::euler(tight()), Implicit::crank_nicolson(tight())] {
            let mut decay = CountedDecay::default();
            let report = method.step(&mut decay, 0.0, 0.1, &mut [1.0, 2.0]).unwrap();
            assert_eq!(report.evaluations, decay.calls);
        }
    }
}
