//! Convection: `q = f(x, y, z, t) h(T) (T_ambient - T)` into the body, T of the surface point itself.
//!
//! The factor f lies between 0 and 1, so that h(T) is the largest coefficient at all places and times and limits the
//! step: zones with and without spray, jets that move, water that is turned on.
//!
//! The point lies half a spacing below the surface, and the temperature drop across that half cell is
//! neglected: accurate while `h dx / (2 k)` is far below 1. A step must resolve the exchange,
//! `dt <= C dx / (2 h)` for each bare face of a cell with the volumetric capacity C; automatic steps do.

use std::cell::Cell;

use perimelt_core::formula::Formula;
use perimelt_core::material::Property;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Face, Programme, Read, Report, RunError, Setup, SetupError, Step, World, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::smallest_capacity;
use crate::InTime;

use crate::surface::{SurfaceHeat, all_faces};

/// Heat exchange with a fluid around the body.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convection {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Outward directions of the cooled surface; default all.
    #[serde(default = "all_faces")]
    pub faces: Vec<Face>,
    /// Region that limits the cooled surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// Heat transfer coefficient (W/(m² K)): a number, or `{ temperature = [...], value = [...] }`
    /// with the temperature of the surface in K.
    pub coefficient: Property,
    /// What the coefficient is multiplied by, from 0 to 1: a formula in the position x, y, z (m) of a surface point and the
    /// time t (s), such as `"exp(-((x - 0.1 * t) / 0.02)^2)"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<Formula>,
    /// Temperature of the fluid (K): a number, or `{ time = [...], value = [...] }`, times in s.
    pub ambient: InTime,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<ConvectionState>,
}

/// What a factor may be.
const FACTORS: &str =
    "a value from 0 to 1 at all places and times; `coefficient` is the largest coefficient";

fn is_fraction(value: f64) -> bool {
    // rounding of sums and quotients
    (-1e-12..=1.0 + 1e-12).contains(&value)
}

#[derive(Debug)]
struct ConvectionState {
    body: BodyIndex,
    heat: SurfaceHeat,
    temperature: Read<f64>,
    /// Largest coefficient, W/(m² K).
    largest: f64,
    /// Smallest capacity of the materials, J/(m³ K); a steady solution needs none.
    capacity: Option<f64>,
}

#[typetag::serialize(name = "convection")]
impl Coupler for Convection {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let coefficients = self.coefficient.values();
        if self.coefficient.is_by_phase() || coefficients.iter().any(|h| *h < 0.0) {
            return Err(SetupError::value(
                "coefficient",
                "the heat transfer coefficient is negative or given by phase",
                "a number or a table in temperature, nowhere below 0",
            ));
        }
        let heat = SurfaceHeat::prepare(setup, body, &self.faces, self.region.as_deref())?;
        if let Some(factor) = &self.factor {
            let positions = &setup.body(body).points.position;
            for cell in heat.cells() {
                let at = positions[cell.point as usize].into();
                let value = factor.at(at, 0.0);
                if !is_fraction(value) {
                    let message = format!("`factor` is {value} at {at:?} m at the start");
                    return Err(SetupError::value("factor", message, FACTORS));
                }
            }
        }
        let largest = coefficients.iter().fold(0.0, |a: f64, h| a.max(*h));
        self.prepared = Some(ConvectionState {
            body,
            heat,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            largest,
            capacity: smallest_capacity(setup, body),
        });
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_mut().expect("prepared before the run");
        let temperature = world.read(p.temperature);
        let ambient = self.ambient.at(step.middle());
        let exchange = |point: usize| {
            let temperature = temperature[point];
            self.coefficient.at(temperature, 0.0) * (ambient - temperature)
        };
        let Some(factor) = &self.factor else {
            p.heat.add(world, exchange);
            return Ok(());
        };
        let positions = &world.body(p.body).points.position;
        let shift = world.window_shift(p.body);
        let wrong = Cell::new(None);
        p.heat.add(world, |point| {
            let at = (positions[point] + shift).into();
            let value = factor.at(at, step.middle());
            if !is_fraction(value) {
                wrong.set(Some((value, at)));
            }
            value * exchange(point)
        });
        match wrong.get() {
            None => Ok(()),
            Some((value, at)) => Err(RunError::Plugin {
                plugin: "convection".into(),
                time: step.middle(),
                cause: format!("`factor` is {value} at {at:?} m; expected {FACTORS}").into(),
            }),
        }
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        self.ambient.next_event(after)
    }

    fn programme(&self, _run_end: f64) -> Option<Programme> {
        Programme::of_values([("ambient", &self.ambient)])
    }

    fn step_limit(&self) -> Option<f64> {
        self.prepared.as_ref()?.heat.step_limit()
    }

    /// The exchange is explicit: beyond its time constant the temperature of a point overshoots that of the fluid.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let p = self.prepared.as_mut()?;
        p.heat.stable_step(world, p.largest, p.capacity)
    }

    fn report(&self) -> Vec<Report> {
        let prepared = self.prepared.as_ref();
        prepared.map_or_else(Vec::new, |p| p.heat.report())
    }
}

perimelt_core::register_coupler!("convection", Convection);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    #[test]
    fn each_surface_point_exchanges_at_its_own_temperature_and_area() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let mut boundary: Convection = read(
            "coefficient = { temperature = [300, 500], value = [10, 30] }
             ambient = { time = [0, 2], value = [250, 350] }",
        );
        prepare(&mut world, &mut boundary, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 400.0);
        apply(&world, &mut boundary, 0.0);
        // middle of the first second: 275 K; coefficient 20; corner, edge, face, heart
        let heat = values(&world, &keys::HEAT_SOURCE);
        let expected = [3.0, 2.0, 1.0, 0.0].map(|faces| faces * 20.0 * (275.0 - 400.0));
        assert_eq!([heat[0], heat[1], heat[4], heat[13]], expected);
        assert_eq!(boundary.report()[0].value, -54.0 * 2500.0);
        // capacity 4e6 over three faces of 30 W/(m² K)
        boundary.stable_step(&world);
        let limit = boundary.step_limit().expect("there is an exchange");
        assert!((limit - 0.5 * 4e6 / 90.0).abs() < 1e-6);
    }

    /// q = h f(x, y, z, t) (T_ambient - T) at the middle of the step, and the stable step of the largest coefficient.
    #[test]
    fn the_coefficient_depends_on_place_and_time() {
        let mut world = World::new(vec![block([5, 3, 3], 3, STEEL)]);
        let mut boundary: Convection = read(
            "faces = ['z+']
             coefficient = { temperature = [300, 500], value = [10, 30] }
             factor = 'exp(-((x - 2 * t) / 1.5)^2) * (1 + y) / 4'
             ambient = 300",
        );
        prepare(&mut world, &mut boundary, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 400.0);
        let positions = world.body(0).points.position.clone();
        for start in [0.0, 1.0, 7.0] {
            set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
            apply(&world, &mut boundary, start);
            for (x, heat) in positions.iter().zip(values(&world, &keys::HEAT_SOURCE)) {
                let at_top = if x.z > 2.0 { 1.0 } else { 0.0 };
                let jet = (-((x.x - 2.0 * (start + 0.5)) / 1.5).powi(2)).exp();
                let expected = at_top * jet * (1.0 + x.y) / 4.0 * 20.0 * (300.0 - 400.0);
                assert!(
                    (heat - expected).abs() < 1e-11,
                    "{x} at {start} s: {heat} {expected}"
                );
            }
        }
        // capacity 4e6 over one face of 30 W/(m² K), wherever the jet is
        boundary.stable_step(&world);
        let limit = boundary.step_limit().expect("there is an exchange");
        assert!((limit - 0.5 * 4e6 / 30.0).abs() < 1e-6);
    }

    #[test]
    fn a_factor_outside_0_to_1_is_refused() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let mut boundary: Convection = read("coefficient = 1\nambient = 300\nfactor = '0.5 * x'");
        let message = refusal(&mut world, &mut boundary);
        assert!(
            message.starts_with("factor: `factor` is 1.25 at"),
            "{message}"
        );
        let mut later: Convection = read("coefficient = 1\nambient = 300\nfactor = '0.5 * t'");
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        prepare(&mut world, &mut later, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid at first");
        later.apply(&world, Step::new(0.0, 1.0)).expect("0.25");
        let error = later.apply(&world, Step::new(2.0, 1.0)).expect_err("1.25");
        assert!(error.to_string().contains("1.25"), "{error}");
    }

    #[test]
    fn a_negative_coefficient_is_refused() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let mut boundary: Convection = read("coefficient = -1\nambient = 300");
        assert!(refusal(&mut world, &mut boundary).starts_with("coefficient: "));
    }
}
