//! A step of a body: loads and moduli, the solver, plastic flow, and breaking bonds.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::LayerRule;
use perimelt_core::solver::Verlet;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{Step, World};
use serde::{Deserialize, Serialize};

use super::classical;
use super::energy::Energy;
use super::energy_watch::{EnergyWatch, Scratch};
use super::equilibrium::Statics;
use super::fields::{Damage, Fields};
use super::fracture::FractureState;
use super::moduli::Moduli;
use super::momentum::{Balanced, Momentum};
use super::nodes::{Held, HeldNodes, Nodes};
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
    /// m³/kg, by component; zero where it is held. For the explicit solver.
    pub(super) free_inverse_density: Vec<f64>,
    /// Volume over mean volume of each component, if points differ; else empty.
    pub(super) relative_volume: Vec<f64>,
    pub(super) statics: Statics,
    /// Three components for each node.
    pub(super) work: Vec<f64>,
    /// Sum of the largest eigenstrain and the largest inelastic strain.
    pub(super) eigenstrain_size: f64,
    /// By section, N.
    pub(super) section_forces: Vec<[f64; 3]>,
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
    /// Displacement of the corners of cells by component, m, where these are the nodes; else empty.
    pub(super) corners: Vec<f64>,
    /// The body force in the force that `verlet` carries to the next step, N/m³; empty if there is none.
    pub(super) loaded_body_force: Vec<f64>,
    /// Sum of the forces of the surroundings in that force, N, and of their moments, unless points were held anew.
    pub(super) external_force: Option<Momentum>,
    /// Momentum at the start.
    pub(super) initial: Momentum,
    /// What the surroundings gave since the start.
    pub(super) given: Momentum,
    pub(super) watch: EnergyWatch,
    /// Compliance of transformation plasticity that the plastic strain contains, 1/Pa; empty without.
    pub(super) seen_compliance: Vec<f64>,
    /// Points that have material in the family, of a body that grows; else empty.
    pub(super) present: Vec<bool>,
    /// Points that have not cooled below the annealing temperature since their birth, of a body that grows.
    pub(super) fresh: Vec<bool>,
    /// Factors and offsets of the layers in the last step, of a body that grows.
    pub(super) layers: Vec<[[f64; 3]; 2]>,
}

impl MechanicalRun {
    /// Completes the initial state.
    pub(super) fn start(&mut self, world: &World) {
        self.state.present = world.present_points(self.body).unwrap_or_default();
        if let Some(corners) = self.nodes().corners() {
            let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
            self.state.corners = corners.around_points(&displacement);
        }
        self.set_in_motion(world);
        let temperature = world.read_if_provided(self.fields.temperature);
        let body = world.body(self.body);
        self.solid.set_points(PointStates {
            moduli: Some(PointModuli::At(body, temperature.as_deref())),
            ..PointStates::default()
        });
        if self.fields.conjugate_stress_is_read {
            self.provide_conjugate_stress(world);
        }
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
        let of_eigenstrain = eigenstrain.map_or(0.0, |strain| max_abs(&strain));
        self.eigenstrain_size = of_eigenstrain;
        self.load_stress_free(world);
        // the strain of births depends on what prescribed strains do to gradients
        if self.follow_activity(world) {
            self.eigenstrain_size = of_eigenstrain;
            self.load_stress_free(world);
        }
        self.note_loads(world);
        self.load_plasticity(world, temperature.as_deref(), step.size);
        self.load_law(world, step);
        let is_held_anew = match self.fields.hold {
            Some(hold) => self.stop_held_points(world, hold, step.size),
            None => self.nodes().corners().is_some(),
        };
        if is_held_anew {
            self.hold_nodes(world);
        }
    }

    pub(super) fn nodes(&self) -> &Nodes {
        &self.solid.base().nodes
    }

    /// Passes what holds the nodes, and the displacement of the points, to `use_held`.
    fn with_held<R>(&self, world: &World, use_held: impl FnOnce(HeldNodes<'_>) -> R) -> R {
        let hold = self
            .fields
            .hold
            .map(|hold| (world.read(hold.constraint), world.read(hold.displacement)));
        let held = hold
            .as_ref()
            .map_or_else(Held::default, |(count, sum)| Held { count, sum });
        let rules = world.layer_rules(self.layers);
        use_held(self.nodes().held(held, &rules, &self.state.present))
    }

    /// Sets held components of the displacement to the mean of the values at which boundaries hold them. In explicit motion
    /// `work` then has their movement.
    fn hold_nodes(&mut self, world: &World) {
        let mut work = std::mem::take(&mut self.work);
        let mut corners = std::mem::take(&mut self.state.corners);
        self.with_held(world, |held| {
            let mut displacement = world.write(self.fields.displacement);
            let unknowns = self.nodes().unknowns(&mut displacement, &mut corners);
            held.place(unknowns, &mut work);
        });
        (self.work, self.state.corners) = (work, corners);
        if self.fields.velocity.is_some() {
            self.scratch.has_moved = true;
            self.add_half_work_of_held(world);
        }
    }

    /// Number of boundaries that hold each component of the displacement; nodes without material count as held.
    pub(super) fn constraints(&self, world: &World) -> Vec<f64> {
        let mut constraint = self.with_held(world, |held| held.count.into_owned());
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
        let unknowns = match self.nodes() {
            Nodes::Points => bytemuck::cast_slice(&displacement),
            Nodes::Corners(_) => &self.state.corners[..],
        };
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
        let settled = plasticity.states.settled().iter();
        let strains = settled.map(|s| max_abs(&s.strain));
        self.eigenstrain_size += strains.fold(0.0, f64::max);
    }

    /// Takes the state of a law of points from the fields, for a step.
    fn load_law(&mut self, world: &World, step: Step) {
        let Some(points) = &mut self.solid.base_mut().law_points else {
            return;
        };
        points.step = step;
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
        let Some(Damage { field, breaker }) = &self.fields.damage else {
            return false;
        };
        let breaks = self.solid.break_bonds(fraction, &mut world.write(*field));
        world.break_pairs(breaker, breaks.pairs);
        breaks.any
    }

    /// An upper bound of the highest frequency in any state of damage, at the stiffest moduli, rad/s.
    pub(super) fn largest_frequency(&mut self, world: &World) -> f64 {
        self.solid.set_points(PointStates {
            moduli: Some(PointModuli::Stiffest(world.body(self.body))),
            ..PointStates::default()
        });
        // that of the intact body, so that a resumed run takes the same steps
        let intact = FractureState::intact(self.solid.base().family(), self.density.len());
        let state = self.solid.replace_fracture_state(intact);
        let rules: Vec<LayerRule> = (world.layer_rules(self.layers).iter())
            .map(LayerRule::homogeneous)
            .collect();
        let largest = self.solid.largest_frequency(&self.density, &rules);
        if let Some(state) = state {
            self.solid.replace_fracture_state(state);
        }
        largest
    }
}
