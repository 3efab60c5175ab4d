//! Conduction on bodies of several spacings.

use super::Thermal;
use crate::testing::{material, read, run, set, simulation};
use perimelt_core::body::{Body, Jitter, Zone};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::Simulation;

const STEEL: &str = "density = 8000\nspecific_heat = 500\nconductivity = 40";

/// A plate whose right half has twice the spacing, its points displaced by up to a tenth of it.
fn plate(keys: &str) -> Simulation {
    let zone = |min: f64, max: f64, spacing| Zone {
        min: [min, 0.0, 0.0],
        max: [max, 0.024, 0.0],
        spacing,
    };
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.04, 0.024, 0.01],
    });
    let zones = [zone(0.0, 0.02, 1e-3), zone(0.02, 0.04, 2e-3)];
    let body = Body::fill_zones("plate", &shape, 2, 0.1, &zones).expect("valid zones");
    let jitter = Jitter {
        amplitude: 0.1,
        seed: 1,
    };
    let mut body = body.jittered(jitter).expect("valid");
    body.materials = vec![material(STEEL)];
    let thermal: Thermal = read(keys);
    simulation(body, vec![Box::new(thermal)], vec![], 0.5)
}

fn warm(s: &mut Simulation) {
    set(s, "temperature", |[x, y, _]| {
        [300.0 + 1e4 * x + 2e5 * x * y]
    });
}

#[test]
fn an_insulated_body_keeps_its_heat() {
    for horizon in ["3", "{ length = 0.006 }"] {
        for solver in ["explicit", "rkl2", "implicit"] {
            let mut s = plate(&format!("horizon = {horizon}\nsolver = '{solver}'"));
            warm(&mut s);
            run(&mut s);
            let heat = &s.balances()[0].1[0];
            // rounding of some hundred enthalpies over some hundred steps; what Newton's method leaves
            let limit = if solver == "implicit" { 1e-9 } else { 1e-12 };
            assert!(
                heat.error().abs() < limit * heat.stored,
                "{solver}: {heat:?}"
            );
            assert_eq!(heat.supplied, 0.0);
        }
    }
}
