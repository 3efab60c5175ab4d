//! Steady states of `y' = f(t, y)`: the state at which the rate vanishes, without time steps.

use super::error::SolverError;
use super::krylov::{Hints, NullSpace};
use super::newton::{Newton, NewtonReport};
use super::rhs::Rhs;
use super::vector::update;

/// Brings the rate to zero by [`Newton`]; with `options.linear` this is a single linear
/// solve. `state` holds the initial guess on entry.
///
/// `conserved` is for systems that exchange nothing with their surroundings, such as an
/// insulated body: then steady states form a family, and the one with the (weighted,
/// [`Rhs::weights`]) sum of the initial guess is returned. The rate must depend on the state only through differences,
/// so that adding a constant to all entries changes nothing.
///
/// Choose the absolute tolerance of `newton` in the unit of the rate: a relative one means
/// little when the guess is already good.
///
/// # Errors
/// Errors of [`Newton::solve`]; no convergence if there is no steady state, as in an
/// insulated body that is heated.
pub fn steady_state(
    newton: &mut Newton,
    rhs: &mut dyn Rhs,
    time: f64,
    state: &mut [f64],
    conserved: bool,
) -> Result<NewtonReport, SolverError> {
    if !conserved {
        return newton.solve(rhs, time, state, Hints::default());
    }
    let weights: Option<Vec<f64>> = rhs.weights().map(<[f64]>::to_vec);
    let points = rhs.points();
    let total = |state: &[f64]| match &weights {
        Some(weights) => points.dot(state, weights),
        None => points.sum(state),
    };
    let before = total(state);
    let constant = NullSpace::constant(state.len(), &points);
    let hints = Hints {
        null_space: Some(&constant),
        ..Hints::default()
    };
    let report = newton.solve(rhs, time, state, hints)?;
    // the projection keeps the sum to rounding in each iteration; this removes the accumulated error
    let size = total(&vec![1.0; state.len()]);
    let excess = (total(state) - before) / size;
    update(state, [], |y, []| y - excess);
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::reduce::{dot, sum};
    use crate::solver::test_problems::insulated_bar;
    use crate::solver::{KrylovMethod, NewtonOptions, rhs};

    fn solver(linear: bool) -> Newton {
        let krylov = KrylovMethod::ConjugateGradient;
        Newton::new(NewtonOptions {
            krylov,
            linear,
            relative_tolerance: 1e-12,
            ..Default::default()
        })
    }

    #[test]
    fn an_insulated_bar_becomes_uniform_at_its_mean() {
        let mut y: Vec<f64> = (0..101).map(|i| 300.0 + i as f64).collect();
        let report =
            steady_state(&mut solver(true), &mut insulated_bar(), 0.0, &mut y, true).unwrap();
        assert_eq!(report.iterations, 1);
        for y in y {
            // residual 1e-12 sqrt(2) times the inverse of the smallest eigenvalue, 1000
            assert!((y - 350.0).abs() < 2e-9);
        }
    }

    /// A ring of cells of several sizes that exchange heat with their neighbours.
    struct Ring(Vec<f64>);

    impl Rhs for Ring {
        fn rate(&mut self, _: f64, y: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
            let n = y.len();
            for i in 0..n {
                rate[i] = (y[(i + 1) % n] - 2.0 * y[i] + y[(i + n - 1) % n]) / self.0[i];
            }
            Ok(())
        }

        fn weights(&self) -> Option<&[f64]> {
            Some(&self.0)
        }
    }

    #[test]
    fn cells_of_several_sizes_end_at_their_weighted_mean() {
        let sizes: Vec<f64> = (0..40).map(|i| if i < 20 { 1.0 } else { 4.0 }).collect();
        let mut y: Vec<f64> = (0..40).map(|i| f64::from(i * i)).collect();
        let mean = dot(&sizes, &y) / sum(&sizes);
        steady_state(&mut solver(true), &mut Ring(sizes), 0.0, &mut y, true).unwrap();
        for y in y {
            // residual 1e-12 of some hundred, over the smallest eigenvalue, 0.025
            assert!((y - mean).abs() < 1e-7, "{y} {mean}");
        }
    }

    #[test]
    fn conductivity_that_grows_with_temperature_gives_the_kirchhoff_profile() {
        // k = 1 + T between T = 0 and T = 1: T + T^2/2 is linear; (T^2 differences make it exact on a grid)
        let n = 40;
        let potential = |t: f64| t + 0.5 * t * t;
        let mut bar = rhs(move |_, t, rate| {
            for i in 0..n {
                let left = if i == 0 { 0.0 } else { potential(t[i - 1]) };
                let right = if i + 1 == n {
                    potential(1.0)
                } else {
                    potential(t[i + 1])
                };
                rate[i] = left - 2.0 * potential(t[i]) + right;
            }
            Ok(())
        });
        let mut newton = solver(false);
        newton.options.krylov = KrylovMethod::BiCgStab;
        let mut t = vec![0.5; n];
        steady_state(&mut newton, &mut bar, 0.0, &mut t, false).unwrap();
        for (i, t) in t.iter().enumerate() {
            let exact = -1.0 + (1.0 + 3.0 * (i + 1) as f64 / (n + 1) as f64).sqrt();
            // relative residual 1e-12 times the condition number, about 700
            assert!((t - exact).abs() < 1e-9, "{t} {exact}");
        }
    }

    #[test]
    fn an_insulated_heated_bar_has_no_steady_state() {
        let mut heated = rhs(|_, y: &[f64], rate: &mut [f64]| {
            insulated_bar().rate(0.0, y, rate)?;
            rate[3] += 1.0;
            Ok(())
        });
        let error =
            steady_state(&mut solver(true), &mut heated, 0.0, &mut [300.0; 20], true).unwrap_err();
        assert!(matches!(error, SolverError::NotConverged { .. }), "{error}");
    }
}
