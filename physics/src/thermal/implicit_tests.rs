//! Steps far above the explicit limit, at and near steady states.

use super::Thermal;
use crate::testing::{block, read, set, simulation, values};
use perimelt_core::body::{Body, Store};
use perimelt_core::simulation::Simulation;
use perimelt_core::world::PhaseChange;
use perimelt_core::{
    Coupler, Read, RunError, RunningCoupler, Setup, SetupError, Step, World, Write, keys,
};
use serde::{Deserialize, Serialize};

const ALUMINIUM: &str = "density = 2700\nspecific_heat = 900\nconductivity = 200";
const MELTING: &str = "density = 2700\nspecific_heat = 900\n\
    conductivity = { temperature = [300, 1000], value = [200, 250] }\n\
    solidus = 820\nliquidus = 880\nlatent_heat = 390e3";
const AMBIENT: f64 = 300.0;
const SPACING: f64 = 5e-4;
/// Volumetric capacity, J/(m³ K).
const CAPACITY: f64 = 2700.0 * 900.0;

/// Convection at the face x-, W/(m² K).
#[derive(Debug, Serialize, Deserialize)]
struct Cooling {
    coefficient: f64,
    melts: bool,
    #[serde(skip)]
    fields: Option<(Read<f64>, Write<f64>)>,
}

#[typetag::serialize(name = "cooling_of_a_face")]
impl Coupler for Cooling {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        if self.melts {
            setup.publish(0, PhaseChange::default()).expect("free");
        }
        let temperature = setup.read(0, &keys::TEMPERATURE)?;
        self.fields = Some((temperature, setup.add(0, &keys::HEAT_SOURCE)?));
        Ok(self)
    }
}

impl RunningCoupler for Cooling {
    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        let (temperature, heat) = self.fields.expect("prepared");
        let (temperature, mut heat) = (world.read(temperature), world.write(heat));
        for (i, position) in world.body(0).points.position.iter().enumerate() {
            if position.x < SPACING {
                heat[i] -= self.coefficient * (temperature[i] - AMBIENT) / SPACING;
            }
        }
        Ok(())
    }
}

fn plate(material: &str) -> Body {
    block([40, 4, 1], 2, SPACING, Store::Lattice, material)
}

fn check_heat(s: &Simulation, what: &str) {
    let heat = &s.balances()[0].1[0];
    // rounding of 160 enthalpies over some hundred steps
    assert!(heat.relative_error() < 1e-12, "{what}: {heat:?}");
}

const LENGTH: f64 = 40.0 * SPACING;

/// With steps of 1 s, 3000 times the explicit limit. The coupler takes the temperature at the start of a step: a lumped
/// plate loses the fraction `h dt / (c L)` of its excess temperature in each.
#[test]
fn a_plate_cools_as_a_lumped_body_down_to_the_ambient_temperature() {
    let coefficient = 100.0;
    for solver in ["implicit", "crank_nicolson"] {
        for tolerance in [1e-8, 1e-9, 1e-10, 1e-12] {
            for start in [1000.0, AMBIENT + 1e-3, AMBIENT + 1e-9, AMBIENT] {
                let keys = format!("solver = '{solver}'\nstep = 1\ntolerance = {tolerance}");
                let cooling = Cooling {
                    coefficient,
                    melts: false,
                    fields: None,
                };
                let thermal: Thermal = read(&keys);
                let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(cooling)];
                let body = plate(ALUMINIUM);
                // near the ambient temperature what may fail does so at once
                let end = if start == 1000.0 { 1000.0 } else { 100.0 };
                let mut s = simulation(body, vec![Box::new(thermal)], couplers, end);
                set(&mut s, "temperature", |_| [start]);
                s.start().expect("starts");
                let what = format!("{solver}, {tolerance:e}, from {start} K");
                let mut excess = start - AMBIENT;
                while !s.is_finished() {
                    s.step().unwrap_or_else(|e| panic!("{what}: {e}"));
                    excess *= 1.0 - coefficient * s.progress().last_step / (CAPACITY * LENGTH);
                    let temperature = values(&s, "temperature");
                    let mean = temperature.iter().sum::<f64>() / temperature.len() as f64;
                    // the face is colder than the mean by a third of the Biot number, 0.01: so much slower the plate cools
                    let bound = 0.0035 * (start - AMBIENT) + 1e-9;
                    assert!((mean - AMBIENT - excess).abs() < bound, "{what}: {mean}");
                    check_heat(&s, &what);
                }
            }
        }
    }
}

/// Insulated plates, without any load by which a residual could be measured.
#[test]
fn the_steady_state_of_an_insulated_plate_is_its_mean_however_near_the_start() {
    for material in [ALUMINIUM, MELTING] {
        for amplitude in [100.0, 1e-6, 1e-10, 0.0] {
            for level in [293.15, 700.0] {
                let body = plate(material);
                let thermal: Thermal = read("solver = 'steady'");
                let mut s = simulation(body, vec![Box::new(thermal)], vec![], 1.0);
                set(&mut s, "temperature", |[x, ..]| {
                    [level + amplitude * (std::f64::consts::PI * x / LENGTH).cos()]
                });
                s.start().expect("starts");
                let what = format!("{material}: {amplitude} K about {level} K");
                while !s.is_finished() {
                    s.step().unwrap_or_else(|e| panic!("{what}: {e}"));
                }
                for t in values(&s, "temperature") {
                    // rounding, times the condition number of the plate, about 1000
                    assert!((t - level).abs() < 1e-8, "{what}: {t}");
                }
            }
        }
    }
}

/// Freezing within an interval and at one temperature, with steps up to 12000 times the explicit limit: all points start
/// and end to freeze within a few of them.
#[test]
fn a_plate_freezes_with_steps_far_above_the_explicit_limit() {
    const PURE: &str = "density = 2700\nspecific_heat = 900\n\
        conductivity = { solid = 200, liquid = 90 }\n\
        solidus = 850\nliquidus = 850\nlatent_heat = 390e3";
    const START: f64 = 1000.0;
    let (coefficient, latent_heat) = (500.0, 390e3 * 2700.0);
    for material in [MELTING, PURE] {
        for (solver, step) in [
            ("implicit", 0.5),
            ("implicit", 1.0),
            ("implicit", 4.0),
            ("crank_nicolson", 1.0),
        ] {
            let cooling = Cooling {
                coefficient,
                melts: true,
                fields: None,
            };
            let thermal: Thermal = read(&format!("solver = '{solver}'\nstep = {step}"));
            let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(cooling)];
            let body = plate(material);
            let mut s = simulation(body, vec![Box::new(thermal)], couplers, 200.0);
            set(&mut s, "temperature", |_| [START]);
            s.start().expect("starts");
            let what = format!("{material}, {solver}, {step} s");
            let mut lost = 0.0;
            while !s.is_finished() {
                let face = values(&s, "temperature")[0];
                s.step().unwrap_or_else(|e| panic!("{what}: {e}"));
                lost += coefficient * (face - AMBIENT) * s.progress().last_step / LENGTH;
                check_heat(&s, &what);
                let temperature = values(&s, "temperature");
                let (coldest, hottest) = (temperature[0], temperature[39]);
                // a steady flow would need the heat of the face times the length over twice the conductivity: 39 K
                assert!(hottest - coldest < 60.0, "{what}: {coldest}, {hottest}");
            }
            let end = values(&s, "temperature");
            let mean = end.iter().sum::<f64>() / end.len() as f64;
            // all has frozen; the tolerance of the steps
            let expected = START - (lost - latent_heat) / CAPACITY;
            assert!((mean - expected).abs() < 1e-6, "{what}: {mean}, {expected}");
            assert!(end[39] < 820.0, "{what}: {}", end[39]);
        }
    }
}
