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

use std::sync::Arc;

use perimelt_core::family::LayerRule;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::{max_abs, sum_of, weighted_sum};
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{
    Balance, Bond, BondKernel, Clock, Correction, Face, Family, FamilySpec, Moment, PartialVolume,
    Physics, Read, RunError, Setup, SetupError, Step, StepSize, Update, Work, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bond-based heat conduction; owns `temperature` and `enthalpy`, consumes `heat_source`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thermal {
    /// Body that conducts; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Horizon in spacings. 1 is the classical stencil of nearest neighbours, the cheapest.
    #[serde(default = "three")]
    pub horizon: f64,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Calibration of the bonds.
    #[serde(default)]
    pub correction: Correction,
    /// Whether the faces of the body continue in mirrored layers.
    #[serde(default)]
    pub surfaces: Surfaces,
    /// Time integration.
    #[serde(default)]
    pub solver: ThermalSolver,
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

fn three() -> f64 {
    3.0
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
    /// Forward Euler, as published.
    #[default]
    Explicit,
}

#[derive(Debug)]
struct Run {
    body: BodyIndex,
    family: Arc<Family>,
    layers: LayersHandle,
    temperature: Write<f64>,
    enthalpy: Write<f64>,
    heat_source: Read<f64>,
    curves: Vec<EnthalpyCurve>,
    conduction: Conduction,
    heat: HeatAccount,
}

/// Heat since the start of the run, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct HeatAccount {
    initial: f64,
    supplied: f64,
}

/// The conduction operator with its work arrays.
#[derive(Debug)]
struct Conduction {
    conductivity: Vec<Property>,
    uniform: Option<f64>,
    /// `2 / M`: micro-conductivity per conductivity, 1/m⁵ (3D).
    micro: f64,
    temperature_slots: Vec<f64>,
    conductivity_slots: Vec<f64>,
    conductivity_field: Vec<f64>,
    rate: Vec<[f64; 1]>,
}

/// Conduction with one conductivity; `micro_conductivity = 2 k / M`.
struct Uniform {
    micro_conductivity: f64,
}

impl BondKernel<1, 1> for Uniform {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [self.micro_conductivity * bond.volume / bond.length * (other - own)]
    }
}

/// Conduction with a conductivity at each point; the bond takes the mean of its ends.
struct Varying {
    micro: f64,
}

impl BondKernel<2, 1> for Varying {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let mean = 0.5 * (own[1] + other[1]);
        [self.micro * bond.volume / bond.length * mean * (other[0] - own[0])]
    }
}

/// Sum of the coefficients of a point's bonds, W/(m³ K).
struct RowSum {
    micro: f64,
}

impl BondKernel<1, 1> for RowSum {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [self.micro * bond.volume / bond.length * 0.5 * (own + other)]
    }
}

impl Conduction {
    fn new(family: &Family, moment: f64, conductivity: Vec<Property>, points: usize) -> Self {
        let first = conductivity[0].constant();
        let uniform = first.filter(|_| conductivity.iter().all(|k| k.constant() == first));
        let varying = if uniform.is_some() { 0 } else { points };
        Conduction {
            conductivity,
            uniform,
            micro: 2.0 / moment,
            temperature_slots: vec![0.0; family.slots()],
            conductivity_slots: vec![0.0; if varying == 0 { 0 } else { family.slots() }],
            conductivity_field: vec![0.0; varying],
            rate: vec![[0.0]; points],
        }
    }

    /// Fills the slots from a temperature field (K) and evaluates the conductivities.
    fn load(
        &mut self,
        family: &Family,
        rules: &[LayerRule],
        temperature: &[f64],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) {
        family.scatter(temperature, 1, 0, &mut self.temperature_slots);
        family.fill_layers(rules, 0, &mut self.temperature_slots);
        if self.uniform.is_none() {
            let properties = &self.conductivity;
            let values = self
                .conductivity_field
                .par_iter_mut()
                .zip(temperature)
                .zip(material);
            values.for_each(|((k, &t), &m)| {
                let m = m as usize;
                *k = properties[m].at(t, curves[m].liquid_fraction(t));
            });
            family.scatter(&self.conductivity_field, 1, 0, &mut self.conductivity_slots);
            family.fill_layers(&[], 0, &mut self.conductivity_slots);
        }
    }

    /// Heat that flows to each point, W/m³, from what was loaded.
    fn flow(&mut self, family: &Family) {
        let slots = &self.temperature_slots[..];
        match self.uniform {
            Some(k) => {
                let kernel = Uniform {
                    micro_conductivity: self.micro * k,
                };
                family.sum(&kernel, [slots], &mut self.rate);
            }
            None => {
                let kernel = Varying { micro: self.micro };
                family.sum(&kernel, [slots, &self.conductivity_slots], &mut self.rate);
            }
        }
    }

    /// Heat that flows in through layers with prescribed values, W, from what was loaded.
    fn inflow(&self, family: &Family, volume: &[f64]) -> f64 {
        let mut total = 0.0;
        let add = |point: usize, [rate]: [f64; 1]| total += volume[point] * rate;
        let slots = &self.temperature_slots[..];
        match self.uniform {
            Some(k) => {
                let kernel = Uniform {
                    micro_conductivity: self.micro * k,
                };
                family.sum_from_layers(&kernel, [slots], add);
            }
            None => {
                let kernel = Varying { micro: self.micro };
                family.sum_from_layers(&kernel, [slots, &self.conductivity_slots], add);
            }
        }
        total
    }
}

impl Thermal {
    fn run(&self) -> &Run {
        self.run.as_ref().expect("prepared before the first step")
    }
}

#[typetag::serde(name = "thermal")]
impl Physics for Thermal {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        if self.horizon.is_nan() || self.horizon < 1.0 {
            let message = format!("`horizon` = {} reaches no neighbour", self.horizon);
            return Err(SetupError::value(
                "horizon",
                message,
                "at least 1 (spacing)",
            ));
        }
        let temperature = setup.own(body, &keys::TEMPERATURE)?;
        let enthalpy = setup.own(body, &keys::ENTHALPY)?;
        let heat_source = setup.consume(body, &keys::HEAT_SOURCE)?;
        let conductivity = setup.property(body, "conductivity")?;
        let curves = setup.enthalpy_curves(body)?;

        let (layers, mut faces, audited) = setup.layers(body, &keys::TEMPERATURE);
        let this = setup.body(body);
        let mirrored = match self.surfaces {
            Surfaces::Auto => this.lattice.is_full(),
            Surfaces::Mirrored => true,
            Surfaces::Bare => false,
        };
        if mirrored {
            faces = Face::ALL
                .into_iter()
                .filter(|f| f.axis() < this.dimension)
                .collect();
        }
        let horizon = self.horizon * this.lattice.spacing;
        let moment = Moment::Conduction.continuum(this.dimension, horizon, this.thickness);
        let points = this.points.len();
        let spec = FamilySpec {
            horizon,
            partial_volume: self.partial_volume,
            correction: self.correction,
            moment: Moment::Conduction,
            layers: faces,
            audited,
        };
        let family = setup.family(body, &spec)?;
        let conduction = Conduction::new(&family, moment, conductivity, points);
        let heat = HeatAccount::default();
        self.run = Some(Run {
            body,
            family,
            layers,
            temperature,
            enthalpy,
            heat_source,
            curves,
            conduction,
            heat,
        });
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        let body = world.body(run.body);
        let temperature = world.read(run.temperature.into());
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
        let body = world.body(run.body);
        let largest: Vec<f64> = run
            .conduction
            .conductivity
            .iter()
            .map(|k| max_abs(&k.values()))
            .collect();
        let conductivity: Vec<f64> = body
            .material_of_point
            .iter()
            .map(|&m| largest[m as usize])
            .collect();
        let mut slots = vec![0.0; run.family.slots()];
        run.family.scatter(&conductivity, 1, 0, &mut slots);
        run.family.fill_layers(&[], 0, &mut slots);
        let mut sums = vec![[0.0]; conductivity.len()];
        run.family.sum(
            &RowSum {
                micro: run.conduction.micro,
            },
            [&slots],
            &mut sums,
        );
        let limit =
            |(&[sum], &m): (&[f64; 1], &u16)| run.curves[m as usize].minimum_capacity() / sum;
        Some(
            sums.iter()
                .zip(&body.material_of_point)
                .map(limit)
                .fold(f64::INFINITY, f64::min),
        )
    }

    fn plausible(&self, _world: &World) -> Vec<(&'static str, f64)> {
        vec![("temperature", 1e7)]
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = self.run.as_mut().expect("prepared before the first step");
        let body = world.body(run.body);
        let (volume, material) = (&body.points.volume[..], &body.material_of_point[..]);
        let source = world.read(run.heat_source);
        let mut temperature = world.write(run.temperature);
        let mut enthalpy = world.write(run.enthalpy);
        let rules = world.layer_rules(run.layers);

        run.conduction
            .load(&run.family, &rules, &temperature, material, &run.curves);
        run.conduction.flow(&run.family);
        let inflow = run.conduction.inflow(&run.family, volume);
        run.heat.supplied += step.size * (inflow + sum_of([&source, volume], |[q, v]| q * v));

        let (curves, rate) = (&run.curves, &run.conduction.rate);
        let state = temperature.par_iter_mut().zip(&mut *enthalpy);
        let state = state
            .with_min_len(4096)
            .zip(rate)
            .zip(&*source)
            .zip(material);
        state.for_each(|((((t, h), [flow]), q), &m)| {
            (*t, *h) = curves[m as usize].advance(*t, *h, step.size * (flow + q));
        });
        Ok(Work { iterations: 1 })
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run();
        let enthalpy = world.read::<f64>(run.enthalpy.into());
        vec![Balance {
            quantity: "heat".into(),
            unit: "J".into(),
            stored: weighted_sum(&enthalpy, &world.body(run.body).points.volume),
            initial: run.heat.initial,
            supplied: run.heat.supplied,
        }]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, read, run, set, simulation, values};
    use perimelt_core::body::Store;
    use perimelt_core::simulation::Simulation;

    const STEEL: &str = "density = 8000\nspecific_heat = 500\nconductivity = 40";
    const GRADED: &str = "density = 8000\nspecific_heat = 500\n\
        conductivity = { temperature = [0, 1000], value = [60, 20] }";

    fn plate(store: Store, material: &str, cells: [usize; 3], keys: &str) -> Simulation {
        let dimension = cells.iter().filter(|c| **c > 1).count();
        let body = block(cells, dimension, 1e-3, store, material);
        let thermal: Thermal = read(keys);
        simulation(body, vec![Box::new(thermal)], vec![], 0.5)
    }

    /// `div(k grad T)` of a quadratic temperature is `2 k a`, whatever dimension, horizon, rule.
    #[test]
    fn discrete_conductivity_is_exact_after_calibration() {
        for cells in [[40, 1, 1], [24, 22, 1], [18, 16, 17]] {
            for horizon in [1.0, 2.0, 3.0, 3.015] {
                for rule in ["none", "half", "full"] {
                    let keys = format!("horizon = {horizon}\npartial_volume = \"{rule}\"");
                    let mut s = plate(Store::Lattice, STEEL, cells, &keys);
                    set(&mut s, "temperature", |[x, y, z]| {
                        [3e7 * x * x - 1e7 * y * y + 5e3 * z]
                    });
                    s.start().expect("starts");
                    let before = values(&s, "enthalpy");
                    s.step().expect("steps");
                    let dt = s.progress().last_step;
                    let middle = cells.map(|c| c / 2);
                    let i = (middle[2] * cells[1] + middle[1]) * cells[0] + middle[0];
                    let rate = (values(&s, "enthalpy")[i] - before[i]) / dt;
                    let curvature = 2.0 * (3e7 - if cells[1] > 1 { 1e7 } else { 0.0 });
                    // enthalpies of 1e9 J/m3 change by about 1e6 in the step: 1e-16 / 1e-3
                    let error = (rate / (40.0 * curvature) - 1.0).abs();
                    assert!(error < 1e-10, "{cells:?} {horizon} {rule}: {error}");
                }
            }
        }
    }

    #[test]
    fn a_uniform_temperature_stays_uniform_at_bare_and_mirrored_surfaces() {
        for surfaces in ["mirrored", "bare"] {
            for material in [STEEL, GRADED] {
                let keys = format!("surfaces = \"{surfaces}\"");
                let mut s = plate(Store::Lattice, material, [9, 8, 7], &keys);
                set(&mut s, "temperature", |_| [345.678]);
                run(&mut s);
                // T -> h -> T may turn the last bits
                assert!(
                    values(&s, "temperature")
                        .iter()
                        .all(|t| (t - 345.678).abs() < 1e-10)
                );
            }
        }
    }

    #[test]
    fn an_insulated_body_keeps_its_heat() {
        for keys in [
            "",
            "surfaces = \"bare\"",
            "horizon = 1",
            "horizon = 2\npartial_volume = \"full\"",
        ] {
            for material in [STEEL, GRADED] {
                let mut s = plate(Store::Lattice, material, [13, 11, 1], keys);
                set(&mut s, "temperature", |[x, y, _]| {
                    [300.0 + 4e4 * x + 2e6 * x * y]
                });
                s.start().expect("starts");
                let first = values(&s, "temperature");
                while !s.is_finished() {
                    s.step().expect("steps");
                }
                let spread = |t: &[f64]| {
                    t.iter().copied().fold(f64::MIN, f64::max)
                        - t.iter().copied().fold(f64::MAX, f64::min)
                };
                assert!(
                    spread(&values(&s, "temperature")) < 0.9 * spread(&first),
                    "heat moves"
                );
                let heat = &s.balances()[0].1[0];
                // rounding of 143 enthalpies over some hundred steps
                assert!(
                    heat.error().abs() < 1e-12 * heat.stored.abs(),
                    "{keys}: {heat:?}"
                );
                assert_eq!(heat.supplied, 0.0);
            }
        }
    }

    #[test]
    fn lattice_and_list_store_agree_and_threads_do_not_matter() {
        for (material, surfaces) in [(STEEL, "mirrored"), (GRADED, "mirrored"), (STEEL, "bare")] {
            let keys = format!("surfaces = \"{surfaces}\"");
            let go = |store, threads| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| {
                    let mut s = plate(store, material, [40, 30, 12], &keys);
                    set(&mut s, "temperature", |[x, y, z]| {
                        [300.0 + 3e4 * x * (1.0 + 20.0 * y) - 2e4 * z]
                    });
                    run(&mut s);
                    values(&s, "temperature")
                })
            };
            let lattice = go(Store::Lattice, 1);
            assert_eq!(lattice, go(Store::Lattice, 2), "bit by bit");
            for (a, b) in lattice.iter().zip(go(Store::List, 2)) {
                assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
            }
        }
    }

    #[test]
    fn a_cosine_decays_at_the_rate_of_the_classical_mode() {
        let mut s = plate(Store::Lattice, STEEL, [100, 4, 1], "");
        let length = 0.1;
        set(&mut s, "temperature", |[x, ..]| {
            [300.0 + (std::f64::consts::PI * x / length).cos()]
        });
        run(&mut s);
        let decay = (-1e-5 * (std::f64::consts::PI / length).powi(2) * 0.5).exp();
        let first = values(&s, "temperature")[0] - 300.0;
        let expected = decay * (std::f64::consts::PI * 0.0005 / length).cos();
        // (horizon / wavelength)^2 of nonlocality on a loss of half a percent
        assert!((first - expected).abs() < 1e-5, "{first} {expected}");
    }
}
