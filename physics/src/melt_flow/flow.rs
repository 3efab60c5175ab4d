//! The flow of the melt during a step of conduction, in sub-steps of its own.

use perimelt_core::solver::SolverError;

use super::heat::Heat;
use super::melt::Melt;
use super::momentum::Momentum;
use super::pool::Pool;
use super::pressure::Pressure;
use super::surface::Surface;
use crate::advection::Convection;

/// Largest fraction of the spacing by which the melt moves in a sub-step.
const COURANT: f64 = 0.4;
/// Largest sub-step times diffusivity over the squared spacing.
const DIFFUSION: f64 = 0.12;
/// Sub-steps of a step of conduction beyond which the flow has blown up.
const MOST: f64 = 1e6;

/// Why the flow cannot go on.
#[derive(Debug, thiserror::Error)]
pub(super) enum FlowError {
    /// The pressure was not found.
    #[error("the pressure of the melt was not found: {0}")]
    Pressure(#[from] SolverError),
    /// The melt is too fast.
    #[error(
        "the melt flows at {speed:.3e} m/s and would need {count:.1e} sub-steps in {step:.3e} s; check the viscosity, the \
         surface tension and the sources of heat"
    )]
    TooFast {
        /// m/s.
        speed: f64,
        count: f64,
        /// s.
        step: f64,
    },
}

/// How the flow is computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scheme {
    pub(super) convection: Convection,
    /// Change of volume relative to the one that the fastest melt carries over the spacing.
    pub(super) tolerance: f64,
}

/// What a step cost.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cost {
    pub(super) sub_steps: usize,
    pub(super) iterations: usize,
}

/// State and work arrays of the liquid cells.
#[derive(Debug)]
pub(super) struct Flow {
    scheme: Scheme,
    pub(super) momentum: Momentum,
    pub(super) pressure: Pressure,
    pub(super) heat: Heat,
}

impl Flow {
    pub(super) fn new(scheme: Scheme) -> Self {
        Flow {
            scheme,
            momentum: Momentum::default(),
            pressure: Pressure::default(),
            heat: Heat::default(),
        }
    }

    /// Adapts the arrays to a new list; `has_force`: a force acts in the cells.
    pub(super) fn resize(&mut self, melt: &Melt, pool: &Pool, has_force: bool) {
        self.momentum.resize(pool.len(), melt, has_force);
        self.pressure.resize(pool);
        self.heat.resize(pool.len());
    }

    /// Advances over a step of `size` (s) from the state that was loaded.
    pub(super) fn advance(
        &mut self,
        melt: &Melt,
        pool: &Pool,
        surface: &Surface,
        size: f64,
    ) -> Result<Cost, FlowError> {
        let mut cost = Cost::default();
        let mut left = size;
        while left > 0.0 {
            self.momentum.follow(melt, pool, surface, &self.heat);
            let count = (left / self.largest_step(melt, pool) * (1.0 - 1e-9)).ceil();
            let count = count.max(1.0);
            if count > MOST {
                let speed = self.momentum.largest_speed();
                let step = left;
                return Err(FlowError::TooFast { speed, count, step });
            }
            let ds = left / count;
            cost.sub_steps += 1;
            cost.iterations += self.take_sub_step(melt, pool, ds)?;
            left = if count > 1.0 { left - ds } else { 0.0 };
        }
        Ok(cost)
    }

    /// Largest sub-step, s: so that `ds (v + ds a)` is at most [`COURANT`] spacings, and viscosity is stable.
    fn largest_step(&self, melt: &Melt, pool: &Pool) -> f64 {
        let spacing = pool.stencil.spacing;
        let speed = self.momentum.largest_speed();
        let acceleration = self.momentum.largest_acceleration(melt.density);
        let moved = COURANT * spacing;
        let sum = speed + (speed * speed + 4.0 * acceleration * moved).sqrt();
        let by_speed = if sum > 0.0 {
            2.0 * moved / sum
        } else {
            f64::INFINITY
        };
        let mut diffusivity = self.momentum.largest_viscosity();
        for temperature in &self.heat.temperature {
            let Some(added) = melt.added_conductivity(*temperature) else {
                break;
            };
            diffusivity = diffusivity.max(added / melt.curve.minimum_capacity());
        }
        by_speed.min(DIFFUSION * spacing * spacing / diffusivity)
    }

    fn take_sub_step(&mut self, melt: &Melt, pool: &Pool, ds: f64) -> Result<usize, FlowError> {
        let Flow {
            scheme,
            momentum,
            pressure,
            heat,
        } = self;
        pressure.find_coefficients(pool, momentum, melt.density, ds);
        momentum.advance(pool, pressure, scheme.convection, ds);
        let speed = momentum.largest_speed() + ds * momentum.largest_acceleration(melt.density);
        let tolerance = scheme.tolerance * speed / pool.stencil.spacing;
        let iterations = pressure.solve(pool, momentum, ds, tolerance)?;
        pressure.apply(pool, momentum, ds);
        heat.advance(melt, pool, &pressure.flux, ds);
        Ok(iterations)
    }
}
