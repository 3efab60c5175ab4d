//! Corners of cracked, periodic and growing bodies, and what is refused.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::body::{Body, Cut, Jitter};
use perimelt_core::family::{LayerRule, Traction};
use perimelt_core::shape::Shape;
use perimelt_core::solver::Reducer;
use perimelt_core::{Axis, Face, Setup, World};

use super::corners::Corners;
use super::tests::{SPACING, STEEL, corners, displacement, force, largest, solid, staircase};
use crate::mechanical::Mechanical;
use crate::mechanical::nodes::PointLoads;
use crate::testing::{material, read};

fn filled(shape: &str, dimension: usize) -> Body {
    let shape: Shape = read(shape);
    let mut body = Body::fill("part", &shape, dimension, SPACING, 1.0).expect("a valid shape");
    body.materials = vec![material(STEEL)];
    body
}

/// Four by four cells.
fn plate() -> Body {
    filled("box = { min = [0, 0, 0], max = [0.004, 0.004, 1] }", 2)
}

fn of(body: &Body) -> Corners {
    let points = Reducer::alone(body.points.len());
    Corners::new(body, body.lattice().expect("a lattice"), &points)
}

/// The tip of a crack is one corner, the sides have corners of their own; a crack through the body parts it.
#[test]
fn cracks_part_corners() {
    for (end, doubled) in [(0.002, 2), (0.0045, 5)] {
        let mut body = plate();
        body.cuts = vec![Cut::segment([-0.001, 0.002], [end, 0.002]).expect("length")];
        assert_eq!(of(&body).position.len(), 25 + doubled, "{end}");
    }
    let mut body = plate();
    body.cuts = vec![Cut::segment([-0.001, 0.002], [0.005, 0.002]).expect("length")];
    let mut solid = solid(&body, "");
    let upper: Vec<bool> = (0..corners(&*solid).position.len())
        .map(|corner| {
            let mut around = corners(&*solid).around(corner, &[]);
            around.all(|(_, point)| body.points.position.at(point).y > 0.002)
        })
        .collect();
    let apart: Vec<f64> = upper
        .iter()
        .flat_map(|upper| if *upper { [1e-5, 3e-5, 0.0] } else { [0.0; 3] })
        .collect();
    // rounding of displacements of 1e-5 m
    let rounding = 2e11 * 1e-5 / (SPACING * SPACING) * 1e-14;
    assert!(largest(&force(&mut *solid, &apart)) < rounding);
}

/// Two squares that touch at a corner do not hold each other.
#[test]
fn cells_that_touch_along_an_edge_have_corners_of_their_own() {
    let square = |at: f64| {
        format!(
            "{{ box = {{ min = [{at}, {at}, 0], max = [{0}, {0}, 1] }} }}",
            at + 0.002
        )
    };
    let body = filled(&format!("union = [{}, {}]", square(0.0), square(0.002)), 2);
    assert_eq!(body.points.len(), 8);
    assert_eq!(of(&body).position.len(), 18);
}

/// The force on a corner does not depend on where the body begins to repeat itself.
#[test]
fn a_periodic_body_has_the_same_force_wherever_it_begins() {
    for (shape, dimension, count) in [
        (
            "box = { min = [0, 0, 0], max = [0.005, 0.002, 1] }",
            2,
            5 * 3,
        ),
        (
            "box = { min = [0, 0, 0], max = [0.005, 0.002, 0.003] }",
            3,
            5 * 3 * 4,
        ),
    ] {
        let mut body = filled(shape, dimension);
        body.repeat(&[Axis::X]).expect("it fills its box");
        let mut solid = solid(&body, "");
        assert_eq!(corners(&*solid).position.len(), count);
        let wave = |x: Vector3<f64>, shift: f64| {
            let phase = std::f64::consts::TAU * (x.x + shift) / 0.005;
            1e-6 * Vector3::new(
                phase.sin() + 200.0 * x.y,
                (phase + 900.0 * x.y).cos(),
                phase.cos(),
            )
        };
        let [here, moved] = [0.0, SPACING].map(|shift| {
            let state = displacement(&*solid, |x| wave(x, shift));
            force(&mut *solid, &state)
        });
        let size = largest(&here);
        assert!(size > 1e6);
        let positions = &corners(&*solid).position;
        let at = |place: Vector3<f64>| {
            let distance = |x: &Vector3<f64>| (x - place).norm();
            positions.iter().position(|x| distance(x) < 0.1 * SPACING)
        };
        for (corner, moved) in moved.chunks(3).enumerate() {
            let beside = |cells: f64| at(positions[corner] + Vector3::x() * cells * SPACING);
            let next = beside(1.0).or(beside(-4.0)).expect("a row of five");
            for (a, b) in moved.iter().zip(&here[3 * next..]) {
                assert!((a - b).abs() < 1e-12 * size, "{dimension}D {corner}");
            }
        }
    }
}

#[test]
fn material_waits_until_a_face_joins_it() {
    let body = plate();
    let corners = of(&body);
    let with = |points: &[usize]| {
        let mut present = vec![false; 16];
        points.iter().for_each(|point| present[*point] = true);
        present
    };
    for (was, active, expected) in [
        // along the diagonal
        (&[0][..], &[0, 5][..], &[0][..]),
        (&[0], &[0, 5, 10], &[0]),
        // a piece of two, one of which touches
        (&[0], &[0, 5, 6], &[0]),
        // joined by a neighbour that is born with it, or that was there
        (&[0], &[0, 1, 5], &[0, 1, 5]),
        (&[0, 1], &[0, 1, 5], &[0, 1, 5]),
        // away from everything
        (&[0], &[0, 10, 11], &[0, 10, 11]),
        // what was there stays
        (&[0, 5], &[0, 5], &[0, 5]),
        // pieces that touch each other along an edge, one of them attached
        (&[0], &[0, 1, 6], &[0, 1]),
    ] {
        let mut found = with(active);
        let points = Reducer::alone(found.len());
        corners.leave_out_hinges(&points, &mut found, &with(was));
        assert_eq!(found, with(expected), "{was:?} {active:?}");
    }
}

/// On a face of the box, a traction by a layer is that of the faces of its cells.
#[test]
fn tractions_by_layers_act_on_the_faces() {
    let shape = "box = { min = [0, 0, 0], max = [0.003, 0.002, 0.004] }";
    let body = filled(shape, 3);
    let corners = of(&body);
    let stress = [1e6, -2e6, 3e6];
    let rule = LayerRule {
        traction: Some(Traction {
            stress,
            difference: false,
        }),
        ..LayerRule::even(Face::YMax)
    };
    let mut force = vec![Vector3::zeros(); body.points.len()];
    let mut moment = vec![Matrix3::zeros(); body.points.len()];
    for cell in body.surface(&[Face::YMax]) {
        let point = cell.point as usize;
        let load = Vector3::from(stress) * cell.face_area / body.points.volume[point];
        force[point] += load;
        moment[point] += load * (0.5 * SPACING * cell.face.normal()).transpose();
    }
    let [mut by_layer, mut by_force] = [Vec::new(), Vec::new()];
    let faces = PointLoads {
        faces: &[rule],
        ..PointLoads::default()
    };
    corners.loads(faces, &[], &mut by_layer);
    let cells = PointLoads {
        force: &force,
        moment: &moment,
        faces: &[],
    };
    corners.loads(cells, &[], &mut by_force);
    let size = largest(&by_force);
    let same = by_layer
        .iter()
        .zip(&by_force)
        .all(|(a, b)| (a - b).abs() < 1e-12 * size);
    assert!(same && size > 1e9);
}

/// What is not supported is told with its key.
#[test]
fn unsupported_keys_and_bodies_are_refused() {
    let lattice = staircase(2);
    let jitter = Jitter {
        amplitude: 0.1,
        seed: 1,
    };
    let cloud = lattice.clone().jittered(jitter).expect("valid");
    for (body, keys, key) in [
        (&lattice, "fracture = {}", "fracture"),
        (
            &lattice,
            "surface_stress = 'extrapolated'",
            "surface_stress",
        ),
        (&lattice, "horizon = 2", "horizon"),
        (&lattice, "partial_volume = 'full'", "partial_volume"),
        (&lattice, "influence = 'conical'", "influence"),
        (&lattice, "correction = 'lattice'", "correction"),
        (&lattice, "stabilisation = -1", "stabilisation"),
        (&cloud, "", "formulation"),
    ] {
        let mut world = World::new(vec![body.clone()]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("mechanical");
        let mechanical: Mechanical = read(&format!("formulation = 'staggered'\n{keys}"));
        let error = mechanical.ready(&mut setup).err().expect(keys);
        assert_eq!(error.key, key, "{error:?}");
    }
}

#[test]
fn a_corner_has_one_spring_to_each_other_corner_of_the_cells_around_it() {
    for dimension in [1, 2, 3] {
        let body = staircase(dimension);
        let solid = solid(&body, "");
        let corners = corners(&*solid);
        for corner in 0..corners.position.len() {
            let mut ends = Vec::new();
            solid.couplings(corner, &mut |spring| ends.push(spring.to));
            let around = corners.around(corner, &[]);
            let mut expected: Vec<usize> = around
                .flat_map(|(_, point)| corners.of(point).iter().map(|other| *other as usize))
                .filter(|other| *other != corner)
                .collect();
            expected.sort_unstable();
            expected.dedup();
            ends.sort_unstable();
            assert_eq!(ends, expected, "{dimension}D");
        }
    }
}
