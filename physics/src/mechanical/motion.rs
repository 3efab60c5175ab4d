//! Motion by velocity Verlet.

use nalgebra::Vector3;
use perimelt_core::solver::{Motion, SolverError};
use perimelt_core::{Step, World};

use super::Run;

impl Run {
    /// Moves the body over `step`; held components keep the displacement that was loaded.
    pub(super) fn move_on(&mut self, world: &World, step: Step) -> Result<usize, SolverError> {
        let body_force = world.read(self.body_force);
        let body_force: &[f64] = bytemuck::cast_slice(&body_force);
        let constraint = world.read(self.constraint);
        let constraint: &[f64] = bytemuck::cast_slice(&constraint);
        let mut displacement = world.write(self.displacement);
        let mut velocity = world.write(self.velocity.expect("owned by the explicit solver"));
        let (rules, volume) = (
            world.layer_rules(self.layers),
            &world.body(self.body).points.volume,
        );

        for (i, inverse) in self.free_inverse_density.iter_mut().enumerate() {
            *inverse = if constraint[i] > 0.0 {
                0.0
            } else {
                1.0 / self.density[i / 3]
            };
        }
        let velocity: &mut [f64] = bytemuck::cast_slice_mut(&mut velocity);
        for (v, c) in velocity.iter_mut().zip(constraint) {
            if *c > 0.0 {
                *v = 0.0;
            }
        }
        let impulse = body_force.chunks_exact(3).zip(volume);
        for (b, volume) in impulse {
            for (impulse, b) in self.state.impulse.iter_mut().zip(b) {
                *impulse += b * volume * step.size;
            }
        }
        let elastic = &mut self.elastic;
        let motion = Motion {
            displacement: bytemuck::cast_slice_mut::<Vector3<f64>, f64>(&mut displacement),
            velocity,
            inverse_mass: &self.free_inverse_density,
        };
        self.state
            .verlet
            .step(step.start, step.size, motion, |_, u, force| {
                elastic.set_displacement(u, &rules);
                elastic.force(force);
                force.iter_mut().zip(body_force).for_each(|(f, b)| *f += b);
                Ok(())
            })?;
        Ok(1)
    }
}
