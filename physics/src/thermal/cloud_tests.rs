//! Conduction on bodies of several spacings.

use super::Thermal;
use crate::testing::{material, read, run, set, simulation, values};
use perimelt_core::body::{Body, Jitter, Zone};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::Simulation;
use proptest::prelude::*;

const STEEL: &str = "density = 8000\nspecific_heat = 500\nconductivity = 40";

/// A plate whose right half has twice the spacing.
fn body_of_two_spacings() -> Body {
    let zone = |min: f64, max: f64, spacing| Zone {
        min: [min, 0.0, 0.0],
        max: [max, 0.024, 0.0],
        spacing,
        horizon_factor: 1.0,
    };
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.04, 0.024, 0.01],
    });
    let zones = [zone(0.0, 0.02, 1e-3), zone(0.02, 0.04, 2e-3)];
    Body::fill_zones("plate", &shape, 2, 0.1, &zones).expect("valid zones")
}

/// The plate with its points displaced by up to a tenth of the spacing.
fn plate(keys: &str) -> Simulation {
    let jitter = Jitter {
        amplitude: 0.1,
        seed: 1,
    };
    let mut body = body_of_two_spacings().jittered(jitter).expect("valid");
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

/// A cloud of random points with random spacings, in a unit box.
fn random_cloud(points: &[([f64; 3], f64)], dimension: usize) -> Body {
    let mut table = "x,y,z,spacing\n".to_string();
    for ([x, y, z], spacing) in points {
        table += &format!("{x},{y},{z},{spacing}\n");
    }
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [1.0; 3],
    });
    let mut body = Body::from_table("cloud", &shape, dimension, 0.5, &table).expect("valid");
    body.materials = vec![material(STEEL)];
    body
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn heat_is_conserved_to_rounding_on_random_clouds_of_dual_horizons(
        points in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), 0.02..0.12f64), 60..150),
        horizon in 3.0..7.0f64,
        correction in 0..4usize,
        form in 0..3usize,
        dimension in 1..4usize,
        mirrored in any::<bool>(),
        crack in any::<bool>(),
    ) {
        let mut body = random_cloud(&points, dimension);
        if crack && dimension > 1 {
            body.cuts = perimelt_core::Cut::segment([0.3, 0.4], [0.6, 0.5]).into_iter().collect();
        }
        let correction = ["none", "lattice", "zone", "point"][correction];
        let form = ["form = 'bonds'", "form = 'ordinary'", "form = 'ordinary'\nstabilisation = 0.5"][form];
        let surfaces = if mirrored { "mirrored" } else { "bare" };
        let keys = format!("horizon = {horizon}\ncorrection = '{correction}'\nsurfaces = '{surfaces}'\n{form}");
        // some clouds leave a point without a neighbour, which is refused
        let spec = perimelt_core::FamilySpec {
            horizon: perimelt_core::Horizon::Spacings(horizon),
            ..perimelt_core::FamilySpec::new(1.0)
        };
        if perimelt_core::Family::build(&body, &spec).is_err() {
            return Ok(());
        }
        let thermal: Thermal = read(&keys);
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], 1e-2);
        set(&mut s, "temperature", |[x, y, z]| [300.0 + 100.0 * (5.0 * x + 7.0 * y - 3.0 * z).sin()]);
        s.start().expect("a valid start");
        for _ in 0..20 {
            if s.is_finished() {
                break;
            }
            s.step().expect("a step");
        }
        let heat = &s.balances()[0].1[0];
        prop_assert_eq!(heat.supplied, 0.0);
        // rounding of a hundred enthalpies over twenty steps
        prop_assert!(heat.error().abs() <= 1e-13 * heat.size, "{keys}: {heat:?}");
    }
}

#[test]
fn the_ordinary_form_of_calibrated_families_is_close_to_that_of_bonds() {
    let temperatures = ["form = 'bonds'", "form = 'ordinary'"].map(|form| {
        let mut body = body_of_two_spacings();
        body.materials = vec![material(STEEL)];
        let thermal: Thermal = read(form);
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], 0.5);
        warm(&mut s);
        run(&mut s);
        values(&s, "temperature")
    });
    for (bonds, ordinary) in temperatures[0].iter().zip(&temperatures[1]) {
        // of 870 K; the largest difference, beside the interface of the zones, is 0.021 K
        assert!((bonds - ordinary).abs() < 0.05, "{bonds} {ordinary}");
    }
}

#[test]
fn the_ordinary_form_conducts_exactly_without_correction_of_its_bonds() {
    // the transient of a jittered plate: against that of a lattice with calibrated bonds
    let rod = |body: Body, keys: &str| {
        let mut body = body;
        body.materials = vec![material(STEEL)];
        let thermal: Thermal = read(keys);
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], 20.0);
        set(&mut s, "temperature", |[x, _, _]| {
            [300.0 + 100.0 * (std::f64::consts::PI * x / 0.04).cos()]
        });
        run(&mut s);
        let cos = |x: f64| (std::f64::consts::PI * x / 0.04).cos();
        let positions = &s.world().body(0).points.position;
        let amplitudes = values(&s, "temperature").into_iter().zip(positions);
        let (mut above, mut below) = (0.0, 0.0);
        for (t, x) in amplitudes {
            above += (t - 300.0) * cos(x.x);
            below += cos(x.x).powi(2);
        }
        above / below
    };
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.04, 0.012, 0.01],
    });
    let body = || {
        let body = Body::fill("plate", &shape, 2, 1e-3, 0.1).expect("valid");
        let jitter = Jitter {
            amplitude: 0.2,
            seed: 9,
        };
        body.jittered(jitter).expect("valid")
    };
    // exp(-a (pi/L)^2 t), a = 1e-5 m2/s
    let exact = 100.0 * (-1e-5 * (std::f64::consts::PI / 0.04).powi(2) * 20.0).exp();
    let form = |keys: &str| (rod(body(), keys) / exact - 1.0).abs();
    let ordinary = form("form = 'ordinary'\ncorrection = 'none'");
    let bonds = form("correction = 'none'");
    assert!(ordinary < 0.01, "{ordinary}");
    assert!(bonds > 3.0 * ordinary, "{bonds} {ordinary}");
}
