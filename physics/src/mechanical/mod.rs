//! Deformation of a thermoelastic solid.
//!
//! Balances (`quasi_static`, `relaxation`) or integrates in time (`explicit`)
//!
//! ```text
//! rho u'' = sum_j T_ij - T_ji + b                               Wang (2025), eq. 3.2
//! ```
//!
//! with force states T that follow the displacement and the eigenstrain (sink field, from thermal
//! expansion), and b the sink field `body_force`, N/m³. Moduli depend on the temperature where the
//! material gives tables. Metal flows plastically by [`plasticity`], bonds break by [`fracture`]. With `linear`
//! kinematics eigenstrains must be small.
//!
//! | file | has |
//! |---|---|
//! | [`keys`] | the keys of the case file |
//! | `fields` | the fields that are read and written |
//! | `prepare` | the solid and the solvers, from the keys |
//! | `step` | a step: loads, solver, plastic state |
//! | `equilibrium`, `motion` | the solvers: statics, explicit motion |
//! | `growth` | material that is deposited or cut off |
//! | `momentum`, `reports` | balances of momentum, and stresses for the log |
//! | `energy`, `energy_watch` | energies of explicit motion, and a watch over them |
//! | `validity` | warnings of states outside the validity of the model |
//! | `layer_forces` | forces of bonds to layers that are no symmetric images |
//! | [`solid`] | what the solvers need of a formulation |
//! | [`ordinary`], [`stretch`] | bond-based and ordinary state-based solids, and their bond kernels |
//! | [`correspondence`] | correspondence solids |
//! | [`fracture`], [`interfaces`] | breaking bonds; strength between materials and across interfaces |
//! | `stress_free` | stress-free strains that vary in space, as seen by the shape tensor |

mod classical;
#[cfg(test)]
mod cloud_tests;
mod coarse;
pub mod correspondence;
#[cfg(test)]
mod correspondence_tests;
mod elastic;
mod energy;
mod energy_watch;
#[cfg(test)]
mod energy_watch_tests;
mod equilibrium;
#[cfg(test)]
mod equilibrium_tests;
mod fields;
pub mod fracture;
#[cfg(test)]
mod fracture_tests;
mod gradient;
mod growth;
#[cfg(test)]
mod interface_tests;
pub mod interfaces;
pub mod keys;
mod layer_forces;
#[cfg(test)]
mod layer_forces_tests;
#[cfg(test)]
mod layer_tests;
pub mod moduli;
mod momentum;
#[cfg(test)]
mod momentum_tests;
mod motion;
pub mod ordinary;
pub mod plasticity;
mod prepare;
mod reports;
mod residual;
mod rigid;
#[cfg(test)]
mod rigid_motion_tests;
pub mod section;
pub mod solid;
mod specialise;
mod step;
mod stress_free;
#[cfg(test)]
mod stress_free_tests;
pub mod stretch;
pub mod surface_stress;
#[cfg(test)]
mod tests;
mod validity;

use perimelt_core::plugin::check_length;
use perimelt_core::{
    Balance, Clock, Physics, Report, RunError, Setup, SetupError, Step, Work, World,
};

use fracture::FractureState;
pub use keys::{Formulation, Kinematics, Mechanical, MechanicalSolver};
use step::State;

/// Stretch of a bond that shows an instability once displacements are ten times as large as the body: where its ends have
/// moved so far relative to each other over a chain of bonds as long as the body, bonds have a stretch of eight or more.
const IMPLAUSIBLE_STRETCH: f64 = 5.0;

#[typetag::serialize(name = "mechanical")]
impl Physics for Mechanical {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        self.run = Some(prepare::run(self, setup)?);
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        run.start(world);
        Ok(())
    }

    fn clock(&self) -> Clock {
        Clock {
            step: self.step,
            update: self.update,
        }
    }

    /// `2 / omega`, with the highest frequency.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_mut().expect("prepared before the start");
        if !matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            return None;
        }
        Some(2.0 / run.largest_frequency(world))
    }

    /// Ten times the size of the body.
    fn plausible(&self, world: &World) -> Vec<(&'static str, f64)> {
        let body = self.run.as_ref().map_or(0, |r| r.body);
        let (min, max) = world.body(body).bounds();
        vec![("displacement", 10.0 * (max - min).norm())]
    }

    /// A body that flies, and its pieces, may be displaced by any distance; a bond that has become several times as long
    /// is a sign of instability. Rigid motion does not stretch bonds, and broken bonds do not count.
    fn find_blow_up(&mut self, world: &World, field: &str, first: usize) -> Option<usize> {
        let run = self.run.as_mut().expect("prepared before the first step");
        if field != "displacement" {
            return Some(first);
        }
        run.load_displacement(world);
        run.solid.find_overstretched(IMPLAUSIBLE_STRETCH)
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = self.run.as_mut().expect("prepared before the first step");
        if !step.repeated {
            run.load(world, step);
        }
        let once = self.fracture.as_ref().is_some_and(|f| f.once);
        let result = match self.solver {
            MechanicalSolver::QuasiStatic { .. } => {
                equilibrium::balance_and_break(run, world, once, |run| {
                    equilibrium::newton(run, world, step)
                })
            }
            MechanicalSolver::Relaxation(_) => {
                equilibrium::balance_and_break(run, world, once, |run| {
                    equilibrium::relax(run, world)
                })
            }
            MechanicalSolver::Explicit { .. } => {
                let done = run.move_points(world, step);
                run.break_bonds(world, 0.0);
                done
            }
        };
        let work = result.map_err(|cause| RunError::Plugin {
            plugin: "mechanical".into(),
            time: step.end(),
            cause: cause.into(),
        })?;
        run.settle(world);
        if run.fields.conjugate_stress_is_read {
            run.provide_conjugate_stress(world);
        }
        if matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            run.watch_energy(world, (step.size, step.end()))?;
        }
        Ok(work)
    }

    fn examine(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the first step");
        match self.solver {
            MechanicalSolver::Explicit { .. } => run.sample_energy(world, time),
            _ => Ok(()),
        }
    }

    fn observe(&mut self, world: &World) {
        let run = self.run.as_mut().expect("prepared before the first step");
        run.provide_conjugate_stress(world);
        run.provide_stress(world);
        run.examine_validity(world);
        if matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            run.logged_energy = Some(run.energy(world));
        }
        for (i, section) in self.sections.iter().enumerate() {
            run.section_forces[i] = section.force(run, world);
        }
    }

    fn report(&self) -> Vec<Report> {
        let run = self.run.as_ref().expect("prepared before the first step");
        let forces = self.sections.iter().zip(&run.section_forces);
        let forces = forces.flat_map(|(s, force)| s.report(*force));
        let broken = run.solid.fracture().map(|fracture| Report {
            name: "bonds.broken".into(),
            unit: "1".into(),
            value: 0.5 * fracture.state.broken.total() as f64,
        });
        let energies = run.logged_energy.iter().flat_map(|e| e.reports());
        let validity = run.validity.report();
        let others = broken.into_iter().chain(validity);
        forces.chain(others).chain(energies).collect()
    }

    fn remarks(&self, world: &World) -> Vec<String> {
        let run = self.run.as_ref().expect("prepared before the end");
        run.validity.remarks(world.body(run.body))
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run.as_ref().expect("prepared before the first step");
        if !matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            return Vec::new();
        }
        run.balances(world)
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let run = self.run.as_ref().expect("prepared before a save");
        Box::new((&run.state, run.solid.fracture().map(|f| &f.state)))
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = self.run.as_mut().expect("prepared before a restart");
        let (state, broken): (State, Option<FractureState>) = erased_serde::deserialize(state)?;
        if let (Some(own), Some(broken)) = (run.solid.fracture(), &broken) {
            let is_own = own.state.broken.is_of_same_family(&broken.broken);
            check_length("broken bonds", usize::from(is_own), 1)?;
            check_length("frozen stress", broken.frozen.len(), own.state.frozen.len())?;
        }
        run.state = state;
        run.scratch.note_load();
        run.restore_presence();
        if let Some(broken) = broken {
            run.solid.replace_fracture_state(broken);
        }
        Ok(())
    }

    fn restored(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_ref().expect("prepared before a restart");
        if let (Some(fracture), Some(damage)) = (run.solid.fracture(), &run.fields.damage) {
            let pairs = fracture.broken_pairs(run.solid.family());
            world.replace_broken_pairs(&damage.breaker, pairs);
        }
        Ok(())
    }
}

perimelt_core::register_physics!("mechanical", Mechanical, supports: [Births, Cuts]);
