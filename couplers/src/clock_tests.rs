//! What couplers of all kinds tell the clock, and what they keep for a restart.

use std::path::Path;
use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::world::exchange::Exchange;
use perimelt_core::{Body, Coupler, Key, RunningCoupler, Setup, Step, Stepping, World, keys};
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
use crate::testing::{STEEL, apply, block, prepare, read, set, set_vector, values};
use crate::transformation_heat::TransformationHeat;
use crate::viscous_heat::ViscousHeat;

/// A coupler that is ready to run.
pub(crate) struct Ready {
    /// Its `type` in a case file.
    name: String,
    pub running: Box<dyn RunningCoupler>,
    pub stepping: Stepping,
}

/// Prepares the coupler of a table beside a physics that owns and consumes what couplers need.
pub(crate) fn ready_on<C: Coupler + DeserializeOwned + 'static>(
    bodies: Vec<Body>,
    table: &str,
) -> Ready {
    let mut world = World::new(bodies);
    let mut coupler: Box<dyn Coupler> = Box::new(read::<C>(table));
    let keys_given = serde_json::to_value(&coupler).expect("serialises");
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("the coupler");
    coupler.publish(&mut setup).expect("valid");
    let running = coupler.prepare(&mut setup).expect("valid");
    setup.next_plugin("the physics");
    for key in [
        keys::TEMPERATURE,
        keys::AUSTENITE,
        keys::FERRITE,
        keys::PEARLITE,
        keys::BAINITE,
        keys::MARTENSITE,
        keys::PLASTIC_WORK,
    ] {
        setup.own(0, &key).expect("free");
    }
    setup.own(0, &keys::DISPLACEMENT).expect("free");
    setup.own(0, &keys::VELOCITY).expect("free");
    setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    setup.consume(0, &keys::EIGENSTRAIN_TENSOR).expect("free");
    setup.consume(0, &keys::BODY_FORCE).expect("free");
    setup.consume(0, &keys::CONSTRAINT).expect("free");
    setup.facts::<Rc<Exchange>>(0).for_each(drop);
    setup.facts::<perimelt_core::Wall>(0).for_each(drop);
    let finished = setup.finish().map_err(|mistakes| mistakes[0].1.to_string());
    Ready {
        name: keys_given["type"].to_string(),
        running,
        stepping: finished.expect("complete").stepping.swap_remove(0),
    }
}

fn steel() -> Body {
    block([3, 3, 3], 3, &format!("{STEEL}\nyield_stress = 4e8"))
}

/// A source that is ready on a block of steel, see [`ready_on`].
pub(crate) fn ready<C: Coupler + DeserializeOwned + 'static>(table: &str) -> Ready {
    ready_on::<C>(vec![steel()], table)
}

/// All events after time 0, s.
fn events(coupler: &dyn RunningCoupler) -> Vec<f64> {
    let next = |after: &f64| coupler.step_limits(*after).next_event;
    std::iter::successors(next(&0.0), next).collect()
}

/// Steps land on the rows of tables in time, and on the times of releases and cuts.
#[test]
fn rows_in_time_are_events() {
    let table = "{ time = [0, 1, 4], value = [300, 300, 500] }";
    for (coupler, expected) in [
        (
            ready::<HeatFlux>(&format!("faces = ['z+']\nflux = {table}")),
            &[1.0, 4.0][..],
        ),
        (
            ready::<Convection>(&format!("coefficient = 1\nambient = {table}")),
            &[1.0, 4.0],
        ),
        (
            ready::<Radiation>(&format!("ambient = {table}")),
            &[1.0, 4.0],
        ),
        (
            ready::<PrescribedTemperature>(&format!("face = 'x-'\nvalue = {table}")),
            &[1.0, 4.0],
        ),
        (
            ready::<Traction>(&format!("faces = ['x+']\npressure = 1\nfactor = {table}")),
            &[1.0, 4.0],
        ),
        (
            ready::<InherentStrain>(&format!(
                "region = 'left'\nstrain = [1, 0, 0]\nfactor = {table}"
            )),
            &[1.0, 4.0],
        ),
        // components have rows of their own
        (
            ready::<PrescribedDisplacement>(&format!(
                "face = 'x-'\nx = {table}\ny = {{ time = [2, 3], value = [0, 1] }}\nz = 0"
            )),
            &[1.0, 2.0, 3.0, 4.0],
        ),
        (ready::<Clamp>("region = 'left'\nuntil = 2"), &[2.0]),
        (ready::<Cut>("region = 'left'\ntime = 3"), &[3.0]),
        (ready::<Clamp>("region = 'left'"), &[]),
        (ready::<HeatFlux>("faces = ['z+']\nflux = 1"), &[]),
    ] {
        assert_eq!(events(&*coupler.running), expected, "{}", coupler.name);
    }
}

/// A steady coupler is applied once for all sub-steps of its physics: what it adds depends on neither time nor step.
#[test]
fn couplers_that_depend_on_state_only_are_steady() {
    let mut fluids = vec![steel(), steel()];
    for (body, name) in fluids.iter_mut().zip(["a", "b"]) {
        body.name = name.into();
    }
    let varying = "{ time = [0, 1], value = [0, 1] }";
    for (coupler, is_steady) in [
        (
            ready::<Buoyancy>("gravity = [0, -10, 0]\nreference_temperature = 300"),
            true,
        ),
        (
            ready::<ThermalExpansion>("reference_temperature = 300"),
            true,
        ),
        (ready::<PhaseExpansion>("reference_temperature = 300"), true),
        (ready::<PhaseStrength>(""), true),
        (ready::<PhaseChange>(""), true),
        (
            ready_on::<FluidStructure>(fluids, "fluid = 'a'\nsolid = 'b'"),
            true,
        ),
        (ready::<Insulated>(""), true),
        (ready::<Symmetry>("face = 'x-'"), true),
        (ready::<Wall>("faces = ['x-']"), true),
        (
            ready::<InherentStrain>("region = 'left'\nstrain = [1, 0, 0]"),
            true,
        ),
        (
            ready::<InherentStrain>(&format!(
                "region = 'left'\nstrain = [1, 0, 0]\nfactor = {varying}"
            )),
            false,
        ),
        (
            ready::<HeatFlux>(&format!("faces = ['z+']\nflux = {varying}")),
            false,
        ),
        (ready::<PlasticHeat>(""), false),
    ] {
        assert_eq!(coupler.stepping.is_steady, is_steady, "{}", coupler.name);
    }
}

fn restore(world: &World, coupler: &mut dyn RunningCoupler, saved: &str) {
    let mut json = serde_json::Deserializer::from_str(saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    coupler.load(world, &mut erased).expect("what was saved");
}

/// A coupler that makes heat of the field that the test sets.
fn heat<C: Coupler + DeserializeOwned + 'static>(
    world: &mut World,
    table: &str,
    key: &Key<f64>,
) -> Box<dyn RunningCoupler> {
    let prepared = prepare(world, read::<C>(table), |setup| {
        setup.own(0, key).expect("free");
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    });
    prepared.expect("valid").0
}

/// Heat from a rate is that of the change since it was last taken, also by the coupler of a run before the restart.
#[test]
fn a_restart_knows_the_work_that_became_heat_before() {
    type New = fn(&mut World, &str, &Key<f64>) -> Box<dyn RunningCoupler>;
    let cases: [(New, _, _, f64); 4] = [
        (
            heat::<PlasticHeat>,
            "fraction = 0.5",
            &keys::PLASTIC_WORK,
            0.5,
        ),
        (heat::<ViscousHeat>, "", &keys::VISCOUS_WORK, 1.0),
        // of 1000 kg/m³
        (
            heat::<TransformationHeat>,
            "latent_heat = 2",
            &keys::AUSTENITE,
            -2000.0,
        ),
        // expansion 1e-3 at 500 K
        (
            heat::<DeformationHeat>,
            "linearised_at = 500",
            &keys::CONJUGATE_STRESS,
            -0.5,
        ),
    ];
    for (new, table, key, factor) in cases {
        let name = &key.name;
        let mut world = World::new(vec![block(
            [2, 1, 1],
            1,
            "density = 1000\nthermal_expansion = 1e-3",
        )]);
        let mut first = new(&mut world, table, key);
        set(&mut world, key, |i| [3.0, 5.0][i]);
        apply(&world, &mut *first, 0.0);
        let heat = values(&world, &keys::HEAT_SOURCE);
        assert_eq!(heat, [3.0 * factor, 5.0 * factor], "{name}");
        assert_eq!(first.report()[0].value, 8.0 * factor, "{name}");
        let saved = serde_json::to_string(&first.save(&world)).expect("serialises");

        let mut other = World::new(vec![world.body(0).clone()]);
        let mut second = new(&mut other, table, key);
        restore(&other, &mut *second, &saved);
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
        let mut world = World::new(vec![body.clone()]);
        let (ball, ()) = prepare(&mut world, new(), |setup| {
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
    let saved = serde_json::to_string(&first.save(&world)).expect("serialises");
    let (other, mut second) = ready();
    restore(&other, &mut *second, &saved);
    for (world, ball) in [(&world, &mut first), (&other, &mut second)] {
        ball.apply(world, Step::new(0.07, 0.01)).expect("applies");
    }
    let numbers = |ball: &dyn RunningCoupler| -> Vec<(String, f64)> {
        let reports = ball.report().into_iter();
        reports.map(|r| (r.name, r.value)).collect()
    };
    assert_eq!(numbers(&*first), numbers(&*second));
    let force = numbers(&*first)[8].clone();
    assert!(force.0 == "force.z" && force.1 > 0.0, "{force:?}");
}
