//! A watch that stops a run whose energy grows beyond the work that is done on the body.
//!
//! From sample to sample, the sum of kinetic and elastic energy and the potential of the body force,
//! `H = K + U - sum_i V_i b_i . u_i`, grows by no more than
//!
//! | load | work in a step from 0 to 1 | |
//! |---|---|---|
//! | body force that changes | `-1/2 sum V (b_1 - b_0) . (u_0 + u_1)` | exact |
//! | held components that move by d | `-1/2 sum V (F_0 + F_1) d` | exact |
//! | impulse j | `sum V (j . v + j^2 / 2 rho)` | exact |
//! | eigenstrain e, whose heat follows the deformation | `sum V (de/dt) (-stress conjugate to e)`, less the energy of the lag | see below |
//! | other stress-free strain | `K + U` from S to at most `(sqrt(S) + sqrt(U(de)))^2` | upper bound |
//! | layers that move by c | `K + U` from S to at most `(sqrt(S) + sqrt(U(c)))^2` | upper bound |
//! | moduli that rise by a factor r | `K + U` from S to at most `r S` | upper bound |
//!
//! with the forces F of the time integration, for which velocity Verlet changes `K - dt^2 F^2 / 8 rho` by exactly
//! `(F_0 + F_1) . (u_1 - u_0) / 2`. Upper bounds follow from the triangle inequality of the elastic energy, with `U(de)`
//! the energy of the change in a body whose points stay in place. Plastic flow, breaking bonds and damping lower H, and
//! the smallest bound so far is kept, so that what they took is not given back. Where material is born or cut off, or
//! layers are switched on or off, the ratio of bound and energy is kept.
//!
//! Heat from deformation that is computed after the step feeds the motion: its eigenstrain follows the conjugate stress p
//! one step late, and does the work `sum V de dp` besides the reversible one. That energy has no source. It is subtracted
//! from the work, with a factor above one: otherwise the bound would follow the energy. Bodies with plastic flow have the
//! upper bound instead.
//!
//! H is compared with its bound at the end of the first step, in intervals, and before a state is logged.

use nalgebra::Vector3;
use perimelt_core::{RunError, Step, World};
use serde::{Deserialize, Serialize};

use super::energy::{Energy, work_of};
use super::solid::{EnergyKind, Wanted};
use super::step::MechanicalRun;

/// Steps from sample to sample, each of which costs as much as the forces of a few steps.
const INTERVAL: u64 = 2048;
/// The fraction of kinetic and elastic energy that may exceed the bound. Velocity Verlet keeps an energy near `K + U`,
/// whose modes are off by `1/(1 - (omega dt/2)^2)`: a factor of five at the highest frequency and nine tenths of the
/// stable step. A factor of twenty has no physical source.
const GROWN: f64 = 0.95;
/// Strain whose energy in the whole body is taken for rounding.
const ROUNDING: f64 = 1e-9;
/// Rounding of the sum of works, relative to the potential energy.
const ROUNDING_OF_SUMS: f64 = 1e-9;
/// Factor on the energy that heat gives to the motion because it is late.
const LAG: f64 = 1.25;

/// What is known about the energy of a body, in a checkpoint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct EnergyWatch {
    /// Steps since the start.
    steps: u64,
    pub(super) reference: Option<Reference>,
    /// Bound over energy, of kinetic and elastic energy in the last sample; at most one.
    kept: Option<f64>,
    /// Work of loads in the present step, J.
    pub(super) work: f64,
    /// Square root of the elastic energy of what changed in the present step while the points stayed in place, J^0.5.
    amplitude: f64,
    /// Factors and offsets of the layers in the last step.
    layers: Vec<[[f64; 3]; 2]>,
    /// Whether the fields that the watch keeps are those of a step.
    knows_eigenstrain: bool,
    knows_stress: bool,
}

/// The largest energy that the body may have.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Reference {
    /// Time of the first sample, s.
    time: f64,
    /// Energy at that time, J.
    first: f64,
    /// Bound of the sum of kinetic, elastic and potential energy now, J.
    pub(super) bound: f64,
}

/// What the watch computes anew when it needs it.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// `V d^2 bulk` of each point (J): twice the energy of a unit eigenstrain.
    stiffness: Vec<f64>,
    /// Stress-free strain with components in the last step.
    stress_free: Vec<[f64; 6]>,
    /// By layer and axis, square root of the elastic energy of a unit offset, J^0.5/m.
    of_offset: Vec<[Option<f64>; 3]>,
    /// Whether held components moved in this step: the work array of the run has their displacement.
    pub(super) has_moved: bool,
    /// Whether steps are repeated until heat and deformation agree.
    pub(super) is_repeated: bool,
    /// Whether a step was done, so that a state which is loaded is that of its start.
    has_advanced: bool,
    /// Size of the last step, s.
    step: f64,
}

impl Scratch {
    /// A saved state was loaded.
    pub(super) fn note_load(&mut self) {
        self.is_repeated |= self.has_advanced;
    }
}

/// An energy that grew.
#[derive(Debug, thiserror::Error)]
#[error(
    "the energy of body `{body}` grew to {now:.4e} J without work being done on it: after {first:.4e} J at t = {since:.4e} s, \
     its loads allow {allowed:.4e} J at most; point {point} ({:.4e}, {:.4e}, {:.4e}) m is fastest, at {speed:.4e} m/s. The \
     motion is unstable: {advice}",
    at[0], at[1], at[2]
)]
struct EnergyGrowth {
    body: String,
    now: f64,
    allowed: f64,
    first: f64,
    since: f64,
    point: usize,
    at: [f64; 3],
    speed: f64,
    advice: &'static str,
}

impl EnergyWatch {
    /// Drops the bound for a change of the body whose work is not known; the ratio of bound and energy stays.
    pub(super) fn renew(&mut self) {
        self.reference = None;
    }
}

impl MechanicalRun {
    /// Whether the work of the eigenstrain is summed from the stress conjugate to it, which is known in every step.
    fn knows_conjugate_stress(&self) -> bool {
        self.fields.conjugate_stress_is_read
            && self.fields.eigenstrain.is_some()
            && self.fields.plastic.is_none()
    }

    /// Notes what loads changed since the last step, before the solid takes them.
    pub(super) fn note_loads(&mut self, world: &World) {
        if self.fields.velocity.is_none() {
            return;
        }
        self.scratch.has_advanced = true;
        self.note_layers(world);
        let (Some(eigenstrain), Some(watched)) = (self.fields.eigenstrain, self.fields.watched)
        else {
            return;
        };
        let eigenstrain = &*world.read(eigenstrain);
        let mut before = world.write(watched.eigenstrain);
        if !std::mem::replace(&mut self.state.watch.knows_eigenstrain, true) {
            before.copy_from_slice(eigenstrain);
        }
        if self.knows_conjugate_stress() {
            return;
        }
        self.find_stiffness(world);
        let (stiffness, known) = (&self.scratch.stiffness, &*before);
        let of_point = |i: usize| 0.5 * stiffness[i] * (eigenstrain[i] - known[i]).powi(2);
        let [energy] = world.reducer(self.body).sum_points(|i| [of_point(i)]);
        self.state.watch.amplitude += energy.sqrt();
        before.copy_from_slice(eigenstrain);
    }

    /// Notes the change of the stress-free strain with components.
    pub(super) fn note_stress_free(&mut self, world: &World, strains: &[[f64; 6]]) {
        if self.fields.velocity.is_none() {
            return;
        }
        self.find_stiffness(world);
        let Scratch {
            stiffness,
            stress_free,
            ..
        } = &mut self.scratch;
        if stress_free.len() != strains.len() {
            *stress_free = strains.to_vec();
            return;
        }
        let of_point = |i: usize| {
            let [xx, yy, zz, xy, yz, zx] =
                std::array::from_fn(|c| (strains[i][c] - stress_free[i][c]).powi(2));
            0.5 * stiffness[i] * (xx + yy + zz + 2.0 * (xy + yz + zx))
        };
        let [energy] = world.reducer(self.body).sum_points(|i| [of_point(i)]);
        stress_free.copy_from_slice(strains);
        self.state.watch.amplitude += energy.sqrt();
    }

    /// Energies of the points (J/m³, with the stress conjugate to the eigenstrain (Pa) behind each) at the end of a step.
    /// Adds the work of the eigenstrain in it.
    pub(super) fn energies_after_step(&mut self, world: &World) -> &[[f64; 2]] {
        let wanted = Wanted::energy(EnergyKind::Total);
        let (true, Some(eigenstrain)) = (self.knows_conjugate_stress(), self.fields.eigenstrain)
        else {
            return self.solid.evaluate(wanted).energy;
        };
        let watched = self.fields.watched;
        let watched = watched.and_then(|watched| Some((watched.eigenstrain, watched.stress?)));
        let (Some((before, seen)), true) = (watched, self.state.watch.knows_eigenstrain) else {
            return self.solid.evaluate(wanted).energy;
        };
        let now = &*world.read(eigenstrain);
        let (mut before, mut seen) = (world.write(before), world.write(seen));
        self.find_stiffness(world);
        let stress_before = &*world.read::<f64>(self.fields.conjugate_stress.into());
        let energies = self.solid.evaluate(wanted).energy;
        let watch = &mut self.state.watch;
        if !std::mem::replace(&mut watch.knows_stress, true) {
            seen.copy_from_slice(stress_before);
        }
        let volume = &world.body(self.body).points.volume;
        let (stiffness, strain_before, stress_seen) = (&self.scratch.stiffness, &*before, &*seen);
        let lag = match self.scratch.is_repeated {
            true => 0.0,
            false => 0.5 * LAG,
        };
        let of_point = |i: usize| {
            let (stress, change) = (energies[i][1], now[i] - strain_before[i]);
            let reversible = -0.5 * volume[i] * (stress_before[i] + stress) * change
                + 0.5 * stiffness[i] * (now[i] + strain_before[i]) * change;
            let late = lag * volume[i] * change * (stress - stress_seen[i]);
            [reversible + late, change.abs()]
        };
        let [work, change] = world.reducer(self.body).sum_points(of_point);
        if change > 0.0 {
            watch.work += work;
            before.copy_from_slice(now);
            seen.copy_from_slice(stress_before);
        }
        energies
    }

    fn note_layers(&mut self, world: &World) {
        let rules = world.layer_rules(self.layers);
        let known = &self.state.watch.layers[..];
        if rules
            .iter()
            .map(|r| [r.scale, r.offset])
            .eq(known.iter().copied())
        {
            return;
        }
        let same_scale = rules.iter().map(|r| r.scale).eq(known.iter().map(|k| k[0]));
        if same_scale {
            for layer in 0..rules.len() {
                for axis in 0..3 {
                    let moved =
                        (rules[layer].offset[axis] - self.state.watch.layers[layer][1][axis]).abs();
                    if moved > 0.0 {
                        let of_unit = self.energy_of_offset(world, layer, axis);
                        self.state.watch.amplitude += of_unit * moved;
                    }
                }
            }
        } else {
            self.state.watch.renew();
            self.scratch.of_offset.clear();
        }
        let layers = rules.iter().map(|r| [r.scale, r.offset]);
        self.state.watch.layers.clear();
        self.state.watch.layers.extend(layers);
    }

    /// Square root of the elastic energy of a layer that moves by one metre while all points stay in place, J^0.5/m. Corners
    /// in a face move with it as held ones, whose work is summed.
    fn energy_of_offset(&mut self, world: &World, layer: usize, axis: usize) -> f64 {
        if self.nodes().corners().is_some() {
            return 0.0;
        }
        let rules = world.layer_rules(self.layers);
        self.scratch.of_offset.resize(rules.len(), [None; 3]);
        if let Some(known) = self.scratch.of_offset[layer][axis] {
            return known;
        }
        let mut rules: Vec<_> = rules.iter().map(|r| r.homogeneous()).collect();
        // small, for finite kinematics
        let offset = 1e-6 * self.solid.base().largest_horizon();
        rules[layer].offset[axis] = offset;
        self.work.fill(0.0);
        self.solid.set_displacement(&self.work, &rules);
        let volume = &world.body(self.body).points.volume;
        let wanted = Wanted::energy(EnergyKind::Total);
        let density = self.solid.evaluate(wanted).energy;
        let points = world.reducer(self.body);
        let [energy] = points.sum_points(|i| [volume[i] * density[i][0]]);
        let of_unit = energy.max(0.0).sqrt() / offset;
        self.scratch.of_offset[layer][axis] = Some(of_unit);
        of_unit
    }

    fn find_stiffness(&mut self, world: &World) {
        if !self.scratch.stiffness.is_empty() {
            return;
        }
        let body = world.body(self.body);
        let d = body.dimension as f64;
        let of_point = |(i, volume): (usize, &f64)| {
            let moduli = self.solid.base().moduli_of(i);
            let stiffness = volume * d * d * moduli.bulk * moduli.swelling.powi(2);
            stiffness * self.solid.base().elastic_law.steepest
        };
        let volumes = body.points.volume.iter().enumerate();
        self.scratch.stiffness = volumes.map(of_point).collect();
    }

    /// Adds half of the work that held components do which moved in this step, at the forces before or after it.
    pub(super) fn add_half_work_of_held(&mut self, world: &World) {
        let volume = self.nodes().volumes(world.body(self.body));
        let nodes = self.node_reducer(world);
        let work = self.with_force(world, |force| work_of(&nodes, volume, [force, &self.work]));
        match work {
            Some(work) => self.state.watch.work -= 0.5 * work,
            None => self.state.watch.renew(),
        }
    }

    /// Ends a step, and compares the energy if it is time for a sample.
    ///
    /// # Errors
    /// An energy that grew without work.
    pub(super) fn watch_energy(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let time = step.end();
        self.scratch.step = step.size;
        let stiffening = self.solid.base_mut().take_stiffening();
        let stiffening = world.reducer(self.body).max(stiffening);
        let watch = &mut self.state.watch;
        watch.steps += 1;
        let work = std::mem::take(&mut watch.work);
        let amplitude = std::mem::take(&mut watch.amplitude);
        let is_due = watch.steps.is_multiple_of(INTERVAL);
        let Some(reference) = watch.reference else {
            return self.sample_energy(world, time);
        };
        let mut bound = reference.bound + work;
        if !stiffening.is_finite() {
            watch.renew();
            return self.sample_energy(world, time);
        }
        if amplitude > 0.0 || stiffening > 1.0 {
            let stored = (bound - self.potential(world)).max(0.0);
            bound += ((stored * stiffening).sqrt() + amplitude).powi(2) - stored;
        }
        self.state.watch.reference = Some(Reference { bound, ..reference });
        match is_due {
            true => self.sample_energy(world, time),
            false => Ok(()),
        }
    }

    /// Keeps the ratio of bound and energy before points of the solid, whose displacement is set, become present or absent. The
    /// loads of the step act already.
    pub(super) fn keep_ratio(&mut self, world: &World) {
        let Some(reference) = self.state.watch.reference else {
            return;
        };
        let energy = self.energy_as_set(world);
        let stored = energy.stored();
        if stored > self.negligible_energy(world, &energy) {
            let watch = &mut self.state.watch;
            let before = (reference.bound + watch.work - energy.potential).max(0.0);
            let ratio = (before.sqrt() + watch.amplitude).powi(2) / stored;
            watch.kept = Some(ratio.clamp(0.0, 1.0));
        }
    }

    /// Compares the energy at `time` (s) with its bound.
    ///
    /// # Errors
    /// An energy that grew without work.
    fn sample_energy(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        let energy = self.energy(world);
        self.check_energy(world, time, energy)
    }

    /// Checks the energies of an explicit body now, from the first step on.
    pub(super) fn check_energy(
        &mut self,
        world: &World,
        time: f64,
        energy: Energy,
    ) -> Result<(), RunError> {
        if self.state.watch.steps == 0 {
            return Ok(());
        }
        let stored = energy.stored();
        let negligible = self.negligible_energy(world, &energy);
        // moduli may have changed since the last sample
        self.scratch.stiffness.clear();
        let watch = &mut self.state.watch;
        let Some(reference) = &mut watch.reference else {
            let bound = stored * watch.kept.unwrap_or(1.0) + energy.potential;
            watch.reference = Some(Reference {
                time,
                first: energy.total(),
                bound,
            });
            return Ok(());
        };
        let allowed = reference.bound - energy.potential;
        if stored > negligible {
            reference.bound = reference.bound.min(energy.total());
            watch.kept = Some((allowed / stored).clamp(0.0, 1.0));
        }
        let reference = *reference;
        if (1.0 - GROWN) * stored <= allowed || stored <= negligible {
            return Ok(());
        }
        Err(RunError::Plugin {
            plugin: "mechanical".into(),
            time,
            cause: Box::new(self.growth(world, reference, stored, allowed)),
        })
    }

    /// Noise floor of the energy balance, J: the energy of strains of the size of rounding, the rounding of sums, and the energy that
    /// body forces give to a body at rest in one step, by which the energy of velocity Verlet differs from the exact one.
    fn negligible_energy(&self, world: &World, energy: &Energy) -> f64 {
        let volume = &world.body(self.body).points.volume;
        let of_strain = |i: usize| {
            let moduli = self.solid.base().moduli_of(i);
            [volume[i] * (moduli.lame.abs() + 2.0 * moduli.shear) * ROUNDING * ROUNDING]
        };
        let [of_strains] = world.reducer(self.body).sum_points(of_strain);
        let volume = self.nodes().volumes(world.body(self.body));
        let nodes = self.node_reducer(world);
        let of_loads = self.with_loads_in_force(world, |loads| {
            let (loads, _) = loads.as_chunks::<3>();
            let of_load = |i: usize| {
                let Some(load) = loads.get(i).filter(|_| self.node_density[i] > 0.0) else {
                    return [0.0];
                };
                let square: f64 = load.iter().map(|b| b * b).sum();
                [0.5 * self.scratch.step.powi(2) * volume[i] * square / self.node_density[i]]
            };
            nodes.sum_points(of_load)[0]
        });
        of_strains + of_loads + ROUNDING_OF_SUMS * energy.potential.abs()
    }

    fn growth(&self, world: &World, reference: Reference, now: f64, allowed: f64) -> EnergyGrowth {
        let body = world.body(self.body);
        let velocity = self
            .fields
            .velocity
            .map(|v| world.read::<Vector3<f64>>(v.into()));
        let speeds = velocity.iter().flat_map(|v| v.iter()).map(Vector3::norm);
        let fastest = speeds.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let (point, speed) = fastest.unwrap_or_default();
        EnergyGrowth {
            body: body.name.clone(),
            now,
            allowed: allowed.max(0.0),
            first: reference.first,
            since: reference.time,
            point,
            at: body.points.position.at(point).into(),
            speed,
            advice: match self.knows_conjugate_stress() && !self.scratch.is_repeated {
                true => {
                    "heat of `deformation_heat` that is one step late adds energy to a vibration; set `time.iteration`, \
                     `damping` of `solver.explicit`, or a smaller step"
                }
                false => {
                    "look at what holds the body, take a smaller step, and report the case if its step is `auto`"
                }
            },
        }
    }
}
