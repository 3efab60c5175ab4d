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

#[cfg(test)]
mod tests;

use super::error::{SolverError, positive};
use super::krylov::Hints;
use super::newton::{Newton, NewtonOptions, NewtonReport};
use super::reduce::are_equal;
use super::reducer::Reducer;
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
        let points = rhs.points();
        if old > 0.0 {
            rhs.rate(time, state, old_rate)?;
            points.bring(old_rate);
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
        points.bring(history);
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
            rhs.points().bring(old_rate);
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
        rhs.points().bring(&mut work.direction);
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

    fn points(&self) -> Reducer {
        self.rhs.points()
    }

    /// Rounding error of the residual: of the state, which is computed from the unknowns, plus that of the rate times the
    /// step. The rate dominates for steps far above the explicit limit. The unknowns are those of the last evaluation.
    fn rounding(&self, at: At) -> f64 {
        let StepVectors { state, slope, .. } = &*self.work;
        let points = self.rhs.points();
        let squares = points.sum_of([slope, at.state], |[slope, s]| (slope * s).powi(2));
        4.0 * f64::EPSILON * (points.norm(state) + squares.sqrt())
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
