//! Explicit steps for `y' = f(t, y)` by a stabilised Runge-Kutta method.
//!
//! The state is the conserved quantity. Heat conduction advances the enthalpy; the rate function
//! turns enthalpy into temperature and sums the heat flow over the bonds. If the entries of
//! the rate add up to zero, the entries of the state keep their sum to rounding.

use super::error::{SolverError, positive};
use super::rhs::Rhs;
use super::vector::update;

/// Second-order Runge-Kutta-Legendre: one step of `s` stages is stable for a step
/// `(s^2 + s - 2) / 4` times that of forward Euler, at `s` rates.
///
/// For rates whose Jacobian has (nearly) real negative eigenvalues: diffusion. Not for
/// waves or advection. The gain over forward Euler is about `s / 4` and the order is two.
///
/// Source: Meyer, Balsara & Aslam (2014), J. Comput. Phys. 257, 594-626, eqs. 16 to 18.
/// With `D_j = Y_j - y` the stages read
///
/// ```text
/// b_j = (j^2 + j - 2) / (2 j (j + 1)), b_0 = b_1 = b_2 = 1/3,  a_j = 1 - b_j,  w = 4 / (s^2 + s - 2)
/// D_1 = b_1 w dt f(y)
/// D_j = mu_j D_(j-1) + nu_j D_(j-2) + mu_j w dt f(Y_(j-1)) - a_(j-1) mu_j w dt f(y)
/// mu_j = (2 j - 1) / j  b_j / b_(j-1),   nu_j = -(j - 1) / j  b_j / b_(j-2)
/// ```
///
/// Written for the increments `D` rather than the stages `Y` of the source: the terms in
/// `y`, whose factors add up to one, drop out, and the sum of the state is kept to the
/// rounding of the increment.
#[derive(Debug, Clone, Default)]
pub struct Rkl2 {
    first_rate: Vec<f64>,
    rate: Vec<f64>,
    stage: Vec<f64>,
    increment: Vec<f64>,
    previous: Vec<f64>,
    /// Number of stages of the last step.
    stages: usize,
}

impl Rkl2 {
    /// Smallest odd number of stages, at least 3, that is stable for `dt` when forward Euler
    /// is stable for `stable_step` (both in seconds). Odd numbers damp the stiffest modes better.
    ///
    /// # Errors
    /// A step that is not positive and finite, a stable step that is not positive.
    pub fn stages(dt: f64, stable_step: f64) -> Result<usize, SolverError> {
        positive("the time step [s]", dt)?;
        if stable_step.is_nan() || stable_step <= 0.0 {
            return Err(SolverError::OutOfRange {
                what: "the stable time step [s]",
                value: stable_step,
                range: "positive",
            });
        }
        // s^2 + s - 2 >= 4 dt / stable_step
        let stages = 0.5 * ((9.0 + 16.0 * dt / stable_step).sqrt() - 1.0);
        if stages > 1e6 {
            return Err(SolverError::OutOfRange {
                what: "the ratio of the time step to the stable step of forward Euler",
                value: dt / stable_step,
                range: "at most 2.5e11; the stable step is probably wrong",
            });
        }
        // a step of exactly the limit must not gain two stages by rounding
        let stages = (stages - 1e-9).ceil() as usize;
        Ok(stages.max(3) | 1)
    }

    /// Advances `state` from `time` by `dt` (s) in `stages` stages (see [`Rkl2::stages`]).
    ///
    /// # Errors
    /// A step that is not positive, fewer than two stages, and errors of the model.
    pub fn step(
        &mut self,
        rhs: &mut dyn Rhs,
        time: f64,
        dt: f64,
        stages: usize,
        state: &mut [f64],
    ) -> Result<(), SolverError> {
        positive("the time step [s]", dt)?;
        if stages < 2 {
            return Err(SolverError::OutOfRange {
                what: "the number of stages",
                value: stages as f64,
                range: "at least 2",
            });
        }
        let Self {
            first_rate,
            rate,
            stage,
            increment,
            previous,
            stages: last_stages,
        } = self;
        *last_stages = stages;
        for vector in [
            &mut *first_rate,
            &mut *rate,
            &mut *stage,
            &mut *increment,
            &mut *previous,
        ] {
            vector.resize(state.len(), 0.0);
        }
        let s = stages as f64;
        let w = 4.0 / (s * s + s - 2.0);

        let points = rhs.points();
        rhs.rate(time, state, first_rate)?;
        points.bring(first_rate);
        previous.fill(0.0);
        update(increment, [first_rate], |_, [f0]| b(1.0) * w * dt * f0);
        // the same recursion for y' = 1 gives the time of each stage, as a fraction of dt
        let (mut fraction, mut previous_fraction) = (b(1.0) * w, 0.0);
        for stage_number in 2..=stages {
            let j = stage_number as f64;
            let mu = (2.0 * j - 1.0) / j * b(j) / b(j - 1.0);
            let nu = -(j - 1.0) / j * b(j) / b(j - 2.0);
            let a = 1.0 - b(j - 1.0);

            update(stage, [state, increment], |_, [y, d]| y + d);
            rhs.rate(time + fraction * dt, stage, rate)?;
            points.bring(rate);
            update(
                previous,
                [increment, rate, first_rate],
                |before, [d, f, f0]| mu * d + nu * before + mu * w * dt * (f - a * f0),
            );
            std::mem::swap(previous, increment);
            let next = mu * fraction + nu * previous_fraction + mu * w * (1.0 - a);
            previous_fraction = std::mem::replace(&mut fraction, next);
        }
        update(state, [increment], |y, [d]| y + d);
        Ok(())
    }

    /// Writes the estimated error of the last step, from `time` by `dt` (s), into `error`, with one more rate; `[before,
    /// after]`: the states before and after the step.
    ///
    /// The cubic coefficient of the stability polynomial is `c = (s^2 + s - 6) / (s^2 + s - 2) / 9`: a step is wrong by
    /// `(1/6 - c) dt^3 d3y/dt3`, the trapezoidal rule over both rates differs from it by `(1/4 - c) dt^3 d3y/dt3`. Compare
    /// Sommeijer, Shampine and Verwer (1998), J. Comput. Appl. Math. 88, 315-326, eq. 2.8, for another polynomial.
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
        rhs.rate(time + dt, after, &mut self.rate)?;
        rhs.points().bring(&mut self.rate);
        let s = self.stages as f64;
        let c = (s * s + s - 6.0) / (s * s + s - 2.0) / 9.0;
        let factor = (1.0 / 6.0 - c) / (1.0 / 4.0 - c);
        let inputs = [before, after, &self.first_rate, &self.rate];
        update(error, inputs, |_, [y0, y1, f0, f1]| {
            factor * (y1 - y0 - 0.5 * dt * (f0 + f1))
        });
        Ok(())
    }
}

fn b(j: f64) -> f64 {
    if j <= 2.0 {
        1.0 / 3.0
    } else {
        (j * j + j - 2.0) / (2.0 * j * (j + 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::reduce::{max_abs, sum};
    use crate::solver::rhs;
    use crate::solver::test_problems::{
        estimated_over_true_error, insulated_bar, order_of_convergence,
    };

    #[test]
    fn rkl2_is_of_second_order_also_for_rates_that_depend_on_time() {
        for stages in [2, 3, 4, 9, 15] {
            let order = order_of_convergence(|f, time, dt, y| {
                Rkl2::default().step(f, time, dt, stages, y).unwrap();
            });
            assert!((order - 2.0).abs() < 0.05, "{stages} stages: {order}");
        }
    }

    /// `y' = -y`: `y - y_exact` after one step.
    #[test]
    fn the_estimated_error_of_rkl2_is_that_of_the_step() {
        for stages in [3, 5, 15, 101] {
            let mut method = Rkl2::default();
            let ratio = estimated_over_true_error(|rhs, dt, y, error| {
                method.step(rhs, 0.0, dt, stages, y).unwrap();
                method.error(rhs, 0.0, dt, [&[1.0], y], error).unwrap();
            });
            // the next term is about dt relative to the first
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        }
    }

    #[test]
    fn rkl2_on_a_stiff_bar_is_of_second_order() {
        // a cosine is an eigenvector of the bar, lambda = -4 sin^2(pi / 2n), with 400 stable steps
        // of forward Euler to its decay
        let n = 40;
        let angle = std::f64::consts::PI / n as f64;
        let lambda = -4.0 * (angle / 2.0).sin().powi(2);
        let error = |steps: usize| {
            let dt = 200.0 / steps as f64;
            let stages = Rkl2::stages(dt, 0.5).unwrap();
            let mut y: Vec<f64> = (0..n).map(|i| (angle * (i as f64 + 0.5)).cos()).collect();
            let exact = y[0] * (lambda * 200.0).exp();
            for _ in 0..steps {
                Rkl2::default()
                    .step(&mut insulated_bar(), 0.0, dt, stages, &mut y)
                    .unwrap();
            }
            (y[0] - exact).abs()
        };
        // the constant of the error changes by some per cent with the number of stages
        let order = (error(4) / error(8)).log2();
        assert!((order - 2.0).abs() < 0.15, "{order}");
    }

    #[test]
    fn rkl2_is_stable_up_to_its_limit_and_not_beyond() {
        // the stiffest mode of the bar, lambda = -4: forward Euler is stable up to dt = 1/2
        let n = 64;
        let start: Vec<f64> = (0..n)
            .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        for (dt, stable) in [
            (0.5 * (13.0 * 13.0 + 13.0 - 2.0) / 4.0, true),
            (30.0, false),
        ] {
            let mut y = start.clone();
            for _ in 0..20 {
                Rkl2::default()
                    .step(&mut insulated_bar(), 0.0, dt, 13, &mut y)
                    .unwrap();
            }
            assert_eq!(max_abs(&y) < 1.0, stable, "dt = {dt}: {}", max_abs(&y));
        }
        assert_eq!(Rkl2::stages(0.5 * 45.0, 0.5).unwrap(), 13);
        assert_eq!(Rkl2::stages(0.5 * 45.1, 0.5).unwrap(), 15);
        assert_eq!(Rkl2::stages(0.1, f64::INFINITY).unwrap(), 3);
    }

    #[test]
    fn a_large_stiff_step_keeps_the_sum_to_rounding() {
        let n = 1000;
        let mut y: Vec<f64> = (0..n)
            .map(|i| 300.0 + 700.0 * (-(i as f64 - 300.0).powi(2) / 50.0).exp())
            .collect();
        let before = sum(&y);
        let mut method = Rkl2::default();
        let stages = Rkl2::stages(500.0, 0.5).unwrap();
        for step in 0..50 {
            method
                .step(
                    &mut insulated_bar(),
                    step as f64 * 500.0,
                    500.0,
                    stages,
                    &mut y,
                )
                .unwrap();
        }
        // each of 50 additions rounds each of 1000 entries by eps/2 of 300 at random
        assert!((sum(&y) / before - 1.0).abs() < 10.0 * f64::EPSILON);
        assert!(max_abs(&y) < 330.0, "the peak has diffused");
    }

    #[test]
    fn errors_of_the_model_and_of_the_step_are_reported() {
        let mut failing = rhs(|_, _, _| Err(SolverError::model(std::fmt::Error)));
        let mut y = [1.0];
        assert!(matches!(
            Rkl2::default().step(&mut failing, 0.0, 1.0, 3, &mut y),
            Err(SolverError::Model(_))
        ));
        assert!(Rkl2::stages(f64::NAN, 1.0).is_err());
        assert!(Rkl2::stages(1.0, 0.0).is_err());
        assert!(
            Rkl2::default()
                .step(&mut failing, 0.0, -1.0, 3, &mut y)
                .is_err()
        );
        assert_eq!(y, [1.0]);
    }

    #[test]
    fn a_stable_step_of_next_to_nothing_is_refused() {
        // more than a million stages; and some hundred thousand
        assert!(matches!(
            Rkl2::stages(1.0, 1e-13),
            Err(SolverError::OutOfRange { .. })
        ));
        assert!(Rkl2::stages(1.0, 1e-10).is_ok());
    }
}
