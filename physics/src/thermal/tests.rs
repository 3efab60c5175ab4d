use super::Thermal;
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
                let middle = cells.map(|c| c / 2);
                let [at_x, at_y] = [0, 1].map(|axis| 1e-3 * (middle[axis] as f64 + 0.5));
                // nearly 0 K in the middle, so that the enthalpy there changes by more than it is
                set(&mut s, "temperature", |[x, y, z]| {
                    [1.0 + 3e7 * (x - at_x).powi(2) + 1e7 * (y - at_y).powi(2) + 5e3 * z]
                });
                s.start().expect("starts");
                let before = values(&s, "enthalpy");
                s.step().expect("steps");
                let dt = s.progress().last_step;
                let i = (middle[2] * cells[1] + middle[1]) * cells[0] + middle[0];
                let rate = (values(&s, "enthalpy")[i] - before[i]) / dt;
                let curvature = 2.0 * (3e7 + if cells[1] > 1 { 1e7 } else { 0.0 });
                let error = (rate / (40.0 * curvature) - 1.0).abs();
                assert!(error < 1e-12, "{cells:?} {horizon} {rule}: {error:e}");
            }
        }
    }
}

/// docs/theory/fluids.md, "Numbers of the square lattice": at 3.015 spacings a step of `dx^2 / (1.1096 alpha)` is
/// stable, one that is a tenth above `2 dx^2 / (1.3161 alpha)` is not.
#[test]
fn second_derivatives_are_stable_at_the_published_step_and_not_far_beyond() {
    for (factor, is_stable) in [(1.0 / 1.1096, true), (1.1 * 2.0 / 1.3161, false)] {
        // dx^2 / alpha is 0.1 s
        let step = 0.1 * factor;
        let keys = format!("form = \"second_derivatives\"\nhorizon = 3.015\nstep = {step}");
        let body = block([24, 22, 1], 2, 1e-3, Store::Lattice, STEEL);
        let thermal: Thermal = read(&keys);
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], 300.0 * step);
        set(&mut s, "temperature", |[x, y, _]| {
            [500.0 + 10.0 * (3e6 * x * x + 7e6 * y * y).sin()]
        });
        let mut outcome = s.start().map(|()| false);
        while outcome.is_ok() && !s.is_finished() {
            outcome = s.step();
        }
        let far = |t: &f64| (t - 500.0).abs() > 10.0;
        let is_quiet = outcome.is_ok() && !values(&s, "temperature").iter().any(far);
        assert_eq!(is_quiet, is_stable, "{step} s: {outcome:?}");
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
