//! Heat conduction with enthalpy as the conserved state, and convection with an Eulerian fluid.
//!
//! ```text
//! dh_i/dt = (V_i / V0_i) sum_j kappa_ij v V_j (T_j - T_i) / |xi| + q_i    Wang (2025), eqs. 7.1 to 7.4
//! kappa_ij = 2 (k_i + k_j) / 2 / M,   M = integral of |xi| n^2 dV
//! T = T(h)
//! ```
//!
//! as derived in docs/theory/heat_conduction.md and docs/theory/phase_change.md.
//!
//! `h` is the enthalpy per reference volume `V0` (J/m³), at the density of the material; a point keeps its mass
//! and its reference volume wherever it goes. `V` are the current volumes, which differ from `V0` only where a physics
//! moves the points. `q` is the sink field `heat_source`, also per reference volume. Since `V0_i dh_i/dt` is
//! antisymmetric in the two ends of a bond, heat is conserved pair by pair.
//!
//! The description of the points determines the family ([`Description`](perimelt_core::Description)):
//!
//! - points at rest, or of a solid: bonds between reference neighbours; the lattice calibration (or the correction of
//!   every bond at bare surfaces) makes the discrete conductivity exact;
//! - points that a physics moves: bonds between current neighbours, calibrated for complete families;
//! - points of a body that grows by deposition: bonds between the points with material, whose weights are recomputed
//!   around each new point; the enthalpy of a point is supplied when it is born;
//! - points of an Eulerian fluid with sound: conduction between neighbours at rest, and convection ([`Convection`]) with the
//!   flux of mass of the fluid. Fluids that keep their volume, and melt, carry heat themselves and give what they carried as amounts.
//!
//! Where the coupler `powder` provides the field `consolidated`, powder has the conductivity `powder_conductivity`; where a
//! `metallurgy` provides the field `austenite`, austenite has `austenite_conductivity` if the material has that property.
//!
//! In the ordinary form the heat flow of a bond depends on all bonds of both ends, so that families of any shape conduct exactly.
//! The form of second derivatives sums the differential operator ([`Form`]), as published for flows.
//!
//! Plies of a lay-up conduct by bonds with a conductivity by their direction, and through each other (`plies`).
//!
//! A body may have a window of finer points that moves with a source (`refined`).
//!
//! Surfaces: the faces of a body that fills its box continue in mirrored layers (insulated
//! unless a boundary says otherwise); other surfaces end, and their bonds are corrected where points are at rest.
//!
//! Not for: radiation inside the body.

mod carried;
#[cfg(test)]
mod cloud_tests;
mod conduction;
pub mod conductivity;
mod control;
mod faces;
#[cfg(test)]
mod flow_tests;
mod given;
#[cfg(test)]
mod given_tests;
mod growth;
#[cfg(test)]
mod growth_tests;
#[cfg(test)]
mod implicit_tests;
mod integrate;
mod interfaces;
mod keys;
mod kinds;
#[cfg(test)]
mod laminate_tests;
mod mixture;
mod phases;
mod plies;
#[cfg(test)]
mod plies_tests;
#[cfg(test)]
mod ply_materials_tests;
#[cfg(test)]
mod ply_surface_tests;
mod points;
mod prepare;
mod rates;
mod refined;
mod run;
mod states;
mod surface;
mod surface_depth;
#[cfg(test)]
mod surface_tests;
#[cfg(test)]
mod tests;

pub use crate::advection::Convection;
pub use conduction::BondConduction;
pub use keys::{BrokenConduction, Form, Surfaces, Thermal, ThermalSolver};

use perimelt_core::body::Horizon;
use perimelt_core::keys as core_keys;
use perimelt_core::world::FamilyReach;
use perimelt_core::{
    Balance, Fact, LoadError, Physics, PhysicsReport, Prepared, Read, Report, RunError,
    RunningPhysics, SavedState, Setup, SetupError, Step, StepLimits, Stepping, Work, World,
};
use serde::{Deserialize, Serialize};

use control::StepControl;
use faces::HeatedFace;
use growth::{Born, Growth};
use run::{HeatAccount, RunningThermal};

/// The initial temperature was left out: 0 K everywhere.
#[derive(Debug, thiserror::Error)]
#[error(
    "body `{0}` has no initial temperature; give `initial.temperature` (K) under `[bodies.{0}]`"
)]
struct NoTemperature(String);

/// State that is saved with checkpoints.
#[derive(Serialize, Deserialize)]
struct Saved {
    heat: HeatAccount,
    control: StepControl,
    growth: Option<Born>,
}

/// A temperature below absolute zero.
#[derive(Debug, thiserror::Error)]
#[error(
    "body `{body}` has {value:.4} K at {} m, below absolute zero ({solver}); {cure}",
    perimelt_core::text::position(*position)
)]
struct BelowZero {
    body: String,
    value: f64,
    position: [f64; 3],
    solver: String,
    cure: &'static str,
}

impl RunningThermal {
    /// Refuses temperatures below 0 K.
    fn check_absolute_zero(&self, world: &World, step: Step) -> Result<(), RunError> {
        let temperature = world.read::<f64>(self.fields.temperature.into());
        let reducer = world.reducer(self.body);
        let own = reducer.own(&temperature);
        let least = own.iter().copied().fold(f64::INFINITY, f64::min);
        if !(least < 0.0) {
            return Ok(());
        }
        let body = world.body(self.body);
        let point = temperature.iter().position(|t| *t == least).unwrap_or(0);
        let (solver, cure) = match self.solver {
            ThermalSolver::CrankNicolson => (
                format!("`crank_nicolson`, step of {} s", step.size),
                "Crank-Nicolson oscillates after jumps: take smaller steps, or `solver = \"implicit\"` or \"rkl2\"",
            ),
            ThermalSolver::Steady => (
                "`steady`".into(),
                "check the fluxes and sources that take heat out of the body",
            ),
            _ => (
                format!("step of {} s", step.size),
                "check the fluxes, sources and prescribed temperatures of the body",
            ),
        };
        Err(RunError::Plugin {
            plugin: "thermal".into(),
            time: step.end(),
            cause: Box::new(BelowZero {
                body: body.name.clone(),
                value: least,
                position: body.points.position.at(point).into(),
                solver,
                cure,
            }),
        })
    }
}

/// The heat of a body is computed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConductsHeat;

impl Fact for ConductsHeat {}

#[typetag::serialize(name = "thermal")]
impl Physics for Thermal {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let reach = self.horizon.unwrap_or(Horizon::Spacings(3.0));
        setup.publish(body, FamilyReach(reach))?;
        setup.publish(body, ConductsHeat)
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        setup.stepping(Stepping {
            step: self.step,
            update: self.update,
            is_steady: self.solver == ThermalSolver::Steady,
            ..Stepping::default()
        });
        Ok(Box::new(RunningThermal::prepare(&self, setup)?))
    }
}

impl RunningPhysics for RunningThermal {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let body = world.body(self.body);
        let temperature = world.read(self.fields.temperature.into());
        if temperature.iter().all(|t| *t == 0.0) {
            return Err(RunError::Plugin {
                plugin: "thermal".into(),
                time: 0.0,
                cause: Box::new(NoTemperature(body.name.clone())),
            });
        }
        let mut enthalpy = world.write(self.fields.enthalpy);
        let fraction = self.fraction(world);
        let content = self.content(&body.material_of_point, fraction.as_deref());
        for (point, (h, t)) in enthalpy.iter_mut().zip(&*temperature).enumerate() {
            *h = content.enthalpy(point, *t);
        }
        if let Some(growth) = &mut self.growth {
            growth.start(world);
        }
        let volume = self.heated_volumes(world);
        self.heat.initial = (world.reducer(self.body)).sum_over(&enthalpy, &volume, |h, v| h * v);
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        if self.stable_step.is_none() {
            self.find_stable_step(world);
        }
        let is_explicit = self.solver == ThermalSolver::Explicit;
        let own = self.stable_step.filter(|_| is_explicit);
        own.into_iter()
            .chain(self.given_step(world))
            .reduce(f64::min)
    }

    /// The step by the error in time, so that histories and other physics resolve the temperature.
    fn step_limits(&self, _time: f64) -> StepLimits {
        let longest = self.integrator.next_step().filter(|_| self.is_automatic);
        StepLimits {
            longest,
            next_event: None,
        }
    }

    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        /// K
        const IMPLAUSIBLE: f64 = 1e7;
        let is_beyond = field == core_keys::TEMPERATURE.name && largest > IMPLAUSIBLE;
        let temperature = Read::from(self.fields.temperature);
        is_beyond.then(|| world.first_beyond(temperature, IMPLAUSIBLE))?
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.follow_cracks(world);
        let work = self
            .integrate(world, step)
            .map_err(|cause| RunError::Plugin {
                plugin: "thermal".into(),
                time: step.end(),
                cause: cause.into(),
            })?;
        if self.has_changing_limit() {
            self.find_stable_step(world);
        }
        // stable explicit steps keep temperatures between those of the neighbours
        if self.solver != ThermalSolver::Explicit {
            self.check_absolute_zero(world, step)?;
        }
        Ok(work)
    }

    fn observe(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        self.check_absolute_zero(world, Step::new(time, 0.0))?;
        self.measure_faces(world);
        Ok(())
    }

    /// Heat, where the form conserves it. None in an Eulerian fluid with sound, where heat is conserved per mass, not per volume.
    fn balance(&self, world: &World) -> Vec<Balance> {
        if !self.conduction.is_conservative() || self.carried.is_some() {
            return Vec::new();
        }
        let enthalpy = world.read::<f64>(self.fields.enthalpy.into());
        let volume = &self.heated_volumes(world);
        let reducer = world.reducer(self.body);
        let stored = reducer.sum_over(&enthalpy, volume, |h, v| h * v);
        // errors are relative to the content: the change of the heat may vanish
        let content = reducer.sum_over(&enthalpy, volume, |h, v| (h * v).abs());
        let (initial, supplied) = (
            self.heat.initial,
            self.heat.supplied + self.heat_of_moves(world),
        );
        let balance = Balance::new("heat", "J", stored, initial, supplied);
        let balance = balance.of_size(content + self.heat.exchanged);
        match &self.growth {
            None => vec![balance],
            Some(growth) => {
                let heat = balance.with_deposited(growth.deposited_heat());
                vec![heat, growth.mass_balance(world)]
            }
        }
    }

    fn report(&self, _world: &World) -> PhysicsReport {
        let faces = &self.faces;
        let mut reports: Vec<Report> = faces.iter().flat_map(HeatedFace::reports).collect();
        if faces.len() > 1 {
            reports.push(HeatedFace::total(faces));
            reports.push(Report::new("heat.layers", "W", self.through_layers));
        }
        if self.exchanges_with_bodies() {
            let heat = self.heat.from_bodies;
            reports.push(Report::new("heat.from_bodies", "J", heat));
        }
        reports.extend(self.growth.iter().flat_map(Growth::reports));
        reports.into()
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(Saved {
            heat: self.heat,
            control: self.integrator.control(),
            growth: self.growth.as_ref().map(|growth| growth.save(world)),
        })
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        let saved: Saved = erased_serde::deserialize(state)?;
        self.heat = saved.heat;
        self.integrator.set_control(saved.control);
        self.stable_step = None;
        if let (Some(growth), Some(state)) = (&mut self.growth, saved.growth) {
            growth.load(world, state)?;
        }
        Ok(())
    }
}

perimelt_core::register_physics!(
    "thermal",
    Thermal,
    supports: [Motion, Flow, Births, Cuts, Window, Layers, Division]
);
