//! Heat sources on bodies without a lattice: the power is exact, and on a uniform cloud it is that of the lattice.

use std::path::Path;

use nalgebra::Vector3;
use perimelt_core::Description;
use perimelt_core::body::Jitter;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, Coupler, PointMover, RunningCoupler, Setup, World, keys};
use proptest::prelude::*;

use super::*;
use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, total, values, zones};

/// Prepares one of several sources and lets `physics` declare what it does.
fn prepared<R>(
    body: Body,
    mut source: Box<dyn Coupler>,
    physics: impl FnOnce(&mut Setup<'_>) -> R,
) -> (World, Box<dyn RunningCoupler>, R) {
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("the source");
    source.publish(&mut setup).expect("valid");
    let running = source.prepare(&mut setup).expect("valid");
    setup.next_plugin("the physics");
    let handles = physics(&mut setup);
    assert!(setup.finish().is_ok());
    (world, running, handles)
}

fn ready(body: Body, source: Box<dyn Coupler>) -> (World, Box<dyn RunningCoupler>) {
    let (world, running, ()) = prepared(body, source, |setup| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    });
    (world, running)
}

fn cloud(body: Body, amplitude: f64) -> Body {
    body.jittered(Jitter { amplitude, seed: 2 }).expect("valid")
}

fn report(source: &dyn RunningCoupler, name: &str) -> f64 {
    let reports = source.report();
    let found = reports.iter().find(|r| r.name == name);
    found.expect("reported").value
}

fn moving(kind: usize, path: &str) -> Box<dyn Coupler> {
    moving_on("z+", kind, path)
}

/// One of five sources that heats a face.
fn moving_on(face: &str, kind: usize, path: &str) -> Box<dyn Coupler> {
    let line = format!("\ntoolpath.line = {path}\nheated_surface.face = '{face}'");
    match kind {
        0 => Box::new(read::<EllipsoidSource>(&format!(
            "power = 100\nhalf_length = 1.5\nhalf_width = 2\ndepth = 1{line}"
        ))),
        1 => Box::new(read::<GoldakSource>(&format!(
            "power = 100\nfront_length = 1.5\nrear_length = 3\nhalf_width = 2\ndepth = 2{line}"
        ))),
        2 => Box::new(read::<GaussianSource>(&format!(
            "power = 100\nsigma = 1\neffective_depth = 8{line}"
        ))),
        3 => Box::new(read::<SuperGaussianSource>(&format!(
            "power = 100\nabsorptivity = 1\nradius = 2\npenetration_depth = 2\npenetration = 'gaussian'{line}"
        ))),
        _ => Box::new(read::<PointSource>(&format!(
            "power = 100\ntoolpath.line = {path}"
        ))),
    }
}

#[test]
fn a_uniform_cloud_is_heated_as_its_lattice() {
    let paths = [
        ("z+", "[9.3, 10.2, 8]", "[1, 0, 0]"),
        ("z+", "[9.3, 10.2, 8]", "[1, 0.4, 0]"),
        ("y-", "[9.3, 0, 4.2]", "[1, 0, 0]"),
        ("x+", "[20, 10.2, 4.2]", "[0, 1, 0]"),
    ];
    for kind in 0..5 {
        for (face, start, direction) in paths {
            // point sources know no face
            if kind == 4 && face != "z+" {
                continue;
            }
            let path = format!("{{ start = {start}, direction = {direction}, speed = 2 }}");
            let heat = [false, true].map(|is_cloud| {
                let mut body = block([20, 20, 8], 3, STEEL);
                if is_cloud {
                    body = cloud(body, 0.0);
                }
                let source = moving_on(face, kind, &path);
                let (world, mut source) = ready(body, source);
                apply(&world, &mut *source, 0.0);
                let heat = values(&world, &keys::HEAT_SOURCE);
                let positions = &world.body(0).points.position;
                let mut by_place: Vec<_> = positions
                    .iter()
                    .map(|x| x.map(|c| c as i64))
                    .zip(heat)
                    .collect();
                by_place.sort_by_key(|(x, _)| (x.z, x.y, x.x));
                by_place
            });
            let peak = heat[0].iter().map(|(_, h)| *h).fold(0.0, f64::max);
            for ((x, lattice), (_, cloud)) in heat[0].iter().zip(&heat[1]) {
                // the part beyond the cut-off, and numerical integration
                assert!(
                    (lattice - cloud).abs() < 1e-4 * peak,
                    "{kind} {face} {direction} {x}: {lattice} {cloud}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn the_power_is_exact_on_zones_and_displaced_points(
        kind in 0..5usize,
        x in 7.0..15.0f64,
        y in 8.0..12.0f64,
        turn in 0.0..3.0f64,
        amplitude in 0.0..0.4f64,
        flat in any::<bool>(),
    ) {
        let body = cloud(zones(if flat { 2 } else { 3 }), amplitude);
        let path = format!("{{ start = [{x}, {y}, 8], direction = [{}, {}, 0], speed = 1 }}", turn.cos(), turn.sin());
        let source = moving(kind, &path);
        let (world, mut source) = ready(body, source);
        apply(&world, &mut *source, 0.0);
        prop_assert!((total(&world, &keys::HEAT_SOURCE) - 100.0).abs() < 1e-9, "{kind}: {}", total(&world, &keys::HEAT_SOURCE));
        prop_assert!((report(&*source, "power.deposited") - 100.0).abs() < 1e-9);
        prop_assert_eq!(report(&*source, "power.lost"), 0.0);
    }
}

#[test]
fn what_falls_beside_a_cloud_is_lost() {
    for kind in 0..4 {
        // the source is at the edge in the middle of the step
        let source = moving(
            kind,
            "{ start = [-1, 10, 8], direction = [1, 0, 0], speed = 2 }",
        );
        let (world, mut source) = ready(zones(3), source);
        apply(&world, &mut *source, 0.0);
        let (deposited, lost) = (
            report(&*source, "power.deposited"),
            report(&*source, "power.lost"),
        );
        assert!((deposited + lost - 100.0).abs() < 1e-9);
        assert!((total(&world, &keys::HEAT_SOURCE) - deposited).abs() < 1e-9);
        // the fraction of the front is given for the double ellipsoid: 2 / (1 + 3/1.5) of it in front, halved
        let front = if kind == 1 { 100.0 / 3.0 } else { 50.0 };
        assert!((deposited - front).abs() < 0.1, "{kind}: {deposited}");
    }
}

/// A point source heats the cells at half a spacing on either side of it: four on the face, eight inside, with equal parts;
/// those beside the body are lost.
#[test]
fn a_point_source_heats_four_cells_of_a_face_and_eight_inside() {
    // the body is 20 by 20 by 8 m, with cells of 1 m in the middle and of 2 m at its ends
    for (x, y, z, level, cells, deposited) in [
        (10.0, 10.0, 8.0, "", 4, 100.0),
        (10.0, 10.0, 8.0, "heated_surface.level = 8", 4, 100.0),
        (10.0, 10.0, 4.0, "heated_surface.level = 8", 8, 100.0),
        (4.0, 10.0, 8.0, "", 4, 100.0),
        // above the level it heats the face
        (10.0, 10.0, 9.0, "heated_surface.level = 8", 4, 100.0),
        (0.0, 10.0, 8.0, "", 2, 50.0),
        (0.0, 10.0, 4.0, "heated_surface.level = 8", 4, 50.0),
        (0.0, 0.0, 4.0, "heated_surface.level = 8", 2, 25.0),
    ] {
        let path = format!(
            "{{ start = [{}, {y}, {z}], direction = [1, 0, 0], speed = 2 }}",
            x - 1.0
        );
        let source: PointSource = read(&format!("power = 100\n{level}\ntoolpath.line = {path}"));
        let (world, mut source) = ready(zones(3), Box::new(source));
        apply(&world, &mut *source, 0.0);
        let heat = values(&world, &keys::HEAT_SOURCE);
        let points = &world.body(0).points;
        let place = format!("{x} {y} {z} {level}");
        let hot: Vec<usize> = (0..heat.len()).filter(|p| heat[*p] > 0.0).collect();
        assert_eq!(hot.len(), cells, "{place}");
        for p in hot {
            let power = heat[p] * points.volume[p];
            assert!(
                (power - deposited / cells as f64).abs() < 1e-9,
                "{place}: {power}"
            );
            let away = points.position.at(p) - nalgebra::Vector3::new(x, y, f64::min(z, 8.0));
            let half = 0.5 * points.spacing[p];
            assert!(
                away.iter().all(|c| (c.abs() - half).abs() < 1e-9),
                "{place}: {away}"
            );
        }
        assert!(
            (report(&*source, "power.deposited") - deposited).abs() < 1e-9,
            "{place}"
        );
        assert!((report(&*source, "power.lost") - (100.0 - deposited)).abs() < 1e-9);
    }
}

#[test]
fn the_power_is_exact_on_points_of_a_table() {
    let mut table = "x,y,z,volume\n".to_string();
    for n in 0..4000 {
        let at = |step: f64, size: f64| (f64::from(n) * step).fract() * size;
        table += &format!(
            "{},{},{},{}\n",
            at(0.618_034, 20.0),
            at(0.414_214, 20.0),
            at(0.732_051, 8.0),
            0.8
        );
    }
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [20.0, 20.0, 8.0],
    });
    for kind in 0..4 {
        let mut body = Body::from_table("table", &shape, 3, 1.0, &table).expect("valid");
        body.materials = block([1, 1, 1], 3, STEEL).materials;
        let source = moving(
            kind,
            "{ start = [9, 10, 8], direction = [1, 0, 0], speed = 1 }",
        );
        let (world, mut source) = ready(body, source);
        apply(&world, &mut *source, 0.0);
        // the cells of the table end a little below the top of the box or beyond it
        let heat = total(&world, &keys::HEAT_SOURCE);
        assert!((heat - report(&*source, "power.deposited")).abs() < 1e-9);
        assert!((heat - 100.0).abs() < 15.0, "{kind}: {heat}");
    }
}

#[test]
fn a_pulse_heats_zones_as_a_lattice() {
    const PULSE: &str =
        "fluence = 10\nreflectivity = 0.5\npulse_duration = 1\nabsorption_depth = 3";
    for (dimension, face, area) in [
        (1, "x-", 1.0),
        (2, "y+", 160.0),
        (3, "z+", 400.0),
        (2, "z+", 400.0),
    ] {
        let body = match dimension {
            1 => cloud(block([20, 1, 1], 1, STEEL), 0.1),
            _ => zones(dimension),
        };
        let laser: PulsedLaserSource = read(&format!("{PULSE}\nheated_surface.face = '{face}'"));
        let whole = laser.shape.absorbed(1.5, 2.5) * area;
        let (world, mut laser) = ready(body, Box::new(laser));
        apply(&world, &mut *laser, 1.5);
        let energy = |name: &str| report(&*laser, &format!("energy.{name}"));
        assert!(
            (energy("asked") / whole - 1.0).abs() < 1e-12,
            "{dimension}D {face}"
        );
        assert!((total(&world, &keys::HEAT_SOURCE) - energy("deposited")).abs() < 1e-9);
        let depth = if face == "x-" || face == "y+" {
            20.0
        } else {
            8.0
        };
        let through = f64::exp(-depth / 3.0);
        assert!(
            (energy("lost") / whole - through).abs() < 1e-9,
            "{dimension}D {face}"
        );
    }
}

#[test]
fn values_at_cell_centres_need_a_lattice() {
    let path = "toolpath.line = { start = [9, 10, 8], direction = [1, 0, 0], speed = 1 }";
    let keys = format!(
        "power = 1\nhalf_length = 1\nhalf_width = 2\ndepth = 1\nsampling = 'point'\n{path}"
    );
    let source: EllipsoidSource = read(&keys);
    let message = refusal(&mut World::new(vec![zones(3)]), source);
    assert!(message.starts_with("sampling: "), "{message}");
}

/// A world whose points the test moves.
fn moving_world(
    body: Body,
    source: Box<dyn Coupler>,
) -> (World, Box<dyn RunningCoupler>, PointMover) {
    prepared(body, source, |setup| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        setup.next_plugin("fluid");
        let moves = Description::UpdatedLagrangian;
        setup.publish(0, moves).expect("free");
        setup.move_points(0)
    })
}

/// A source at rest over a fluid that drifts by `shift` (m) along x heats a trail of points. The trail is as long as the
/// drift, and its middle lies half of it behind the front.
#[test]
fn a_source_heats_the_points_that_are_below_it_now() {
    let at_rest = "{ start = [13, 10, 8], end = [13.0001, 10, 8], speed = 1e-6 }";
    for kind in 0..5 {
        let source = moving(kind, at_rest);
        let (mut world, mut source, mover) = moving_world(block([20, 20, 8], 3, STEEL), source);
        let reference = world.body(0).points.position.to_vec();
        let volumes = world.body(0).points.volume.to_vec();
        let at =
            |shift: f64| -> Vec<_> { reference.iter().map(|x| x + Vector3::x() * shift).collect() };
        let (steps, drift) = (40, 5.0);
        let (mut energy, mut path) = (vec![0.0; reference.len()], 0.0);
        for step in 0..steps {
            path = (f64::from(step) + 0.5) * drift / f64::from(steps);
            world.set_configuration(&mover, &at(path), &volumes);
            set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
            apply(&world, &mut *source, f64::from(step));
            let power = total(&world, &keys::HEAT_SOURCE);
            assert!(
                (power - 100.0).abs() < 1e-9,
                "{kind} after {path} m: {power}"
            );
            assert!((report(&*source, "power.deposited") - 100.0).abs() < 1e-9);
            let heat = values(&world, &keys::HEAT_SOURCE);
            energy.iter_mut().zip(heat).for_each(|(e, h)| *e += h);
        }
        let whole: f64 = energy.iter().sum();
        let centroid: f64 = energy
            .iter()
            .zip(at(path))
            .map(|(e, x)| e * x.x)
            .sum::<f64>()
            / whole;
        // behind its centre a double ellipsoid is longer: 4 / (3 sqrt(3 pi)) of the difference of its lengths is an
        // upper bound; the others are symmetric, and cells average their density
        let tolerance = if kind == 1 { 1.0 } else { 1e-3 * drift };
        let expected = 13.0 + 0.5 * (drift - drift / f64::from(steps));
        assert!(
            (centroid - expected).abs() < tolerance,
            "{kind}: {centroid} {expected}"
        );
    }
}

#[test]
fn over_a_hole_of_a_fluid_power_is_lost() {
    let source = moving(
        0,
        "{ start = [10, 10, 8], direction = [1, 0, 0], speed = 1e-6 }",
    );
    let (mut world, mut source, mover) = moving_world(block([20, 20, 8], 3, STEEL), source);
    let volumes = world.body(0).points.volume.to_vec();
    // both halves move away from the middle of the beam, which is 4 m long
    let points = world.body(0).points.position.to_vec();
    let apart = |gap: f64| -> Vec<_> {
        let points = points.iter();
        points
            .map(|x| x + Vector3::x() * gap * (x.x - 10.0).signum())
            .collect()
    };
    for (gap, lost) in [(0.0, 0.0..1e-9), (1.0, 30.0..99.0), (8.0, 99.99..100.01)] {
        world.set_configuration(&mover, &apart(gap), &volumes);
        set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
        apply(&world, &mut *source, 0.0);
        let (deposited, missing) = (
            report(&*source, "power.deposited"),
            report(&*source, "power.lost"),
        );
        assert!(lost.contains(&missing), "{gap}: {missing}");
        assert!((deposited + missing - 100.0).abs() < 1e-9);
        assert!((total(&world, &keys::HEAT_SOURCE) - deposited).abs() < 1e-9);
    }
}

#[test]
fn a_pulse_heats_a_fluid_below_its_current_surface() {
    const PULSE: &str =
        "fluence = 10\nreflectivity = 0.5\npulse_duration = 1\nabsorption_depth = 3";
    let laser: PulsedLaserSource = read(PULSE);
    let absorbed = laser.shape.absorbed(1.5, 2.5);
    let (world, mut laser, mover) = moving_world(block([4, 4, 8], 3, STEEL), Box::new(laser));
    let points = world.body(0).points.clone();
    // turned over: the lowest points are at the top now
    let over: Vec<_> = points
        .position
        .iter()
        .map(|x| Vector3::new(x.x, x.y, 8.0 - x.z))
        .collect();
    world.set_configuration(&mover, &over, &points.volume);
    apply(&world, &mut *laser, 1.5);
    let heat = values(&world, &keys::HEAT_SOURCE);
    for (x, heat) in over.iter().zip(heat) {
        let depth = 8.0 - x.z;
        let part = (-(depth - 0.5) / 3.0).exp() - (-(depth + 0.5) / 3.0).exp();
        assert!((heat - absorbed * part).abs() < 1e-9, "{x}: {heat}");
    }
}

#[test]
fn what_needs_a_lattice_at_rest_is_refused_where_points_move() {
    let path = "toolpath.line = { start = [9, 10, 8], direction = [1, 0, 0], speed = 1 }";
    for (key, line) in [
        ("sampling", "sampling = 'point'"),
        (
            "heated_surface.direction",
            "heated_surface.direction = [0, -1, -1]",
        ),
    ] {
        let table =
            format!("power = 1\nhalf_length = 1\nhalf_width = 2\ndepth = 1\n{line}\n{path}");
        let source: EllipsoidSource = read(&table);
        let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
        let refused = prepare(&mut world, source, |setup| {
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
            setup
                .publish(0, Description::UpdatedLagrangian)
                .expect("free");
        });
        assert_eq!(refused.err().expect("points move").key, key);
    }
}
