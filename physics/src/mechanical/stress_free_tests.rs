//! Strains that vary linearly are free of stress in a free body, to rounding.

use super::step::MechanicalRun;
use nalgebra::{Matrix3, Vector3};
use perimelt_core::body::{Jitter, Store, Zone};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, BrokenBonds, Family, Setup, World, keys};

use super::Mechanical;
use super::classical::{COMPONENTS, symmetric};
use super::fracture::FractureState;
use super::solid::{EnergyKind, PointStates, Solid, StressFreeStrain, StressKind, Wanted};
use crate::testing::{block, read};

const MATERIAL: &str =
    "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nfracture_energy = 1e6";

/// A strain that is linear in the place x (m), as xx, yy, zz, xy, yz, zx.
#[derive(Clone, Copy)]
struct Linear {
    at_origin: [f64; 6],
    /// 1/m, along x, y and z.
    gradient: [[f64; 6]; 3],
    dimension: usize,
}

impl Linear {
    fn isotropic(dimension: usize) -> Linear {
        let all = |value: f64| [value, value, value, 0.0, 0.0, 0.0];
        let mut gradient = [all(0.04), all(-0.07), all(0.05)];
        (dimension..3).for_each(|axis| gradient[axis] = [0.0; 6]);
        Linear {
            at_origin: all(1e-4),
            gradient,
            dimension,
        }
    }

    fn tensor(dimension: usize) -> Linear {
        let mut this = Linear {
            at_origin: [1e-4, -2e-4, 5e-5, 3e-5, -4e-5, 2e-5],
            gradient: [
                [0.04, 0.01, -0.02, 0.03, -0.01, 0.02],
                [-0.02, 0.05, 0.01, -0.04, 0.02, 0.03],
                [0.03, -0.01, 0.06, 0.02, 0.01, -0.05],
            ],
            dimension,
        };
        (dimension..3).for_each(|axis| this.gradient[axis] = [0.0; 6]);
        this
    }

    fn at(&self, x: &Vector3<f64>) -> [f64; 6] {
        std::array::from_fn(|c| {
            (0..3).fold(self.at_origin[c], |sum, a| sum + self.gradient[a][c] * x[a])
        })
    }

    /// Component of the tensor at a row and column.
    fn component(row: usize, column: usize) -> usize {
        let is_here = |&(a, b): &(usize, usize)| (a, b) == (row, column) || (b, a) == (row, column);
        COMPONENTS.iter().position(is_here).expect("a component")
    }

    /// `E_ab x_b + (E_ab,c - 1/2 E_bc,a) x_b x_c` within the dimension, m.
    fn displacement(&self, x: &Vector3<f64>) -> [f64; 3] {
        let axes = 0..self.dimension;
        std::array::from_fn(|a| {
            if a >= self.dimension {
                return 0.0;
            }
            let mut sum = 0.0;
            for b in axes.clone() {
                sum += self.at_origin[Self::component(a, b)] * x[b];
                for c in axes.clone() {
                    let rise = self.gradient[c][Self::component(a, b)]
                        - 0.5 * self.gradient[a][Self::component(b, c)];
                    sum += rise * x[b] * x[c];
                }
            }
            sum
        })
    }
}

/// A body with two spacings.
fn two_spacings(dimension: usize) -> Body {
    let max = [8e-3, 8e-3, if dimension == 3 { 6e-3 } else { 1e-3 }];
    let zone = |from: f64, to: f64, spacing: f64| Zone {
        min: [from, 0.0, 0.0],
        max: [to, max[1], if dimension == 3 { max[2] } else { 0.0 }],
        spacing,
        horizon_factor: 1.0,
    };
    let zones = [zone(0.0, 4e-3, 1e-3), zone(4e-3, 8e-3, 2e-3)];
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    let body = Body::fill_zones("block", &shape, dimension, 0.1, &zones);
    let mut body = body.expect("valid zones");
    body.materials = vec![crate::testing::material(MATERIAL)];
    body
}

/// Bodies with faces, edges and corners: lattices in two stores, a cloud, two spacings.
fn bodies(dimension: usize) -> Vec<Body> {
    let cells = [9, 8, if dimension == 3 { 7 } else { 1 }];
    let lattices = [Store::Lattice, Store::List];
    let mut bodies: Vec<Body> = lattices
        .map(|store| block(cells, dimension, 1e-3, store, MATERIAL))
        .into();
    let jitter = Jitter {
        amplitude: 0.2,
        seed: 3,
    };
    let lattice = block(cells, dimension, 1e-3, Store::Lattice, MATERIAL);
    bodies.push(lattice.jittered(jitter).expect("a valid amplitude"));
    bodies.push(two_spacings(dimension));
    bodies
}

fn prepared(body: Body, keys: &str) -> MechanicalRun {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    let mut run = mechanical.ready(&mut setup).expect("valid").run;
    setup.finish().expect("complete");
    run.load_plasticity(&world, None, 1.0);
    run
}

/// Largest force (over modulus and spacing) and in-plane stress (over the modulus) in a displacement.
fn residuals(solid: &mut dyn Solid, displacement: &[f64], plane_strain: bool) -> [f64; 2] {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, v| m.max(v.abs())) / 2e11;
    let mut stress = solid
        .evaluate(Wanted::stress(StressKind::Spatial))
        .stress
        .to_vec();
    // across the plane a strain that is not free has a stress
    let across = stress.iter_mut().filter(|_| plane_strain);
    across.for_each(|tensor| tensor[2] = 0.0);
    [1e-3 * largest(&force), largest(stress.as_flattened())]
}

/// Breaks every fifth bond.
fn some_broken(family: &Family, points: usize) -> BrokenBonds {
    let mut broken = family.unbroken();
    let point_in = family.points_of_slots();
    for point in 0..points as u32 {
        let mut others = Vec::new();
        family.for_each_bond(point as usize, |_, _, slot| others.push(point_in[slot]));
        for other in others.into_iter().filter(|other| (point + other) % 5 == 0) {
            family.break_pair([point, other], &point_in, &mut broken);
        }
    }
    broken
}

#[test]
fn a_linear_temperature_is_free_of_stress() {
    for dimension in [2, 3] {
        let mut variants = vec![("bond", "", 1.0)];
        for formulation in ["ordinary", "correspondence"] {
            variants.push((formulation, "", 1.0));
            variants.push((formulation, "plasticity = {}", 1.0));
            if dimension == 2 {
                variants.push((formulation, "plane = 'strain'", 1.3));
                let yielding = "plane = 'strain'\nplasticity = {}";
                variants.push((formulation, yielding, 1.3));
            }
        }
        for (formulation, keys, swelling) in variants {
            for fracture in ["", "fracture = {}"] {
                let keys = format!("formulation = '{formulation}'\n{keys}\n{fracture}");
                for mut body in bodies(dimension) {
                    if keys.contains("plasticity") {
                        // across the plane of plane strain there is stress
                        let yielding = format!("{MATERIAL}\nyield_stress = 1e12");
                        body.materials = vec![crate::testing::material(&yielding)];
                    }
                    let positions = body.points.position.to_vec();
                    let kind = format!("{keys} {dimension}D {:?}", body.store);
                    let strain = Linear::isotropic(dimension);
                    let mut mechanical = prepared(body, &keys);
                    let solid = &mut mechanical.solid;
                    if keys.contains("fracture") {
                        let state = FractureState {
                            broken: vec![some_broken(solid.base().family(), positions.len())],
                            frozen: vec![[0.0; 6]; positions.len()],
                            sliding_energy: Vec::new(),
                        };
                        solid.replace_fracture_state(state);
                    }
                    let eigenstrain: Vec<f64> = positions.iter().map(|x| strain.at(x)[0]).collect();
                    solid.set_points(PointStates {
                        eigenstrain: Some(&eigenstrain),
                        ..PointStates::default()
                    });
                    let displacement: Vec<f64> = positions
                        .iter()
                        .flat_map(|x| strain.displacement(x).map(|u| swelling * u))
                        .collect();
                    let is_plane_strain = swelling != 1.0;
                    let found = residuals(&mut **solid, &displacement, is_plane_strain);
                    // strains are up to 7e-4: rounding of differences of displacements
                    assert!(found.iter().all(|r| *r < 1e-14), "{kind}: {found:?}");
                }
            }
        }
    }
}

/// Eigenstrains that differ by direction.
fn set_tensor(solid: &mut dyn Solid, tensor: &[[f64; 6]]) {
    solid.set_points(PointStates {
        stress_free: Some(StressFreeStrain {
            strain: tensor,
            prescribed: tensor,
        }),
        ..PointStates::default()
    });
}

/// Every linear strain is compatible, so that a body which has its displacement has no stress. In plane strain the plane expands
/// by the part of the strain across it that it must not have, nu times that.
#[test]
fn a_linear_tensor_is_free_of_stress() {
    for dimension in [2, 3] {
        let mut variants = Vec::new();
        for (formulation, ratio) in [("bond", 0.25), ("ordinary", 0.3), ("correspondence", 0.3)] {
            variants.push((formulation, "", 0.0));
            if formulation != "bond" {
                variants.push((formulation, "plasticity = {}", 0.0));
            }
            if formulation != "correspondence" {
                variants.push((formulation, "fracture = {}", 0.0));
            }
            if dimension == 2 {
                variants.push((formulation, "plane = 'strain'", ratio));
            }
            if dimension == 2 && formulation == "correspondence" {
                variants.push((formulation, "plane = 'strain'\nplasticity = {}", ratio));
            }
        }
        for (formulation, keys, ratio) in variants {
            for mut body in bodies(dimension) {
                let yielding = format!("{MATERIAL}\nyield_stress = 1e12");
                body.materials = vec![crate::testing::material(&yielding)];
                let positions = body.points.position.to_vec();
                let kind = format!("{formulation} {keys} {dimension}D {:?}", body.store);
                let strain = Linear::tensor(dimension);
                let mut in_plane = strain;
                let rows = in_plane
                    .gradient
                    .iter_mut()
                    .chain([&mut in_plane.at_origin]);
                rows.for_each(|row| (0..2).for_each(|c| row[c] += ratio * row[2]));
                let mut mechanical =
                    prepared(body, &format!("formulation = '{formulation}'\n{keys}"));
                let solid = &mut mechanical.solid;
                let tensor: Vec<[f64; 6]> = positions.iter().map(|x| strain.at(x)).collect();
                set_tensor(&mut **solid, &tensor);
                let displacement = positions.iter().flat_map(|x| in_plane.displacement(x));
                let displacement: Vec<f64> = displacement.collect();
                let found = residuals(&mut **solid, &displacement, ratio != 0.0);
                assert!(found.iter().all(|r| *r < 1e-14), "{kind}: {found:?}");
            }
        }
    }
}

/// A body that is stretched by a uniform strain and turned as a whole has no stress: to rounding where stress follows a strain of
/// points, to the order of the square of the strain where bonds have the part of the strain along themselves.
#[test]
fn a_uniform_tensor_turns_with_the_body() {
    let tensor = [2e-3, -1e-3, 5e-4, 3e-4, -4e-4, 2e-4];
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -0.3).into_inner();
    for (formulation, limit) in [
        ("bond", 4e-6),
        ("ordinary", 4e-6),
        ("correspondence", 1e-13),
    ] {
        for body in bodies(3) {
            let positions = body.points.position.to_vec();
            let kind = format!("{formulation} {:?}", body.store);
            let keys = format!("formulation = '{formulation}'\nkinematics = 'finite'");
            let mut mechanical = prepared(body, &keys);
            let solid = &mut mechanical.solid;
            set_tensor(&mut **solid, &vec![tensor; positions.len()]);
            // besides an isotropic strain
            let isotropic = 1e-3;
            solid.set_points(PointStates {
                eigenstrain: Some(&vec![isotropic; positions.len()]),
                ..PointStates::default()
            });
            set_tensor(&mut **solid, &vec![tensor; positions.len()]);
            let stretch = Matrix3::identity() * (1.0 + isotropic) + symmetric(&tensor);
            let gradient = turn * stretch - Matrix3::identity();
            let displacement = positions
                .iter()
                .flat_map(|x| <[f64; 3]>::from(gradient * x));
            let displacement: Vec<f64> = displacement.collect();
            let found = residuals(&mut **solid, &displacement, false);
            assert!(found.iter().all(|r| *r < limit), "{kind}: {found:?}");
        }
    }
}

/// The stress conjugate to the eigenstrain is that of the total strain, without the eigenstrain; its trace is the scalar one.
#[test]
fn the_conjugate_stress_is_that_of_the_total_strain() {
    let gradient = Matrix3::new(1e-3, 2e-4, -5e-4, 7e-4, -3e-4, 4e-4, 1e-4, -6e-4, 8e-4);
    for (dimension, plane) in [(2, "stress"), (2, "strain"), (3, "stress")] {
        for formulation in ["bond", "ordinary", "correspondence", "staggered"] {
            let cells = [9, 9, if dimension == 3 { 9 } else { 1 }];
            let body = block(cells, dimension, 1e-3, Store::Lattice, MATERIAL);
            let (min, max) = body.bounds();
            let middle = (0..body.points.len()).min_by(|a, b| {
                let distance = |p: &usize| (body.points.position.at(*p) - 0.5 * (min + max)).norm();
                distance(a).total_cmp(&distance(b))
            });
            let (middle, positions) = (middle.expect("points"), body.points.position.to_vec());
            let mut gradient = gradient;
            if dimension == 2 {
                gradient.fill_row(2, 0.0);
                gradient.fill_column(2, 0.0);
            }
            let keys = format!("formulation = '{formulation}'\nplane = '{plane}'");
            let mut mechanical = prepared(body, &keys);
            let solid = &mut mechanical.solid;
            set_tensor(
                &mut **solid,
                &vec![[1e-3, 2e-3, 3e-3, 0.0, 1e-3, 0.0]; positions.len()],
            );
            let same = block(cells, dimension, 1e-3, Store::Lattice, MATERIAL);
            let nodes = solid.base().nodes.positions(&same);
            let displacement = nodes.iter().flat_map(|x| <[f64; 3]>::from(gradient * x));
            let displacement: Vec<f64> = displacement.collect();
            solid.set_displacement(&displacement, &[]);
            let moduli = solid.base().moduli_of(middle);
            let strain: Matrix3<f64> = (gradient + gradient.transpose()) * 0.5;
            let trace: f64 = (0..dimension).map(|a| strain[(a, a)]).sum();
            let mut expected = COMPONENTS.map(|(a, b)| {
                let isotropic = if a == b && a < dimension {
                    moduli.lame * trace
                } else {
                    0.0
                };
                isotropic + 2.0 * moduli.shear * strain[(a, b)]
            });
            if plane == "strain" {
                expected[2] = moduli.lame * trace;
            }
            let stress = solid
                .evaluate(Wanted::stress(StressKind::Conjugate))
                .stress
                .to_vec();
            let energy = solid
                .evaluate(Wanted::energy(EnergyKind::Total))
                .energy
                .to_vec();
            // calibrated families have the shear of the continuum to 6 % in 3D (docs/theory/thermomechanics.md)
            let limit = if ["bond", "ordinary"].contains(&formulation) {
                0.08
            } else {
                1e-12
            };
            for (found, expected) in stress[middle].iter().zip(expected) {
                let kind = format!("{formulation} {dimension}D plane {plane}");
                assert!(
                    (found - expected).abs() < limit * 4e8,
                    "{kind}: {found} {expected}"
                );
            }
            for (tensor, [_, conjugate]) in stress.iter().zip(energy) {
                let trace: f64 = tensor[..3].iter().sum();
                assert!(
                    (trace - conjugate).abs() < 1e-3,
                    "{formulation}: {trace} {conjugate}"
                );
            }
        }
    }
}

/// A temperature that is not linear has stress, and a uniform one has none.
#[test]
fn stress_follows_from_strains_that_are_not_compatible() {
    for formulation in ["bond", "ordinary", "correspondence"] {
        let body = block([9, 8, 1], 2, 1e-3, Store::Lattice, MATERIAL);
        let positions = body.points.position.to_vec();
        let mut mechanical = prepared(body, &format!("formulation = '{formulation}'"));
        let solid = &mut mechanical.solid;
        let curved: Vec<f64> = positions.iter().map(|x| 1e2 * x.x * x.x).collect();
        solid.set_points(PointStates {
            eigenstrain: Some(&curved),
            ..PointStates::default()
        });
        let none = vec![0.0; 3 * positions.len()];
        let [force, stress] = residuals(&mut **solid, &none, false);
        assert!(
            force > 1e-4 && stress > 1e-3,
            "{formulation}: {force} {stress}"
        );
        solid.set_points(PointStates {
            eigenstrain: Some(&vec![1e-3; positions.len()]),
            ..PointStates::default()
        });
        let swollen: Vec<f64> = positions
            .iter()
            .flat_map(|x| [1e-3 * x.x, 1e-3 * x.y, 0.0])
            .collect();
        let found = residuals(&mut **solid, &swollen, false);
        assert!(found.iter().all(|r| *r < 1e-14), "{formulation}: {found:?}");
    }
}

/// What does not know strains that differ by direction is refused, so that no solid ignores them.
#[test]
fn what_does_not_know_a_tensor_is_refused() {
    let tensor: fn(&mut Setup<'_>) = |setup| {
        setup.add(0, &keys::EIGENSTRAIN_TENSOR).expect("a field");
    };
    let heat: fn(&mut Setup<'_>) = |setup| {
        setup
            .read(0, &keys::CONJUGATE_STRESS_TENSOR)
            .expect("a field");
    };
    for (declare, keys, part) in [
        (tensor, "formulation = 'bond'", ""),
        (tensor, "formulation = 'ordinary'", ""),
        (tensor, "formulation = 'ordinary'\nfracture = {}", ""),
        (tensor, "formulation = 'correspondence'", ""),
        (tensor, "formulation = 'staggered'", ""),
        (
            tensor,
            "formulation = 'correspondence'\nfracture = {}",
            "`fracture` does not support a stress-free strain that differs by direction",
        ),
        (heat, "formulation = 'bond'\nfracture = {}", ""),
        (
            tensor,
            "formulation = 'correspondence'\nkinematics = 'finite'\nlaw.neo_hookean = {}",
            "",
        ),
    ] {
        let body = block([9, 8, 1], 2, 1e-3, Store::Lattice, MATERIAL);
        let mut world = World::new(vec![body]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("strain");
        declare(&mut setup);
        setup.next_plugin("mechanical");
        let mechanical: Mechanical = read(keys);
        let error = mechanical.ready(&mut setup).err();
        let message = error.map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(message.is_empty(), part.is_empty(), "{keys}: {message}");
        assert!(message.contains(part), "{keys}: {message}");
    }
}

/// Bonds that break carry their stress away, which is no unloading: the body must not heat by it, in any direction.
#[test]
fn breaking_bonds_do_not_change_the_conjugate_stress() {
    for plane in ["", "plane = 'strain'"] {
        let keys = format!("formulation = 'bond'\nfracture = {{}}\n{plane}");
        let brittle = format!("{MATERIAL}\ncritical_stretch = 1e-3");
        let body = block([9, 8, 1], 2, 1e-3, Store::Lattice, &brittle);
        let positions = body.points.position.to_vec();
        let mut mechanical = prepared(body, &keys);
        let solid = &mut mechanical.solid;
        let torn: Vec<f64> = (positions.iter())
            .flat_map(|x| [2e-3 * x.x, 4e-4 * x.x - 5e-4 * x.y, 0.0])
            .collect();
        solid.set_displacement(&torn, &[]);
        let mut force = vec![0.0; torn.len()];
        solid.evaluate(Wanted::force(&mut force));
        let wanted = || Wanted::stress(StressKind::Conjugate);
        let before = solid.evaluate(wanted()).stress.to_vec();
        let mut damage = vec![0.0; positions.len()];
        assert!(solid.break_bonds(0.0, &mut damage).any);
        let after = solid.evaluate(wanted()).stress;
        let largest = before.iter().flatten().fold(0.0_f64, |m, s| m.max(s.abs()));
        for (before, after) in before.iter().flatten().zip(after.iter().flatten()) {
            assert!(
                (before - after).abs() < 1e-12 * largest,
                "{keys}: {before} {after}"
            );
        }
    }
}
