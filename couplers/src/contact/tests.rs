//! Contact of pieces of a body and of two bodies: normals, repulsion, friction and stable steps.

use perimelt_core::Body;
use perimelt_core::shape::{BoxShape, Shape};

use super::*;
use crate::testing::{block, prepare, read, refusal, values};

mod rubbing;

const ELASTIC: &str = "density = 1000\nyoungs_modulus = 1e6";

fn own(setup: &mut Setup<'_>, bodies: usize) {
    for body in 0..bodies {
        setup.own(body, &keys::DISPLACEMENT).expect("free");
        setup.own(body, &keys::VELOCITY).expect("free");
        setup.take_if_added(body, &keys::IMPULSE).expect("free");
    }
}

/// A world of two blocks, the second moved by `offset`.
fn two(offset: [f64; 3]) -> World {
    let mut second = block([3, 5, 5], 3, ELASTIC);
    second.name = "second".into();
    second
        .points
        .position
        .iter_mut()
        .for_each(|x| *x += Vector3::from(offset));
    World::new(vec![block([3, 5, 5], 3, ELASTIC), second])
}

/// Stiffness of a contact of the first point of the first body, N/m⁷.
fn first_stiffness(world: &mut World) -> f64 {
    let setup = Setup::new(world, std::path::Path::new("."));
    stiffness(&setup, 0, 15.0).expect("a modulus")[0]
}

/// Impulse on the first body, in a step of two blocks that overlap and move along each other at these speeds.
fn impulse_along(speeds: [f64; 2], friction: f64) -> f64 {
    let mut world = two([4.0, 0.0, 0.0]);
    let keys = format!("body = 'block'\nother = 'second'\nfriction = {friction}");
    let contact: Contact = read(&keys);
    let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 2)).expect("valid");
    for (body, speed) in speeds.into_iter().enumerate() {
        let index = world.fields().find(body, "velocity").expect("owned");
        let v = world.values_mut(index).chunks_exact_mut(3);
        v.for_each(|v| v[1] = speed);
    }
    let index = world.fields().find(0, "displacement").expect("owned");
    let x = world.values_mut(index).chunks_exact_mut(3);
    x.for_each(|v| v[0] = 1.1);
    contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
    let index = world.fields().find(0, "impulse").expect("a sink");
    let field = world.fields().field(index).data();
    let (vectors, _) = field.flat().as_chunks::<3>();
    vectors.iter().map(|j| j[1]).sum()
}

#[test]
fn friction_acts_on_the_relative_velocity() {
    let sliding = impulse_along([2.0, 0.0], 0.3);
    assert!(sliding < 0.0, "it brakes: {sliding}");
    let moved = impulse_along([5.0, 3.0], 0.3);
    assert!((moved - sliding).abs() < 1e-9 * sliding.abs(), "{moved}");
    let together = impulse_along([3.0, 3.0], 0.3);
    assert!(together.abs() < 1e-9 * sliding.abs(), "{together}");
}

#[test]
fn bodies_repel_each_other_and_keep_their_momentum() {
    for (gap, touch) in [(-0.1, true), (0.1, false)] {
        // apart by one spacing and the gap at the nearest points
        let mut world = two([4.0, 0.1, 0.0]);
        let contact: Contact = read("body = 'block'\nother = 'second'");
        let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 2)).expect("valid");
        let index = world.fields().find(0, "displacement").expect("owned");
        let x = world.values_mut(index).chunks_exact_mut(3);
        x.for_each(|v| v[0] = 1.0 - gap);
        contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
        let total = |body: usize| {
            let index = world.fields().find(body, "impulse").expect("a sink");
            let field = world.fields().field(index).data();
            let (vectors, _) = field.flat().as_chunks::<3>();
            vectors
                .iter()
                .map(|f| Vector3::from(*f))
                .sum::<Vector3<f64>>()
        };
        let (first, second) = (total(0), total(1));
        assert!((first + second).norm() <= 1e-12 * first.norm());
        assert_eq!(first.x < 0.0 && second.x > 0.0, touch, "{first:?}");
        let reported: f64 = contact.report()[0].value;
        assert!((0.1 * reported - first.x).abs() <= 1e-12 * first.norm());
    }
}

#[test]
fn a_body_at_rest_or_turned_feels_nothing_and_one_that_is_crushed_resists() {
    for (shrink, touch) in [(1.0, false), (0.95, false), (0.85, true)] {
        let mut world = World::new(vec![block([5, 4, 3], 3, ELASTIC)]);
        let contact: Contact = read("stiffness = 10");
        let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 1)).expect("valid");
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -0.3);
        let positions = world.body(0).points.position.to_vec();
        let index = world.fields().find(0, "displacement").expect("owned");
        let u = world.values_mut(index).chunks_exact_mut(3).zip(&positions);
        u.for_each(|(u, x)| u.copy_from_slice((turn * (x * shrink) - x).as_slice()));
        contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
        let force = values(&world, &keys::IMPULSE);
        assert_eq!(force.iter().any(|f| f.abs() > 1e-6), touch, "{shrink}");
    }
}

#[test]
fn forces_do_not_depend_on_when_the_list_of_candidates_was_made() {
    let mut world = World::new(vec![block([6, 5, 4], 3, ELASTIC)]);
    let old: Contact = read("");
    let (mut old, _) = prepare(&mut world, old, |setup| own(setup, 1)).expect("valid");
    old.apply(&world, Step::new(0.0, 0.1)).expect("applies");
    let mut other = World::new(vec![block([6, 5, 4], 3, ELASTIC)]);
    let new: Contact = read("");
    let (mut new, _) = prepare(&mut other, new, |setup| own(setup, 1)).expect("valid");
    for world in [&mut world, &mut other] {
        let positions = world.body(0).points.position.to_vec();
        let index = world.fields().find(0, "displacement").expect("owned");
        let u = world.values_mut(index).chunks_exact_mut(3).zip(&positions);
        // within the skin, so that the list of the first one serves
        u.for_each(|(u, x)| u[0] = 0.14 * (7.0 * x.x + 3.0 * x.y + x.z).sin());
    }
    for (contact, world) in [(&mut old, &world), (&mut new, &other)] {
        contact.apply(world, Step::new(1.0, 0.1)).expect("applies");
    }
    let force = values(&world, &keys::IMPULSE);
    assert!(force.iter().any(|f| *f != 0.0));
    assert_eq!(force, values(&other, &keys::IMPULSE));
}

#[test]
fn the_stable_step_is_that_of_the_stiffest_contact() {
    // contacts along the normal that a point may have
    for (dimension, facing) in [(1, 1.0), (2, 2.0), (3, 4.0)] {
        let mut body = block([3, 5, 5], dimension, ELASTIC);
        body.points.volume.fill(0.5);
        let mut world = World::new(vec![body]);
        let contact: Contact = read("body = 'block'");
        let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 1)).expect("valid");
        let step = contact.stable_step(&world).expect("a limit");
        let stiffness = first_stiffness(&mut world);
        // of a density of 1000 kg/m³
        let square = 2.0 * facing * stiffness * 0.5 * 0.5 / (1000.0 * 0.5);
        assert!((step * f64::sqrt(square) - 2.0).abs() < 1e-12, "{step}");
    }
}

#[test]
fn a_contact_with_itself_or_without_stiffness_is_refused() {
    for (keys, message) in [
        ("body = 'block'\nother = 'block'", "are the same body"),
        ("body = 'block'\nstiffness = 0", "`stiffness` is 0"),
        ("body = 'block'\nfriction = -1", "`friction` is -1"),
        ("body = 'block'\nfriction = inf", "`friction` is inf"),
    ] {
        assert!(refusal(&mut two([9.0; 3]), read::<Contact>(keys)).contains(message));
    }
}

/// `k = 15 c / horizon`, with `c = 12 E / (pi horizon⁴)`, `9 E / (pi h horizon³)` and `2 E / (A horizon²)` of a bond-based
/// solid in three, two and one dimensions (Silling and Askari (2005); Madenci and Oterkus (2014), table 4.1).
#[test]
fn stiffness_is_that_of_a_bond_of_a_horizon_of_three_spacings() {
    let (spacing, thickness, modulus) = (0.5, 0.25, 1e6);
    let horizon: f64 = 1.5;
    let pi = std::f64::consts::PI;
    for (dimension, bond) in [
        (1, 2.0 * modulus / (thickness * horizon.powi(2))),
        (2, 9.0 * modulus / (pi * thickness * horizon.powi(3))),
        (3, 12.0 * modulus / (pi * horizon.powi(4))),
    ] {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [2.0, 0.5, 0.5],
        });
        let mut body = Body::fill("bar", &shape, dimension, spacing, thickness).expect("valid");
        body.materials = block([1, 1, 1], 3, ELASTIC).materials;
        let points = body.points.len();
        let mut world = World::new(vec![body]);
        let setup = Setup::new(&mut world, std::path::Path::new("."));
        let found = stiffness(&setup, 0, 15.0).expect("a modulus");
        assert_eq!(found.len(), points);
        let expected = 15.0 * bond / horizon;
        for k in found {
            assert!((k / expected - 1.0).abs() < 1e-12, "{dimension}D: {k}");
        }
    }
}

/// Two bodies of one point each, 0.9 m apart, the first one with a velocity of 2 m/s across; impulse on the first one along
/// and across the line between them, and k.
fn lone_points(dimension: usize, friction: f64) -> ([f64; 2], f64) {
    let mut second = block([1, 1, 1], dimension, ELASTIC);
    second.name = "second".into();
    second.points.position[0].x += 0.9;
    let mut world = World::new(vec![block([1, 1, 1], dimension, ELASTIC), second]);
    let keys = format!("body = 'block'\nother = 'second'\nfriction = {friction}");
    let contact: Contact = read(&keys);
    let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 2)).expect("valid");
    let index = world.fields().find(0, "velocity").expect("owned");
    world.values_mut(index)[1] = 2.0;
    contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
    let index = world.fields().find(0, "impulse").expect("a sink");
    let field = world.fields().field(index).data();
    let force = contact.report()[0].value;
    let [along, across] = [0, 1].map(|axis| field.flat()[axis]);
    drop(field);
    assert!((force - along / 0.1).abs() < 1e-9 * force.abs(), "{force}");
    ([along, across], first_stiffness(&mut world))
}

/// `J_n = dt k overlap w V V` with `w = 1`, `1 / (16/15 2)` and `1 / (pi/3 4)` at the middle of the weight, and
/// `J_t = min(mu J_n, m v)` in the first step, with the reduced mass m.
#[test]
fn lone_points_repel_each_other_and_rub() {
    let sums = [1.0, 32.0 / 15.0, 4.0 * std::f64::consts::PI / 3.0];
    for (dimension, sum) in (1..).zip(sums) {
        let ([along, across], k) = lone_points(dimension, 0.0);
        let expected = 0.1 * k * 0.1 / sum;
        assert!(
            (along / expected + 1.0).abs() < 1e-12,
            "{dimension}D: {along}"
        );
        assert_eq!(across, 0.0);
        if dimension == 1 {
            continue;
        }
        let (sliding, _) = lone_points(dimension, 0.3);
        assert!(
            (sliding[1] / (0.3 * expected) + 1.0).abs() < 1e-12,
            "{sliding:?}"
        );
        // 500 kg times 2 m/s
        let (sticking, _) = lone_points(dimension, 10.0);
        assert!((sticking[1] + 1000.0).abs() < 1e-9, "{sticking:?}");
        assert_eq!([sliding[0], sticking[0]], [along; 2]);
    }
}

/// Points at 0.5, 1.5 and, displaced, 1.8 m: neighbours meet at 0.9 of their distance, others at 1.35 spacings.
#[test]
fn pieces_of_a_body_meet_at_their_distances() {
    let mut world = World::new(vec![block([3, 1, 1], 3, ELASTIC)]);
    let contact: Contact = read("");
    let (mut contact, _) = prepare(&mut world, contact, |setup| own(setup, 1)).expect("valid");
    contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
    assert_eq!(contact.report()[0].value, 0.0, "nothing touches at rest");
    let index = world.fields().find(0, "displacement").expect("owned");
    world.values_mut(index)[6] = -0.7;
    let index = world.fields().find(0, "impulse").expect("a sink");
    world.values_mut(index).fill(0.0);
    contact.apply(&world, Step::new(0.1, 0.1)).expect("applies");
    let k = first_stiffness(&mut world);
    let overlap = [-0.05, -0.6, 0.65];
    let found = values(&world, &keys::IMPULSE);
    for (i, overlap) in overlap.into_iter().enumerate() {
        assert!(
            (found[3 * i] / (0.1 * k) - overlap).abs() < 1e-12,
            "{found:?}"
        );
        assert_eq!(found[3 * i + 1..3 * i + 3], [0.0; 2]);
    }
    assert_eq!(contact.report()[0].value, 3.0);
}
