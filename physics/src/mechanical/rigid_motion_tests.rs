//! Rigid displacements, however large, meet no force and are no blow-up.

use super::step::MechanicalRun;
use perimelt_core::body::Store;
use perimelt_core::shape::Shape;
use perimelt_core::{Body, BrokenBonds, Family, RunError, Setup, World};

use super::Mechanical;
use super::fracture::FractureState;
use super::solid::{EnergyKind, Solid, StressKind, Wanted};
use crate::testing::{material, read, run, set, simulation, values};

const SPACING: f64 = 1e-3;
const BRITTLE: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nfracture_energy = 1e3\nyield_stress = 1e9";

/// A block with a hole, so that points have empty slots on all sides.
fn holed(dimension: usize, store: Store) -> Body {
    let depth = if dimension == 3 { 0.01 } else { SPACING };
    let keys = format!(
        "difference.from.box = {{ min = [0, 0, 0], max = [0.012, 0.011, {depth}] }}
        difference.subtract.cylinder = {{ start = [0.006, 0.005, -1], end = [0.006, 0.005, 1], radius = 0.0024 }}"
    );
    let shape: Shape = read(&keys);
    let mut body = Body::fill("block", &shape, dimension, SPACING, SPACING).expect("valid");
    body.materials = vec![material(BRITTLE)];
    body.store = store;
    body
}

/// All formulations, kinematics and criteria of fracture.
fn variants() -> Vec<String> {
    let mut variants = Vec::new();
    for formulation in ["bond", "ordinary", "correspondence"] {
        for kinematics in ["linear", "finite"] {
            for fracture in ["", "fracture = {}", "fracture = { criterion = 'energy' }"] {
                if formulation != "correspondence" || !fracture.contains("energy") {
                    variants.push(format!(
                        "formulation = '{formulation}'\nkinematics = '{kinematics}'\n{fracture}"
                    ));
                }
            }
            if formulation != "bond" {
                variants.push(format!(
                    "formulation = '{formulation}'\nkinematics = '{kinematics}'\nplasticity = {{}}"
                ));
            }
        }
    }
    variants
}

fn prepared(body: Body, keys: &str) -> MechanicalRun {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run
}

/// Force over that of a strain of one across a spacing, energy and stress over the modulus: the largest of them.
fn largest(solid: &mut dyn Solid, displacement: &[f64]) -> f64 {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    let force = force.iter().map(|f| f * SPACING).collect();
    let elastic = solid
        .evaluate(Wanted::energy(EnergyKind::Elastic))
        .energy
        .as_flattened()
        .to_vec();
    let energy = solid
        .evaluate(Wanted::energy(EnergyKind::Total))
        .energy
        .as_flattened()
        .to_vec();
    let stress = solid
        .evaluate(Wanted::stress(StressKind::Spatial))
        .stress
        .as_flattened()
        .to_vec();
    let all = [force, elastic, energy, stress].concat();
    assert!(all.iter().all(|v: &f64| v.is_finite()), "not a number");
    all.iter().fold(0.0f64, |m, v| m.max(v.abs())) / 2e11
}

/// Breaks every seventh bond.
fn some_broken(family: &Family, points: usize) -> BrokenBonds {
    let mut broken = family.unbroken();
    let point_in = family.points_of_slots();
    for point in 0..points as u32 {
        let mut others = Vec::new();
        family.for_each_bond(point as usize, |_, _, slot| others.push(point_in[slot]));
        for other in others {
            if other != u32::MAX && (point + other) % 7 == 0 {
                family.break_pair([point, other], &point_in, &mut broken);
            }
        }
    }
    broken
}

#[test]
fn displacements_by_the_vectors_of_a_family_meet_no_force() {
    for (dimension, store) in [(2, Store::Lattice), (2, Store::List), (3, Store::Lattice)] {
        for keys in variants() {
            let body = holed(dimension, store);
            let points = body.points.len();
            let mut mechanical = prepared(body, &keys);
            let solid = &mut mechanical.solid;
            for damaged in [false, true] {
                if damaged {
                    let state = FractureState {
                        broken: vec![some_broken(solid.base().family(), points)],
                        frozen: vec![[0.0; 6]; points],
                        sliding_energy: Vec::new(),
                    };
                    if solid.replace_fracture_state(state).is_none() {
                        continue;
                    }
                }
                for (i, j, k) in (-3..=3)
                    .flat_map(|i| (-3..=3).flat_map(move |j| (-3..=3).map(move |k| (i, j, k))))
                {
                    // a family is symmetric: half of its vectors, in 3D those of a coarser choice
                    let flat = dimension == 2 && k != 0;
                    let is_left_out = dimension == 3 && (i + 2 * j + 3 * k) % 4 != 0;
                    if flat || (k, j, i) <= (0, 0, 0) || is_left_out {
                        continue;
                    }
                    let vector = [i, j, k].map(|n| f64::from(n) * SPACING);
                    let displacement: Vec<f64> = (0..points).flat_map(|_| vector).collect();
                    let found = largest(&mut **solid, &displacement);
                    // rounding of displacements of several spacings
                    assert!(found < 1e-12, "{keys} {dimension}D {vector:?}: {found:e}");
                }
            }
        }
    }
}

/// Ends of bonds that are held in one place have no direction between them, and no force.
#[test]
fn points_in_one_place_have_finite_forces() {
    for keys in variants() {
        let body = holed(2, Store::Lattice);
        let half = |x: f64| if x < 0.0035 { SPACING } else { 0.0 };
        let x = body.points.position.iter();
        let displacement: Vec<f64> = x.flat_map(|x| [half(x.x), 0.0, 0.0]).collect();
        let mut mechanical = prepared(body, &keys);
        let solid = &mut mechanical.solid;
        assert!(largest(&mut **solid, &displacement) > 1e-3, "{keys}");
    }
}

fn flight(keys: &str, speed: f64, end: f64) -> perimelt_core::simulation::Simulation {
    let keys = format!("{keys}\nsolver.explicit = {{}}");
    let mechanical: Mechanical = read(&keys);
    let body = holed(2, Store::Lattice);
    let mut s = simulation(body, vec![Box::new(mechanical)], vec![], end);
    set(&mut s, "velocity", |_| [speed, 0.0, 0.0]);
    s
}

#[test]
fn a_body_flies_by_many_times_its_size() {
    for keys in variants() {
        if keys.contains("plasticity") {
            continue;
        }
        let mut s = flight(&keys, 3e5, 1e-6);
        run(&mut s);
        let u = values(&s, "displacement");
        let error = |u: &[f64; 3]| (u[0] / 0.3 - 1.0).abs() + u[1].abs() + u[2].abs();
        let worst = u.as_chunks::<3>().0.iter().map(error).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{keys}: {worst:e}");
    }
}

/// Halves that fly apart after their bonds broke are two bodies in flight.
#[test]
fn pieces_fly_apart_by_many_times_their_size() {
    for formulation in ["bond", "ordinary", "correspondence"] {
        let keys = format!("formulation = '{formulation}'\nkinematics = 'finite'\nfracture = {{}}");
        let mut s = flight(&keys, 0.0, 6.5e-4);
        set(&mut s, "velocity", |[x, ..]| {
            [if x < 6e-3 { -300.0 } else { 300.0 }, 0.0, 0.0]
        });
        run(&mut s);
        let u = values(&s, "displacement");
        let farthest = u.iter().fold(0.0f64, |m, u| m.max(u.abs()));
        assert!(farthest > 10.0 * 0.0163, "{formulation}: {farthest}");
    }
}

/// Bonds that do not break and are stretched beyond all measure are a blow-up.
#[test]
fn parts_of_a_body_that_fly_apart_without_breaking_are_a_blow_up() {
    let mut s = flight("", 0.0, 1e-6);
    set(&mut s, "velocity", |[x, ..]| {
        [if x < 6e-3 { -1e7 } else { 1e7 }, 0.0, 0.0]
    });
    s.start().expect("starts");
    let failure = loop {
        if s.is_finished() {
            break None;
        }
        if let Err(error) = s.step() {
            break Some(error);
        }
    };
    assert!(
        matches!(&failure, Some(RunError::BlowUp { field, .. }) if field == "displacement"),
        "{failure:?}"
    );
}
