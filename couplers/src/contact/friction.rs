//! Friction: points stick by springs, or slide.

use nalgebra::Vector3;
use perimelt_core::World;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::{POINTS, RunningContact, Touch};

/// Tangential stiffness over normal stiffness, as usual for grains (Silbert et al. (2001)).
const TANGENTIAL: f64 = 2.0 / 7.0;

/// Springs between a point and those that it touches, by their numbers, m.
pub(super) type Springs = Vec<(u32, [f64; 3])>;

impl RunningContact {
    pub(super) fn load_velocities(&mut self, world: &World) {
        self.velocity.resize(self.pairs.owned(), [0.0; 3]);
        for (side, (_, points)) in self.sides.iter().zip(self.pairs.of_bodies()) {
            let velocity = world.read(side.velocity);
            let own = self.velocity[points].iter_mut().zip(&*velocity);
            own.for_each(|(own, velocity)| *own = (*velocity).into());
        }
        self.pairs.bring(world, &mut self.velocity);
    }

    fn velocity_of(&self, point: usize) -> Vector3<f64> {
        self.velocity[point].into()
    }

    pub(super) fn count_contacts(&mut self, world: &World) {
        let mut contacts = std::mem::take(&mut self.contacts);
        contacts.resize(self.pairs.owned(), [0.0]);
        let points = contacts.par_iter_mut().enumerate().with_min_len(POINTS);
        points.for_all(|(i, [count])| {
            *count = 0.0;
            self.for_each_touch(i, 1.0, |_, _| *count += 1.0);
        });
        self.pairs.bring(world, &mut contacts);
        self.contacts = contacts;
    }

    /// Friction impulse of point j on point i in a step of `dt` (s), N s, and the length of their spring (m) after the step;
    /// `spring` is the length before.
    pub(super) fn friction(
        &self,
        i: usize,
        j: usize,
        touch: &Touch,
        dt: f64,
        spring: Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let across = |vector: Vector3<f64>| vector - touch.normal * touch.normal.dot(&vector);
        let velocity = across(self.velocity_of(i) - self.velocity_of(j));
        let spring = across(spring);
        let inverse = |p: usize| self.contacts[p][0] / self.points[p].mass;
        let stop = velocity / (inverse(i) + inverse(j));
        let of_length = dt * TANGENTIAL * touch.stiffness;
        let sticking = -(stop + spring * of_length);
        let (size, limit) = (sticking.norm(), self.friction_coefficient * touch.impulse);
        // in a step of size zero the normal impulse is zero, too
        if size <= limit || dt == 0.0 {
            return (sticking.cap_magnitude(limit), spring + velocity * dt);
        }
        let sliding = sticking * (limit / size);
        (sliding, sliding / -of_length)
    }
}
