//! Films over a row of cells: what is dry, wet or lifted off, and the stable step.

use std::path::Path;

use std::rc::Rc;

use super::*;
use crate::testing::{STEEL, apply, block, check_slopes, exchange, heat, read, refusal, set};
use perimelt_core::world::exchange::Exchange;

const JET: &str =
    "flow = 'x+'\nstart = 1\nspeed = 0\nimpingement = 1.6\nwater = 300\nleidenfrost = 700
    flux = { temperature = [300, 500, 700], value = [0, 8e4, 4e4] }\nfilm_coefficient = 100\n";

/// Heat of the points (W), and dry, wet and lifted areas (m²).
fn jet(faces: &str, dimension: usize) -> (Vec<f64>, Vec<f64>) {
    let mut world = World::new(vec![block([6, 1, 1], dimension, STEEL)]);
    let (mut coupler, exchange) = exchange(&mut world, read::<WaterJet>(&format!("{JET}{faces}")));
    let temperatures = [900.0, 900.0, 400.0, 600.0, 800.0, 400.0];
    set(&mut world, &keys::TEMPERATURE, |i| temperatures[i]);
    apply(&world, &mut *coupler, 0.0);
    check_slopes(&exchange, &[310.0, 400.0]);
    let areas = coupler.report()[1..].iter().map(|r| r.value).collect();
    (heat(&world, &exchange, |i| temperatures[i]), areas)
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
    let active = setup
        .change_material(0, perimelt_core::Change::Births, &[4, 5, 6, 7])
        .expect("a lattice");
    setup.next_plugin("thermal");
    setup.own(0, &keys::TEMPERATURE).expect("free");
    setup.next_plugin("jet");
    // above all of the body; the film runs down
    let jet = JET
        .replace("'x+'", "'z-'")
        .replace("start = 1", "start = 10");
    let coupler: WaterJet = read(&format!("{jet}faces = ['x+']"));
    let mut coupler = Box::new(coupler).prepare(&mut setup).expect("valid");
    let exchange = setup.facts::<Rc<Exchange>>(0).next().cloned().expect("one");
    setup.finish().expect("complete");
    let temperature = |i: usize| if i < 4 { 400.0 } else { 900.0 };
    let mut heat = || {
        set(&mut world, &keys::TEMPERATURE, temperature);
        apply(&world, &mut *coupler, 0.0);
        let heat = heat(&world, &exchange, temperature);
        world.write(active).fill(1.0);
        heat
    };
    // wet; then the film lifts off from the hot material above
    assert_eq!(heat(), [0.0, -4e4, 0.0, -4e4, 0.0, 0.0, 0.0, 0.0]);
    let lifted = [0.0, -1e4, 0.0, -1e4, 0.0, -6e4, 0.0, -6e4];
    assert_eq!(heat(), lifted);
}

/// The largest slope of the boiling curve or the coefficient of the film.
#[test]
fn the_stiffness_is_that_of_the_steepest_part_of_the_boiling_curve() {
    for (change, with, expected) in [
        ("", "", 400.0),
        ("film_coefficient = 100", "film_coefficient = 1000", 1000.0),
        (
            "flux = { temperature = [300, 500, 700], value = [0, 8e4, 4e4] }",
            "flux = 8e4",
            100.0,
        ),
    ] {
        let table = format!("{JET}faces = ['z+']").replace(change, with);
        let mut world = World::new(vec![block([6, 1, 1], 3, STEEL)]);
        let (_, exchange) = exchange(&mut world, read::<WaterJet>(&table));
        assert_eq!(exchange.law().stiffness(1000.0), expected, "{with}");
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
        let (mut coupler, exchange) = exchange(&mut world, read::<WaterJet>(&table));
        set(&mut world, &keys::TEMPERATURE, |i| temperatures[i]);
        apply(&world, &mut *coupler, 1.0);
        let expected_heat: Vec<f64> = expected
            .iter()
            .zip(temperatures)
            .map(|(film, t)| match film {
                Dry => 0.0,
                Wet => -1000.0,
                LiftedOff => 300.0 - t,
            })
            .collect();
        let heat = heat(&world, &exchange, |i| temperatures[i]);
        assert_eq!(heat, expected_heat, "{keys}");
        let count = |film: Film| expected.iter().filter(|f| **f == film).count() as f64;
        let areas: Vec<f64> = coupler.report()[1..].iter().map(|r| r.value).collect();
        assert_eq!(areas, Film::ALL.map(count), "{keys}");
    }
}

#[test]
fn a_jet_that_cannot_be_is_refused() {
    let mut world = World::new(vec![block([6, 1, 1], 3, STEEL)]);
    for (change, key) in [("faces = ['z+']\nregion = 'lef'", "region"), ("", "faces")] {
        assert!(refusal(&mut world, read::<WaterJet>(&format!("{JET}{change}"))).starts_with(key));
    }
    let coupler: WaterJet = read(&JET.replace("leidenfrost = 700", "leidenfrost = 200"));
    assert!(refusal(&mut world, coupler).starts_with("leidenfrost"));
    let negative = JET.replace("flux = ", "flux = -1e6 # ");
    assert!(refusal(&mut world, read::<WaterJet>(&negative)).starts_with("flux"));
    for (key, value) in [
        ("impingement = 1.6", "impingement = 0"),
        ("film_coefficient = 100", "film_coefficient = -1"),
        ("water = 300", "water = 0"),
        ("leidenfrost = 700", "leidenfrost = 300"),
        ("start = 1", "start = inf"),
        ("speed = 0", "speed = nan"),
    ] {
        let table = format!("{}faces = ['z+']", JET.replace(key, value));
        let coupler: WaterJet = read(&table);
        let key = key.split(' ').next().expect("a key");
        let refused = refusal(&mut world, coupler);
        assert!(refused.starts_with(&format!("{key}: ")), "{refused}");
    }
}
