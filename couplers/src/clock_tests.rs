//! What couplers of all kinds tell the clock, and what they keep for a restart.

use nalgebra::Vector3;
use perimelt_core::{Coupler, Step, World, keys};
use serde::de::DeserializeOwned;

use crate::boundary::{
    Clamp, Convection, HeatFlux, Insulated, PrescribedDisplacement, PrescribedTemperature,
    Radiation, Symmetry, Traction, Wall,
};
use crate::buoyancy::Buoyancy;
use crate::contact::Impactor;
use crate::cut::Cut;
use crate::deformation_heat::DeformationHeat;
use crate::expansion::ThermalExpansion;
use crate::fluid_structure::FluidStructure;
use crate::inherent_strain::InherentStrain;
use crate::phase_change::PhaseChange;
use crate::phase_expansion::PhaseExpansion;
use crate::phase_strength::PhaseStrength;
use crate::plastic_heat::PlasticHeat;
use crate::testing::{apply, block, prepare, read, set, set_vector, values};
use crate::transformation_heat::TransformationHeat;
use crate::viscous_heat::ViscousHeat;

fn coupler<C: Coupler + DeserializeOwned + 'static>(table: &str) -> Box<dyn Coupler> {
    Box::new(read::<C>(table))
}

/// Its `type` in a case file.
fn name(coupler: &dyn Coupler) -> String {
    let keys = serde_json::to_value(coupler).expect("serialises");
    keys["type"].to_string()
}

/// All events after time 0, s.
fn events(coupler: &dyn Coupler) -> Vec<f64> {
    let after = |time: &f64| coupler.next_event(*time);
    std::iter::successors(coupler.next_event(0.0), after).collect()
}

/// Steps land on the rows of tables in time, and on the times of releases and cuts.
#[test]
fn rows_in_time_are_events() {
    let table = "{ time = [0, 1, 4], value = [300, 300, 500] }";
    for (coupler, expected) in [
        (
            coupler::<HeatFlux>(&format!("faces = ['z+']\nflux = {table}")),
            &[1.0, 4.0][..],
        ),
        (
            coupler::<Convection>(&format!("coefficient = 1\nambient = {table}")),
            &[1.0, 4.0],
        ),
        (
            coupler::<Radiation>(&format!("ambient = {table}")),
            &[1.0, 4.0],
        ),
        (
            coupler::<PrescribedTemperature>(&format!("face = 'x-'\nvalue = {table}")),
            &[1.0, 4.0],
        ),
        (
            coupler::<Traction>(&format!("faces = ['x+']\npressure = 1\nfactor = {table}")),
            &[1.0, 4.0],
        ),
        (
            coupler::<InherentStrain>(&format!(
                "region = 'left'\nstrain = [1, 0, 0]\nfactor = {table}"
            )),
            &[1.0, 4.0],
        ),
        // components have rows of their own
        (
            coupler::<PrescribedDisplacement>(&format!(
                "face = 'x-'\nx = {table}\ny = {{ time = [2, 3], value = [0, 1] }}\nz = 0"
            )),
            &[1.0, 2.0, 3.0, 4.0],
        ),
        (coupler::<Clamp>("region = 'left'\nuntil = 2"), &[2.0]),
        (coupler::<Cut>("region = 'left'\ntime = 3"), &[3.0]),
        (coupler::<Clamp>("region = 'left'"), &[]),
        (coupler::<HeatFlux>("faces = ['z+']\nflux = 1"), &[]),
    ] {
        assert_eq!(events(&*coupler), expected, "{}", name(&*coupler));
    }
}

/// A steady coupler is applied once for all sub-steps of its physics: what it adds depends on neither time nor step.
#[test]
fn couplers_that_depend_on_state_only_are_steady() {
    let varying = "{ time = [0, 1], value = [0, 1] }";
    for (coupler, is_steady) in [
        (
            coupler::<Buoyancy>("gravity = [0, -10, 0]\nreference_temperature = 300"),
            true,
        ),
        (
            coupler::<ThermalExpansion>("reference_temperature = 300"),
            true,
        ),
        (
            coupler::<PhaseExpansion>("reference_temperature = 300"),
            true,
        ),
        (coupler::<PhaseStrength>(""), true),
        (coupler::<PhaseChange>(""), true),
        (coupler::<FluidStructure>("fluid = 'a'\nsolid = 'b'"), true),
        (coupler::<Insulated>(""), true),
        (coupler::<Symmetry>("face = 'x-'"), true),
        (coupler::<Wall>("faces = ['x-']"), true),
        (
            coupler::<InherentStrain>("region = 'left'\nstrain = [1, 0, 0]"),
            true,
        ),
        (
            coupler::<InherentStrain>(&format!(
                "region = 'left'\nstrain = [1, 0, 0]\nfactor = {varying}"
            )),
            false,
        ),
        (
            coupler::<HeatFlux>(&format!("faces = ['z+']\nflux = {varying}")),
            false,
        ),
        (coupler::<PlasticHeat>(""), false),
    ] {
        assert_eq!(coupler.is_steady(), is_steady, "{}", name(&*coupler));
    }
}

fn restore(coupler: &mut dyn Coupler, saved: &str) {
    let mut json = serde_json::Deserializer::from_str(saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    coupler.load(&mut erased).expect("what was saved");
}

/// Heat from a rate is that of the change since it was last taken, also by the coupler of a run before the restart.
#[test]
fn a_restart_knows_the_work_that_became_heat_before() {
    type New = fn() -> Box<dyn Coupler>;
    let cases: [(New, _, f64); 4] = [
        (
            || coupler::<PlasticHeat>("fraction = 0.5"),
            &keys::PLASTIC_WORK,
            0.5,
        ),
        (|| coupler::<ViscousHeat>(""), &keys::VISCOUS_WORK, 1.0),
        // of 1000 kg/m³
        (
            || coupler::<TransformationHeat>("latent_heat = 2"),
            &keys::AUSTENITE,
            -2000.0,
        ),
        // expansion 1e-3 at 500 K
        (
            || coupler::<DeformationHeat>("linearised_at = 500"),
            &keys::CONJUGATE_STRESS,
            -0.5,
        ),
    ];
    for (new, key, factor) in cases {
        let mut world = World::new(vec![block(
            [2, 1, 1],
            1,
            "density = 1000\nthermal_expansion = 1e-3",
        )]);
        let mut first = new();
        prepare(&mut world, &mut *first, |setup| {
            setup.own(0, key).expect("free");
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        let name = name(&*first);
        set(&mut world, key, |i| [3.0, 5.0][i]);
        apply(&world, &mut *first, 0.0);
        let heat = values(&world, &keys::HEAT_SOURCE);
        assert_eq!(heat, [3.0 * factor, 5.0 * factor], "{name}");
        assert_eq!(first.report()[0].value, 8.0 * factor, "{name}");
        let saved = serde_json::to_string(&first.save()).expect("serialises");

        let mut other = World::new(vec![world.body(0).clone()]);
        let mut second = new();
        prepare(&mut other, &mut *second, |setup| {
            setup.own(0, key).expect("free");
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        restore(&mut *second, &saved);
        set(&mut other, key, |i| [4.0, 5.0][i]);
        let step = Step::new(1.0, 0.5);
        second.apply(&other, step).expect("applies");
        let heat = values(&other, &keys::HEAT_SOURCE);
        assert_eq!(heat, [2.0 * factor, 0.0], "{name}");
        assert_eq!(second.report()[0].value, 2.0 * factor, "{name}");
    }
}

#[test]
fn a_restart_knows_where_a_ball_is_and_how_it_moves() {
    let new = || -> Impactor {
        read("centre = [1.5, 1.5, 4]\nradius = 1\nvelocity = [0, 0, -10]\nmass = 500")
    };
    let body = block([3, 3, 3], 3, "density = 1000\nyoungs_modulus = 1e6");
    let ready = || {
        let (mut world, mut ball) = (World::new(vec![body.clone()]), new());
        prepare(&mut world, &mut ball, |setup| {
            setup.own(0, &keys::DISPLACEMENT).expect("free");
            setup.own(0, &keys::VELOCITY).expect("free");
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        })
        .expect("valid");
        set_vector(&mut world, &keys::VELOCITY, Vector3::zeros());
        (world, ball)
    };
    let (world, mut first) = ready();
    // 0.5 m to the topmost points, then 0.2 m into them, then out again
    first.apply(&world, Step::new(0.0, 0.07)).expect("applies");
    let saved = serde_json::to_string(&first.save()).expect("serialises");
    let (other, mut second) = ready();
    restore(&mut second, &saved);
    for (world, ball) in [(&world, &mut first), (&other, &mut second)] {
        ball.apply(world, Step::new(0.07, 0.01)).expect("applies");
    }
    let numbers = |ball: &Impactor| -> Vec<(String, f64)> {
        let reports = ball.report().into_iter();
        reports.map(|r| (r.name, r.value)).collect()
    };
    assert_eq!(numbers(&first), numbers(&second));
    let force = numbers(&first)[8].clone();
    assert!(force.0 == "force.z" && force.1 > 0.0, "{force:?}");
}
