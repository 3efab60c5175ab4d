//! Laminar flow of a fluid, weakly compressible or incompressible, by sums over bonds.
//!
//! ```text
//! D rho/Dt = -rho div v                                               Gao (2020), eqs. 5.22 to 5.27
//! rho Dv/Dt = -grad p + mu lap v [+ mu/3 grad div v] + 2 eps . grad mu + f    eqs. 5.50, 5.55, 5.44 (corrected)
//! p = B ((rho/rho0)^gamma - 1) + p0,   B = rho0 c^2 / gamma           eqs. 5.34, 5.35
//! ```
//!
//! Derivatives are those of [`Pddo`](perimelt_core::Pddo), of second order; `f` (N/m³) is the sink field `body_force`.
//! Without the term in brackets the flow counts as incompressible, since its divergence is small.
//!
//! A fluid owns momentum and mass. Heat belongs to [`thermal`](crate::thermal) on the same body, after the fluid in the
//! case file, which conducts between the points as they lie now or carries heat with an Eulerian flow. The viscosity
//! may depend on its `temperature`, and friction heats by the coupler `viscous_heat`, from the field `viscous_work`.
//!
//! - *Updated Lagrangian*: points move with the fluid and keep their mass; families and operators are those of the
//!   current configuration, volumes follow from the density (eqs. 5.89 to 5.98, with `V = m / rho` for 5.98). A
//!   point that has crossed a wall is reflected (eq. 6.45), a point that leaves through a periodic side enters at the
//!   other side (eq. 5.117).
//! - *Total Lagrangian*: points move with the fluid, families stay those of the reference configuration. For small
//!   strains, and where nothing changes along the flow.
//! - *Eulerian*: points stay, convective terms are added (eqs. 5.99 to 5.101; the last one lacks the viscosity in the
//!   heat of friction), as fluxes that keep mass and momentum to rounding, with a diffusion of short waves that keeps
//!   the terms stable ([`Convection`]). Where the fluid sticks to a wall, the layers behind it have the curvature of the flow before it.
//! - *Arbitrary Lagrangian-Eulerian*: as Eulerian, with points that follow bodies that are walls; the fluxes are relative to the
//!   points, and the volumes of the points change by the same sums.
//!
//! Every face of the body's box, or of its `tank`, is a `wall`, a plane of `symmetry`, or periodic; in the
//! conservative form it may be open, and the body need not fill it: its other surfaces are free. Behind
//! walls the pressure grows with the weight of the fluid (eq. 5.106, by mirror images: second order). The
//! divergence takes mirror images, too, also where the fluid sticks to the wall: nothing flows through.
//!
//! The speed of sound is a number of the method: pressures, also hydrostatic ones, must stay below a
//! hundredth of `rho0 c^2`. A pressure that alternates from point to point has no gradient in this operator;
//! `density_diffusion` removes it.
//!
//! A fluid that keeps its volume has no sound: its pressure follows from the condition that nothing accumulates anywhere. Two such
//! fluids may share the points, with surface tension between them.
//!
//! Not for: turbulence.

mod boundaries;
mod differences;
mod eulerian;
mod heat;
mod interface_report;
mod keys;
#[cfg(test)]
mod keys_tests;
mod kinds;
mod lagrangian;
mod limits;
mod medium;
mod needs;
mod pair;
mod points;
mod prepare;
mod rates;
mod report;
mod run;
#[cfg(test)]
mod stability_tests;
pub mod state;
mod step;
mod surface_waves;
#[cfg(test)]
mod tests;
mod treatments;
pub mod viscosity;
mod walls;

pub use crate::advection::Convection;
pub use keys::{Fluid, Form, Scheme, Stress, Surface};
pub use lagrangian::collision::Collisions;
pub use pair::Interface;
pub use perimelt_core::Description;

use perimelt_core::world::TwoFluids;
use perimelt_core::{
    Balance, ExpectedGift, LoadError, Physics, PhysicsReport, Prepared, RunError, RunningPhysics,
    SavedState, Setup, SetupError, Step, Stepping, Work, World, keys as core_keys,
};
use serde::{Deserialize, Serialize};

use crate::momentum::Momentum;
use points::{Points, SavedPoints};
use rates::Stability;
use run::{FluidRun, MomentumAccount};
use step::Cause;

/// Steps after which the stable step of points that move is found again.
const STEPS_BETWEEN_LIMITS: u64 = 64;

#[typetag::serialize(name = "fluid")]
impl Physics for Fluid {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let keeps_volume = self.state.law.incompressible().is_some();
        // points that move keep their material
        if let Some(fluids) = self.fluids.as_ref().filter(|_| keeps_volume) {
            let materials = fluids.clone();
            setup.publish(body, TwoFluids { materials })?;
        }
        if keeps_volume {
            setup.publish(body, ExpectedGift::of(&core_keys::CARRIED_HEAT))?;
        }
        setup.publish(body, self.description)
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        setup.stepping(Stepping {
            step: self.step,
            ..Stepping::default()
        });
        Ok(Box::new(FluidRun::prepare(*self, setup)?))
    }
}

perimelt_core::register_physics!("fluid", Fluid, supports: [Motion, Flow]);

impl RunningPhysics for FluidRun {
    /// Density from the pressure at the start.
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.complete_state(world);
        self.check_fraction(world)?;
        self.set_fluxes(world);
        if let Some(projection) = self.points.projection_mut() {
            projection.note_walls(&world.layer_rules(self.fields.velocity_layers));
            projection.weigh(&world.body(self.body).points.volume);
        }
        self.initial_mass = self.mass(world);
        if let Some(MomentumAccount { balanced, .. }) = self.momentum {
            self.momentum = Some(MomentumAccount {
                balanced,
                initial: self.momentum_now(world, balanced),
                given: Momentum::default(),
            });
        }
        let set = self.set_configuration(world);
        set.map_err(|e| failed(e.into(), 0.0))?;
        if let Points::Lagrangian(_) = self.points {
            self.points.follow_walls(world, self.body, 0.0);
            self.update_stability();
        }
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        if self.stable_step.is_none() {
            self.stable_step = Some(self.find_stable_step(world));
        }
        self.stable_step
    }

    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        self.point_beyond_limits(world, field, largest)
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let done = self.take_step(world, step);
        if self.steps.is_multiple_of(STEPS_BETWEEN_LIMITS) {
            self.update_stability();
        }
        done.map_err(|e| failed(self.find_lost_fluid(world).unwrap_or(e), step.end()))?;
        self.check_walls(world, step.end())?;
        Ok(self.work())
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        self.balances(world)
    }

    fn report(&self, _world: &World) -> PhysicsReport {
        self.reports().into()
    }

    fn observe(&mut self, world: &World, _time: f64) -> Result<(), RunError> {
        self.find_reports(world);
        Ok(())
    }

    fn save(&self, _: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(SavedFluid {
            initial_mass: self.initial_mass,
            momentum: self.momentum,
            steps: self.steps,
            stability: self.stability,
            points: self.points.save(),
        })
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        let saved: SavedFluid = erased_serde::deserialize(state)?;
        self.initial_mass = saved.initial_mass;
        self.momentum = saved.momentum;
        self.steps = saved.steps;
        self.stability = saved.stability;
        self.stable_step = None;
        self.points.load(saved.points)?;
        self.set_fluxes(world);
        self.set_configuration(world)
            .map_err(serde::de::Error::custom)
    }
}

/// The state that is saved with checkpoints.
#[derive(Serialize, Deserialize)]
struct SavedFluid {
    initial_mass: f64,
    momentum: Option<MomentumAccount>,
    steps: u64,
    stability: Stability,
    points: SavedPoints,
}

fn failed(cause: Cause, time: f64) -> RunError {
    RunError::Plugin {
        plugin: "fluid".into(),
        time,
        cause,
    }
}
