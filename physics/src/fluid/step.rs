//! One step of the flow.
//!
//! 1. The work of viscous friction is counted, where somebody reads it.
//! 2. Artificial viscosity slows points that approach each other.
//! 3. Density, pressure and velocity advance in the order of the [`Scheme`]; impulses that other bodies gave belong to
//!    the pressure.
//! 4. Velocity and density are smoothed, in every n-th step.
//! 5. Points that move collide with walls that they would penetrate and with points that come too close, are displaced,
//!    put in order and put back into their box; the configuration of the body is set.

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, Curved, LayerRule};
use perimelt_core::solver::SolverError;
use perimelt_core::{SlotField, Step, World};

use super::keys::{Scheme, Smoothed};
use super::lagrangian::MotionStep;
use super::points::Points;
use super::rates::Terms;
use super::run::{FluidRun, FluidTemperature, StepSettings};
use super::treatments::{Around, Neighbours, Treatments};

/// Why a step fails.
pub(super) type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Fields of the flow during a step.
struct Flow<'a> {
    velocity: &'a mut [Vector3<f64>],
    density: &'a mut [f64],
    pressure: &'a mut [f64],
}

/// What advances them.
struct Advance<'a> {
    points: &'a mut Points,
    treatments: &'a mut Treatments,
    /// Components of the velocity by slot.
    slots: &'a mut [SlotField],
    terms: Terms<'a>,
    settings: StepSettings,
}

impl FluidRun {
    pub(super) fn take_step(&mut self, world: &World, step: Step) -> Result<(), Cause> {
        self.set_viscosity(world);
        self.take_heat(world);
        self.take_interface_pressure(world);
        self.find_surface_force(world);
        self.points.follow_walls(world, self.body, step.size);
        self.advance_flow(world, step)?;
        self.write_fraction(world);
        self.give_heat(world);
        self.steps += 1;
        self.smooth(world);
        self.move_points(world, step.size);
        self.count_momentum(world, step);
        if self.points.projection().is_some() {
            self.stable_step = None;
        }
        Ok(self.set_configuration(world)?)
    }

    /// Evaluates a viscosity that depends on the flow or the temperature at the start of the step.
    fn set_viscosity(&mut self, world: &World) {
        let viscosity = &mut self.medium.viscosity;
        if viscosity.needs_shear_rate() {
            let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
            let rules = world.layer_rules(self.fields.velocity_layers);
            load_velocity(&self.points, &velocity, &rules, &mut self.slots);
            viscosity.find_shear_rates(self.points.rates().family(), &self.slots);
        }
        let material = &world.body(self.body).material_of_point;
        match &self.fields.temperature {
            Some(FluidTemperature { field, curves }) => {
                viscosity.evaluate(material, Some((&world.read(*field), curves)));
            }
            None => viscosity.evaluate(material, None),
        }
        self.points.rates_mut().set_viscosity(&self.medium);
    }

    fn take_interface_pressure(&mut self, world: &World) {
        let projection = self.points.projection_mut();
        if let (Some(pressure), Some(projection)) = (self.fields.interface_pressure, projection) {
            projection.set_interface_pressure(&world.read(pressure));
        }
    }

    /// Finds the force between two fluids whose points move.
    fn find_surface_force(&mut self, world: &World) {
        if let Points::Lagrangian(points) = &mut self.points {
            let temperature = self.fields.interface_temperature.map(|t| world.read(t));
            points.find_surface_force(temperature.as_deref());
        }
    }

    fn write_fraction(&self, world: &World) {
        if let (Some(fraction), Some(projection)) = (self.fields.fraction, self.points.projection())
        {
            projection.copy_fraction(&mut world.write(fraction));
        }
    }

    fn advance_flow(&mut self, world: &World, step: Step) -> Result<(), Cause> {
        let fields = &self.fields;
        let mut velocity = world.write(fields.velocity);
        let mut density = world.write(fields.density);
        let mut pressure = world.write(fields.pressure);
        let rules = world.layer_rules(fields.velocity_layers);
        let force = fields.body_force.map(|f| world.read(f));
        let reference_volume = &world.body(self.body).points.volume;
        let mut advance = Advance {
            points: &mut self.points,
            treatments: &mut self.treatments,
            slots: &mut self.slots,
            terms: Terms {
                medium: &self.medium,
                force: force.as_deref(),
                density_diffusion: self.settings.density_diffusion,
                acceleration_fraction: startup(self.settings.startup, step.middle()),
                rules: &rules,
                dt: step.size,
            },
            settings: self.settings,
        };
        let mut flow = Flow {
            velocity: &mut velocity,
            density: &mut density,
            pressure: &mut pressure,
        };
        advance.set_velocity(&flow);
        if let Some(work) = fields.viscous_work {
            advance.add_viscous_work(reference_volume, &mut world.write(work));
        }
        // while the density is still that of the volumes
        if self.settings.artificial_viscosity > 0.0 {
            advance.artificial_viscosity(&mut flow);
        }
        advance.flow(world, &mut flow)?;
        match &self.points {
            Points::Lagrangian(points) => {
                points.take_up_impulses(world, self.body, &mut velocity);
            }
            Points::Eulerian(points) => points.write_mass_flux(world, &velocity, &density),
        }
        Ok(())
    }

    /// Smooths density and velocity in every n-th step.
    fn smooth(&mut self, world: &World) {
        let smoothing = self.settings.smoothing;
        if smoothing == 0 || !self.steps.is_multiple_of(u64::from(smoothing)) {
            return;
        }
        let mut pressure = world.write(self.fields.pressure);
        let volume = self.points.volumes(&world.body(self.body).points.volume);
        let medium = &self.medium;
        let neighbours = Neighbours {
            family: self.points.rates().family(),
            volume,
            material: &world.body(self.body).material_of_point,
            rules: &world.layer_rules(self.fields.velocity_layers),
        };
        let mut velocity = world.write(self.fields.velocity);
        let mut density = world.write(self.fields.density);
        let smooth = self.treatments.smooth(neighbours, &velocity, &density);
        for (i, smooth) in smooth.iter().enumerate() {
            if self.settings.smoothed == Smoothed::VelocityAndDensity {
                velocity[i] = smooth.xyz();
            }
            medium.change_density(i, smooth.w, &mut density[i], &mut pressure[i]);
        }
    }

    /// Displaces points that move by a step of `dt` (s).
    fn move_points(&mut self, world: &World, dt: f64) {
        match &mut self.points {
            Points::Lagrangian(points) => {
                let step = MotionStep {
                    world,
                    body: self.body,
                    medium: &self.medium,
                    pressure: self.fields.pressure.into(),
                    rules: &world.layer_rules(self.fields.velocity_layers),
                    slots: &self.slots,
                    dt,
                };
                let mut velocity = world.write(self.fields.velocity);
                points.displace(&step, &mut self.treatments, &mut velocity);
            }
            Points::Eulerian(points) => points.write_displacement(world),
        }
    }

    /// Adds what impulses, body force and walls gave to the account of the momentum.
    fn count_momentum(&mut self, world: &World, step: Step) {
        let Some(account) = &mut self.momentum else {
            return;
        };
        let time = step.size * startup(self.settings.startup, step.middle());
        account.give(self.points.received(world, self.body), 1.0);
        if let Some(force) = self.fields.body_force {
            let mut given = [Vector3::zeros(); 2];
            let density = world.read::<f64>(self.fields.density.into());
            let mass = (self.points).masses(&density, &world.body(self.body).points.volume);
            let now = world.configuration(self.body);
            for (i, (f, x)) in world.read(force).iter().zip(now.positions()).enumerate() {
                let force = mass(i) / self.medium.reference_density[i] * f;
                given[0] += force;
                given[1] += x.cross(&force);
            }
            account.give(given, time);
        }
        if let Some(walls) = self.points.walls() {
            account.give(walls.total_force(world), -time);
            account.give(walls.collisions(), 1.0);
        }
    }
}

impl Advance<'_> {
    /// Copies the velocity to slots and passes it to the rates.
    fn set_velocity(&mut self, flow: &Flow<'_>) {
        load_velocity(self.points, flow.velocity, self.terms.rules, self.slots);
        let rates = self.points.rates_mut();
        rates.set_velocity(self.slots, flow.density, &self.terms);
    }

    /// Adds the work of friction per reference volume, J/m³.
    fn add_viscous_work(&mut self, reference_volume: &[f64], work: &mut [f64]) {
        let mut friction = Vec::new();
        let rates = self.points.rates();
        rates.friction(self.terms.medium, &mut friction);
        let volume = self.points.volumes(reference_volume);
        for (i, (work, friction)) in work.iter_mut().zip(friction).enumerate() {
            *work += self.terms.dt * friction * (volume[i] / reference_volume[i]);
        }
    }

    fn artificial_viscosity(&mut self, flow: &mut Flow<'_>) {
        let strength = self.terms.dt * self.settings.artificial_viscosity;
        let around = Around {
            family: self.points.rates().family(),
            medium: self.terms.medium,
        };
        self.treatments.artificial_viscosity(
            around,
            strength,
            self.slots,
            flow.velocity,
            flow.density,
        );
    }

    /// Advances density, pressure and velocity.
    fn flow(&mut self, world: &World, flow: &mut Flow<'_>) -> Result<(), SolverError> {
        let (dt, force) = (self.terms.dt, self.terms.force);
        let scheme = self.settings.scheme;
        let (first, last) = match scheme {
            Scheme::KickDriftKick => (0.5 * dt, 0.5 * dt),
            Scheme::Symplectic | Scheme::Published => (0.0, dt),
        };
        if scheme != Scheme::Symplectic {
            self.points.rates_mut().set_pressure(flow.pressure, force);
        }
        if first > 0.0 {
            self.kick(first, world, flow);
            self.set_velocity(flow);
        }
        let rates = self.points.rates_mut();
        rates.advance_density(&self.terms, flow.density, flow.pressure)?;
        if let Points::Lagrangian(points) = &self.points {
            points.fill_container(self.terms.medium, flow.density, flow.pressure);
        }
        if self.settings.zero_surface_pressure {
            let around = Around {
                family: self.points.rates().family(),
                medium: self.terms.medium,
            };
            self.treatments
                .zero_surface_pressure(around, flow.density, flow.pressure);
        }
        if scheme != Scheme::Published {
            self.points.rates_mut().set_pressure(flow.pressure, force);
        }
        self.kick(last, world, flow);
        Ok(())
    }

    /// Advances the velocity by a time (s), and gives the walls the opposite of what they do.
    fn kick(&mut self, time: f64, world: &World, flow: &mut Flow<'_>) {
        let rates = self.points.rates_mut();
        rates.advance_velocity(&self.terms, time, flow.velocity, flow.density);
        let time = time * self.terms.acceleration_fraction;
        self.points.give_impulses(world, self.slots, time);
    }
}

/// Copies the components of a velocity to slots.
fn load_velocity(
    points: &Points,
    velocity: &[Vector3<f64>],
    rules: &[LayerRule],
    slots: &mut [SlotField],
) {
    let is_carried = points.convection().is_some();
    let family = points.rates().family();
    for (axis, slots) in slots.iter_mut().enumerate() {
        let rules = ByRules(rules, axis);
        let along = |point: usize| velocity[point][axis];
        match is_carried {
            true => slots.load(family, along, Curved(rules)),
            false => slots.load(family, along, rules),
        }
    }
}

/// Fraction of the acceleration at a time, s (Gao (2020), eq. 5.110).
fn startup(duration: f64, time: f64) -> f64 {
    if time >= duration {
        return 1.0;
    }
    0.5 * (((time / duration - 0.5) * std::f64::consts::PI).sin() + 1.0)
}

#[cfg(test)]
mod tests {
    use super::startup;

    /// `(sin(pi (t / T - 1/2)) + 1) / 2` up to the duration T, and 1 from then on.
    #[test]
    fn accelerations_grow_smoothly_from_zero() {
        let third = 0.25;
        for (duration, time, expected) in [
            (0.0, 0.0, 1.0),
            (3.0, 0.0, 0.0),
            (3.0, 1.0, third),
            (3.0, 1.5, 0.5),
            (3.0, 2.0, 1.0 - third),
            (3.0, 3.0, 1.0),
            (3.0, 9.0, 1.0),
        ] {
            let found = startup(duration, time);
            assert!(
                (found - expected).abs() < 1e-12,
                "{duration} {time}: {found}"
            );
        }
    }
}
