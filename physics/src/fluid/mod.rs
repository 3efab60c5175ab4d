//! Laminar flow of a weakly compressible Newtonian fluid, by the peridynamic differential operator.
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
//! Not for: turbulence, surface tension.

mod boundaries;
mod collision;
mod conservative;
mod convection;
mod differences;
mod fluxes;
mod immersed;
mod interface;
mod keys;
#[cfg(test)]
mod keys_tests;
mod least_distance;
mod medium;
mod point_motion;
#[cfg(test)]
mod point_motion_tests;
mod prepare;
mod rates;
mod report;
mod run;
#[cfg(test)]
mod stability_tests;
mod state;
mod step;
#[cfg(test)]
mod tests;
mod treatments;
mod wall_motion;
mod walls;

pub use crate::advection::Convection;
pub use collision::Collisions;
pub use keys::{Fluid, Form, Scheme, Stress, Surface};
pub use perimelt_core::Description;
pub use state::{State, Tait};

use perimelt_core::keys as core_keys;
use perimelt_core::plugin::check_length;
use perimelt_core::{
    Balance, PddoError, Physics, PhysicsReport, Read, RunError, RunningPhysics, Setup, SetupError,
    Step, Stepping, Work, World,
};

use immersed::LARGEST_DISPLACEMENT;
use nalgebra::Vector3;
use point_motion::{LEAST_DISTORTION, PointMotion};
use rates::Stability;
use run::FluidRun;
use serde::{Deserialize, Serialize};
use wall_motion::WallMotion;
use walls::Walls;

/// Steps after which the stable step of points that move is found again.
const STEPS_BETWEEN_LIMITS: u64 = 64;

#[typetag::serialize(name = "fluid")]
impl Physics for Fluid {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.publish(body, self.description)
    }

    fn prepare(
        self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningPhysics>, SetupError> {
        setup.stepping(Stepping {
            step: self.step,
            ..Stepping::default()
        });
        Ok(Box::new(self.ready(setup)?))
    }
}

impl Fluid {
    fn ready(self, setup: &mut Setup<'_>) -> Result<RunningFluid, SetupError> {
        let run = FluidRun::prepare(&self, setup)?;
        Ok(RunningFluid { keys: self, run })
    }
}

perimelt_core::register_physics!("fluid", Fluid, supports: [Motion, Flow]);

/// A fluid that flows.
struct RunningFluid {
    keys: Fluid,
    run: FluidRun,
}

impl RunningPhysics for RunningFluid {
    /// Density from the pressure at the start.
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = &mut self.run;
        run.complete_state(world);
        run.weigh_points(world);
        run.initial_mass = run.mass(world);
        if run.momentum.is_some() {
            run.momentum = Some([
                run.momentum_now(world, |v| *v),
                Vector3::zeros(),
                Vector3::zeros(),
            ]);
        }
        if run.angular_momentum.is_some() {
            let now = run.angular_momentum_now(world, |x, v| x.cross(v));
            run.angular_momentum = Some([now, Vector3::zeros(), Vector3::zeros()]);
        }
        run.set_configuration(world).map_err(|e| failed(e, 0.0))?;
        if run.moving.is_some() {
            run.rates.follow_walls(world, run.body, 0.0);
            run.update_stability();
        }
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        if self.run.stable_step.is_none() {
            self.run.stable_step = Some(self.find_stable_step(world));
        }
        self.run.stable_step
    }

    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        let reference = &self.run.medium.reference_density;
        if field == core_keys::VELOCITY.name {
            let lightest = reference.iter().copied().fold(f64::INFINITY, f64::min);
            let limit = 10.0 * self.keys.state.sound_speed(lightest);
            let velocity = Read::from(self.run.velocity);
            return (largest > limit).then(|| world.first_beyond(velocity, limit))?;
        }
        let limit = 10.0 * reference.iter().copied().fold(0.0, f64::max);
        let is_beyond = field == core_keys::DENSITY.name && largest > limit;
        let density = Read::from(self.run.density);
        is_beyond.then(|| world.first_beyond(density, limit))?
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = &mut self.run;
        let done = run.advance(&self.keys, world, step);
        let moves = run.moving.is_some() || run.rates.motion().is_some();
        let is_due = moves && run.steps.is_multiple_of(STEPS_BETWEEN_LIMITS);
        if is_due {
            run.update_stability();
            run.stable_step = None;
        }
        done.map_err(|e| failed(e, step.end()))?;
        self.check_distortion(world, step.end())?;
        self.check_displacement(world, step.end())?;
        Ok(Work::of_stages(1))
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        self.run.balances(world)
    }

    fn report(&self, _world: &World) -> PhysicsReport {
        self.run.reports().into()
    }

    fn observe(&mut self, world: &World, _time: f64) -> Result<(), RunError> {
        self.run.observe(world);
        Ok(())
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let run = &self.run;
        Box::new(SavedFluid {
            initial_mass: run.initial_mass,
            momentum: run.momentum,
            angular_momentum: run.angular_momentum,
            steps: run.steps,
            stability: run.stability,
            mass: run.moving.as_ref().map(|m| m.mass.clone()),
            walls: run
                .rates
                .walls()
                .map(|walls| walls.motions().into_iter().cloned().collect()),
            fullness: run.rates.fullness().map(|fullness| fullness.to_vec()),
            displacement: run.rates.motion().map(|motion| motion.state().to_vec()),
        })
    }

    fn load(
        &mut self,
        world: &World,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = &mut self.run;
        let saved: SavedFluid = erased_serde::deserialize(state)?;
        run.initial_mass = saved.initial_mass;
        run.momentum = saved.momentum;
        run.angular_momentum = saved.angular_momentum;
        run.steps = saved.steps;
        run.stability = saved.stability;
        run.stable_step = None;
        if let (Some(moving), Some(mass)) = (&mut run.moving, saved.mass) {
            check_length("masses", mass.len(), moving.mass.len())?;
            moving.mass = mass;
        }
        if let (Some(walls), Some(motions)) = (run.rates.walls_mut(), saved.walls) {
            walls.set_motions(motions);
        }
        if let (Some(motion), Some(displacement)) = (run.rates.motion_mut(), saved.displacement) {
            check_length("displacements", displacement.len(), motion.state().len())?;
            motion.set_state(displacement);
        }
        if let (Some(own), Some(fullness)) = (run.rates.fullness(), &saved.fullness) {
            check_length("fullness", fullness.len(), own.len())?;
        }
        if let Some(fullness) = saved.fullness {
            run.rates.set_fullness(fullness);
        }
        run.set_configuration(world)
            .map_err(serde::de::Error::custom)
    }
}

/// The state that is saved with checkpoints.
#[derive(Serialize, Deserialize)]
struct SavedFluid {
    initial_mass: f64,
    momentum: Option<[Vector3<f64>; 3]>,
    angular_momentum: Option<[Vector3<f64>; 3]>,
    steps: u64,
    stability: Stability,
    /// Masses of points that move, kg.
    mass: Option<Vec<f64>>,
    walls: Option<Vec<WallMotion>>,
    fullness: Option<Vec<f64>>,
    /// Displacements of points that follow walls, m.
    displacement: Option<Vec<Vector3<f64>>>,
}

fn failed(cause: PddoError, time: f64) -> RunError {
    RunError::Plugin {
        plugin: "fluid".into(),
        time,
        cause: cause.into(),
    }
}

/// A wall has left the place that it has for a fluid whose points rest.
#[derive(Debug, thiserror::Error)]
#[error(
    "body `{wall}` moves by {moved:.3e} m along its normal; for an Eulerian fluid walls keep their reference shape, and a \
     displacement may be up to {allowed:.3e} m, half a spacing of body `{fluid}`: choose `description = \
     \"arbitrary_lagrangian_eulerian\"` or `\"updated_lagrangian\"`, or a coarser fluid"
)]
struct WallHasLeft {
    wall: String,
    fluid: String,
    /// m.
    moved: f64,
    /// m.
    allowed: f64,
}

/// Points that follow walls can no longer do so.
#[derive(Debug, thiserror::Error)]
#[error(
    "the points of body `{fluid}` near {place:?} m are distorted until they fold, because the walls that they follow have moved too \
     far: choose `description = \"updated_lagrangian\"`, or keep displacements and rotations of the walls smaller"
)]
struct PointsFold {
    fluid: String,
    /// Reference position, m.
    place: [f64; 3],
}

impl RunningFluid {
    /// Refuses to go on where points that follow walls are about to fold.
    fn check_distortion(&self, world: &World, time: f64) -> Result<(), RunError> {
        let run = &self.run;
        let Some((least, point)) = run.rates.motion().map(PointMotion::distortion) else {
            return Ok(());
        };
        if least >= LEAST_DISTORTION {
            return Ok(());
        }
        let fluid = world.body(run.body);
        let cause = PointsFold {
            fluid: fluid.name.clone(),
            place: fluid.points.position[point].into(),
        };
        Err(RunError::Plugin {
            plugin: "fluid".into(),
            time,
            cause: cause.into(),
        })
    }

    /// Refuses to go on where a wall has moved too far for points that rest.
    fn check_displacement(&self, world: &World, time: f64) -> Result<(), RunError> {
        let run = &self.run;
        // points that follow walls have a limit of their own
        let walls = run.rates.walls().filter(|_| run.rates.motion().is_none());
        let Some((moved, wall)) = walls.and_then(Walls::largest_displacement) else {
            return Ok(());
        };
        if moved <= LARGEST_DISPLACEMENT {
            return Ok(());
        }
        let fluid = world.body(run.body);
        let spacing = fluid.finest_spacing();
        let cause = WallHasLeft {
            wall: wall.into(),
            fluid: fluid.name.clone(),
            moved: moved * spacing,
            allowed: LARGEST_DISPLACEMENT * spacing,
        };
        Err(RunError::Plugin {
            plugin: "fluid".into(),
            time,
            cause: cause.into(),
        })
    }

    /// Largest step (s) for which sound and viscosity are stable (docs/theory/fluids.md, "Largest step"), for speeds up
    /// to a tenth of that of sound: with the frequency `w = kappa c` of sound and the rate `r = 2 S (nu + D)` of viscosity and
    /// density diffusion, a symplectic step is stable for `dt^2 w^2 + 2 dt r < 4`. In an Eulerian fluid `w` is
    /// `kappa (c + |v|)`; convection in the middle of the step has no limit of its own.
    fn find_stable_step(&self, world: &World) -> f64 {
        let run = &self.run;
        let medium = &run.medium;
        let Stability {
            wave_number,
            laplacian,
        } = run.stability;
        let limit = |(i, &m): (usize, &u16)| {
            let sound = medium.sound_speed(i);
            let passing = self.keys.eulerian_convection().map(|c| (c, 0.1 * sound));
            let speed = passing.map_or(0.0, |(_, speed)| speed);
            let artificial = self.keys.artificial_viscosity * medium.smoothing_length(i) * sound;
            let largest = medium.viscosity.largest(m) / medium.reference_density[i];
            // short waves lack more where the viscosity is small; their rate is that of the Laplacian squared
            let missing = passing.map_or(0.0, |(c, speed)| {
                2.0 * c.missing_diffusivity(speed, medium.spacing[i], laplacian, 0.0)
            });
            let viscosity = largest + artificial + missing;
            let damping = viscosity + self.keys.density_diffusion * medium.sound_diffusivity(i);
            let frequency = wave_number * (sound + speed);
            let rate = 2.0 * laplacian * damping;
            4.0 / (rate + (rate * rate + 4.0 * frequency * frequency).sqrt())
        };
        let points = world.body(run.body).material_of_point.iter().enumerate();
        points.map(limit).fold(f64::INFINITY, f64::min)
    }
}
