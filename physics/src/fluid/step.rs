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
use perimelt_core::family::{ByRules, Curved};
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::{PddoError, SlotField, Step, World};

use super::boundaries::keep_inside;
use super::collision::FluidPoints;
use super::keys::{Fluid, Scheme, Stress, Surface};
use super::least_distance::DistantPoints;
use super::medium::Medium;
use super::rates::{Rates, Terms};
use super::run::{FluidRun, FluidTemperature, Moving};
use super::treatments::Treatments;

/// Fields of the flow during a step.
struct Flow<'a> {
    velocity: &'a mut [Vector3<f64>],
    density: &'a mut [f64],
    pressure: &'a mut [f64],
}

/// What advances them.
struct Advance<'a> {
    rates: &'a mut dyn Rates,
    treatments: &'a mut Treatments,
    /// Components of the velocity by slot.
    slots: &'a mut [SlotField],
    terms: Terms<'a>,
    impulses: Option<Impulses<'a>>,
    /// Of a fluid without free surface.
    container: Option<Container<'a>>,
    /// s.
    dt: f64,
}

/// What a fluid fills.
struct Container<'a> {
    /// Of the points, kg.
    mass: &'a [f64],
    /// m³.
    volume: f64,
}

impl Container<'_> {
    /// Factor of all densities with which the points fill the container.
    fn compression(&self, density: &[f64]) -> f64 {
        sum_of([self.mass, density], |[mass, density]| mass / density) / self.volume
    }
}

/// Impulses that other bodies gave to points that move.
struct Impulses<'a> {
    /// N s/m³ of the reference volume.
    density: &'a [Vector3<f64>],
    /// m³.
    reference_volume: &'a [f64],
    /// kg.
    mass: &'a [f64],
}

impl Impulses<'_> {
    fn take_up(&self, velocity: &mut [Vector3<f64>]) {
        let points = velocity.iter_mut().zip(self.density);
        let points = points.zip(self.reference_volume.iter().zip(self.mass));
        points.for_each(|((v, j), (volume, mass))| *v += j * (volume / mass));
    }
}

impl FluidRun {
    pub(super) fn advance(
        &mut self,
        fluid: &Fluid,
        world: &World,
        step: Step,
    ) -> Result<(), PddoError> {
        self.set_viscosity(world);
        self.rates.follow_walls(world, self.body, step.size);
        self.advance_flow(fluid, world, step);
        self.steps += 1;
        self.smooth(fluid, world);
        self.move_points(fluid, world, step.size);
        self.count_momentum(fluid, world, step);
        self.set_configuration(world)
    }

    /// Evaluates a viscosity that varies from point to point.
    fn set_viscosity(&mut self, world: &World) {
        let viscosity = &mut self.medium.viscosity;
        if let Some(FluidTemperature { field, curves }) = &self.temperature {
            let material = &world.body(self.body).material_of_point;
            viscosity.evaluate(&world.read(*field), material, curves);
        }
        if viscosity.varies {
            self.rates.set_viscosity(&self.medium);
        }
    }

    fn advance_flow(&mut self, fluid: &Fluid, world: &World, step: Step) {
        let mut velocity = world.write(self.velocity);
        let mut density = world.write(self.density);
        let mut pressure = world.write(self.pressure);
        let rules = world.layer_rules(self.velocity_layers);
        let force = self.body_force.map(|f| world.read(f));
        let impulse = self.impulse.map(|j| world.read(j));
        let impulses = impulse.as_deref().zip(self.moving.as_ref());
        let container = self.container.zip(self.moving.as_ref());
        let mut advance = Advance {
            rates: &mut *self.rates,
            treatments: &mut self.treatments,
            slots: &mut self.slots,
            terms: Terms {
                medium: &self.medium,
                force: force.as_deref(),
                density_diffusion: fluid.density_diffusion,
                volume_relaxation: fluid.volume_relaxation,
                compressible: fluid.stress == Stress::Compressible,
                convection: fluid.eulerian_convection(),
                acceleration_fraction: startup(fluid.startup, step.middle()),
                rules: &rules,
                dt: step.size,
            },
            impulses: impulses.map(|(density, moving)| Impulses {
                density,
                reference_volume: &world.body(self.body).points.volume,
                mass: &moving.mass,
            }),
            container: container.map(|(volume, moving)| Container {
                mass: &moving.mass,
                volume,
            }),
            dt: step.size,
        };
        let mut flow = Flow {
            velocity: &mut velocity,
            density: &mut density,
            pressure: &mut pressure,
        };
        advance.set_velocity(&flow);
        if let Some(work) = self.viscous_work {
            let ratio = volume_ratio(&self.moving, &world.body(self.body).points.volume);
            advance.add_viscous_work(ratio, &mut world.write(work));
        }
        // while the density is still that of the volumes
        if fluid.artificial_viscosity > 0.0 {
            let strength = step.size * fluid.artificial_viscosity;
            advance.artificial_viscosity(strength, &mut flow);
        }
        advance.flow(fluid, world, &mut flow);
        if let Some(flux) = self.mass_flux {
            advance.rates.mass_flux(&mut world.write(flux));
        }
    }

    /// Smooths velocity and density in every n-th step.
    fn smooth(&mut self, fluid: &Fluid, world: &World) {
        if fluid.smoothing == 0 || !self.steps.is_multiple_of(u64::from(fluid.smoothing)) {
            return;
        }
        let mut pressure = world.write(self.pressure);
        let volume = match &self.moving {
            Some(moving) => &moving.volume,
            None => &world.body(self.body).points.volume,
        };
        let medium = &self.medium;
        self.treatments.smooth(
            (self.rates.family(), volume),
            &mut world.write(self.velocity),
            &mut world.write(self.density),
            |i, densities| {
                pressure[i] = medium.pressure(i, densities, pressure[i]);
            },
        );
    }

    /// Displaces points that move by a step of `dt` (s).
    fn move_points(&mut self, fluid: &Fluid, world: &World, dt: f64) {
        let Some(displacement) = self.displacement else {
            return;
        };
        let mut displacement = world.write(displacement);
        if let Some(motion) = self.rates.motion() {
            let points = displacement.iter_mut().zip(motion.displacements());
            return points.for_each(|(u, now)| *u = now);
        }
        let mut velocity = world.write(self.velocity);
        if let Some(rule) = fluid.collisions
            && let Some(moving) = &self.moving
        {
            let points = FluidPoints {
                velocity: &mut velocity,
                mass: &moving.mass,
                pressure: &world.read(self.pressure.into()),
                rule,
                dt,
            };
            self.rates.collide(world, self.body, points);
        }
        let rules = world.layer_rules(self.velocity_layers);
        let body = world.body(self.body);
        if fluid.least_distance > 0.0
            && let Some(moving) = &self.moving
        {
            let now = world.configuration(self.body);
            let points = DistantPoints {
                body,
                family: self.rates.family(),
                rules: &rules,
                position: now.positions(),
                mass: &moving.mass,
                distance: fluid.least_distance * body.finest_spacing(),
                dt,
            };
            points.keep(&mut velocity);
        }
        let points = displacement.iter_mut().zip(&*velocity);
        points.for_each(|(u, v)| *u += dt * v);
        if self.moving.is_none() {
            return;
        }
        let family = self.rates.family();
        if fluid.xsph > 0.0 {
            let fraction = fluid.xsph * dt;
            self.treatments
                .xsph(family, fraction, &self.slots, &mut displacement);
        }
        if fluid.shifting > 0.0 {
            let fraction = fluid.shifting * dt;
            let surroundings = (family, self.rates.walls(), &self.medium);
            self.treatments
                .shift(surroundings, fraction, &velocity, &mut displacement);
        }
        keep_inside(body, &rules, &mut displacement, &mut velocity);
    }

    /// Adds what body force and walls gave to the momentum and its moment, where they are balanced.
    fn count_momentum(&mut self, fluid: &Fluid, world: &World, step: Step) {
        if self.momentum.is_none() {
            return;
        }
        let time = step.size * startup(fluid.startup, step.middle());
        if let Some(impulse) = self.impulse {
            let volume = &world.body(self.body).points.volume;
            let now = world.configuration(self.body);
            let mut given = [Vector3::zeros(); 2];
            for ((j, volume), x) in world.read(impulse).iter().zip(volume).zip(now.positions()) {
                given[0] += *volume * j;
                given[1] += x.cross(&(*volume * j));
            }
            self.count_given(given, 1.0);
        }
        let mut given = [Vector3::zeros(); 2];
        if let Some(force) = self.body_force {
            let density = world.read::<f64>(self.density.into());
            let mass = self.mass_of_points(world, &density);
            let now = world.configuration(self.body);
            for (i, (f, x)) in world.read(force).iter().zip(now.positions()).enumerate() {
                let force = mass(i) / self.medium.reference_density[i] * f;
                given[0] += force;
                given[1] += x.cross(&force);
            }
        }
        self.count_given(given, time);
        if let Some(walls) = self.rates.walls() {
            let on_walls = walls.total_force(world);
            let collided = walls.collisions();
            self.count_given(on_walls, -time);
            self.count_given(collided, 1.0);
        }
    }

    /// Adds a force and its moment over a time (s) to what the fluid was given.
    fn count_given(&mut self, given: [Vector3<f64>; 2], time: f64) {
        let accounts = [&mut self.momentum, &mut self.angular_momentum];
        for (account, given) in accounts.into_iter().zip(given) {
            if let Some([_, sum, exchanged]) = account {
                let given = time * given;
                *sum += given;
                *exchanged += given.abs();
            }
        }
    }
}

impl Advance<'_> {
    /// Copies the velocity to slots and passes it to the rates.
    fn set_velocity(&mut self, flow: &Flow<'_>) {
        let velocity = &*flow.velocity;
        for (axis, slots) in self.slots.iter_mut().enumerate() {
            let (family, rules) = (self.rates.family(), ByRules(self.terms.rules, axis));
            let along = |point: usize| velocity[point][axis];
            match self.terms.convection {
                Some(_) => slots.load(family, along, Curved(rules)),
                None => slots.load(family, along, rules),
            }
        }
        self.rates
            .set_velocity(self.slots, flow.density, &self.terms);
    }

    /// Adds the work of friction per reference volume, J/m³.
    fn add_viscous_work(&mut self, volume_ratio: impl Fn(usize) -> f64, work: &mut [f64]) {
        let mut friction = Vec::new();
        self.rates.friction(self.terms.medium, &mut friction);
        for (i, (work, friction)) in work.iter_mut().zip(friction).enumerate() {
            *work += self.dt * friction * volume_ratio(i);
        }
    }

    fn artificial_viscosity(&mut self, strength: f64, flow: &mut Flow<'_>) {
        let fields = (&mut *flow.velocity, &*flow.density);
        let family: (_, &Medium) = (self.rates.family(), self.terms.medium);
        self.treatments
            .artificial_viscosity(family, strength, self.slots, fields);
    }

    /// Advances density, pressure and velocity.
    fn flow(&mut self, fluid: &Fluid, world: &World, flow: &mut Flow<'_>) {
        let (dt, force) = (self.dt, self.terms.force);
        let (first, last) = match fluid.scheme {
            Scheme::KickDriftKick => (0.5 * dt, 0.5 * dt),
            Scheme::Symplectic | Scheme::Published => (0.0, dt),
        };
        if fluid.scheme != Scheme::Symplectic {
            self.rates.set_pressure(flow.pressure, force);
        }
        if first > 0.0 {
            self.kick(first, world, flow);
            self.set_velocity(flow);
        }
        let fields = (&mut *flow.density, &mut *flow.pressure);
        self.rates.advance_density(&self.terms, dt, fields);
        if let Some(container) = &self.container {
            let factor = container.compression(flow.density);
            for (i, (rho, p)) in flow.density.iter_mut().zip(&mut *flow.pressure).enumerate() {
                let before = *rho;
                *rho *= factor;
                *p = self.terms.medium.pressure(i, (before, *rho), *p);
            }
        }
        if fluid.surface == Surface::ZeroPressure {
            let family = (self.rates.family(), self.terms.medium);
            let fields = (&mut *flow.density, &mut *flow.pressure);
            self.treatments.zero_surface_pressure(family, fields);
        }
        if fluid.scheme != Scheme::Published {
            self.rates.set_pressure(flow.pressure, force);
        }
        self.kick(last, world, flow);
        if let Some(impulses) = &self.impulses {
            impulses.take_up(flow.velocity);
        }
    }

    /// Advances the velocity by a time (s), and gives the walls the opposite of what they do.
    fn kick(&mut self, time: f64, world: &World, flow: &mut Flow<'_>) {
        self.rates
            .carry(&self.terms, time, flow.velocity, flow.density);
        self.rates
            .advance_velocity(&self.terms, time, flow.velocity, flow.density);
        let time = time * self.terms.acceleration_fraction;
        self.rates.give_impulses(world, self.slots, time);
    }
}

/// Current volume over reference volume of a point.
fn volume_ratio(moving: &Option<Moving>, reference: &[f64]) -> impl Fn(usize) -> f64 {
    |point| match moving {
        Some(moving) => moving.volume[point] / reference[point],
        None => 1.0,
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
