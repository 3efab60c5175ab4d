use super::*;
use crate::testing::{
    STEEL, add_gas, block, disc_in_plate, prepare, prepare_after, read, refusal, set, two_fluids,
};
use nalgebra::Vector3;
use perimelt_core::keys;
use perimelt_core::shape::{BoxShape, Shape};

/// Two blocks of unit cells, the second one above the first and moved by `along` in x.
fn two(along: f64) -> World {
    let mut upper = block([3, 3, 2], 3, STEEL);
    upper.name = "upper".into();
    let offset = Vector3::new(along, 0.0, 2.0);
    upper.points.position.iter_mut().for_each(|x| *x += offset);
    World::new(vec![block([3, 3, 2], 3, STEEL), upper])
}

/// The interface of two bodies with these temperatures (K) after a step.
fn applied(world: &mut World, table: &str, temperatures: [f64; 2]) -> Box<dyn RunningCoupler> {
    let interface: HeatInterface = read(table);
    let prepared = prepare(world, interface, |setup| {
        [0, 1].map(|body| {
            setup.consume(body, &keys::HEAT_SOURCE).expect("free");
            setup.consume(body, &keys::HEAT_CONDUCTANCE).expect("free");
            setup.own(body, &keys::TEMPERATURE).expect("free")
        })
    });
    let (mut interface, handles) = prepared.expect("valid");
    for (handle, temperature) in handles.into_iter().zip(temperatures) {
        world.write(handle).fill(temperature);
    }
    let step = Step::new(0.0, 1.0);
    interface.apply(world, step).expect("applies");
    interface
}

/// Powers into the bodies (W), common area (m²), and stable step (s).
fn exchanged(along: f64, keys: &str) -> (Vec<f64>, f64, f64) {
    let mut world = two(along);
    let table = format!("body = 'block'\nother = 'upper'\n{keys}");
    let mut interface = applied(&mut world, &table, [300.0, 400.0]);
    let sums = [0, 1].map(|body| {
        let index = world.fields().find(body, "heat_source").expect("a sink");
        let field = world.fields().field(index).data();
        field.flat().iter().sum::<f64>()
    });
    let step = interface.stable_step(&world).expect("a limit");
    (sums.to_vec(), interface.report()[1].value, step)
}

#[test]
fn faces_exchange_over_their_common_area_through_resistances_in_series() {
    // half a metre of 40 W/(m K) on either side
    let series = 0.5 / 40.0 + 0.5 / 40.0;
    for (along, area) in [(0.0, 9.0), (0.25, 8.25), (1.5, 4.5), (3.5, 0.0)] {
        let (power, found, step) = exchanged(along, "");
        assert!((found - area).abs() < 1e-12, "{found} {area}");
        assert!((power[0] - area * 100.0 / series).abs() < 1e-8, "{power:?}");
        assert!((power[0] + power[1]).abs() < 1e-9);
        // cells of 1 m, those in the corners with three faces
        let capacity = 8000.0 * 500.0 / 3.0;
        assert!((step / (STEP_FRACTION * capacity * series) - 1.0).abs() < 1e-12);
    }
    let (power, _, step) = exchanged(0.0, "conductance = 50");
    let expected = STEP_FRACTION * 8000.0 * 500.0 / 3.0 * (series + 1.0 / 50.0);
    assert!((step / expected - 1.0).abs() < 1e-12);
    assert!((power[0] - 9.0 * 100.0 / (series + 1.0 / 50.0)).abs() < 1e-8);
}

#[test]
fn mistakes_are_refused() {
    for (keys, message) in [
        ("body = 'block'\nother = 'block'", "are both `block`"),
        ("body = 'block'\nother = 'uper'", "did you mean `upper`?"),
        (
            "body = 'block'\nother = 'upper'\nconductance = 0",
            "`conductance` is 0",
        ),
        ("body = 'block'\nother = 'upper'\ngap = inf", "`gap` is inf"),
    ] {
        let interface: HeatInterface = read(keys);
        let found = refusal(&mut two(0.0), interface);
        assert!(found.contains(message), "{found}");
    }
}

/// Steps of the cells of two bodies along a curved interface do not meet where spacings or grids differ.
#[test]
fn curved_interfaces_have_their_area_whatever_the_cells() {
    for (spacings, offset) in [
        ([0.05, 0.05], 0.0),
        ([0.05, 0.05], 0.02),
        ([0.05, 0.025], 0.0),
        ([0.05, 0.025], 0.02),
        ([0.04, 0.05], 0.0),
        ([0.02, 0.05], 0.013),
    ] {
        let mut world = World::new(disc_in_plate(spacings, offset).into());
        let table = "body = 'plate'\nother = 'disc'";
        let interface = applied(&mut world, table, [300.0, 400.0]);
        let area = interface.report()[1].value / std::f64::consts::PI;
        assert!((area - 1.0).abs() < 0.02, "{spacings:?} {offset}: {area}");
    }
}

/// Cells of 1 m below cells of 0.5 m, of another conductivity and capacity, within a gap: areas and resistances are
/// those of the overlaps, and the step is that of the cell with the least capacity over its surface.
#[test]
fn cells_of_two_sizes_exchange_over_their_overlaps() {
    let copper = "density = 9000\nspecific_heat = 400\nconductivity = 400";
    for (height, gap, area) in [
        (2.0, "", 1.0),
        (2.2, "", 1.0),
        // farther than half of the smaller spacing
        (2.3, "", 0.0),
        (2.3, "gap = 0.35", 1.0),
        (2.3, "gap = 0.25", 0.0),
    ] {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [1.0; 3],
        });
        let mut upper = Body::fill("upper", &shape, 3, 0.5, 1.0).expect("valid");
        upper.materials = block([1, 1, 1], 3, copper).materials;
        let offset = Vector3::new(0.0, 0.0, height);
        upper.points.position.iter_mut().for_each(|x| *x += offset);
        let mut world = World::new(vec![block([3, 3, 2], 3, STEEL), upper]);
        let table = format!("body = 'upper'\nother = 'block'\n{gap}");
        let mut interface = applied(&mut world, &table, [400.0, 300.0]);
        let reports: Vec<f64> = interface.report().iter().map(|r| r.value).collect();
        // half cells of either side
        let series = 0.5 / 40.0 + 0.25 / 400.0;
        let expected = [area * 100.0 / series, area];
        for (found, expected) in reports.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-8,
                "{height} {gap}: {reports:?}"
            );
        }
        // three bare faces of a cell of 0.5 m
        let capacity = 9000.0 * 400.0 * 0.125 / (3.0 * 0.25);
        let step = interface.stable_step(&world).expect("a limit");
        assert!(
            (step / (0.5 * capacity * series) - 1.0).abs() < 1e-12,
            "{step}"
        );
    }
}

/// Through the lower body flow two fluids: its resistance is that of what is there now, the step that of the quicker one.
#[test]
fn two_fluids_conduct_by_their_shares() {
    let mut bodies = two(0.0).bodies().to_vec();
    let gas = "density = 2\nspecific_heat = 1000\nconductivity = 0.5";
    add_gas(&mut bodies[0], gas);
    let mut world = World::new(bodies);
    let fluid = |setup: &mut Setup<'_>| {
        two_fluids(setup, 0);
        for body in 0..2 {
            setup.own(body, &keys::TEMPERATURE).expect("free");
            setup.consume(body, &keys::HEAT_SOURCE).expect("free");
            setup.consume(body, &keys::HEAT_CONDUCTANCE).expect("free");
        }
    };
    let interface: HeatInterface = read("body = 'block'\nother = 'upper'");
    let prepared = prepare_after(&mut world, fluid, interface, |_| ());
    let mut interface = prepared.expect("valid").0;
    set(&mut world, &keys::TEMPERATURE, |_| 300.0);
    let upper = world.fields().find(1, "temperature").expect("a field");
    world.values_mut(upper).fill(400.0);
    for c in [1.0, 0.0, 0.25] {
        set(&mut world, &keys::FLUID_FRACTION, |_| c);
        interface
            .apply(&world, Step::new(0.0, 1.0))
            .expect("applies");
        let series = 0.5 * (c / 40.0 + (1.0 - c) / 0.5) + 0.5 / 40.0;
        let power = interface.report()[0].value;
        assert!(
            (power / (9.0 * 100.0 / series) - 1.0).abs() < 1e-12,
            "{c}: {power}"
        );
    }
    let capacity = 2.0 * 1000.0 / 3.0;
    let step = interface.stable_step(&world).expect("a limit");
    let expected = STEP_FRACTION * capacity * (0.5 / 0.5 + 0.5 / 40.0);
    assert!((step / expected - 1.0).abs() < 1e-12, "{step} {expected}");
}

#[test]
fn a_second_interface_of_two_bodies_is_refused() {
    let mut world = two(0.0);
    let first = |setup: &mut Setup<'_>| {
        for body in 0..2 {
            setup.own(body, &keys::TEMPERATURE).expect("free");
        }
        let first: HeatInterface = read("body = 'block'\nother = 'upper'");
        Box::new(first).prepare(setup).expect("valid");
    };
    let second: HeatInterface = read("body = 'upper'\nother = 'block'");
    let refused = prepare_after(&mut world, first, second, |_| ()).err();
    let refused = refused.expect("the heat would count twice").to_string();
    assert!(
        refused.contains("`upper` and `block` already exchange heat"),
        "{refused}"
    );
}
