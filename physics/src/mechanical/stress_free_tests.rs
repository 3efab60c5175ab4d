//! Strains that vary linearly are free of stress in a free body, to rounding.

use super::step::MechanicalRun;
use nalgebra::Vector3;
use perimelt_core::body::{Jitter, Store};
use perimelt_core::{Body, BrokenBonds, Family, Setup, World, keys};

use super::Mechanical;
use super::classical::COMPONENTS;
use super::fracture::FractureState;
use super::solid::{PointStates, Solid, StressFreeStrain, StressKind, Wanted};
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

/// Bodies with faces, edges and corners: lattices in two stores, a cloud.
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
    bodies
}

fn prepared(body: Body, keys: &str) -> MechanicalRun {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run
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
            variants.push((formulation, "plasticity = { yield_stress = 1e6 }", 1.0));
            if dimension == 2 {
                variants.push((formulation, "plane = 'strain'", 1.3));
            }
        }
        for (formulation, keys, swelling) in variants {
            for fracture in ["", "fracture = {}"] {
                let keys = format!("formulation = '{formulation}'\n{keys}\n{fracture}");
                let keys = keys.replace("plasticity = { yield_stress = 1e6 }", "plasticity = {}");
                for mut body in bodies(dimension) {
                    if keys.contains("plasticity") {
                        let yielding = format!("{MATERIAL}\nyield_stress = 1e6");
                        body.materials = vec![crate::testing::material(&yielding)];
                    }
                    let positions = body.points.position.clone();
                    let kind = format!("{keys} {dimension}D {:?}", body.store);
                    let strain = Linear::isotropic(dimension);
                    let mut mechanical = prepared(body, &keys);
                    let solid = &mut mechanical.solid;
                    if keys.contains("fracture") {
                        let state = FractureState {
                            broken: some_broken(solid.base().family(), positions.len()),
                            frozen: vec![0.0; positions.len()],
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

/// Inherent strains have components, and correspondence solids have them.
#[test]
fn a_linear_inherent_strain_is_free_of_stress() {
    for dimension in [2, 3] {
        for body in bodies(dimension) {
            let positions = body.points.position.clone();
            let kind = format!("{dimension}D {:?}", body.store);
            let strain = Linear::tensor(dimension);
            let mut mechanical = prepared(body, "formulation = 'correspondence'");
            let solid = &mut mechanical.solid;
            let inherent: Vec<[f64; 6]> = positions.iter().map(|x| strain.at(x)).collect();
            solid.set_points(PointStates {
                stress_free: Some(StressFreeStrain {
                    strain: &inherent,
                    prescribed: &inherent,
                }),
                ..PointStates::default()
            });
            let displacement: Vec<f64> = positions
                .iter()
                .flat_map(|x| strain.displacement(x))
                .collect();
            let found = residuals(&mut **solid, &displacement, false);
            assert!(found.iter().all(|r| *r < 1e-14), "{kind}: {found:?}");
        }
    }
}

/// A temperature that is not linear has stress, and a uniform one has none.
#[test]
fn stress_follows_from_strains_that_are_not_compatible() {
    for formulation in ["bond", "ordinary", "correspondence"] {
        let body = block([9, 8, 1], 2, 1e-3, Store::Lattice, MATERIAL);
        let positions = body.points.position.clone();
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

/// Bonds along themselves have no inherent strain: set-up refuses it, so that no solid ignores it.
#[test]
fn an_inherent_strain_is_refused_where_points_have_no_stress() {
    for (formulation, is_refused) in [
        ("bond", true),
        ("ordinary", true),
        ("correspondence", false),
        ("staggered", false),
    ] {
        let body = block([9, 8, 1], 2, 1e-3, Store::Lattice, MATERIAL);
        let mut world = World::new(vec![body]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("strain");
        setup.add(0, &keys::INHERENT_STRAIN).expect("a field");
        setup.next_plugin("mechanical");
        let mechanical: Mechanical = read(&format!("formulation = '{formulation}'"));
        let error = mechanical.ready(&mut setup).err();
        let message = error.map(|error| format!("{error:?}"));
        assert_eq!(message.is_some(), is_refused, "{formulation}");
        let names =
            |message: String| message.contains("do not support a body with an inherent strain");
        assert!(message.is_none_or(names), "{formulation}");
    }
}
