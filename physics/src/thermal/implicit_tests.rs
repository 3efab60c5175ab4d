//! Steps far above the explicit limit, at and near steady states.

use super::Thermal;
use crate::testing::{block, read, set, simulation, values};
use perimelt_core::body::{Body, Store};
use perimelt_core::simulation::Simulation;
use perimelt_core::{Coupler, Read, RunError, Setup, SetupError, Step, World, Write, keys};
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
    #[serde(skip)]
    fields: Option<(Read<f64>, Write<f64>)>,
}

#[typetag::serialize(name = "cooling_of_a_face")]
impl Coupler for Cooling {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let temperature = setup.read(0, &keys::TEMPERATURE)?;
        self.fields = Some((temperature, setup.add(0, &keys::HEAT_SOURCE)?));
        Ok(())
    }

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
                    fields: None,
                };
                let thermal: Thermal = read(&keys);
                let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(cooling)];
                let body = plate(ALUMINIUM);
                let mut s = simulation(body, vec![Box::new(thermal)], couplers, 1000.0);
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
