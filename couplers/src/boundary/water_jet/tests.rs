//! Films over a row of cells: what is dry, wet or lifted off, and the stable step.

use std::path::Path;

use super::*;
use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

const JET: &str =
    "flow = 'x+'\nstart = 1\nspeed = 0\nimpingement = 1.6\nwater = 300\nleidenfrost = 700
    flux = { temperature = [300, 500, 700], value = [0, 8e4, 4e4] }\nfilm_coefficient = 100\n";

/// Heat sources (W/m³), and dry, wet and lifted areas (m²).
fn jet(faces: &str, dimension: usize) -> (Vec<f64>, Vec<f64>) {
    let mut world = World::new(vec![block([6, 1, 1], dimension, STEEL)]);
    let mut coupler: WaterJet = read(&format!("{JET}{faces}"));
    prepare(&mut world, &mut coupler, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |i| {
        [900.0, 900.0, 400.0, 600.0, 800.0, 400.0][i]
    });
    apply(&world, &mut coupler, 0.0);
    let areas = coupler.report()[1..].iter().map(|r| r.value).collect();
    (values(&world, &keys::HEAT_SOURCE), areas)
}

#[test]
fn the_jet_boils_the_film_wets_until_it_lifts_off() {
    // dry; hit by the jet although hot; hit; wet; lifted off, although the last one is cold
    let expected = vec![0.0, -4e4, -4e4, -6e4, -5e4, -1e4];
    let expected = (expected, vec![1.0, 3.0, 2.0]);
    assert_eq!(jet("faces = ['z+']", 3), expected);
    assert_eq!(jet("", 2), expected);
}

#[test]
fn the_film_runs_over_the_material_that_is_there() {
    let mut world = World::new(vec![block([2, 1, 4], 3, STEEL)]);
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("deposit");
    let active = setup.deposit(0, &[4, 5, 6, 7]).expect("a lattice");
    setup.next_plugin("thermal");
    setup.own(0, &keys::TEMPERATURE).expect("free");
    setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    setup.follow_activity(0);
    setup.next_plugin("jet");
    // above all of the body; the film runs down
    let jet = JET
        .replace("'x+'", "'z-'")
        .replace("start = 1", "start = 10");
    let mut coupler: WaterJet = read(&format!("{jet}faces = ['x+']"));
    coupler.prepare(&mut setup).expect("valid");
    setup.finish().expect("complete");
    let mut heat = || {
        set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
        set(&mut world, &keys::TEMPERATURE, |i| {
            if i < 4 { 400.0 } else { 900.0 }
        });
        apply(&world, &mut coupler, 0.0);
        let heat = values(&world, &keys::HEAT_SOURCE);
        world.write(active).fill(1.0);
        heat
    };
    // wet; then the film lifts off from the hot material above
    assert_eq!(heat(), [0.0, -4e4, 0.0, -4e4, 0.0, 0.0, 0.0, 0.0]);
    let lifted = [0.0, -1e4, 0.0, -1e4, 0.0, -6e4, 0.0, -6e4];
    assert_eq!(heat(), lifted);
}

/// Half of the time constant `C V / (h A)` of a point, with the largest slope of the boiling curve or the coefficient of
/// the film as h.
#[test]
fn steps_resolve_the_steepest_part_of_the_boiling_curve() {
    // 4e6 J/(m³ K), and slopes of 400 W/(m² K) up to 500 K
    for (change, with, stable) in [
        ("", "", 4e6 / 400.0),
        ("faces = ['z+']", "faces = ['z+', 'y+']", 4e6 / 800.0),
        (
            "film_coefficient = 100",
            "film_coefficient = 1000",
            4e6 / 1000.0,
        ),
        (
            "flux = { temperature = [300, 500, 700], value = [0, 8e4, 4e4] }",
            "flux = 8e4",
            4e6 / 100.0,
        ),
    ] {
        let table = format!("{JET}faces = ['z+']").replace(change, with);
        let mut world = World::new(vec![block([6, 1, 1], 3, STEEL)]);
        let mut coupler: WaterJet = read(&table);
        assert_eq!(coupler.step_limit(), None, "not prepared");
        prepare(&mut world, &mut coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        let found = coupler.stable_step(&world).expect("there is an exchange");
        assert!((found / stable - 1.0).abs() < 1e-12, "{with}: {found}");
        let limit = coupler.step_limit().expect("there is an exchange");
        assert!(
            (limit / (0.5 * stable) - 1.0).abs() < 1e-12,
            "{with}: {limit}"
        );
    }
}

/// Temperatures of the points at 0.5, 1.5, ... 5.5 m, and the films over them. The step is from 1 s to 2 s.
#[test]
fn the_jet_moves_and_its_limits_belong_to_the_wetted_surface() {
    use Film::{Dry, LiftedOff, Wet};
    for (keys, temperatures, expected) in [
        // at 2.0 m in the middle of the step
        (
            "flow = 'x+'\nstart = -1\nspeed = 2",
            [400.0; 6],
            [Dry, Dry, Wet, Wet, Wet, Wet],
        ),
        (
            "flow = 'x-'\nstart = 5\nspeed = -2",
            [400.0; 6],
            [Wet, Wet, Dry, Dry, Dry, Dry],
        ),
        // a point at the jet, and one at the end of the impingement, although hot
        (
            "flow = 'x+'\nstart = 0.5\nspeed = 0",
            [900.0; 6],
            [Wet, Wet, LiftedOff, LiftedOff, LiftedOff, LiftedOff],
        ),
        // just at the Leidenfrost temperature the film stays
        (
            "flow = 'x+'\nstart = 0.5\nspeed = 0",
            [700.0, 700.0, 700.0, 700.1, 700.0, 700.0],
            [Wet, Wet, Wet, LiftedOff, LiftedOff, LiftedOff],
        ),
    ] {
        let mut world = World::new(vec![block([6, 1, 1], 3, STEEL)]);
        let table = format!(
            "{keys}\nfaces = ['z+']\nimpingement = 1\nwater = 300\nleidenfrost = 700\nflux = 1000\nfilm_coefficient = 1"
        );
        let mut coupler: WaterJet = read(&table);
        prepare(&mut world, &mut coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| temperatures[i]);
        apply(&world, &mut coupler, 1.0);
        let heat: Vec<f64> = expected
            .iter()
            .zip(temperatures)
            .map(|(film, t)| match film {
                Dry => 0.0,
                Wet => -1000.0,
                LiftedOff => 300.0 - t,
            })
            .collect();
        assert_eq!(values(&world, &keys::HEAT_SOURCE), heat, "{keys}");
        let count = |film: Film| expected.iter().filter(|f| **f == film).count() as f64;
        let areas: Vec<f64> = coupler.report()[1..].iter().map(|r| r.value).collect();
        assert_eq!(areas, Film::ALL.map(count), "{keys}");
    }
}

#[test]
fn a_jet_that_cannot_be_is_refused() {
    let mut world = World::new(vec![block([6, 1, 1], 3, STEEL)]);
    for (change, key) in [("faces = ['z+']\nregion = 'lef'", "region"), ("", "faces")] {
        let mut coupler: WaterJet = read(&format!("{JET}{change}"));
        assert!(refusal(&mut world, &mut coupler).starts_with(key));
    }
    let mut coupler: WaterJet = read(&JET.replace("leidenfrost = 700", "leidenfrost = 200"));
    assert!(refusal(&mut world, &mut coupler).starts_with("leidenfrost"));
    let negative = JET.replace("flux = ", "flux = -1e6 # ");
    let mut coupler: WaterJet = read(&negative);
    assert!(refusal(&mut world, &mut coupler).starts_with("flux"));
    for (key, value) in [
        ("impingement = 1.6", "impingement = 0"),
        ("film_coefficient = 100", "film_coefficient = -1"),
        ("water = 300", "water = 0"),
        ("leidenfrost = 700", "leidenfrost = 300"),
        ("start = 1", "start = inf"),
        ("speed = 0", "speed = nan"),
    ] {
        let table = format!("{}faces = ['z+']", JET.replace(key, value));
        let mut coupler: WaterJet = read(&table);
        let key = key.split(' ').next().expect("a key");
        let refused = refusal(&mut world, &mut coupler);
        assert!(refused.starts_with(&format!("{key}: ")), "{refused}");
    }
}
