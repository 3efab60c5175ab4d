//! Surroundings as they are read, and bodies as surroundings.

use std::rc::Rc;

use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::exchange::Exchange;
use perimelt_core::{Access, Body, Description, RunningCoupler};

use super::*;
use crate::boundary::Convection;
use crate::testing::{STEEL, apply, block, prepare};

#[derive(Debug, Serialize, Deserialize)]
struct Holder {
    ambient: Ambient,
}

fn read(ambient: &str) -> Result<Ambient, String> {
    let holder = toml::from_str::<Holder>(&format!("ambient = {ambient}"));
    holder.map(|h| h.ambient).map_err(|e| e.to_string())
}

#[test]
fn surroundings_have_a_temperature_in_time_or_are_a_body() {
    assert_eq!(read("300"), Ok(Ambient::InTime(InTime::Constant(300.0))));
    for in_time in [
        "{ time = [0, 1], value = [300, 400] }",
        "'293.15 + fire_iso_834(t)'",
        "300.5",
    ] {
        assert!(matches!(read(in_time), Ok(Ambient::InTime(_))), "{in_time}");
    }
    let body = |horizon, exchange| {
        Ok(Ambient::Body(AmbientBody {
            body: "gas".into(),
            horizon,
            exchange,
        }))
    };
    assert_eq!(read("{ body = 'gas' }"), body(3.015, ExchangeKind::TwoWay));
    let keys = "{ body = 'gas', horizon = 2, exchange = 'one_way' }";
    assert_eq!(read(keys), body(2.0, ExchangeKind::OneWay));
}

/// A formula in time may leave the kelvins that surroundings can have during the run.
#[test]
fn temperatures_that_no_surroundings_have_end_the_run() {
    for (ambient, told) in [
        ("'300 - 400 * t'", "`ambient` is -100 at t = 1 s"),
        ("'300 + log(1 - t)'", "`ambient` is -inf at t = 1 s"),
    ] {
        let mut world = World::new(vec![block([2, 2, 1], 2, STEEL)]);
        let text = format!("faces = ['x+']\ncoefficient = 10\nambient = {ambient}");
        let convection: Convection = crate::testing::read(&text);
        let (mut convection, ()) = prepare(&mut world, convection, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            assert_eq!(setup.facts::<Rc<Exchange>>(0).count(), 1);
        })
        .expect("valid at the start");
        let mut at = |time: f64| convection.apply(&world, Step::new(time, 0.0));
        at(0.5).expect("kelvins");
        let error = at(1.0).expect_err("no kelvins");
        let found = error.to_string();
        assert!(found.contains(told), "{found}");
    }
}

#[test]
fn keys_that_do_not_go_together_are_refused() {
    for (table, message) in [
        (
            "{ body = 'gas', value = [1], time = [0] }",
            "a body has a temperature of its own",
        ),
        ("{ exchange = 'one_way' }", "missing field `body`"),
        ("{ value = [1] }", "missing field `time`"),
        ("{ bodi = 'gas' }", "unknown field `bodi`"),
        (
            "{ body = 'gas', exchange = 'both' }",
            "unknown variant `both`",
        ),
        ("true", "expected a number, { time"),
    ] {
        let found = read(table).expect_err("a mistake");
        assert!(found.contains(message), "{found}");
    }
}

/// A case that is written back is the same.
#[test]
fn surroundings_are_written_as_they_are_read() {
    for ambient in [
        "300",
        "{ time = [0, 1], value = [300, 400] }",
        "{ body = 'gas', horizon = 2, exchange = 'one_way' }",
    ] {
        let read_ = read(ambient).expect("valid");
        let text = toml::to_string(&Holder {
            ambient: read_.clone(),
        })
        .expect("writes");
        let again: Holder = toml::from_str(&text).expect("reads");
        assert_eq!(again.ambient, read_, "{text}");
    }
}

/// A block of 4 x 3 x 2 m and a gas of two dimensions above it, with a gap of half a metre.
fn block_and_gas() -> World {
    let place = BoxShape {
        min: [0.0, 3.0, 0.0],
        max: [4.0, 9.0, 2.0],
    };
    let mut gas = Body::fill("gas", &Shape::Box(place), 2, 1.0, 2.0).expect("valid");
    let solid = block([4, 3, 2], 3, STEEL);
    gas.materials = solid.materials.clone();
    World::new(vec![solid, gas])
}

/// Prepares a boundary of the block, with the physics of both bodies.
fn prepared(
    world: &mut World,
    keys: &str,
    happens: Option<Change>,
) -> Result<(Box<dyn RunningCoupler>, Rc<Exchange>), SetupError> {
    let boundary: Convection =
        crate::testing::read(&format!("body = 'block'\ncoefficient = 10\n{keys}"));
    prepare(world, boundary, |setup| {
        let exchange = setup.facts::<Rc<Exchange>>(0).next().cloned();
        for body in [0, 1] {
            setup.own(body, &keys::TEMPERATURE).expect("free");
        }
        if exchange
            .as_ref()
            .is_some_and(|e| e.around.as_ref().is_some_and(|a| a.is_two_way))
        {
            setup
                .give(1, &keys::GIVEN_HEAT, Access::Give)
                .expect("a gift");
        }
        if setup.is_declared(1, &keys::GIVEN_HEAT, Access::Add) {
            setup.take(1, &keys::GIVEN_HEAT).expect("taken");
        }
        if happens == Some(Change::Motion) {
            setup
                .publish(1, Description::UpdatedLagrangian)
                .expect("free");
        }
        exchange.expect("one")
    })
}

/// Each point of the surface sees the gas near it, which covers nothing, and the faces that a flat gas cannot reach are left out.
#[test]
fn each_point_of_the_surface_sees_the_gas_near_it() {
    for exchange_kind in ["one_way", "two_way"] {
        let mut world = block_and_gas();
        let keys = format!(
            "region = 'top'\nambient = {{ body = 'gas', horizon = 2, exchange = '{exchange_kind}' }}"
        );
        let mut bodies = world.bodies().to_vec();
        let top = bodies[0].points_in(&Shape::Box(BoxShape {
            min: [0.0, 2.0, 0.0],
            max: [4.0, 3.0, 2.0],
        }));
        bodies[0].regions.insert("top".into(), top);
        world = World::new(bodies);
        let (mut boundary, exchange) = prepared(&mut world, &keys, None).expect("valid");
        let field = world.fields().find(1, "temperature").expect("known");
        let positions = world.body(1).points.position.to_vec();
        let values = world.values_mut(field).iter_mut().zip(&positions);
        values.for_each(|(t, x)| *t = 300.0 + 10.0 * x.x + x.y);
        apply(&world, &mut *boundary, 0.0);
        let cells = exchange.cells();
        let mut at_top = 0;
        for (i, cell) in cells.iter().enumerate() {
            assert!(cell.face.axis() < 2, "the gas is flat");
            let at = world.body(0).points.position.at(cell.point as usize);
            let near = positions
                .iter()
                .filter(|x| ((*x - at).xy()).norm() <= 2.0 + 1e-9);
            let near: Vec<f64> = near.map(|x| 300.0 + 10.0 * x.x + x.y).collect();
            let mean = near.iter().sum::<f64>() / near.len() as f64;
            let flux = exchange.law().flux(i, 200.0).flux;
            assert!((flux - 10.0 * (mean - 200.0)).abs() < 1e-9, "{at}");
            at_top += usize::from(cell.face == Face::YMax);
        }
        assert_eq!(at_top, 8);
    }
}

#[test]
fn surroundings_that_cannot_be_are_refused() {
    for (keys, key, message) in [
        (
            "ambient = { body = 'ga' }",
            "ambient",
            "did you mean `gas`?",
        ),
        (
            "ambient = { body = 'block' }",
            "ambient",
            "cannot surround itself",
        ),
        (
            "ambient = { body = 'gas', horizon = 0 }",
            "ambient",
            "horizon",
        ),
        (
            "faces = ['z+']\nambient = { body = 'gas' }",
            "faces",
            "is 2D and does not reach face `z+`",
        ),
        (
            "ambient = { body = 'gas', horizon = 1 }",
            "ambient",
            "no point of body `gas` lies within 1 m",
        ),
    ] {
        let found = prepared(&mut block_and_gas(), keys, None);
        let Err(error) = found else {
            panic!("{keys} must be refused");
        };
        assert_eq!(error.key, key, "{error}");
        assert!(error.to_string().contains(message), "{error}");
    }
    let keys = "faces = ['y+']\nambient = { body = 'gas' }";
    prepared(&mut block_and_gas(), keys, None)
        .map(drop)
        .expect("valid");
    let moving = prepared(&mut block_and_gas(), keys, Some(Change::Motion));
    let message = moving.map(drop).expect_err("points that move").to_string();
    assert!(
        message.contains("near the surface would change"),
        "{message}"
    );
}
