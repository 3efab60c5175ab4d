//! Tests of melt flow.

use perimelt_core::body::Store;
use perimelt_core::{Coupler, Physics, Simulation, StepSize};

use super::MeltFlow;
use crate::testing::{Melting, block, read, run, set, simulation_in_steps, values};
use crate::thermal::Thermal;

const METAL: &str = "density = 7000\nspecific_heat = 500\nconductivity = 50\nviscosity = 5e-3\n\
    liquid_expansion = 1e-4\nsolidus = 1000\nliquidus = 1010\nlatent_heat = 2e5";

/// A square of metal with 16 x 16 points of 1 mm and these temperatures, over a time (s).
fn square(keys: &str, end: f64, temperature: impl Fn([f64; 3]) -> f64) -> Simulation {
    square_in_steps(keys, end, StepSize::Auto, temperature)
}

fn square_in_steps(
    keys: &str,
    end: f64,
    step: StepSize,
    temperature: impl Fn([f64; 3]) -> f64,
) -> Simulation {
    let thermal: Thermal = read("horizon = 1");
    let flow: MeltFlow = read(keys);
    // `thermal` comes first in the case, and yet the melt flows before heat is conducted
    let physics: Vec<Box<dyn Physics>> = vec![Box::new(thermal), Box::new(flow)];
    let body = block([16, 16, 1], 2, 1e-3, Store::Lattice, METAL);
    let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(Melting {})];
    let mut s = simulation_in_steps(body, physics, couplers, end, step);
    set(&mut s, "temperature", |x| [temperature(x)]);
    run(&mut s);
    s
}

fn speeds(s: &Simulation) -> Vec<f64> {
    let velocity = values(s, "melt_velocity");
    velocity
        .chunks(3)
        .map(|v| v.iter().map(|v| v * v).sum::<f64>().sqrt())
        .collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Hot on the left, solid on the right: the melt rises along the hot side, the solid rests, and heat is only moved.
#[test]
fn hot_melt_rises_and_heat_is_conserved() {
    let keys = "buoyancy = { gravity = [0, -10, 0] }";
    let hot = |x: [f64; 3]| 1200.0 - 18.0e3 * x[0];
    let s = square(keys, 0.5, hot);
    let velocity = values(&s, "melt_velocity");
    let (left, right) = (velocity[3 * (16 * 8) + 1], velocity[3 * (16 * 8 + 8) + 1]);
    assert!(left > 1e-4 && right < 0.0, "{left} {right}");
    let temperature = values(&s, "temperature");
    for (i, speed) in speeds(&s).into_iter().enumerate() {
        assert!(speed == 0.0 || temperature[i] > 1000.0, "{i}: {speed}");
    }
    let heat = &s.balances()[0].1[0];
    assert!(heat.relative_error() < 1e-13, "{heat:?}");
}

/// Melt of one temperature above the reference has weight everywhere the same, which pressure balances.
#[test]
fn melt_of_one_temperature_rests_under_its_weight() {
    let keys =
        "buoyancy = { gravity = [0, -10, 0], reference_temperature = 1100 }\ntolerance = 1e-6";
    let s = square(keys, 0.2, |_| 1200.0);
    // a thousandth of the square root of beta dT g L; the middle of the first sub-step does not know the pressure
    let speed = largest(&speeds(&s));
    assert!(speed < 1.3e-5, "{speed}");
    let pressure = values(&s, "melt_pressure");
    let rise = pressure[16 * 15] - pressure[0];
    let expected = 7000.0 * 1e-4 * 100.0 * 10.0 * 0.015;
    assert!(
        (rise - expected).abs() < 1e-3 * expected,
        "{rise} {expected}"
    );
}

/// A falling surface tension drives the melt from hot to cold along the surface, a rising one back.
#[test]
fn the_slope_of_the_surface_tension_drives_the_surface() {
    for (slope, sign) in [(-1e-5, 1.0), (1e-5, -1.0)] {
        let keys = format!("surface = {{ faces = ['y+'], tension.slope = {slope} }}");
        let s = square(&keys, 0.2, |x| 1400.0 - 1e4 * x[0]);
        let velocity = values(&s, "melt_velocity");
        let surface = velocity[3 * (16 * 15 + 8)];
        assert!(sign * surface > 1e-4, "{slope}: {surface}");
        let reports = s.reports();
        let mut reports = reports.iter().flat_map(|r| &r.1);
        let points = reports.find(|r| r.name.ends_with("boundary_layer.points"));
        assert!(points.is_some_and(|r| r.value > 0.0));
    }
}

/// The points across the layer under the surface are those of the pool in which it is thinnest, whatever pools lie beside it.
#[test]
fn the_layer_under_the_surface_is_that_of_one_pool() {
    let keys = "surface = { faces = ['y+'], tension.slope = -1e-5 }";
    let points = |temperature: &dyn Fn([f64; 3]) -> f64| {
        let s = square(keys, 0.05, temperature);
        let reports = s.reports();
        let found = (reports.iter().flat_map(|r| &r.1))
            .find(|r| r.name.ends_with("boundary_layer.points"))
            .map(|r| r.value);
        found.expect("reported")
    };
    let left = |x: [f64; 3]| (1400.0 - 1.2e5 * (x[0] - 2e-3).abs()).max(900.0);
    let right = |x: [f64; 3]| (1400.0 - 1.2e5 * (x[0] - 14e-3).abs()).max(900.0);
    let one = points(&left);
    assert!(
        one > 0.0 && (points(&right) / one - 1.0).abs() < 1e-6,
        "{one}"
    );
    let both = points(&|x| left(x).max(right(x)));
    assert!((both / one - 1.0).abs() < 0.02, "{both} {one}");
}

/// A given step in which the melt flows farther than `largest_lag` points is told.
#[test]
fn a_given_step_that_is_too_long_is_told() {
    let is_told = |step: StepSize| {
        let keys = "surface = { faces = ['y+'], tension.slope = -1e-3 }\nlargest_lag = 0.2";
        let s = square_in_steps(keys, 0.2, step, |x| 1400.0 - 1e4 * x[0]);
        let mut remarks = s.remarks().into_iter();
        remarks.any(|(_, text)| text.contains("without an exchange of heat"))
    };
    assert!(!is_told(StepSize::Auto));
    assert!(is_told(StepSize::Fixed(0.02)));
}

/// Drag brings the mushy zone to rest, in which melt flows otherwise.
#[test]
fn drag_slows_the_mushy_zone() {
    let mushy = |x: [f64; 3]| 1005.0 - 200.0 * x[0];
    let buoyancy = "buoyancy = { gravity = [0, -1000, 0] }";
    let free = largest(&speeds(&square(
        &format!("{buoyancy}\nleast_liquid = 0.1"),
        0.2,
        mushy,
    )));
    let slow = largest(&speeds(&square(
        &format!("{buoyancy}\ndrag = 1.6e6"),
        0.2,
        mushy,
    )));
    assert!(slow < 0.05 * free, "{slow} {free}");
}
