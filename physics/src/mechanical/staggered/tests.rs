//! Forces, stiffness and stress of staggered solids.

use nalgebra::Vector3;
use perimelt_core::body::Body;
use perimelt_core::family::LayerRule;
use perimelt_core::shape::Shape;
use perimelt_core::{Face, Setup, World};

use super::corners::Corners;
use crate::mechanical::Mechanical;
use crate::mechanical::nodes::{Held, HeldNodes, PointLoads};
use crate::mechanical::solid::{
    EnergyKind, PointStates, Solid, Stiffness, StressFreeStrain, StressKind, Wanted,
};
use crate::testing::{material, read};

pub(super) const STEEL: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nyield_stress = 2e8\nhardening_modulus = 1e9";
pub(super) const SPACING: f64 = 1e-3;

/// A ring or a shell, whose surfaces are staircases, by dimension; a bar in 1D.
pub(super) fn staircase(dimension: usize) -> Body {
    let sphere =
        |radius: f64| format!("sphere = {{ centre = [0.006, 0.006, 0.006], radius = {radius} }}");
    let shape: Shape = match dimension {
        1 => read("box = { min = [0, 0, 0], max = [0.006, 0.001, 0.001] }"),
        _ => read(&format!(
            "difference = {{ from = {{ {} }}, subtract = {{ {} }} }}",
            sphere(0.006),
            sphere(0.002)
        )),
    };
    let mut body = Body::fill("part", &shape, dimension, SPACING, 0.1).expect("a valid shape");
    body.materials = vec![material(STEEL)];
    body
}

pub(super) fn solid(body: &Body, keys: &str) -> Box<dyn Solid> {
    let mechanical: Mechanical = read(&format!("formulation = 'staggered'\n{keys}"));
    let mut world = World::new(vec![body.clone()]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run.solid
}

pub(super) fn corners(solid: &dyn Solid) -> &Corners {
    solid.base().nodes.corners().expect("a staggered solid")
}

/// Displacement of the corners within the dimensions.
pub(super) fn displacement(
    solid: &dyn Solid,
    of: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Vec<f64> {
    let dimension = solid.base().dimension;
    let within = |x: &Vector3<f64>| {
        let u = of(*x);
        std::array::from_fn::<f64, 3, _>(|a| if a < dimension { u[a] } else { 0.0 })
    };
    corners(solid).position.iter().flat_map(within).collect()
}

/// A displacement without order, of strains of some 1e-3.
fn uneven(solid: &dyn Solid, seed: f64) -> Vec<f64> {
    displacement(solid, |x| {
        let wave = |k: f64| (k * 1e3 * (x.x + 1.7 * x.y - 0.6 * x.z) + seed).sin();
        1e-6 * Vector3::new(wave(2.3), wave(3.1), wave(1.9))
    })
}

pub(super) fn force(solid: &mut dyn Solid, displacement: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    force
}

fn product(solid: &mut dyn Solid, kind: Stiffness, displacement: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.stiffness(kind, &mut out);
    out
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// All dimensions and planes.
pub(super) fn all(mut test: impl FnMut(&Body, &str)) {
    for (dimension, plane) in [
        (1, ""),
        (2, "plane = 'stress'\n"),
        (2, "plane = 'strain'\n"),
        (3, ""),
    ] {
        test(&staircase(dimension), plane);
    }
}

fn all_kinematics(mut test: impl FnMut(&Body, &str)) {
    all(|body, plane| {
        for kinematics in ["linear", "finite"] {
            test(body, &format!("{plane}kinematics = '{kinematics}'\n"));
        }
    });
}

#[test]
fn the_stiffness_is_symmetric_also_while_metal_flows() {
    for damping in [0.0, 0.05] {
        all_kinematics(|body, plane| assert_symmetric_stiffness(body, plane, damping));
    }
}

fn assert_symmetric_stiffness(body: &Body, plane: &str, damping: f64) {
    let mut solid = solid(body, &format!("{plane}plasticity = {{}}"));
    set_yield(&mut *solid, body);
    let state: Vec<f64> = uneven(&*solid, 0.3).iter().map(|u| 10.0 * u).collect();
    force(&mut *solid, &state);
    solid.linearise(damping);
    let states = &solid.base_mut().plasticity().expect("it flows").states;
    let states = states.tried().iter().zip(states.settled());
    let flowing = states.filter(|(tried, settled)| tried.equivalent > settled.equivalent);
    assert!(4 * flowing.count() > body.points.len(), "it flows");
    let (u, v) = (uneven(&*solid, 1.0), uneven(&*solid, 2.0));
    for kind in [Stiffness::Elastic, Stiffness::Tangent] {
        let (ku, kv) = (
            product(&mut *solid, kind, &u),
            product(&mut *solid, kind, &v),
        );
        let size = dot(&u, &ku);
        assert!(size > 0.0);
        // in plane stress the tangent of the flow is one of differences
        let by_differences = plane.contains("stress") && kind == Stiffness::Tangent;
        let tolerance = if by_differences { 1e-7 } else { 1e-12 };
        let error = (dot(&v, &ku) - dot(&u, &kv)).abs();
        assert!(
            error < tolerance * size,
            "{plane}{kind:?}: {}",
            error / size
        );
    }
}

/// Lets the material of the body yield at its stress without temperature.
fn set_yield(solid: &mut dyn Solid, body: &Body) {
    let plasticity = solid.base_mut().plasticity().expect("it flows");
    plasticity.set_conditions(&body.material_of_point, None, None, 1.0);
}

#[test]
fn forces_and_their_moments_cancel() {
    all_kinematics(|body, plane| {
        let mut solid = solid(body, &format!("{plane}plasticity = {{}}"));
        set_yield(&mut *solid, body);
        let state = uneven(&*solid, 0.3);
        let force = force(&mut *solid, &state);
        let (force, _) = force.as_chunks::<3>();
        let size: f64 = force.iter().map(|f| Vector3::from(*f).norm()).sum();
        let sum: Vector3<f64> = force.iter().map(|f| Vector3::from(*f)).sum();
        // about positions in space, about which forces of small displacements have moments
        let moved = if plane.contains("finite") { 1.0 } else { 0.0 };
        let (state, _) = state.as_chunks::<3>();
        let position = corners(&*solid).position.iter().zip(state);
        let position = position.map(|(x, u)| x + moved * Vector3::from(*u));
        let moments = position
            .zip(force)
            .map(|(x, f)| x.cross(&Vector3::from(*f)));
        let moment: Vector3<f64> = moments.sum();
        assert!(sum.norm() < 1e-14 * size, "{sum}");
        assert!(moment.norm() < 1e-14 * size * 0.012, "{moment}");
    });
}

/// Also at surfaces, where the stress is in equilibrium with the traction at the corners of the faces.
#[test]
fn uniform_strain_is_exact_everywhere() {
    all(|body, plane| {
        let mut solid = solid(body, plane);
        let dimension = body.dimension;
        let gradient =
            nalgebra::Matrix3::new(1e-3, 2e-4, -5e-4, 7e-4, -3e-4, 4e-4, 1e-4, -6e-4, 8e-4);
        let gradient = nalgebra::Matrix3::from_fn(|r, c| match r.max(c) < dimension {
            true => gradient[(r, c)],
            false => 0.0,
        });
        let state = displacement(&*solid, |x| gradient * x);
        let force = force(&mut *solid, &state);
        let moduli = solid.base().moduli_of(0);
        let strain: nalgebra::Matrix3<f64> = (gradient + gradient.transpose()) * 0.5;
        let sigma = nalgebra::Matrix3::from_fn(|r, c| match r.max(c) < dimension {
            true => {
                2.0 * moduli.shear * strain[(r, c)]
                    + if r == c {
                        moduli.lame * strain.trace()
                    } else {
                        0.0
                    }
            }
            false => 0.0,
        });
        let found = solid.evaluate(Wanted::stress(StressKind::Spatial)).stress;
        for stress in found {
            for (component, (r, c)) in [(0, (0, 0)), (1, (1, 1)), (3, (0, 1)), (5, (2, 0))] {
                assert!((stress[component] - sigma[(r, c)]).abs() < 1e-13 * 2e11 * 1e-3 * 10.0);
            }
        }
        // tractions on the bare faces, given as forces of points with their moments
        let mut loads = vec![Vector3::zeros(); body.points.len()];
        let mut moments = vec![nalgebra::Matrix3::zeros(); body.points.len()];
        for cell in body.surface(&Face::ALL) {
            let point = cell.point as usize;
            let load = sigma * cell.face.normal() * cell.face_area / body.points.volume[point];
            loads[point] += load;
            moments[point] += load * (0.5 * SPACING * cell.face.normal()).transpose();
        }
        let loads = PointLoads {
            force: &loads,
            moment: &moments,
            faces: &[],
        };
        let mut at_corners = Vec::new();
        corners(&*solid).loads(loads, &[], &mut at_corners);
        let loads = at_corners;
        let unbalanced: Vec<f64> = force.iter().zip(&loads).map(|(f, b)| f + b).collect();
        assert!(largest(&loads) > 1e9);
        assert!(
            largest(&unbalanced) < 1e-12 * largest(&loads),
            "{}",
            largest(&unbalanced)
        );
    });
}

#[test]
fn small_rotations_and_translations_make_no_force() {
    all(|body, plane| {
        let mut solid = solid(body, plane);
        let turn = match body.dimension {
            1 => Vector3::zeros(),
            2 => Vector3::new(0.0, 0.0, 1e-3),
            _ => Vector3::new(1e-3, -2e-3, 3e-3),
        };
        let moved = displacement(&*solid, |x| {
            turn.cross(&x) + Vector3::new(0.1, -0.2, 0.3) * 1e-3
        });
        // rounding of displacements of 1e-3 m over the square of the spacing
        let rounding = 2e11 * 1e-3 / (SPACING * SPACING) * 1e-14;
        assert!(largest(&force(&mut *solid, &moved)) < rounding);
    });
}

#[test]
fn the_tangent_is_the_derivative_of_the_force() {
    all_kinematics(|body, plane| {
        let mut solid = solid(body, &format!("{plane}plasticity = {{}}"));
        set_yield(&mut *solid, body);
        let state = uneven(&*solid, 0.3);
        let change = uneven(&*solid, 1.0);
        let step = 1e-5;
        let mut at = |factor: f64| {
            let moved: Vec<f64> = state
                .iter()
                .zip(&change)
                .map(|(u, d)| u + factor * d)
                .collect();
            force(&mut *solid, &moved)
        };
        let (up, down) = (at(step), at(-step));
        force(&mut *solid, &state);
        solid.linearise(0.0);
        let tangent = product(&mut *solid, Stiffness::Tangent, &change);
        let differences = up.iter().zip(&down).map(|(u, d)| (d - u) / (2.0 * step));
        let error: Vec<f64> = differences.zip(&tangent).map(|(d, t)| d - t).collect();
        // kinks of points that begin to flow are not differentiable
        assert!(
            largest(&error) < 2e-3 * largest(&tangent),
            "{plane}{}",
            largest(&error) / largest(&tangent)
        );
    });
}

#[test]
fn forces_are_the_derivative_of_the_energy() {
    all(|body, plane| {
        let mut solid = solid(body, plane);
        let eigenstrain: Vec<f64> = body
            .points
            .position
            .iter()
            .map(|x| 0.2 * x.x + 30.0 * x.y * x.y)
            .collect();
        let strain: Vec<[f64; 6]> = body
            .points
            .position
            .iter()
            .map(|x| [0.1 * x.y, 1e-4, 0.0, 0.05 * x.x, 0.0, 0.0])
            .collect();
        solid.set_points(PointStates {
            eigenstrain: Some(&eigenstrain),
            stress_free: Some(StressFreeStrain {
                strain: &strain,
                prescribed: &[],
            }),
            ..PointStates::default()
        });
        let (state, change) = (uneven(&*solid, 0.3), uneven(&*solid, 1.0));
        let mut energy = |factor: f64| {
            let moved: Vec<f64> = state
                .iter()
                .zip(&change)
                .map(|(u, d)| u + factor * d)
                .collect();
            solid.set_displacement(&moved, &[]);
            let energy = solid.evaluate(Wanted::energy(EnergyKind::Elastic)).energy;
            energy.iter().map(|e| e[0]).sum::<f64>()
        };
        let rise = 0.5 * (energy(1.0) - energy(-1.0));
        let force = force(&mut *solid, &state);
        let work = dot(&force, &change);
        assert!((rise + work).abs() < 1e-9 * work.abs(), "{rise} {work}");
    });
}

/// `E' kappa^2 h^2 / 24` in energy per volume, with the plate modulus E': bending about one axis of a plate of one cell.
#[test]
fn a_plate_of_one_cell_bends_as_it_should() {
    for (dimension, plane, modulus) in [
        (2, "plane = 'stress'", 2e11),
        (2, "plane = 'strain'", 2e11 / 0.91),
        (3, "", 2e11 / 0.91),
    ] {
        let shape: Shape = read("box = { min = [0, 0, 0], max = [0.004, 0.001, 0.003] }");
        let mut body = Body::fill("plate", &shape, dimension, SPACING, 0.003).expect("valid");
        body.materials = vec![material(STEEL)];
        let mut solid = solid(&body, plane);
        let curvature = 2.0;
        // strain across the plate, so that nothing presses on its faces: nu / (1 - nu) of that along it in plane strain
        let ratio = if plane.contains("stress") {
            0.3
        } else {
            0.3 / 0.7
        };
        let bent = displacement(&*solid, |x| {
            let y = x.y - 0.5 * SPACING;
            Vector3::new(
                -curvature * x.x * y,
                0.5 * curvature * (x.x * x.x + ratio * y * y),
                0.0,
            )
        });
        solid.set_displacement(&bent, &[]);
        let energy = solid.evaluate(Wanted::energy(EnergyKind::Elastic)).energy;
        let exact = modulus * curvature * curvature * SPACING * SPACING / 24.0;
        for [energy, _] in energy {
            assert!((energy / exact - 1.0).abs() < 1e-10, "{dimension}D {plane}");
        }
    }
}

/// `u = (g . x) x - 1/2 g |x|^2` has the strain `g . x` of the linear eigenstrain.
#[test]
fn linear_temperatures_leave_a_staircase_free_of_stress() {
    for (dimension, plane) in [(2, "plane = 'stress'"), (2, "plane = 'strain'"), (3, "")] {
        let body = staircase(dimension);
        let mut solid = solid(&body, plane);
        let swelling = solid.base().moduli_of(0).swelling;
        let mut slope = Vector3::new(0.2, -0.1, 0.3);
        (dimension..3).for_each(|a| slope[a] = 0.0);
        let eigenstrain: Vec<f64> = body.points.position.iter().map(|x| slope.dot(x)).collect();
        solid.set_points(PointStates {
            eigenstrain: Some(&eigenstrain),
            ..PointStates::default()
        });
        let free = displacement(&*solid, |x| {
            let mut x = x;
            (dimension..3).for_each(|a| x[a] = 0.0);
            swelling * (slope.dot(&x) * x - 0.5 * x.norm_squared() * slope)
        });
        let force = force(&mut *solid, &free);
        let size = 2e11 * largest(&eigenstrain);
        assert!(largest(&force) * SPACING < 1e-12 * size, "{plane}");
        let stress = solid.evaluate(Wanted::stress(StressKind::Spatial)).stress;
        for stress in stress {
            let in_plane = [stress[0], stress[1], stress[3]];
            assert!(largest(&in_plane) < 1e-12 * size, "{plane}");
        }
    }
}

/// A face holds the corners in it. Supports at three corners of the body hold one corner each.
#[test]
fn faces_and_points_hold_corners() {
    let shape: Shape = read("box = { min = [0, 0, 0], max = [0.003, 0.002, 1] }");
    let mut body = Body::fill("plate", &shape, 2, SPACING, 1.0).expect("valid");
    body.materials = vec![material(STEEL)];
    let solid = solid(&body, "");
    let corners = corners(&*solid);
    let place = |corner: usize| {
        let cells = corners.position[corner] / SPACING;
        (cells.x.round() + 4.0 * cells.y.round()) as usize
    };
    let held = |points: &[usize], rules: &[LayerRule]| {
        let mut count = vec![Vector3::zeros(); body.points.len()];
        let mut sum = count.clone();
        for &point in points {
            count[point].x = 1.0;
            sum[point].x = 0.1;
        }
        let held = Held {
            count: &count,
            sum: &sum,
        };
        let corners = corners.held(held, rules, &[]);
        let held = HeldNodes {
            count: &corners.count,
            sum: &corners.sum,
        };
        let mut u = vec![0.0; held.count.len()];
        let mut movement = u.clone();
        held.place(&mut u, &mut movement);
        assert_eq!(u, movement);
        let at = (0..u.len() / 3).filter(|c| held.count[3 * c] > 0.0);
        let mut at: Vec<_> = at.map(|c| (place(c), u[3 * c])).collect();
        at.sort_by_key(|(place, _)| *place);
        at
    };
    // places are numbered in rows of four, points in rows of three
    let rule = LayerRule {
        scale: [-1.0, 1.0, 1.0],
        offset: [0.4, 0.0, 0.0],
        ..LayerRule::even(Face::XMin)
    };
    assert_eq!(held(&[], &[rule]), [(0, 0.2), (4, 0.2), (8, 0.2)]);
    assert_eq!(held(&[0], &[]), [(0, 0.1)]);
    assert_eq!(held(&[5], &[]), [(11, 0.1)]);
    // in the middle of a face, one of its corners
    assert_eq!(held(&[1], &[]), [(1, 0.1)]);
    // the column at a face holds the corners in it
    assert_eq!(held(&[0, 3], &[]), [(0, 0.1), (4, 0.1), (8, 0.1)]);
}

/// The coarse space is built from the couplings of corners: together they are the elastic stiffness.
#[test]
fn couplings_are_the_stiffness() {
    all(|body, plane| {
        let mut solid = solid(body, plane);
        let u = uneven(&*solid, 0.3);
        let expected = product(&mut *solid, Stiffness::Elastic, &u);
        let (nodes, _) = u.as_chunks::<3>();
        let mut found = vec![0.0; u.len()];
        for (node, here) in nodes.iter().enumerate() {
            solid.couplings(node, &mut |spring| {
                for a in 0..3 {
                    let relative = |b: usize| here[b] - nodes[spring.to][b];
                    found[3 * node + a] += (0..3)
                        .map(|b| spring.stiffness[a][b] * relative(b))
                        .sum::<f64>();
                }
            });
        }
        let error: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| f - e).collect();
        assert!(largest(&error) < 1e-12 * largest(&expected), "{plane}");
        // and its diagonal blocks are those of unit displacements
        let blocks = solid.blocks().to_vec();
        for node in [0, blocks.len() / 2] {
            let mut sum = [[0.0; 3]; 3];
            solid.couplings(node, &mut |spring| {
                for (row, coupling) in sum.iter_mut().zip(spring.stiffness) {
                    (0..3).for_each(|b| row[b] += coupling[b]);
                }
            });
            let found = [
                sum[0][0], sum[1][1], sum[2][2], sum[0][1], sum[1][2], sum[2][0],
            ];
            for (found, expected) in found.iter().zip(blocks[node]) {
                assert!((found - expected).abs() < 1e-12 * blocks[node][0]);
            }
        }
    });
}
