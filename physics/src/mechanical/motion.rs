//! Motion by velocity Verlet.

use nalgebra::Vector3;
use perimelt_core::solver::reduce::weighted_vectors;
use perimelt_core::solver::{Motion, SolverError};
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::step::Run;

impl Run {
    /// Moves the body over `step`; held components keep the displacement that was loaded.
    pub(super) fn move_points(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        let body_force = self.fields.body_force.map(|b| world.read(b));
        let body_force: &[f64] = body_force
            .as_deref()
            .map_or(&[], |b| bytemuck::cast_slice(b));
        let mut displacement = world.write(self.fields.displacement);
        let mut velocity = world.write(self.fields.velocity.expect("owned by the explicit solver"));
        let (rules, volume) = (
            world.layer_rules(self.layers),
            &world.body(self.body).points.volume,
        );

        let velocity: &mut [f64] = bytemuck::cast_slice_mut(&mut velocity);
        if let Some(hold) = self.fields.hold.filter(|_| !step.repeated) {
            let constraint = world.read(hold.constraint);
            let constraint: &[f64] = bytemuck::cast_slice(&constraint);
            let inverses = self.free_inverse_density.par_chunks_mut(3);
            let points = inverses.zip(velocity.par_chunks_mut(3)).zip(&self.density);
            let points = points.zip(constraint.par_chunks(3)).with_min_len(4096);
            points.for_each(|(((inverse, velocity), density), constraint)| {
                for axis in 0..3 {
                    let free = constraint[axis] == 0.0;
                    inverse[axis] = if free { 1.0 / density } else { 0.0 };
                    velocity[axis] = if free { velocity[axis] } else { 0.0 };
                }
            });
        }
        if let Some(impulse) = self.fields.impulse {
            let impulse = world.read(impulse);
            let impulse: &[f64] = bytemuck::cast_slice(&impulse);
            let total = weighted_vectors(impulse, volume);
            let given = self.state.impulse.iter_mut().zip(total);
            given.for_each(|(given, impulse)| *given += impulse);
            let components = velocity.par_iter_mut().zip(impulse);
            let components = components
                .zip(&self.free_inverse_density)
                .with_min_len(4096);
            components.for_each(|((v, j), inverse)| *v += j * inverse);
        }
        if !body_force.is_empty() {
            let total = weighted_vectors(body_force, volume);
            let impulse = self.state.impulse.iter_mut().zip(total);
            impulse.for_each(|(impulse, force)| *impulse += force * step.size);
        }
        let solid = &mut self.solid;
        let motion = Motion {
            displacement: bytemuck::cast_slice_mut::<Vector3<f64>, f64>(&mut displacement),
            velocity,
            inverse_mass: &self.free_inverse_density,
        };
        self.state
            .verlet
            .step(step.start, step.size, motion, |_, u, force| {
                solid.set_displacement(u, &rules);
                solid.force(force);
                let forces = force.par_iter_mut().zip(body_force);
                forces.with_min_len(4096).for_each(|(f, b)| *f += b);
                Ok(())
            })?;
        Ok(Work::of_stages(1))
    }
}
