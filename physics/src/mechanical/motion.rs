//! Motion by velocity Verlet, with an account of the impulses that the body takes up.

use nalgebra::Vector3;
use perimelt_core::body::{Positions, Sizes};
use perimelt_core::family::LayerRule;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::are_equal;
use perimelt_core::solver::{Dynamics, HalfKick, Reducer, SolverError, Verlet, VerletState};
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::energy::work_of;
use super::momentum::{Balanced, Momentum, by_axis, place};
use super::nodes::{CornerMotion, HeldNodes, PointLoads};
use super::solid::{Solid, Wanted};
use super::step::{MechanicalRun, MechanicalState};

impl MechanicalRun {
    /// Moves the body over `step`. Held components keep the displacement that was loaded.
    pub(super) fn move_points(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        self.take_up_impulses(world);
        self.move_nodes(world, step)?;
        self.write_means(world);
        if std::mem::take(&mut self.scratch.has_moved) {
            self.add_half_work_of_held(world);
        }
        Ok(Work::of_stages(1))
    }

    fn move_nodes(&mut self, world: &World, step: Step) -> Result<(), SolverError> {
        if !self.state.verlet.knows_force() {
            self.with_motion(world, |verlet, mut motion, mut dynamics| {
                verlet.find_force(step.start, &mut motion, &mut dynamics)
            })?;
            match self.fields.force {
                Some(force) => world.bring_remote(force),
                None => {
                    let nodes = self.node_reducer(world);
                    nodes.bring(&mut self.state.corners.force);
                }
            }
        }
        self.with_motion(world, |verlet, motion, dynamics| {
            verlet.step(step.start, step.size, motion, dynamics)
        })
    }

    /// Passes the state of motion and the forces to `act`.
    fn with_motion<R>(
        &mut self,
        world: &World,
        act: impl FnOnce(&mut Verlet, VerletState<'_>, SolidDynamics<'_>) -> R,
    ) -> R {
        let (nodes, body) = (self.nodes().clone(), world.body(self.body));
        let reducer = self.node_reducer(world);
        let rules = world.layer_rules(self.layers);
        let sinks = self.fields.loads(world);
        let loads = sinks.of_points(&rules);
        let body_force = nodes.loads(loads, &self.state.present, &mut self.loads);
        let mut displacement = world.write(self.fields.displacement);
        let velocity = self.fields.velocity.expect("owned by the explicit solver");
        let mut velocity = world.write(velocity);
        let [mut force, mut loaded] =
            [self.fields.force, self.fields.loads_in_force].map(|f| f.map(|f| world.write(f)));
        let MechanicalState {
            corners,
            watch,
            has_loads_in_force,
            verlet,
            external_force,
            given,
            ..
        } = &mut self.state;
        let motion = VerletState {
            displacement: nodes.values_mut(&mut displacement, &mut corners.displacement),
            velocity: nodes.values_mut(&mut velocity, &mut corners.velocity),
            force: nodes.values_mut(force.as_deref_mut().unwrap_or_default(), &mut corners.force),
            inverse_mass: &self.free_inverse_density,
        };
        let loaded = nodes.values_mut(
            loaded.as_deref_mut().unwrap_or_default(),
            &mut corners.loads,
        );
        let (positions, volumes) = (nodes.positions(body), nodes.volumes(body));
        let mut loads = LoadsInForce {
            now: body_force,
            before: loaded,
            has_before: has_loads_in_force,
            has_changed: false,
            work: &mut watch.work,
        };
        loads.begin(&reducer, volumes, motion.displacement);
        let dynamics = SolidDynamics {
            rules: &rules,
            positions,
            volumes,
            reducer: &reducer,
            density: &self.node_density,
            inverse_density: &self.free_inverse_density,
            balanced: self.balanced,
            has_held_nodes: self.fields.hold.is_some() || nodes.corners().is_some(),
            has_layers: self.solid.base().family().has_layers(),
            solid: &mut *self.solid,
            loads,
            external_force,
            given,
        };
        act(verlet, motion, dynamics)
    }

    /// Adds the momentum of the sink `impulse` to the velocities of free components.
    fn take_up_impulses(&mut self, world: &World) {
        let (Some(impulse), Some(velocity)) = (self.fields.impulse, self.fields.velocity) else {
            return;
        };
        let (nodes, body) = (self.nodes().clone(), world.body(self.body));
        let reducer = self.node_reducer(world);
        let impulse = world.read(impulse);
        let impulse = PointLoads {
            force: &impulse,
            ..PointLoads::default()
        };
        let impulse = nodes.loads(impulse, &self.state.present, &mut self.loads);
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let CornerMotion {
            displacement: of_corners,
            velocity: velocity_of_corners,
            ..
        } = &mut self.state.corners;
        let displacement = nodes.values(&displacement, of_corners);
        let (positions, volumes) = (nodes.positions(body), nodes.volumes(body));
        let inverse = &self.free_inverse_density[..];
        self.state.given += Momentum::sum(self.balanced, &reducer, |i| {
            let x = place(&positions.at(i), &displacement[3 * i..3 * i + 3]);
            let free = |axis: usize| inverse[3 * i + axis] != 0.0;
            let impulse_on = |axis: usize| match free(axis) {
                true => volumes[i] * impulse[3 * i + axis],
                false => 0.0,
            };
            [x, by_axis(impulse_on)]
        });
        let mut velocity = world.write(velocity);
        let velocity = nodes.values_mut(&mut velocity, velocity_of_corners);
        let before = &*velocity;
        self.state.watch.work += reducer.sum_points(|i| {
            let of_component = |n: usize| {
                let (j, v) = (impulse[n], before[n]);
                j * (v + 0.5 * j * inverse[n])
            };
            let free = (3 * i..3 * i + 3).filter(|n| inverse[*n] != 0.0);
            [volumes[i] * free.map(of_component).sum::<f64>()]
        })[0];
        let components = velocity.par_iter_mut().zip(impulse).zip(inverse);
        let components = components.with_min_len(4096);
        components.for_all(|((v, j), inverse)| *v += j * inverse);
    }

    /// Stops components that are held anew or move, before they take the displacement at which they are held. Whether
    /// there are any.
    pub(super) fn stop_held_nodes(
        &mut self,
        world: &World,
        held: HeldNodes<'_>,
        duration: f64,
    ) -> bool {
        let Some(velocity) = self.fields.velocity else {
            return true;
        };
        let mut velocity = world.write(velocity);
        let mut of_corners = std::mem::take(&mut self.state.corners.velocity);
        let velocity = self.nodes().values_mut(&mut velocity, &mut of_corners);
        let changes = self.holding_changes(world, held, velocity);
        if changes {
            self.state.external_force = None;
            let given = self.impulse_of_holding(world, held, velocity, duration);
            self.state.given += given;
            let components = self.free_inverse_density.par_iter_mut();
            let components = components.zip(velocity.par_iter_mut()).enumerate();
            let (density, count) = (&self.node_density, held.count);
            let components = components.with_min_len(4096);
            components.for_all(|(n, (inverse, velocity))| {
                let free = count[n] == 0.0 && density[n / 3] > 0.0;
                *inverse = if free { 1.0 / density[n / 3] } else { 0.0 };
                *velocity = if free { *velocity } else { 0.0 };
            });
        }
        self.state.corners.velocity = of_corners;
        changes
    }

    /// Whether components are held or let go that were not, or held ones move.
    fn holding_changes(&self, world: &World, held: HeldNodes<'_>, velocity: &[f64]) -> bool {
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let corners = &self.state.corners.displacement;
        let displacement = self.nodes().values(&displacement, corners);
        let HeldNodes { count, sum } = held;
        let (inverse, density) = (&self.free_inverse_density[..], &self.node_density[..]);
        let changes = |n: usize| {
            if density[n / 3] == 0.0 {
                return false;
            }
            let is_held = count[n] > 0.0;
            let moves = || velocity[n] != 0.0 || sum[n] / count[n] != displacement[n];
            is_held != (inverse[n] == 0.0) || (is_held && moves())
        };
        let components = (0..inverse.len()).into_par_iter();
        let here = components.with_min_len(4096).any(changes);
        self.node_reducer(world).any(here)
    }

    /// Change of momentum and of its moment when the held components stop and their displacement jumps to the held
    /// one, in a step of `duration` (s).
    fn impulse_of_holding(
        &self,
        world: &World,
        held: HeldNodes<'_>,
        velocity: &[f64],
        duration: f64,
    ) -> Momentum {
        let at_forces =
            |forces: [&[f64]; 2]| self.impulse_at_forces(world, held, velocity, (duration, forces));
        if self.solid.base().family().has_layers() {
            return at_forces([&[], &[]]);
        }
        self.with_loads_in_force(world, |loads| {
            let known = self.with_force(world, |force| at_forces([force, loads]));
            known.unwrap_or_else(|| at_forces([&[], &[]]))
        })
    }

    /// [`MechanicalRun::impulse_of_holding`] with the forces and the body forces in them (N/m³, by component), empty where they are
    /// not known.
    fn impulse_at_forces(
        &self,
        world: &World,
        held: HeldNodes<'_>,
        velocity: &[f64],
        (duration, [force, loads]): (f64, [&[f64]; 2]),
    ) -> Momentum {
        let HeldNodes { count, sum } = held;
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (nodes, body) = (self.nodes(), world.body(self.body));
        let displacement = nodes.values(&displacement, &self.state.corners.displacement);
        let (positions, volumes) = (nodes.positions(body), nodes.volumes(body));
        let density = &self.node_density;
        // The forces of the first half kick were evaluated before the jump, and their moments cancel there.
        let bond_force = |component: usize| match force.get(component) {
            Some(force) => force - loads.get(component).unwrap_or(&0.0),
            None => 0.0,
        };
        let is_held = |n: usize| count[n] > 0.0 && density[n / 3] > 0.0;
        let jump = |n: usize| match is_held(n) {
            true => sum[n] / count[n] - displacement[n],
            false => 0.0,
        };
        let stop = |n: usize| match is_held(n) {
            true => -volumes[n / 3] * density[n / 3] * velocity[n],
            false => 0.0,
        };
        let reducer = self.node_reducer(world);
        let mut given = Momentum::sum(self.balanced, &reducer, |i| {
            let x = place(&positions.at(i), &displacement[3 * i..3 * i + 3]);
            [x, by_axis(|axis| stop(3 * i + axis))]
        });
        if self.balanced.angular {
            let moved = Momentum::sum(self.balanced, &reducer, |i| {
                let remaining = |axis: usize| {
                    let n = 3 * i + axis;
                    let half_kick = 0.5 * duration * bond_force(n);
                    let momentum = density[i] * velocity[n] + half_kick;
                    volumes[i] * momentum + stop(n)
                };
                let jump = by_axis(|axis| jump(3 * i + axis));
                [jump, by_axis(remaining)]
            });
            given += moved.only_angular();
        }
        given
    }
}

/// The forces on a solid, and the sum of the impulses that its surroundings give to it.
struct SolidDynamics<'a> {
    solid: &'a mut dyn Solid,
    rules: &'a [LayerRule],
    /// m, by node.
    positions: &'a Positions,
    /// m³, by node.
    volumes: &'a Sizes,
    reducer: &'a Reducer,
    /// kg/m³, by node.
    density: &'a [f64],
    /// m³/kg, by component; zero where it is held.
    inverse_density: &'a [f64],
    balanced: Balanced,
    has_held_nodes: bool,
    has_layers: bool,
    loads: LoadsInForce<'a>,
    /// Its sum at the displacement and the force of the moment, if it is known.
    external_force: &'a mut Option<Momentum>,
    given: &'a mut Momentum,
}

/// The body force (N/m³, by component) in the force of the motion.
struct LoadsInForce<'a> {
    /// Empty if there is none.
    now: &'a [f64],
    /// In the last force, if `has_before`.
    before: &'a mut [f64],
    has_before: &'a mut bool,
    has_changed: bool,
    /// Work of loads, J.
    work: &'a mut f64,
}

impl LoadsInForce<'_> {
    fn in_force(&self) -> &[f64] {
        match *self.has_before {
            true => self.before,
            false => &[],
        }
    }

    /// Finds out whether the body force has changed, and adds half of its work at the displacement (m) before the next force.
    fn begin(&mut self, nodes: &Reducer, volumes: &Sizes, displacement: &[f64]) {
        let is_same = are_equal(nodes.own(self.in_force()), nodes.own(self.now));
        self.has_changed = nodes.processes().any(!is_same);
        if self.has_changed {
            *self.work += self.half_work(nodes, volumes, displacement);
        }
    }

    /// Takes the body force into the force at a displacement, m.
    fn take_up(&mut self, nodes: &Reducer, volumes: &Sizes, displacement: &[f64]) {
        if !std::mem::take(&mut self.has_changed) {
            return;
        }
        *self.work += self.half_work(nodes, volumes, displacement);
        *self.has_before = !self.now.is_empty();
        let components = self.before.par_iter_mut().zip(self.now);
        let components = components.with_min_len(4096);
        components.for_all(|(before, now)| *before = *now);
    }

    /// Half of the work of a body force that changes, `-1/2 sum V (b_1 - b_0) . u`, J: that at one end of the step. Zero if there
    /// was none before.
    fn half_work(&self, nodes: &Reducer, volumes: &Sizes, displacement: &[f64]) -> f64 {
        if !*self.has_before || self.now.is_empty() {
            return 0.0;
        }
        let work = |loads: &[f64]| work_of(nodes, volumes, [loads, displacement]);
        0.5 * (work(self.before) - work(self.now))
    }
}

impl Dynamics for SolidDynamics<'_> {
    fn force(&mut self, _: f64, u: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        self.solid.set_displacement(u, self.rules);
        self.solid.evaluate(Wanted::force(force));
        let forces = force.par_iter_mut().zip(self.loads.now);
        forces.with_min_len(4096).for_all(|(f, b)| *f += b);
        self.solid
            .subtract_added_inertia(self.inverse_density, force);
        *self.external_force = None;
        self.loads.take_up(self.reducer, self.volumes, u);
        Ok(())
    }

    fn before_half_kick(&mut self, kick: &HalfKick<'_>) {
        let external = match self.external_force.take() {
            Some(known) => known,
            None => self.external_force(kick),
        };
        *self.given += external.times(kick.duration);
        *self.external_force = Some(external);
        if kick.friction != 0.0 {
            *self.given += self.impulse_of_friction(kick);
        }
    }
}

impl SolidDynamics<'_> {
    /// Sum of the forces of the surroundings (N) and of their moments. Forces of bonds between points cancel; what is
    /// left are body forces, the reaction of held components to their bonds, and the forces of bonds to layers.
    fn external_force(&self, kick: &HalfKick<'_>) -> Momentum {
        let loaded = self.loads.in_force();
        let has_loads = !loaded.is_empty() || self.has_layers;
        if !has_loads && !self.has_held_nodes {
            return Momentum::default();
        }
        let (positions, volumes, has_layers) = (self.positions, self.volumes, self.has_layers);
        let inverse_density = self.inverse_density;
        let external = |component: usize| {
            let force = kick.force[component];
            let is_free = inverse_density[component] != 0.0;
            match (has_layers, is_free) {
                (true, true) => force,
                (true, false) => 0.0,
                (false, true) => loaded.get(component).copied().unwrap_or(0.0),
                (false, false) => loaded.get(component).copied().unwrap_or(0.0) - force,
            }
        };
        Momentum::sum(self.balanced, self.reducer, |i| {
            let x = place(&positions.at(i), &kick.displacement[3 * i..3 * i + 3]);
            [x, by_axis(|axis| volumes[i] * external(3 * i + axis))]
        })
    }

    /// What damping takes.
    fn impulse_of_friction(&self, kick: &HalfKick<'_>) -> Momentum {
        let (positions, volumes, rule) = (self.positions, self.volumes, kick.rule());
        let (density, inverse_density) = (self.density, self.inverse_density);
        let friction = |node: usize, component: usize| {
            let inverse = inverse_density[component];
            if inverse == 0.0 {
                return 0.0;
            }
            let velocity = kick.velocity[component];
            let after = rule(velocity, kick.force[component], inverse);
            -volumes[node] * kick.friction * density[node] * (velocity + after)
        };
        Momentum::sum(self.balanced, self.reducer, |i| {
            let x = place(&positions.at(i), &kick.displacement[3 * i..3 * i + 3]);
            [x, by_axis(|axis| friction(i, 3 * i + axis))]
        })
    }
}
