//! Sources by formula, powers by voltage and current, and pulses.

use nalgebra::Vector3;
use perimelt_core::{Body, Coupler, RunningCoupler, Setup, World, keys};

use super::*;
use crate::testing::{STEEL, apply, block, prepare, read, refusal, total, values, zones};

fn ready(body: Body, source: impl Coupler + 'static) -> (World, Box<dyn RunningCoupler>) {
    let mut world = World::new(vec![body]);
    let (running, ()) = prepare(&mut world, source, |setup: &mut Setup<'_>| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    })
    .expect("valid");
    (world, running)
}

fn report(source: &dyn RunningCoupler, name: &str) -> f64 {
    let reports = source.report();
    let found = reports.iter().find(|r| r.name == name);
    found.expect("reported").value
}

fn profile(formula: &str, keys: &str) -> ProfileSource {
    read(&format!(
        "power = 100\nprofile = '{formula}'\nreach = 4\ndepth = 3\n{keys}"
    ))
}

const LINE: &str = "toolpath.line = { start = [5.3, 10.2, 8], direction = [1, 0, 0], speed = 2 }";

/// Centre of the power, m.
fn centre(world: &World) -> Vector3<f64> {
    let powers = values(world, &keys::HEAT_SOURCE);
    let points = &world.body(0).points;
    let weighed = powers.iter().zip(&points.volume).zip(&points.position);
    let sum: Vector3<f64> = weighed.map(|((q, v), at)| at * (q * v)).sum();
    sum / total(world, &keys::HEAT_SOURCE)
}

/// A Gaussian by formula heats as the Gaussian does.
#[test]
fn a_formula_is_the_source_that_it_describes() {
    let heat = |(world, mut source): (World, Box<dyn RunningCoupler>)| {
        apply(&world, &mut *source, 0.0);
        values(&world, &keys::HEAT_SOURCE)
    };
    let body = || block([20, 20, 8], 3, STEEL);
    let formula = profile(
        "exp(-r^2 / (2 * 1.2^2))",
        &format!("{LINE}\nfinest = 0.6\nefficiency = 0.5"),
    );
    let formula = heat(ready(body(), formula));
    let gaussian = read::<GaussianSource>(&format!(
        "power = 50\nsigma = 1.2\neffective_depth = 3\n{LINE}"
    ));
    let gaussian = heat(ready(body(), gaussian));
    let peak = gaussian.iter().copied().fold(0.0, f64::max);
    let apart = formula.iter().zip(&gaussian).map(|(a, b)| (a - b).abs());
    // what lies beyond the reach of 3.3 sigma, 0.4 %, is spread over the rest
    assert!(apart.fold(0.0, f64::max) < 0.01 * peak);
}

#[test]
fn the_power_of_a_formula_is_exact_on_every_body_and_under_every_torch() {
    let tilted = "heated_surface.direction = [0, 1, -2]";
    let side = "heated_surface = { face = 'y+', level = 20 }";
    let formula = "exp(-(x / 2)^2 - (y / 1.5)^2) * (3.5 - z)";
    for (body, keys) in [
        (block([20, 20, 8], 3, STEEL), ""),
        (block([20, 20, 8], 3, STEEL), tilted),
        (block([20, 20, 8], 3, STEEL), side),
        (block([20, 20, 1], 2, STEEL), ""),
        (block([20, 20, 1], 2, STEEL), side),
        (zones(3), ""),
        (zones(2), ""),
    ] {
        for path in [
            LINE,
            "toolpath.line = { start = [6, 9, 8], end = [13, 12, 8], speed = 2 }",
        ] {
            // in the middle of the face y+
            let path = path.replace(", 8]", if keys == side { ", 4]" } else { ", 8]" });
            let source = profile(formula, &format!("{path}\n{keys}"));
            let (world, mut source) = ready(body.clone(), source);
            apply(&world, &mut *source, 1.0);
            let power = total(&world, &keys::HEAT_SOURCE);
            // a sum over 1e3 cells
            assert!((power - 100.0).abs() < 1e-9, "{keys} {path}: {power} W");
            assert!((report(&*source, "energy.deposited") - 100.0).abs() < 1e-9);
            assert_eq!(report(&*source, "energy.lost"), 0.0, "{keys} {path}");
        }
    }
}

#[test]
fn the_part_of_a_formula_beside_the_body_is_lost() {
    for keys in ["", "heated_surface.direction = [0, 1, -1]"] {
        let start = "toolpath.line = { start = [-1, 10, 8], direction = [1, 0, 0], speed = 2 }";
        let source = profile("exp(-r^2)", &format!("{start}\n{keys}"));
        let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
        // half of the source is over the edge in the middle of the first second
        apply(&world, &mut *source, 0.0);
        assert!(
            (report(&*source, "power.lost") - 50.0).abs() < 1e-9,
            "{keys}"
        );
        assert!(
            (total(&world, &keys::HEAT_SOURCE) - 50.0).abs() < 1e-9,
            "{keys}"
        );
    }
}

/// x runs along the direction of travel, y to its left as seen from outside, z downwards.
#[test]
fn local_coordinates_turn_with_the_travel() {
    for (direction, ahead, left) in [
        ([1.0, 0.0, 0.0], Vector3::x(), Vector3::y()),
        ([0.0, -3.0, 0.0], -Vector3::y(), Vector3::x()),
        (
            [1.0, 1.0, 0.0],
            Vector3::new(1.0, 1.0, 0.0).normalize(),
            Vector3::new(-1.0, 1.0, 0.0).normalize(),
        ),
    ] {
        for (formula, towards) in [
            ("exp(-r^2) * (1 + tanh(5 * x))", ahead),
            ("exp(-r^2) * (1 + tanh(5 * y))", left),
            ("exp(-r^2) * (1 + tanh(5 * (z - 1.5)))", -Vector3::z()),
        ] {
            let path = format!(
                "toolpath.line = {{ start = [10, 10, 8], direction = {direction:?}, speed = 1e-9 }}\nfinest = 0.2"
            );
            let source = profile(formula, &path);
            let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
            apply(&world, &mut *source, 0.0);
            let even = {
                let source = profile("exp(-r^2)", &path);
                let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
                apply(&world, &mut *source, 0.0);
                centre(&world)
            };
            let shift = centre(&world) - even;
            // half of a Gaussian has its centre 0.56 of its radius off; of a depth of 3 m the lower half 0.75 m
            assert!(
                shift.dot(&towards) > 0.4,
                "{direction:?} {formula}: {shift}"
            );
            assert!(
                (shift - towards * shift.dot(&towards)).norm() < 1e-3,
                "{formula}: {shift}"
            );
        }
    }
}

#[test]
fn formulas_that_are_no_density_are_refused() {
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    for (formula, keys, message) in [
        ("x", "", "profile: the density of the heat source is -"),
        (
            "1 / r",
            "",
            "profile: the density of the heat source is inf",
        ),
        (
            "sqrt(x)",
            "",
            "profile: the density of the heat source is NaN",
        ),
        (
            "exp(-(r / 1e-6)^2 - 9)  * 0",
            "",
            "is zero everywhere within its reach",
        ),
        ("1", "finest = 0", "finest: `finest` is 0"),
        ("1", "finest = 1e-9", "the heat source spans"),
        ("1", "efficiency = 2", "efficiency: "),
    ] {
        let refused = refusal(&mut world, profile(formula, &format!("{LINE}\n{keys}")));
        assert!(refused.contains(message), "{formula}: {refused}");
    }
    let text = format!("profile = 'exp(-t)'\nreach = 1\ndepth = 1\npower = 1\n{LINE}");
    let error = toml::from_str::<ProfileSource>(&text)
        .err()
        .expect("no time");
    assert!(
        error
            .message()
            .contains("`t` in the formula `exp(-t)` is unknown; known are x, y, z, r"),
        "{error}"
    );
}

fn ellipsoid(keys: &str) -> EllipsoidSource {
    read(&format!(
        "half_length = 2\nhalf_width = 2\ndepth = 1\n{keys}"
    ))
}

#[test]
fn the_power_is_voltage_times_current() {
    let source = ellipsoid(&format!(
        "voltage = 25\ncurrent = 8\nefficiency = 0.75\n{LINE}"
    ));
    let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
    apply(&world, &mut *source, 0.0);
    assert!((report(&*source, "power.asked") - 150.0).abs() < 1e-12);
    // a power of the toolpath replaces it
    let path =
        "toolpath.line = { start = [5, 10, 8], direction = [1, 0, 0], speed = 2, power = 60 }";
    let source = ellipsoid(&format!("voltage = 25\ncurrent = 8\n{path}"));
    let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
    apply(&world, &mut *source, 0.0);
    assert_eq!(report(&*source, "power.asked"), 60.0);
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    for (keys, message) in [
        (
            "voltage = 25",
            "voltage: `voltage` of the heat source is given without `current`",
        ),
        (
            "current = 25",
            "current: `current` of the heat source is given without `voltage`",
        ),
        (
            "power = 9\ncurrent = 25",
            "power: `power` of the heat source is given besides",
        ),
        ("voltage = -25\ncurrent = 1", "voltage: `voltage` is -25"),
        ("voltage = 25\ncurrent = inf", "current: `current` is inf"),
        (
            "power = 1\npulse = { frequency = 0, duty = 0.5 }",
            "pulse.frequency: `pulse.frequency` is 0",
        ),
    ] {
        let refused = refusal(&mut world, ellipsoid(&format!("{keys}\n{LINE}")));
        assert!(refused.starts_with(message), "{keys}: {refused}");
    }
    let json = serde_json::to_value(ellipsoid(&format!("voltage = 25\ncurrent = 8\n{LINE}")))
        .expect("written");
    assert_eq!(
        (&json["voltage"], &json["current"]),
        (&25.0.into(), &8.0.into())
    );
}

/// Applies a source over steps that end at its events and at 0.3 s at most; the energy asked for, J.
fn energy(source: &mut dyn RunningCoupler, world: &World, end: f64) -> f64 {
    let mut at = 0.0;
    while at < end {
        source.begin_step(world, at);
        let next = source
            .step_limits(at)
            .next_event
            .unwrap_or(end)
            .min(at + 0.3)
            .min(end);
        source
            .apply(world, perimelt_core::Step::new(at, next - at))
            .expect("applies");
        at = next;
    }
    report(source, "energy.asked")
}

/// Mean power: duty + base (1 - duty) of that of the toolpath.
#[test]
fn the_energy_of_pulses_is_exact() {
    for (pulse, path, expected) in [
        ("{ frequency = 2.5, duty = 0.3 }", LINE, 100.0 * 0.3 * 4.0),
        (
            "{ frequency = 2.5, duty = 0.3, base = 0.2 }",
            LINE,
            100.0 * (0.3 + 0.7 * 0.2) * 4.0,
        ),
        ("{ frequency = 2.5, duty = 1 }", LINE, 400.0),
        // ten and a half periods from the start of the path at 0.35 s, to its end at 2.45 s
        (
            "{ frequency = 5, duty = 0.25 }",
            "toolpath.line = { start = [5, 10, 8], end = [9.2, 10, 8], speed = 2, start_time = 0.35 }",
            100.0 * 11.0 * 0.05,
        ),
        // a power that rises in time: the sum over four pulses of 0.1 s, of the powers in their middles
        (
            "{ frequency = 2.5, duty = 0.25 }",
            "toolpath.polyline = { start = [5, 10, 8], segments = [{ to = [8.2, 10, 8], speed = 2, power = 200 }] }",
            200.0 * 4.0 * 0.1,
        ),
    ] {
        let source = ellipsoid(&format!("power = 100\npulse = {pulse}\n{path}"));
        let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
        let found = energy(&mut *source, &world, 4.0);
        assert!(
            (found - expected).abs() < 1e-9 * expected,
            "{pulse} {path}: {found} J"
        );
        // the weld is as long as without pulses
        let steady = ellipsoid(&format!("power = 100\n{path}"));
        let (world, mut steady) = ready(block([20, 20, 8], 3, STEEL), steady);
        energy(&mut *steady, &world, 4.0);
        let [length, whole] = [&source, &steady].map(|source| report(&**source, "path"));
        assert!((length / whole - 1.0).abs() < 1e-9, "{length} {whole}");
    }
    // without power no switches
    let path = "toolpath.line = { start = [5, 10, 8], end = [7, 10, 8], speed = 2 }";
    let source = ellipsoid(&format!(
        "power = 100\npulse = {{ frequency = 4, duty = 0.5 }}\n{path}"
    ));
    let (_, source) = ready(block([20, 20, 8], 3, STEEL), source);
    let next = |after: &f64| source.step_limits(*after).next_event;
    let events: Vec<f64> = std::iter::successors(next(&0.0), next).collect();
    assert_eq!(events, [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0]);
}

/// A ramp of the power of a table, in pulses: linear between switches.
#[test]
fn pulses_of_a_power_that_rises_are_exact() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("ramp.csv");
    std::fs::write(&file, "time,x,y,z,power\n0,5,10,8,0\n4,9,10,8,400\n").expect("written");
    let table = format!("toolpath.table.file = '{}'", file.display());
    let source = ellipsoid(&format!(
        "pulse = {{ frequency = 1, duty = 0.5, base = 0.1 }}\n{table}"
    ));
    let (world, mut source) = ready(block([20, 20, 8], 3, STEEL), source);
    // integral of 100 t over [k, k + 1/2] and a tenth of it over the rest
    let expected: f64 = (0..4)
        .map(|k| {
            let part = |from: f64, to: f64| 50.0 * (to * to - from * from);
            let k = f64::from(k);
            part(k, k + 0.5) + 0.1 * part(k + 0.5, k + 1.0)
        })
        .sum();
    let found = energy(&mut *source, &world, 5.0);
    assert!(
        (found - expected).abs() < 1e-9 * expected,
        "{found} J, expected {expected}"
    );
}

/// Pulses rest while the toolpath waits, and go on in its time.
#[test]
fn pulses_rest_during_a_wait() {
    let passes = "toolpath.sequence = { wait_until = { temperature = 400 }, passes = [
        { toolpath.line = { start = [5, 10, 8], end = [7, 10, 8], speed = 2 } },
        { toolpath.line = { start = [5, 10, 8], end = [7, 10, 8], speed = 2 } } ] }";
    let source = ellipsoid(&format!(
        "power = 100\npulse = {{ frequency = 4, duty = 0.5 }}\n{passes}"
    ));
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    let (mut source, ()) = prepare(&mut world, source, |setup: &mut Setup<'_>| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        setup.own(0, &keys::TEMPERATURE).expect("free");
    })
    .expect("valid");
    crate::testing::set(&mut world, &keys::TEMPERATURE, |_| 500.0);
    let first = energy(&mut *source, &world, 1.7);
    assert!((first - 50.0).abs() < 1e-9, "{first}");
    crate::testing::set(&mut world, &keys::TEMPERATURE, |_| 300.0);
    source.begin_step(&world, 1.7);
    let next = source
        .step_limits(1.7)
        .next_event
        .expect("the first switch of the second pass");
    assert!((next - 1.825).abs() < 1e-12, "{next}");
}
