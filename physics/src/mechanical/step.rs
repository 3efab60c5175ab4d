//! A step of a body: loads and moduli, the solver, plastic flow, and breaking bonds.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::LayerRule;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::solver::{Reducer, Verlet};
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{Step, World, Write};
use serde::{Deserialize, Serialize};

use super::classical;
use super::energy::Energy;
use super::energy_watch::{EnergyWatch, Scratch};
use super::equilibrium::Statics;
use super::fields::{Damage, Fields};
use super::fracture::FractureState;
use super::moduli::Moduli;
use super::momentum::{Balanced, Momentum};
use super::nodes::{CornerMotion, Held, HeldCorners, HeldNodes, Nodes};
use super::plasticity::Inelastic;
use super::solid::{PointModuli, PointStates, Solid, StressKind, Wanted};
use super::surface_stress::Extrapolation;
use super::validity::Validity;

/// A body between set-up and the end of the run.
#[derive(Debug)]
pub(super) struct MechanicalRun {
    pub(super) body: BodyIndex,
    pub(super) layers: LayersHandle,
    pub(super) fields: Fields,
    pub(super) solid: Box<dyn Solid>,
    /// kg/m³, by point.
    pub(super) density: Vec<f64>,
    /// kg/m³, by node; zero without material.
    pub(super) node_density: Vec<f64>,
    /// m³/kg, by component of nodes; zero where it is held. For the explicit solver.
    pub(super) free_inverse_density: Vec<f64>,
    /// Volume over mean volume of each component, if points differ; else empty.
    pub(super) relative_volume: Vec<f64>,
    pub(super) statics: Statics,
    /// Three components for each node.
    pub(super) work: Vec<f64>,
    /// Loads of the nodes.
    pub(super) loads: Vec<f64>,
    pub(super) held_corners: HeldCorners,
    /// Sum of the largest eigenstrain and the largest inelastic strain.
    pub(super) eigenstrain_size: f64,
    /// By section, N.
    pub(super) section_forces: Vec<[f64; 3]>,
    /// Broken bonds of the whole body, where they have one mode of failure.
    pub(super) broken_bonds: f64,
    /// Energy of the last logged state, with the explicit solver.
    pub(super) logged_energy: Option<Energy>,
    pub(super) balanced: Balanced,
    /// Working memory of the watch over the energy.
    pub(super) scratch: Scratch,
    /// Extrapolation of stresses to surfaces.
    pub(super) extrapolation: Option<Extrapolation>,
    pub(super) validity: Validity,
    pub(super) state: MechanicalState,
}

/// What a restart needs besides the fields.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct MechanicalState {
    pub(super) verlet: Verlet,
    /// Saved beside the rest.
    #[serde(skip)]
    pub(super) corners: CornerMotion,
    /// Whether there is a body force in the force of the last step.
    pub(super) has_loads_in_force: bool,
    /// Sum of the forces of the surroundings in that force, N, and of their moments, unless points were held anew.
    pub(super) external_force: Option<Momentum>,
    /// Momentum at the start.
    pub(super) initial: Momentum,
    /// What the surroundings gave since the start.
    pub(super) given: Momentum,
    pub(super) watch: EnergyWatch,
    /// Compliance of transformation plasticity that the plastic strain contains, 1/Pa, by point; empty without. Saved beside the rest.
    #[serde(skip)]
    pub(super) seen_compliance: Vec<f64>,
    /// Points that have material in the family, of a body that grows; else empty. Saved beside the rest.
    #[serde(skip)]
    pub(super) present: Vec<bool>,
    /// Points that have not cooled below the annealing temperature since their birth, of a body that grows. Saved beside the rest.
    #[serde(skip)]
    pub(super) fresh: Vec<bool>,
    /// Factors and offsets of the layers in the last step, of a body that grows.
    pub(super) layers: Vec<[[f64; 3]; 2]>,
}

impl MechanicalRun {
    /// Completes the initial state.
    pub(super) fn start(&mut self, world: &World) {
        self.state.present = world.present_points(self.body).unwrap_or_default();
        if let Some(corners) = self.nodes().corners() {
            let (body, symmetry) = (world.body(self.body), world.symmetry(self.body));
            let at_corners = |field: Write<Vector3<f64>>| {
                corners.around_points(body, &symmetry, &world.read::<Vector3<f64>>(field.into()))
            };
            let velocity = self.fields.velocity.map(at_corners).unwrap_or_default();
            self.state.corners = CornerMotion {
                displacement: at_corners(self.fields.displacement),
                force: vec![0.0; velocity.len()],
                loads: vec![0.0; velocity.len()],
                velocity,
            };
        }
        self.set_in_motion(world);
        self.write_means(world);
        let temperature = world.read_if_provided(self.fields.temperature);
        let body = world.body(self.body);
        self.solid.set_points(PointStates {
            moduli: Some(PointModuli::At(body, temperature.as_deref())),
            ..PointStates::default()
        });
        if self.fields.conjugate_stress_is_read {
            self.provide_conjugate_stress(world);
        }
        self.provide_conjugate_tensor(world);
        self.state.initial = self.momentum(world);
    }

    /// Takes the present loads and moduli, and writes held components into `displacement`.
    pub(super) fn load(&mut self, world: &World, step: Step) {
        self.validity.has_begun = true;
        let body = world.body(self.body);
        let temperature = world.read_if_provided(self.fields.temperature);
        let eigenstrain = self.fields.eigenstrain.map(|field| world.read(field));
        self.solid.set_points(PointStates {
            moduli: Some(PointModuli::At(body, temperature.as_deref())),
            eigenstrain: eigenstrain.as_deref(),
            ..PointStates::default()
        });
        let points = world.reducer(self.body);
        let of_eigenstrain = eigenstrain.map_or(0.0, |strain| points.max_abs(&strain));
        self.eigenstrain_size = of_eigenstrain;
        self.load_stress_free(world);
        self.note_loads(world);
        // the strain of births depends on what prescribed strains do to gradients
        if self.follow_activity(world) {
            self.eigenstrain_size = of_eigenstrain;
            self.load_stress_free(world);
        }
        self.load_plasticity(world, temperature.as_deref(), step.size);
        self.load_law(world, step);
        if self.fields.hold.is_some() || self.nodes().corners().is_some() {
            self.with_held(world, |run, held| {
                if run.stop_held_nodes(world, held, step.size) {
                    run.hold_nodes(world, held);
                }
            });
        }
    }

    pub(super) fn nodes(&self) -> &Nodes {
        &self.solid.base().nodes
    }

    /// Sums over the nodes.
    pub(super) fn node_reducer(&self, world: &World) -> Reducer {
        match self.nodes().corners() {
            None => world.reducer(self.body),
            Some(corners) => corners.reducer().clone(),
        }
    }

    /// The force of the last step by component of nodes, N/m³, passed to `look`; `None` if the next step has to evaluate it.
    pub(super) fn with_force<R>(&self, world: &World, look: impl FnOnce(&[f64]) -> R) -> Option<R> {
        let (is_known, corners) = (self.state.verlet.knows_force(), &self.state.corners);
        is_known.then(|| self.with_kept(world, self.fields.force, &corners.force, look))
    }

    /// The body force in the force of the last step by component of nodes, N/m³, passed to `look`; empty if there is none.
    pub(super) fn with_loads_in_force<R>(
        &self,
        world: &World,
        look: impl FnOnce(&[f64]) -> R,
    ) -> R {
        let corners = &self.state.corners;
        match self.state.has_loads_in_force {
            true => self.with_kept(world, self.fields.loads_in_force, &corners.loads, look),
            false => look(&[]),
        }
    }

    /// Passes what is kept by component of nodes to `look`: the field of the points, or that of the corners.
    fn with_kept<R>(
        &self,
        world: &World,
        of_points: Option<Write<Vector3<f64>>>,
        of_corners: &[f64],
        look: impl FnOnce(&[f64]) -> R,
    ) -> R {
        let of_points = of_points.map(|field| world.read(field.into()));
        let of_points = of_points.as_deref().unwrap_or_default();
        look(self.nodes().values(of_points, of_corners))
    }

    /// Passes what holds the nodes to `use_held`.
    fn with_held<R>(
        &mut self,
        world: &World,
        use_held: impl FnOnce(&mut Self, HeldNodes<'_>) -> R,
    ) -> R {
        let hold = self
            .fields
            .hold
            .map(|hold| (world.read(hold.constraint), world.read(hold.displacement)));
        let held = hold
            .as_ref()
            .map_or_else(Held::default, |(count, sum)| Held { count, sum });
        let mut corners = std::mem::take(&mut self.held_corners);
        let rules = world.layer_rules(self.layers);
        let held = self
            .nodes()
            .held(held, &rules, &self.state.present, &mut corners);
        let result = use_held(self, held);
        self.held_corners = corners;
        result
    }

    /// Sets held components of the displacement to the mean of the values at which boundaries hold them. In explicit motion
    /// `work` then has their movement.
    fn hold_nodes(&mut self, world: &World, held: HeldNodes<'_>) {
        let mut corners = std::mem::take(&mut self.state.corners.displacement);
        let mut displacement = world.write(self.fields.displacement);
        let unknowns = self.nodes().values_mut(&mut displacement, &mut corners);
        held.place(unknowns, &mut self.work);
        drop(displacement);
        self.state.corners.displacement = corners;
        if self.fields.velocity.is_some() {
            self.scratch.has_moved = true;
            self.add_half_work_of_held(world);
        }
    }

    /// Brings the motion of corners that other processes own, and sets that of the points to the mean of that of their corners, where these are the
    /// nodes.
    pub(super) fn write_means(&mut self, world: &World) {
        let Nodes::Corners(corners) = self.nodes().clone() else {
            return;
        };
        let CornerMotion {
            displacement,
            velocity,
            force,
            ..
        } = &mut self.state.corners;
        for values in [&mut *displacement, velocity, force] {
            if !values.is_empty() {
                corners.reducer().bring(values);
            }
        }
        corners.mean(displacement, &mut world.write(self.fields.displacement));
        if let Some(field) = self.fields.velocity {
            corners.mean(velocity, &mut world.write(field));
        }
    }

    /// Number of boundaries that hold each component of the displacement; nodes without material count as held.
    pub(super) fn constraints(&mut self, world: &World) -> Vec<f64> {
        let mut constraint = self.with_held(world, |_, held| held.count.to_vec());
        constraint.resize(self.work.len(), 0.0);
        let (nodes, _) = constraint.as_chunks_mut::<3>();
        let present = self.nodes().present(&self.state.present);
        let absent = nodes
            .iter_mut()
            .zip(&*present)
            .filter(|(_, present)| !**present);
        absent.for_each(|(node, _)| *node = [1.0; 3]);
        constraint
    }

    pub(super) fn load_displacement(&mut self, world: &World) {
        let rules = world.layer_rules(self.layers);
        self.set_displacement(world, &rules);
    }

    /// Passes the displacement and the layers to the solid.
    pub(super) fn set_displacement(&mut self, world: &World, rules: &[LayerRule]) {
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let corners = &self.state.corners.displacement;
        let unknowns = self.solid.base().nodes.values(&displacement, corners);
        self.solid.set_displacement(unknowns, rules);
    }

    /// Takes the plastic state from the fields, and the constants of the law at the temperature of each point for a step (s).
    pub(super) fn load_plasticity(
        &mut self,
        world: &World,
        temperature: Option<&[f64]>,
        step: f64,
    ) {
        let (Some(fields), Some(plasticity)) =
            (&self.fields.plastic, self.solid.base_mut().plasticity())
        else {
            return;
        };
        let given = world.read_if_provided(fields.yield_stress);
        let material = &world.body(self.body).material_of_point;
        plasticity.set_conditions(material, temperature, given.as_deref(), step);
        if let Some(compliance) = world.read_if_provided(fields.transformation_compliance) {
            let seen = &mut self.state.seen_compliance;
            seen.resize(compliance.len(), 0.0);
            plasticity.set_transformation(compliance.iter().zip(&*seen).map(|(c, s)| c - s));
            seen.copy_from_slice(&compliance);
        }
        for field in &fields.variables {
            field.load(world, &mut plasticity.states.variables);
        }
        let strains = world.read::<Matrix3<f64>>(fields.strain.into());
        let equivalents = world.read::<f64>(fields.equivalent.into());
        let points = strains.iter().zip(&*equivalents);
        let settled = points.map(|(strain, &equivalent)| Inelastic {
            strain: classical::COMPONENTS.map(|at| strain[at]),
            equivalent,
        });
        plasticity.states.load(settled);
        let points = world.reducer(self.body);
        let settled = plasticity.states.settled()[..points.owned()].iter();
        let strains = settled.map(|s| max_abs(&s.strain));
        self.eigenstrain_size += points.max(strains.fold(0.0, f64::max));
    }

    /// Takes the state of a law of points from the fields, for a step.
    fn load_law(&mut self, world: &World, step: Step) {
        let Some(points) = &mut self.solid.base_mut().law_points else {
            return;
        };
        points.step = step;
        if let Some(orientation) = self.fields.orientation {
            points.set_orientation(&world.read(orientation));
        }
        for field in &self.fields.law_variables {
            field.load(world, &mut points.states);
        }
        points.states.reject();
    }

    /// Accepts the state of a law of points in the trial state.
    fn settle_law(&mut self, world: &World) {
        let Some(points) = &mut self.solid.base_mut().law_points else {
            return;
        };
        points.states.commit();
        for field in &self.fields.law_variables {
            field.store(world, &points.states);
        }
    }

    /// Accepts the plastic flow and the states of the displacement that the solver found, and anneals.
    pub(super) fn settle(&mut self, world: &World) {
        if self.fields.plastic.is_none() && self.fields.law_variables.is_empty() {
            return;
        }
        self.load_displacement(world);
        self.solid.evaluate(Wanted::force(&mut self.work));
        self.settle_law(world);
        if let (Some(fields), Some(plasticity)) =
            (&self.fields.plastic, self.solid.base_mut().plasticity())
        {
            plasticity.settle(&mut world.write(fields.work));
        }
        self.anneal(world);
        let (Some(fields), Some(plasticity)) =
            (&self.fields.plastic, self.solid.base_mut().plasticity())
        else {
            return;
        };
        plasticity.states.reject();
        let (mut strains, mut equivalents) =
            (world.write(fields.strain), world.write(fields.equivalent));
        let points = strains.iter_mut().zip(equivalents.iter_mut());
        for ((strain, equivalent), settled) in points.zip(plasticity.states.settled()) {
            *strain = classical::symmetric(&settled.strain);
            *equivalent = settled.equivalent;
        }
        for field in &fields.variables {
            field.store(world, &plasticity.states.variables);
        }
    }

    fn anneal(&mut self, world: &World) {
        let limit = (self.solid.base_mut().plasticity()).and_then(|p| p.annealing_temperature);
        let Some(temperature) = world.read_if_provided(self.fields.temperature) else {
            return;
        };
        let Some(limit) = limit else {
            return;
        };
        let points = 0..self.density.len();
        let moduli: Vec<Moduli> = points.map(|i| self.solid.base().moduli_of(i)).collect();
        let wanted = Wanted::stress(StressKind::Material);
        let mut stress = self.solid.evaluate(wanted).stress.to_vec();
        self.relieve_fresh(world, &temperature, limit, &moduli, &mut stress);
        if let Some(plasticity) = self.solid.base_mut().plasticity() {
            plasticity.anneal(&temperature, &stress, |i| moduli[i]);
        }
        self.solid
            .relieve_modes(&|point| temperature[point] >= limit);
    }

    /// Breaks the bonds that exceed their limit in the displacement of the last force and whose load is at
    /// least `fraction` of the largest; whether there were any.
    pub(super) fn break_bonds(&mut self, world: &World, fraction: f64) -> bool {
        let Some(Damage {
            field,
            modes,
            breaker,
        }) = &self.fields.damage
        else {
            return false;
        };
        let base = self.solid.base_mut();
        if let Some(fracture) = &mut base.fracture {
            base.points.bring(&mut fracture.excess);
        }
        let breaks = self.solid.break_bonds(fraction, &mut world.write(*field));
        world.break_pairs(breaker, breaks.pairs);
        if breaks.any && !modes.is_empty() {
            for (field, mode) in modes.iter().zip(self.solid.failure_modes()) {
                world.write(*field).copy_from_slice(mode.damage);
            }
        }
        breaks.any
    }

    /// Counts the broken bonds of the whole body, for reports, which one process may make alone.
    pub(super) fn count_broken_bonds(&mut self, world: &World) {
        let here = self
            .solid
            .fracture_state()
            .map_or(0.0, FractureState::count);
        self.broken_bonds = world.reducer(self.body).total_of(here);
    }

    /// An upper bound of the highest frequency in any state of damage, at the stiffest moduli, rad/s.
    pub(super) fn largest_frequency(&mut self, world: &World) -> f64 {
        self.solid.set_points(PointStates {
            moduli: Some(PointModuli::Stiffest(world.body(self.body))),
            ..PointStates::default()
        });
        // that of the intact body, so that a resumed run takes the same steps
        let intact = self
            .solid
            .fracture_state()
            .map(FractureState::before_breaks);
        let state = intact.and_then(|intact| self.solid.replace_fracture_state(intact));
        let rules: Vec<LayerRule> = (world.layer_rules(self.layers).iter())
            .map(LayerRule::homogeneous)
            .collect();
        let largest = self.solid.largest_frequency(&self.density, &rules);
        if let Some(state) = state {
            self.solid.replace_fracture_state(state);
        }
        world.reducer(self.body).max(largest)
    }
}
