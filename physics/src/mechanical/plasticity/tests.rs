//! The states of the points of a body that flows, and the keys.

use perimelt_core::body::Store;

use super::law::EquivalentStrain;
use super::*;
use crate::testing::{block, material, read};

/// Two points of two materials, and the hardening factor 1 + 10 p up to p = 0.1.
fn plasticity(keys: &str) -> Plasticity {
    let soft = "yield_stress = { temperature = [300, 400], value = [200e6, 100e6] }\nhardening_modulus = 1e9";
    let mut body = block([2, 1, 1], 2, 1e-3, Store::Lattice, soft);
    body.materials.push(material("yield_stress = 500e6"));
    body.material_of_point = vec![0, 1];
    let chosen = ChosenFlow::of(Some(read(keys)), None, None).expect("valid");
    let chosen = chosen.expect("it flows");
    Plasticity::of(chosen, &body, Plane::Strain).expect("it has all constants")
}

#[test]
fn yield_stresses_are_those_of_material_and_temperature_or_given() {
    let mut plasticity = plasticity("");
    for (temperature, given, expected) in [
        (None, None, [[200e6, 1e9], [500e6, 0.0]]),
        (Some([350.0, 350.0]), None, [[150e6, 1e9], [500e6, 0.0]]),
        (Some([400.0, 300.0]), None, [[100e6, 1e9], [500e6, 0.0]]),
        (
            Some([400.0, 300.0]),
            Some([7e6, 8e6]),
            [[7e6, 1e9], [8e6, 0.0]],
        ),
    ] {
        let temperature = temperature.as_ref().map(|t| &t[..]);
        let given = given.as_ref().map(|g| &g[..]);
        plasticity.set_conditions(&[0, 1], temperature, given, 1.0);
        assert_eq!(plasticity.conditions.constants, expected.as_flattened());
    }
}

/// The flow stress is that of the constants, and of the table.
#[test]
fn the_flow_stress_hardens_by_modulus_and_table() {
    let table = "hardening = { plastic_strain = [0, 0.1], factor = [1, 2] }";
    for (keys, constants, flow_stress) in [
        // 200 MPa and 1 GPa times 0.05
        ("", [200e6, 1e9], 250e6),
        // and a factor of 1.5 at 0.05
        (table, [200e6, 1e9], 350e6),
        (table, [500e6, 0.0], 750e6),
    ] {
        let mut law: J2 = read(keys);
        FlowStressLaw::prepare(&mut law).expect("valid");
        let strain = EquivalentStrain {
            end: 0.05,
            increment: 0.02,
        };
        let found = law.flow_stress(&point(&constants), strain);
        assert!((found - flow_stress).abs() < 1e-6, "{keys}: {found}");
    }
}

/// A point at the start of a step of a second with the moduli of steel.
fn point(constants: &[f64]) -> FlowPoint<'_> {
    let moduli = Moduli::new(2e11, 0.3, 3, Plane::Stress);
    FlowPoint {
        constants,
        temperature: None,
        step: 1.0,
        shear_modulus: moduli.shear,
        bulk_modulus: moduli.bulk,
        equivalent: 0.0,
        state: &[],
    }
}

/// Lets all points flow by an equivalent strain, with a work of 3 J/m³ each.
fn try_flow(plasticity: &mut Plasticity, equivalent: f64) {
    let flow = Flow {
        strain: [0.01; 6],
        equivalent,
        work: 3.0,
    };
    let points = plasticity.states.try_from_settled();
    points.for_each(|(settled, tried)| tried.advance(settled.inelastic, &flow));
}

#[test]
fn an_accepted_flow_has_done_its_work() {
    let mut plasticity = plasticity("");
    (0..2).for_each(|i| plasticity.states.settled_mut(i).equivalent = 0.03);
    try_flow(&mut plasticity, 0.02);
    let mut work = [1.0; 2];
    plasticity.settle(&mut work);
    assert_eq!(work, [4.0; 2]);
    let settled = plasticity.states.settled()[1];
    assert_eq!((settled.equivalent, settled.strain[3]), (0.05, 0.01));
}

/// From the annealing temperature on points forget their hardening, and their deviatoric elastic strain becomes inelastic.
#[test]
fn annealing_begins_at_its_temperature() {
    let moduli = Moduli::new(2e11, 0.3, 3, Plane::Stress);
    let stress = [[30e6, 0.0, 0.0, 5e6, 0.0, 0.0]; 2];
    let shear = 2.0 * moduli.shear;
    let relieved = [
        20e6 / shear,
        -10e6 / shear,
        -10e6 / shear,
        5e6 / shear,
        0.0,
        0.0,
    ];
    for (keys, anneals) in [
        ("", [false; 2]),
        ("annealing_temperature = 1300", [false, true]),
    ] {
        let mut plasticity = plasticity(keys);
        let hardened = Inelastic {
            strain: [0.01; 6],
            equivalent: 0.1,
        };
        plasticity.states.load([hardened; 2].into_iter());
        plasticity.anneal(&[1299.9, 1300.0], &stress, |_| moduli);
        for (settled, anneals) in plasticity.states.settled().iter().zip(anneals) {
            assert_eq!(settled.equivalent, if anneals { 0.0 } else { 0.1 });
            for (found, relieved) in settled.strain.iter().zip(relieved) {
                let expected = if anneals { 0.01 + relieved } else { 0.01 };
                assert!((found - expected).abs() < 1e-15, "{keys}: {found}");
            }
        }
    }
}

#[test]
fn a_hardening_curve_starts_at_zero_and_never_falls() {
    for (keys, is_valid) in [
        ("plastic_strain = [0, 0.1], factor = [1, 2]", true),
        ("plastic_strain = [0, 0.1], factor = [1, 1]", true),
        ("plastic_strain = [0, 0.1], factor = [2, 1]", false),
        ("plastic_strain = [0.01, 0.1], factor = [1, 2]", false),
        ("plastic_strain = [], factor = []", false),
        ("plastic_strain = [0, 0], factor = [1, 2]", false),
    ] {
        for law in ["plasticity", "flow.j2"] {
            let chosen = match law {
                "plasticity" => {
                    ChosenFlow::of(Some(read(&format!("hardening = {{ {keys} }}"))), None, None)
                }
                _ => {
                    let law = read(&format!("j2.hardening = {{ {keys} }}"));
                    ChosenFlow::of(None, Some(law), None)
                }
            };
            let body = block([2, 1, 1], 1, 1e-3, Store::Lattice, "yield_stress = 1e8");
            let chosen = chosen.expect("valid").expect("it flows");
            let found = Plasticity::of(chosen, &body, Plane::Stress);
            assert_eq!(found.is_ok(), is_valid, "{law} {keys}");
            if let Err(error) = found {
                assert_eq!(error.key, format!("{law}.hardening"));
            }
        }
    }
}

/// A trial state is accepted or given up as a whole.
#[test]
fn a_rejected_trial_leaves_the_settled_state() {
    let mut plasticity = plasticity("");
    try_flow(&mut plasticity, 0.05);
    plasticity.states.reject();
    for states in [plasticity.states.settled(), plasticity.states.tried()] {
        assert!(states.iter().all(|s| s.equivalent == 0.0));
    }
    try_flow(&mut plasticity, 0.05);
    plasticity.states.commit();
    for states in [plasticity.states.settled(), plasticity.states.tried()] {
        assert!(states.iter().all(|s| s.equivalent == 0.05));
    }
}

/// Three halves of the growth of the compliance.
#[test]
fn transformation_flows_by_three_halves_of_its_compliance() {
    let mut plasticity = plasticity("");
    plasticity.set_transformation([2e-10, 0.0].into_iter());
    assert_eq!(plasticity.conditions.transformation, [3e-10, 0.0]);
}

/// Both forms at once, and an annealing temperature without flow or below 0 K, are refused at their keys.
#[test]
fn contradictory_keys_of_flow_are_refused() {
    let short = |keys: &str| Some(read::<PlasticitySection>(keys));
    let law = || Some(read::<Law<dyn FlowSweep>>("j2 = {}"));
    for (chosen, key) in [
        (ChosenFlow::of(short(""), law(), None), "flow"),
        (
            ChosenFlow::of(short(""), None, Some(1e3)),
            "annealing_temperature",
        ),
        (
            ChosenFlow::of(None, None, Some(1e3)),
            "annealing_temperature",
        ),
        (
            ChosenFlow::of(None, law(), Some(0.0)),
            "annealing_temperature",
        ),
        (
            ChosenFlow::of(short("annealing_temperature = -1"), None, None),
            "plasticity.annealing_temperature",
        ),
    ] {
        assert_eq!(chosen.expect_err("contradictory").key, key);
    }
    let annealed = ChosenFlow::of(None, law(), Some(1300.0)).expect("valid");
    assert_eq!(
        annealed.expect("it flows").annealing.map(|a| a.limit),
        Some(1300.0)
    );
}
