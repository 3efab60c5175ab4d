//! Deformation of a thermoelastic solid.
//!
//! Balances (`quasi_static`, `relaxation`) or integrates in time (`explicit`)
//!
//! ```text
//! rho u'' = sum_j T_ij - T_ji + b                               Wang (2025), eq. 3.2
//! ```
//!
//! with force states T that follow the displacement and the eigenstrain (sink fields, from thermal
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
//! | `validity`, `deformation` | warnings of states outside the validity of the model, and how far a body is deformed |
//! | `layer_forces` | forces of bonds to layers that are no symmetric images |
//! | [`solid`], `base` | what the solvers need of a formulation, and what all formulations have |
//! | `nodes` | where the unknown displacement of a formulation lives |
//! | [`plasticity`] | plastic flow: the law [`plasticity::FlowLaw`], and the states of points |
//! | [`law`] | laws of elasticity as plugins |
//! | [`ordinary`], [`stretch`] | bond-based and ordinary state-based solids, their bond kernels and the law [`stretch::BondLaw`] |
//! | [`correspondence`], [`points`] | correspondence solids, and laws of their points |
//! | [`staggered`] | staggered solids: displacements at the corners of cells |
//! | [`fracture`], `exceeding`, [`interfaces`] | breaking bonds; bonds beyond their limits; strength between materials and across interfaces |
//! | `smoothing` | means of prescribed strains over families |
//! | `stress_free` | stress-free strains that vary in space, as seen by the shape tensor |

mod base;
mod classical;
#[cfg(test)]
mod cloud_tests;
mod coarse;
pub mod correspondence;
#[cfg(test)]
mod correspondence_tests;
mod deformation;
mod elastic;
mod energy;
mod energy_watch;
#[cfg(test)]
mod energy_watch_tests;
mod equilibrium;
#[cfg(test)]
mod equilibrium_tests;
mod exceeding;
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
#[cfg(test)]
mod keys_tests;
pub mod laminate;
pub mod law;
mod law_states;
#[cfg(test)]
mod law_tests;
mod layer_forces;
#[cfg(test)]
mod layer_forces_tests;
#[cfg(test)]
mod layer_tests;
pub mod linear;
pub mod moduli;
mod momentum;
#[cfg(test)]
mod momentum_tests;
mod motion;
mod nodes;
pub mod ordinary;
pub mod plasticity;
pub mod points;
mod prepare;
mod reports;
mod residual;
mod rigid;
#[cfg(test)]
mod rigid_motion_tests;
pub mod section;
mod smoothing;
pub mod solid;
mod specialise;
pub mod staggered;
mod step;
mod stress_free;
#[cfg(test)]
mod stress_free_tests;
pub mod stretch;
pub mod surface_stress;
mod surroundings;
#[cfg(test)]
mod tests;
mod validity;
mod variables;

use std::borrow::Cow;

use perimelt_core::keys as core_keys;
use perimelt_core::plugin::check_length;
use perimelt_core::world::{FamilyReach, LoadedFaces};
use perimelt_core::{
    Balance, Physics, PhysicsReport, Report, RunError, RunningPhysics, Setup, SetupError, Step,
    StepSize, Stepping, Work, World,
};

use fracture::SavedFracture;
pub use keys::{Formulation, Kinematics, Mechanical, MechanicalSolver};
use nodes::CornerMotion;
use section::Section;
use serde::{Deserialize, Serialize};
use solid::FailureMode;
use step::{MechanicalRun, MechanicalState};

/// Stretch of a bond that shows an instability once displacements are ten times as large as the body: where its ends have
/// moved so far relative to each other over a chain of bonds as long as the body, bonds have a stretch of eight or more.
const IMPLAUSIBLE_STRETCH: f64 = 5.0;

#[typetag::serialize(name = "mechanical")]
impl Physics for Mechanical {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        if self.formulation() == Formulation::Staggered {
            setup.publish(body, LoadedFaces)?;
        }
        setup.publish(body, FamilyReach(self.horizon()))
    }

    fn prepare(
        self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningPhysics>, SetupError> {
        setup.stepping(Stepping {
            step: self.step,
            update: self.update,
            ..Stepping::default()
        });
        Ok(Box::new(self.ready(setup)?))
    }
}

impl Mechanical {
    fn ready(mut self, setup: &mut Setup<'_>) -> Result<RunningMechanical, SetupError> {
        let run = prepare::run(&mut self, setup)?;
        Ok(RunningMechanical {
            is_explicit: self.solver.damping().is_some(),
            breaks_once: self.fracture.as_ref().is_some_and(|f| f.once),
            solver: self.solver,
            step: self.step,
            sections: self.sections,
            run,
            stable_step: None,
        })
    }
}

perimelt_core::register_physics!("mechanical", Mechanical, supports: [Births, Cuts, Layers, Division]);

/// A body that deforms.
struct RunningMechanical {
    solver: MechanicalSolver,
    step: StepSize,
    is_explicit: bool,
    /// Whether bonds break once in a step of equilibrium.
    breaks_once: bool,
    sections: Vec<Section>,
    run: MechanicalRun,
    /// Largest stable step of the explicit solver, s, once it is found.
    stable_step: Option<f64>,
}

/// The state that is saved with checkpoints.
#[derive(Deserialize)]
struct SavedMechanical {
    state: MechanicalState,
    corners: [Vec<[f64; 3]>; 4],
    seen_compliance: Vec<f64>,
    present: Vec<bool>,
    fresh: Vec<bool>,
    broken: Option<SavedFracture>,
    relieved: Vec<[[f64; 3]; 4]>,
}

/// A [`SavedMechanical`] without copies.
#[derive(Serialize)]
struct SavedMechanicalRef<'a> {
    state: &'a MechanicalState,
    /// Displacement, velocity, force and loads of the corners.
    corners: [Cow<'a, [[f64; 3]]>; 4],
    seen_compliance: Cow<'a, [f64]>,
    present: Cow<'a, [bool]>,
    fresh: Cow<'a, [bool]>,
    broken: Option<SavedFracture>,
    relieved: Cow<'a, [[[f64; 3]; 4]]>,
}

impl RunningPhysics for RunningMechanical {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.run.start(world);
        Ok(())
    }

    /// `2 / omega`, with the highest frequency.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        if self.is_explicit && self.stable_step.is_none() {
            let stable = 2.0 / self.run.largest_frequency(world);
            let largest = match self.step {
                StepSize::Auto => stable,
                StepSize::Fixed(step) => step.min(stable),
            };
            self.run.solid.set_largest_step(largest);
            self.stable_step = Some(stable);
        }
        self.stable_step
    }

    /// A body that flies, and its pieces, may be displaced by any distance; a bond that has become several times as long
    /// is a sign of instability. Rigid motion does not stretch bonds, and broken bonds do not count.
    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        let (min, max) = world.body(self.run.body).bounds();
        // ten times the size of the body
        if field != core_keys::DISPLACEMENT.name || largest <= 10.0 * (max - min).norm() {
            return None;
        }
        self.run.load_displacement(world);
        let deformation = self.run.solid.deformation();
        deformation.find_overstretched(IMPLAUSIBLE_STRETCH)
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = &mut self.run;
        if !step.repeated {
            run.load(world, step);
        }
        let once = self.breaks_once;
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
        run.provide_conjugate_tensor(world);
        if self.is_explicit {
            run.watch_energy(world, step)?;
        }
        Ok(work)
    }

    fn observe(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        let run = &mut self.run;
        if self.is_explicit {
            let energy = run.energy(world);
            run.check_energy(world, time, energy)?;
            run.logged_energy = Some(energy);
        }
        run.provide_conjugate_stress(world);
        run.provide_conjugate_tensor(world);
        run.provide_stress(world);
        run.examine_validity(world);
        run.count_broken_bonds(world);
        for (i, section) in self.sections.iter().enumerate() {
            run.section_forces[i] = section.force(run, world);
        }
        Ok(())
    }

    fn report(&self, world: &World) -> PhysicsReport {
        let run = &self.run;
        let forces = self.sections.iter().zip(&run.section_forces);
        let forces = forces.flat_map(|(s, force)| s.report(*force));
        let broken = run.solid.fracture_state().into_iter().flat_map(|_| {
            let modes = run.solid.failure_modes();
            let bonds = match modes.is_empty() {
                true => run.broken_bonds,
                false => modes.iter().map(|mode| mode.broken).sum(),
            };
            let all = Report::new("bonds.broken", "1", bonds);
            let of_mode = |mode: &FailureMode<'_>| {
                Report::new(format!("bonds.broken.{}", mode.name), "1", mode.broken)
            };
            let modes: Vec<Report> = modes.iter().map(of_mode).collect();
            std::iter::once(all).chain(modes)
        });
        let energies = run.logged_energy.iter().flat_map(|e| e.reports());
        let validity = run.validity.report();
        let others = broken.chain(validity);
        PhysicsReport {
            numbers: forces.chain(others).chain(energies).collect(),
            remarks: run.validity.remarks(world.body(run.body)),
        }
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        match self.is_explicit {
            true => self.run.balances(world),
            false => Vec::new(),
        }
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        let run = &self.run;
        let whole = |rows| world.rows_of_whole(run.body, rows);
        let owned = world.reducer(run.body).owned();
        let nodes = run.node_reducer(world);
        let motion = &run.state.corners;
        let corners = [
            &motion.displacement,
            &motion.velocity,
            &motion.force,
            &motion.loads,
        ];
        Box::new(SavedMechanicalRef {
            state: &run.state,
            corners: corners.map(|values| nodes.whole_of(values.as_chunks().0)),
            seen_compliance: world.whole_of(run.body, &run.state.seen_compliance),
            present: world.whole_of(run.body, &run.state.present),
            fresh: world.whole_of(run.body, &run.state.fresh),
            broken: run
                .solid
                .fracture_state()
                .map(|state| state.saved(owned, whole)),
            relieved: world.whole_of(run.body, &run.solid.base().relieved.modes),
        })
    }

    fn load(
        &mut self,
        world: &World,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = &mut self.run;
        let SavedMechanical {
            mut state,
            corners,
            seen_compliance,
            present,
            fresh,
            broken,
            relieved,
        } = erased_serde::deserialize(state)?;
        let nodes = run.node_reducer(world);
        let [count] = nodes.sum_points(|_| [1.0]);
        let number = |has: bool| if has { count as usize } else { 0 };
        let has_corners = run.nodes().corners().is_some();
        let moves = has_corners && run.fields.velocity.is_some();
        for (values, has) in corners.iter().zip([has_corners, moves, moves, moves]) {
            check_length("motion of corners", values.len(), number(has))?;
        }
        let [displacement, velocity, force, loads] =
            corners.map(|values| nodes.part_of(values).into_flattened());
        state.corners = CornerMotion {
            displacement,
            velocity,
            force,
            loads,
        };
        let broken = match (run.solid.fracture_state(), broken) {
            (Some(own), Some(saved)) => {
                let restored = own.restored(saved, |rows| world.rows_of_part(run.body, rows));
                check_length("broken bonds", usize::from(restored.is_some()), 1)?;
                restored
            }
            _ => None,
        };
        let lengths = [
            ("compliances", seen_compliance.len()),
            ("points with material", present.len()),
            ("fresh points", fresh.len()),
            ("relieved modes", relieved.len()),
        ];
        for (what, length) in lengths.into_iter().filter(|(_, length)| *length > 0) {
            check_length(what, length, world.points_of_whole(run.body))?;
        }
        let points = world.reducer(run.body);
        let relieved = points.part_of(relieved);
        run.state = state;
        run.state.seen_compliance = points.part_of(seen_compliance);
        run.state.present = points.part_of(present);
        run.state.fresh = points.part_of(fresh);
        run.scratch.note_load();
        run.restore_presence();
        run.solid.base_mut().relieved = base::RelievedModes::saved(relieved);
        if let Some(broken) = broken {
            run.solid.replace_fracture_state(broken);
        }
        if let Some(damage) = &run.fields.damage {
            world.replace_broken_pairs(&damage.breaker, run.solid.broken_pairs());
            run.count_broken_bonds(world);
        }
        Ok(())
    }
}
