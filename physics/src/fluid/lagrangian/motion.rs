//! How points that carry their mass are displaced in a step.
//!
//! 1. Points collide with walls that they would penetrate, and with points that would come too close.
//! 2. They are displaced with their velocities; XSPH and shifting keep them in order.
//! 3. Points that have crossed a face are put back into the box.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Read, SlotField, World};

use super::collision::FluidPoints;
use super::least_distance::DistantPoints;
use super::{LagrangianForm, LagrangianPoints, Moving};
use crate::fluid::boundaries::keep_inside;
use crate::fluid::medium::Medium;
use crate::fluid::treatments::{Around, Treatments};

/// What a displacement takes into account.
pub(crate) struct MotionStep<'a> {
    pub(crate) world: &'a World,
    pub(crate) body: BodyIndex,
    pub(crate) medium: &'a Medium,
    pub(crate) pressure: Read<f64>,
    /// How the velocity continues behind faces.
    pub(crate) rules: &'a [LayerRule],
    /// Components of the velocity by slot, as last set, m/s.
    pub(crate) slots: &'a [SlotField],
    /// s.
    pub(crate) dt: f64,
}

impl LagrangianPoints {
    /// Displaces the points with their velocities (m/s), which collisions and faces change.
    pub(crate) fn displace(
        &mut self,
        step: &MotionStep<'_>,
        treatments: &mut Treatments,
        velocity: &mut [Vector3<f64>],
    ) {
        let mut displacement = step.world.write(self.displacement);
        if let Some(moving) = &self.moving {
            moving.collide_with_walls(&mut self.form, step, velocity);
        }
        if let Some(moving) = &self.moving {
            self.keep_distance(moving, step, velocity);
        }
        let points = displacement.iter_mut().zip(&*velocity);
        points.for_each(|(u, v)| *u += step.dt * v);
        let Some(Moving { arrangement, .. }) = &self.moving else {
            return;
        };
        let around = Around {
            family: self.rates().family(),
            medium: step.medium,
        };
        if arrangement.xsph > 0.0 {
            let fraction = arrangement.xsph * step.dt;
            treatments.xsph(around.family, fraction, step.slots, &mut displacement);
        }
        if arrangement.shifting > 0.0 {
            let fraction = arrangement.shifting * step.dt;
            treatments.shift(around, self.walls(), fraction, velocity, &mut displacement);
        }
        let body = step.world.body(step.body);
        keep_inside(body, step.rules, &mut displacement, velocity);
    }

    /// Lets points that would come too close to each other collide.
    fn keep_distance(&self, moving: &Moving, step: &MotionStep<'_>, velocity: &mut [Vector3<f64>]) {
        let least_distance = moving.arrangement.least_distance;
        if least_distance == 0.0 {
            return;
        }
        let body = step.world.body(step.body);
        let now = step.world.configuration(step.body);
        let points = DistantPoints {
            body,
            family: self.rates().family(),
            rules: step.rules,
            position: now.positions(),
            mass: &moving.mass,
            distance: least_distance * body.finest_spacing(),
            dt: step.dt,
        };
        points.keep(velocity);
    }
}

impl Moving {
    /// Lets points that would penetrate walls collide with them.
    fn collide_with_walls(
        &self,
        form: &mut LagrangianForm,
        step: &MotionStep<'_>,
        velocity: &mut [Vector3<f64>],
    ) {
        let LagrangianForm::Conservative(rates) = form else {
            return;
        };
        let Some(rule) = rates.keys.collisions else {
            return;
        };
        let points = FluidPoints {
            velocity,
            mass: &self.mass,
            pressure: &step.world.read(step.pressure),
            rule,
            dt: step.dt,
        };
        rates.walls.collide(step.world, step.body, points);
    }
}
