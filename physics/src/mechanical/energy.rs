//! Energy of an explicit body, and a watch that stops a run whose energy grows though nothing does work on it.
//!
//! The energy of an elastic body under constant loads is kept, `H = kinetic + elastic - sum_i V_i b_i . u_i`. Velocity
//! Verlet keeps an energy near it, whose modes are off by `1/(1 - (omega dt/2)^2)`: a factor of five at the highest
//! frequency and nine tenths of the stable step. Energy that grows twentyfold therefore has no physical source.
//!
//! Between two samples a body is *quiet* if its body force, held points, layers and stress-free strain did not change,
//! nothing gave impulses, and no bond broke. Samples of quiet bodies are compared with the first one.

use nalgebra::Vector3;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::{Report, RunError, World};
use serde::{Deserialize, Serialize};

use super::step::Run;

/// Steps from sample to sample, each of which costs as much as the forces of a few steps.
const INTERVAL: u64 = 2048;
/// The fraction of the energy of a quiet body that may be more than at the first sample.
const GROWN: f64 = 0.95;
/// Strain whose energy in the whole body is taken for rounding.
const ROUNDING: f64 = 1e-9;

/// Energies of a body, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Energy {
    pub(super) kinetic: f64,
    pub(super) elastic: f64,
    /// Of the constant body force, `-sum_i V_i b_i . u_i`.
    pub(super) potential: f64,
}

impl Energy {
    /// What a quiet body keeps, J.
    fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.potential
    }

    /// For the log.
    pub(super) fn reports(&self) -> [Report; 3] {
        let report = |name: &str, value| Report {
            name: format!("energy.{name}"),
            unit: "J".into(),
            value,
        };
        [
            report("kinetic", self.kinetic),
            report("elastic", self.elastic),
            report("total", self.total()),
        ]
    }
}

/// An energy at a time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Sample {
    /// s.
    time: f64,
    energy: Energy,
}

/// Compares the energy of a quiet body with that of its first sample.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct EnergyWatch {
    /// Steps since the start.
    steps: u64,
    /// Whether anything acted on the body since the last sample.
    pub(super) disturbed: bool,
    /// Factors and offsets of the layers in the last step.
    layers: Vec<[[f64; 3]; 2]>,
    first: Option<Sample>,
}

/// An energy that grew.
#[derive(Debug, thiserror::Error)]
#[error(
    "the energy of body `{body}` grew from {first:.4e} J at t = {since:.4e} s to {now:.4e} J though nothing did work on it: \
     no load, held point, layer or stress-free strain changed; point {point} ({:.4e}, {:.4e}, {:.4e}) m is fastest, at \
     {speed:.4e} m/s. The motion is unstable: look at what holds the body, and report the case if its step is `auto`",
    at[0], at[1], at[2]
)]
struct EnergyGrowth {
    body: String,
    first: f64,
    since: f64,
    now: f64,
    point: usize,
    at: [f64; 3],
    speed: f64,
}

impl Run {
    /// Energies of an explicit body now; without velocities only the elastic one.
    pub(super) fn energy(&mut self, world: &World) -> Energy {
        self.load_displacement(world);
        let volume = &world.body(self.body).points.volume;
        let elastic = self.solid.energy();
        let [elastic] = sum_points(volume.len(), |i| [elastic[i][0] * volume[i]]);
        let kinetic = self.fields.velocity.map_or(0.0, |velocity| {
            let velocity = &*world.read::<Vector3<f64>>(velocity.into());
            let density = &self.density;
            let of_point = |i: usize| 0.5 * density[i] * volume[i] * velocity[i].norm_squared();
            sum_points(volume.len(), |i| [of_point(i)])[0]
        });
        let potential = self.fields.body_force.map_or(0.0, |body_force| {
            let body_force = &*world.read(body_force);
            let displacement = &*world.read::<Vector3<f64>>(self.fields.displacement.into());
            let of_point = |i: usize| -volume[i] * displacement[i].dot(&body_force[i]);
            sum_points(volume.len(), |i| [of_point(i)])[0]
        });
        Energy {
            kinetic,
            elastic,
            potential,
        }
    }

    /// Whether the energy is kept while loads are constant: no other physics changes the body.
    fn keeps_energy(&self, world: &World) -> bool {
        let fields = &self.fields;
        fields.velocity.is_some()
            && fields.plastic.is_none()
            && fields.eigenstrain.is_none()
            && fields.impulse.is_none()
            && self.state.present.is_empty()
            && world.read_if_provided(fields.temperature).is_none()
    }

    /// Notes whether body force or layers differ from those of the last step.
    pub(super) fn note_loads(&mut self, world: &World) {
        if !self.keeps_energy(world) {
            return;
        }
        let rules = world.layer_rules(self.layers);
        let watch = &mut self.state.watch;
        let layers = || rules.iter().map(|r| [r.scale, r.offset]);
        if !layers().eq(watch.layers.iter().copied()) {
            watch.layers = layers().collect();
            watch.disturbed = true;
        }
        if let Some(body_force) = self.fields.body_force {
            let body_force = world.read(body_force);
            let body_force: &[f64] = bytemuck::cast_slice(&body_force);
            watch.disturbed |= self.state.loaded_body_force[..] != *body_force;
        }
    }

    /// Counts a step to `time` (s) and compares the energy if it is time for a sample.
    ///
    /// # Errors
    /// An energy that grew though nothing did work on the body.
    pub(super) fn watch_energy(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        let watch = &mut self.state.watch;
        watch.steps += 1;
        let is_first = watch.steps == 1;
        if !(is_first || watch.steps.is_multiple_of(INTERVAL)) {
            return Ok(());
        }
        // the loads of the first step are new
        let is_quiet = !std::mem::take(&mut watch.disturbed) || is_first;
        if !is_quiet || !self.keeps_energy(world) {
            self.state.watch.first = None;
            return Ok(());
        }
        let energy = self.energy(world);
        let Some(first) = self.state.watch.first else {
            self.state.watch.first = Some(Sample { time, energy });
            return Ok(());
        };
        let stored = energy.kinetic + energy.elastic;
        let grown = energy.total() - first.energy.total();
        if grown <= GROWN * stored || stored <= self.rounding_energy(world) {
            return Ok(());
        }
        Err(RunError::Plugin {
            plugin: "mechanical".into(),
            time,
            cause: Box::new(self.growth(world, first, energy)),
        })
    }

    /// Elastic energy of a strain of the size of rounding, J.
    fn rounding_energy(&self, world: &World) -> f64 {
        let volume = &world.body(self.body).points.volume;
        let of_point = |i: usize| {
            let moduli = self.solid.moduli_of(i);
            volume[i] * (moduli.lame.abs() + 2.0 * moduli.shear) * ROUNDING * ROUNDING
        };
        (0..volume.len()).map(of_point).sum()
    }

    fn growth(&self, world: &World, first: Sample, now: Energy) -> EnergyGrowth {
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
            first: first.energy.total(),
            since: first.time,
            now: now.total(),
            point,
            at: body.points.position[point].into(),
            speed,
        }
    }
}
