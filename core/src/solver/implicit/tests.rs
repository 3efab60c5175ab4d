//! Implicit steps of decays, bars and melting points.

use super::*;
use crate::solver::reduce::{max_abs, norm, sum};
use crate::solver::rhs;
use crate::solver::test_problems::{
    estimated_over_true_error, insulated_bar, order_of_convergence,
};

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
        let ratio = estimated_over_true_error(|rhs, dt, y, error| {
            method.step(rhs, 0.0, dt, y).unwrap();
            method.error(rhs, 0.0, dt, [&[1.0], y], error).unwrap();
        });
        // the next term is about dt relative to the first
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
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
