//! Problems with known answers, shared by the tests of the solvers.

use super::error::SolverError;
use super::rhs::{At, Rhs, rhs};

/// Insulated bar: `f_i = y_(i-1) - 2 y_i + y_(i+1)` inside, one neighbour at the ends.
/// Rates add up to zero; eigenvalues lie in `(-4, 0]`.
pub(super) struct Bar;

pub(super) fn insulated_bar() -> Bar {
    Bar
}

impl Rhs for Bar {
    fn rate(&mut self, _: f64, y: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        rate.fill(0.0);
        for i in 1..y.len() {
            let flow = y[i - 1] - y[i];
            rate[i - 1] -= flow;
            rate[i] += flow;
        }
        Ok(())
    }

    fn tangent(&mut self, at: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
        self.rate(at.time, v, out)?;
        Ok(true)
    }

    fn tangent_diagonal(&mut self, _: At, out: &mut [f64]) -> Result<bool, SolverError> {
        out.fill(-2.0);
        Ok(true)
    }
}

/// `y' = -y`.
pub(super) fn decay() -> impl Rhs {
    rhs(|_, y, rate| {
        rate[0] = -y[0];
        Ok(())
    })
}

/// The estimated error of one step of [`decay`] over the true one; `step(rhs, dt, y, error)` advances `y` and writes the estimate.
pub(super) fn estimated_over_true_error(
    step: impl FnOnce(&mut dyn Rhs, f64, &mut [f64], &mut [f64]),
) -> f64 {
    let dt = 0.01;
    let (mut y, mut error) = ([1.0], [0.0]);
    step(&mut decay(), dt, &mut y, &mut error);
    error[0] / (y[0] - (-dt).exp())
}

/// Observed order of a method on `y' = -y^2 cos t + sin t / 2`, `y(0) = 1`, to `t = 1`:
/// `log2` of the ratio of errors for 64 and 128 steps.
///
/// The reference is the classical Runge-Kutta method with 4096 steps, exact to rounding.
pub(super) fn order_of_convergence(
    mut step: impl FnMut(&mut dyn Rhs, f64, f64, &mut [f64]),
) -> f64 {
    let f = |t: f64, y: f64| -y * y * t.cos() + 0.5 * t.sin();
    let mut exact = 1.0;
    let h = 1.0 / 4096.0;
    for n in 0..4096 {
        let t = n as f64 * h;
        let k1 = f(t, exact);
        let k2 = f(t + h / 2.0, exact + h / 2.0 * k1);
        let k3 = f(t + h / 2.0, exact + h / 2.0 * k2);
        let k4 = f(t + h, exact + h * k3);
        exact += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    let mut error = |steps: usize| {
        let mut problem = rhs(|t, y, rate| {
            rate[0] = f(t, y[0]);
            Ok(())
        });
        let (mut y, dt) = ([1.0], 1.0 / steps as f64);
        for n in 0..steps {
            step(&mut problem, n as f64 * dt, dt, &mut y);
        }
        (y[0] - exact).abs()
    };
    (error(64) / error(128)).log2()
}
