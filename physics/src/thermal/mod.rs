//! Heat conduction, bond-based, with enthalpy as the conserved state.
//!
//! ```text
//! dh_i/dt = sum_j kappa_ij v V_j (T_j - T_i) / |xi| + q_i            Wang (2025), eqs. 7.1 to 7.4
//! kappa_ij = 2 (k_i + k_j) / 2 / M,   M = integral of |xi| n^2 dV    spec 02, table of 1.1
//! T = T(h)                                                          spec 02, 1.6
//! ```
//!
//! `h` is the enthalpy per reference volume (J/m³), `q` the sink field `heat_source`. The
//! pair term is antisymmetric, so heat is conserved pair by pair. The lattice calibration (or
//! the correction of every bond at bare surfaces) makes the discrete conductivity exact.
//!
//! Surfaces: the faces of a body that fills its box continue in mirrored layers (insulated
//! unless a boundary says otherwise); other surfaces end, and their bonds are corrected.
//!
//! Not for: convection by flow, radiation inside the body.

#[cfg(test)]
mod cloud_tests;
mod conduction;
mod integrate;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use perimelt_core::material::{EnthalpyCurve, LatentHeatForm};
use perimelt_core::solver::reduce::weighted_sum;
use perimelt_core::world::{BodyIndex, BrokenPairs, LayersHandle};
use perimelt_core::{
    Balance, BrokenBonds, Clock, Correction, Face, Family, FamilySpec, Horizon, Influence,
    PartialVolume, Physics, Read, RunError, Setup, SetupError, Step, StepSize, Update, Work, World,
    Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use conduction::Conduction;
use integrate::Integrator;

/// Bond-based heat conduction; owns `temperature` and `enthalpy`, consumes `heat_source`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thermal {
    /// Body that conducts; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Horizon in spacings of each point, or `{ length = ... }` in m, the same everywhere. On a
    /// lattice 1 is the classical stencil of nearest neighbours, the cheapest.
    #[serde(default = "three")]
    pub horizon: Horizon,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Calibration of the bonds.
    #[serde(default)]
    pub correction: Correction,
    /// What becomes of heat where bonds of the mechanics broke.
    #[serde(default)]
    pub broken_bonds: BrokenConduction,
    /// Whether the faces of the body continue in mirrored layers.
    #[serde(default)]
    pub surfaces: Surfaces,
    /// Time integration.
    #[serde(default)]
    pub solver: ThermalSolver,
    /// Relative accuracy of the implicit and steady solvers.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Step in s, or "auto".
    #[serde(default)]
    pub step: StepSize,
    /// Advance in every macro `step`, or once per `log` interval.
    #[serde(default)]
    pub update: Update,
    #[serde(skip)]
    #[schemars(skip)]
    run: Option<Run>,
}

fn three() -> Horizon {
    Horizon::Spacings(3.0)
}

fn tolerance() -> f64 {
    1e-10
}

/// Whether heat crosses a crack that the mechanics opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BrokenConduction {
    /// Points whose mechanical bond broke exchange no heat.
    #[default]
    Insulate,
    /// Heat flows as if nothing had happened.
    Conduct,
}

/// What lies behind the faces of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Surfaces {
    /// Mirrored where the body fills its box, bare elsewhere.
    #[default]
    Auto,
    /// A mirrored layer behind every face of the box.
    Mirrored,
    /// Nothing, but for layers that boundaries ask for.
    Bare,
}

/// How heat is stepped in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThermalSolver {
    /// Forward Euler, as published; the step is limited.
    #[default]
    Explicit,
    /// Stabilised explicit (Runge-Kutta-Legendre, second order): steps far above the explicit
    /// limit for the square root of the work; best for long coolings.
    Rkl2,
    /// Implicit Euler, Newton-Krylov: any step, first order.
    Implicit,
    /// Crank-Nicolson, Newton-Krylov: any step, second order, for smooth data.
    CrankNicolson,
    /// The steady state under the sources and boundaries of the moment.
    Steady,
}

#[derive(Debug)]
struct Run {
    body: BodyIndex,
    family: Arc<Family>,
    layers: LayersHandle,
    temperature: Write<f64>,
    enthalpy: Write<f64>,
    heat_source: Option<Read<f64>>,
    constraint: Option<Read<f64>>,
    held: Option<Read<f64>>,
    curves: Vec<EnthalpyCurve>,
    conduction: Conduction,
    cracks: Option<Cracks>,
    integrator: Integrator,
    /// Nothing holds the temperature level: boundaries are insulated or give fluxes.
    floating: bool,
    heat: HeatAccount,
}

/// How far the bonds of the mechanics that broke have been broken here.
#[derive(Debug, Default)]
struct Cracks {
    taken: usize,
    replaced: usize,
    point_in: Vec<u32>,
}

impl Cracks {
    fn follow(&mut self, broken: &BrokenPairs, family: &Family, own: &mut Option<BrokenBonds>) {
        if self.replaced != broken.replaced {
            (self.taken, self.replaced, *own) = (0, broken.replaced, None);
        }
        if self.taken == broken.pairs.len() {
            return;
        }
        if self.point_in.is_empty() {
            self.point_in = family.points_of_slots();
        }
        let own = own.get_or_insert_with(|| family.unbroken());
        for pair in &broken.pairs[self.taken..] {
            family.break_pair(*pair, &self.point_in, own);
        }
        self.taken = broken.pairs.len();
    }
}

/// Heat since the start of the run, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct HeatAccount {
    initial: f64,
    supplied: f64,
}

/// The initial temperature was left out: 0 K everywhere.
#[derive(Debug, thiserror::Error)]
#[error(
    "body `{0}` has no initial temperature; give `initial.temperature` (K) under `[bodies.{0}]`"
)]
struct NoTemperature(String);

impl Thermal {
    fn run(&self) -> &Run {
        self.run.as_ref().expect("prepared before the first step")
    }
}

#[typetag::serde(name = "thermal")]
impl Physics for Thermal {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        self.horizon.check(setup.body(body))?;
        let temperature = setup.own(body, &keys::TEMPERATURE)?;
        let enthalpy = setup.own(body, &keys::ENTHALPY)?;
        let heat_source = setup.consume_if_added(body, &keys::HEAT_SOURCE)?;
        let constraint = setup.consume_if_added(body, &keys::TEMPERATURE_CONSTRAINT)?;
        let held = setup.consume_if_added(body, &keys::HELD_TEMPERATURE)?;
        let conductivity = setup.property(body, "conductivity")?;
        let curves = setup.enthalpy_curves(body)?;
        let apparent = curves.iter().any(|c| c.form() == LatentHeatForm::Apparent);
        if apparent && self.solver != ThermalSolver::Explicit {
            let message = "the apparent heat capacity is defined for explicit steps only";
            return Err(SetupError::value(
                "solver",
                message,
                "`solver = \"explicit\"`, or the enthalpy form",
            ));
        }

        let (layers, mut faces, audited) = setup.layers(body, &keys::TEMPERATURE);
        let this = setup.body(body);
        let mirrored = match self.surfaces {
            Surfaces::Auto => this.fills_box(),
            Surfaces::Mirrored => true,
            Surfaces::Bare => false,
        };
        if mirrored {
            faces = Face::ALL
                .into_iter()
                .filter(|f| f.axis() < this.dimension)
                .collect();
        }
        if self.correction == Correction::Uniaxial {
            let message = "conduction has no uniaxial strain";
            return Err(SetupError::value("correction", message, "\"point\""));
        }
        let points = this.points.len();
        let spec = FamilySpec {
            horizon: self.horizon,
            partial_volume: self.partial_volume,
            influence: Influence::default(),
            correction: self.correction,
            layers: faces,
            audited: audited.clone(),
        };
        let family = setup.family(body, &spec)?;
        let conduction = Conduction::new(&family, conductivity, points);
        let heat = HeatAccount::default();
        self.run = Some(Run {
            body,
            family,
            layers,
            temperature,
            enthalpy,
            heat_source,
            floating: audited.is_empty() && constraint.is_none(),
            constraint,
            held,
            curves,
            conduction,
            cracks: (self.broken_bonds == BrokenConduction::Insulate).then(Cracks::default),
            integrator: Integrator::new(self.solver, self.tolerance),
            heat,
        });
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        let body = world.body(run.body);
        let temperature = world.read(run.temperature.into());
        if temperature.iter().all(|t| *t == 0.0) {
            return Err(RunError::Plugin {
                plugin: "thermal".into(),
                time: 0.0,
                cause: Box::new(NoTemperature(body.name.clone())),
            });
        }
        let mut enthalpy = world.write(run.enthalpy);
        for ((h, &t), &m) in enthalpy
            .iter_mut()
            .zip(&*temperature)
            .zip(&body.material_of_point)
        {
            *h = run.curves[m as usize].enthalpy(t);
        }
        run.heat.initial = weighted_sum(&enthalpy, &body.points.volume);
        Ok(())
    }

    fn clock(&self) -> Clock {
        Clock {
            step: self.step,
            update: self.update,
        }
    }

    /// The monotone limit `min C / sum_j kappa v V / |xi|` (spec 02, 1.4), with the smallest
    /// capacity and the largest conductivity of each material.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_mut().expect("prepared before the start");
        let material = &world.body(run.body).material_of_point;
        let row_sums = run.conduction.largest_row_sums(&run.family, material);
        let limit =
            |(&[sum], &m): (&[f64; 1], &u16)| run.curves[m as usize].minimum_capacity() / sum;
        let stable = row_sums
            .iter()
            .zip(material)
            .map(limit)
            .fold(f64::INFINITY, f64::min);
        run.integrator.set_limits(stable, row_sums);
        (self.solver == ThermalSolver::Explicit).then_some(stable)
    }

    fn plausible(&self, _world: &World) -> Vec<(&'static str, f64)> {
        vec![("temperature", 1e7)]
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = self.run.as_mut().expect("prepared before the first step");
        if let Some(cracks) = &mut run.cracks {
            let pairs = world.broken_pairs(run.body);
            cracks.follow(&pairs, &run.family, &mut run.conduction.broken);
        }
        run.advance(world, step).map_err(|cause| RunError::Plugin {
            plugin: "thermal".into(),
            time: step.end(),
            cause: cause.into(),
        })
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run();
        let enthalpy = world.read::<f64>(run.enthalpy.into());
        let stored = weighted_sum(&enthalpy, &world.body(run.body).points.volume);
        let (initial, supplied) = (run.heat.initial, run.heat.supplied);
        vec![Balance::new("heat", "J", stored, initial, supplied)]
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.run().heat)
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        self.run.as_mut().expect("prepared before a restart").heat =
            erased_serde::deserialize(state)?;
        Ok(())
    }
}

perimelt_core::register_physics!("thermal", Thermal);
