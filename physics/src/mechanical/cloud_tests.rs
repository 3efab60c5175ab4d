//! Solids of several spacings: what uniform strains meet, and that forces keep momentum and energy.

use nalgebra::Vector3;
use perimelt_core::body::{Body, Jitter, Store, Zone};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Setup, World};

use super::Mechanical;
use super::solid::{EnergyKind, PointStates, Solid, StressKind, Wanted};
use crate::testing::{block, material, read};

const YOUNG: f64 = 2e11;
const FORMULATIONS: [&str; 3] = ["bond", "ordinary", "correspondence"];

/// A block whose right half has twice the spacing of its left half, its points displaced by up to `amplitude` spacings.
fn two_spacings(size: [f64; 3], fine: f64, amplitude: f64, poissons_ratio: f64) -> Body {
    let dimension = if size[2] > fine { 3 } else { 2 };
    let [x, y, z] = size;
    let depth = if dimension == 3 { z } else { 0.0 };
    let zone = |min: f64, max: f64, spacing: f64| Zone {
        min: [min, 0.0, 0.0],
        max: [max, y, depth],
        spacing,
        horizon_factor: 1.0,
    };
    let zones = [zone(0.0, x / 2.0, fine), zone(x / 2.0, x, 2.0 * fine)];
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: size,
    });
    let mut body = Body::fill_zones("block", &shape, dimension, 0.1, &zones).expect("valid zones");
    if amplitude > 0.0 {
        body = body.jittered(Jitter { amplitude, seed: 1 }).expect("valid");
    }
    let steel =
        format!("density = 8000\nyoungs_modulus = {YOUNG}\npoissons_ratio = {poissons_ratio}");
    body.materials = vec![material(&steel)];
    body
}

fn displaced_bodies() -> [Body; 2] {
    [
        two_spacings([0.032, 0.024, 1e-3], 1e-3, 0.2, 0.3),
        two_spacings([0.024, 0.016, 0.016], 1e-3, 0.2, 0.3),
    ]
}

fn solid(body: &Body, keys: &str) -> Box<dyn Solid> {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body.clone()]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run.solid
}

fn displacement(body: &Body, of: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<f64> {
    let points = body.points.position.iter();
    let in_space = |u: Vector3<f64>| std::array::from_fn::<f64, 3, _>(|a| u[a]);
    points
        .flat_map(|x| {
            let mut u = of(x);
            (body.dimension..3).for_each(|axis| u[axis] = 0.0);
            in_space(u)
        })
        .collect()
}

fn force(solid: &mut dyn Solid, displacement: &[f64]) -> Vec<Vector3<f64>> {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    let points = force.chunks_exact(3);
    points.map(|f| Vector3::new(f[0], f[1], f[2])).collect()
}

/// Numbers from -1 to 1 without order, by position.
fn scattered(x: &Vector3<f64>, seed: f64) -> Vector3<f64> {
    Vector3::new(12.9898, 78.233, 37.719).map(|k| {
        let phase = k * (1e3 * x.x + seed) + 3.1 * k * 1e3 * x.y + 1.7 * k * 1e3 * x.z;
        2.0 * (phase.sin() * 43758.5453).rem_euclid(1.0) - 1.0
    })
}

#[test]
fn a_free_body_that_expands_evenly_meets_no_force() {
    let strain = 1e-3;
    let lattices = [[18, 15, 1], [12, 9, 8]].map(|cells: [usize; 3]| {
        let dimension = if cells[2] > 1 { 3 } else { 2 };
        let steel = format!("density = 8000\nyoungs_modulus = {YOUNG}\npoissons_ratio = 0.3");
        block(cells, dimension, 1e-3, Store::Lattice, &steel)
    });
    for body in displaced_bodies().into_iter().chain(lattices) {
        for formulation in FORMULATIONS {
            for correction in ["none", "lattice", "point", "uniaxial"] {
                let keys = format!(
                    "formulation = '{formulation}'\ncorrection = '{correction}'\nhorizon = 3"
                );
                let mut solid = solid(&body, &keys);
                let expanded = displacement(&body, |x| strain * x);
                let held = force(&mut *solid, &expanded);
                solid.set_points(PointStates {
                    eigenstrain: Some(&vec![strain; body.points.len()]),
                    ..PointStates::default()
                });
                let free = force(&mut *solid, &expanded);
                let largest = |f: &[Vector3<f64>]| f.iter().map(|f| f.norm()).fold(0.0, f64::max);
                // sums of a hundred bonds whose stretches are differences of displacements of thirty spacings
                let (free, held) = (largest(&free), largest(&held));
                assert!(
                    free < 1e-10 * held,
                    "{}D {keys}: {free:e} of {held:e}",
                    body.dimension
                );
            }
        }
    }
}

#[test]
fn displaced_points_of_two_spacings_pass_the_patch_test_of_their_formulation() {
    let strains = [
        [1e-3, 1e-3, 1e-3, 0.0],
        [1e-3, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1e-3],
        [1e-3, -2e-3, 5e-4, 7e-4],
    ];
    for body in displaced_bodies() {
        let dimension = body.dimension;
        for (which, [xx, yy, zz, xy]) in strains.into_iter().enumerate() {
            let moved = displacement(&body, |x| {
                Vector3::new(xx * x.x + xy * x.y, yy * x.y + xy * x.x, zz * x.z)
            });
            // the strain of correspondence solids is exact, whatever the family
            for horizon in [2, 3] {
                let keys = format!("formulation = 'correspondence'\nhorizon = {horizon}");
                let mut solid = solid(&body, &keys);
                solid.set_displacement(&moved, &[]);
                let stress = solid
                    .evaluate(Wanted::stress(StressKind::Spatial))
                    .stress
                    .to_vec();
                for (point, stress) in stress.iter().enumerate() {
                    let moduli = solid.base().moduli_of(point);
                    let trace = xx + yy + if dimension == 3 { zz } else { 0.0 };
                    let normal = |strain: f64| moduli.lame * trace + 2.0 * moduli.shear * strain;
                    let expected = [normal(xx), normal(yy), 2.0 * moduli.shear * xy];
                    for (found, expected) in [stress[0], stress[1], stress[3]].iter().zip(expected)
                    {
                        let error = (found - expected).abs() / (YOUNG * 1e-3);
                        assert!(error < 1e-10, "{dimension}D {horizon} {which}: {error:e}");
                    }
                }
            }
            if which > 0 {
                continue;
            }
            // that of bonds is exact where all of them stretch alike
            for formulation in &FORMULATIONS[..2] {
                for correction in ["lattice", "point"] {
                    let keys = format!(
                        "formulation = '{formulation}'\ncorrection = '{correction}'\nhorizon = 3"
                    );
                    let mut solid = solid(&body, &keys);
                    solid.set_displacement(&moved, &[]);
                    let energy = solid
                        .evaluate(Wanted::energy(EnergyKind::Total))
                        .energy
                        .to_vec();
                    for (point, [energy, _]) in energy.iter().enumerate() {
                        let d = dimension as f64;
                        let expected =
                            0.5 * solid.base().moduli_of(point).bulk * (d * 1e-3).powi(2);
                        let error = (energy / expected - 1.0).abs();
                        assert!(error < 1e-10, "{dimension}D {keys}: {error:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn forces_between_two_spacings_keep_momentum_and_are_the_derivative_of_the_energy() {
    for body in displaced_bodies() {
        let volumes = &body.points.volume;
        for formulation in FORMULATIONS {
            for kinematics in ["linear", "finite"] {
                for horizon in ["3", "{ length = 0.006 }"] {
                    let keys = format!(
                        "formulation = '{formulation}'\nkinematics = '{kinematics}'\nhorizon = {horizon}"
                    );
                    let mut solid = solid(&body, &keys);
                    let at = |size: f64| {
                        displacement(&body, |x| {
                            1e-5 * (scattered(x, 0.0) + size * scattered(x, 5.0))
                        })
                    };
                    let u = at(0.0);
                    let density = force(&mut *solid, &u);
                    let forces: Vec<Vector3<f64>> =
                        density.iter().zip(volumes).map(|(f, v)| f * *v).collect();
                    let (mut sum, mut size) = (Vector3::zeros(), 0.0);
                    let (mut moment, mut arms) = (Vector3::zeros(), 0.0);
                    for ((f, x), u) in forces
                        .iter()
                        .zip(&body.points.position)
                        .zip(u.chunks_exact(3))
                    {
                        let y = x + Vector3::new(u[0], u[1], u[2]);
                        sum += f;
                        size += f.norm();
                        // the points of a plate lie in one plane
                        let y = if body.dimension == 3 {
                            y
                        } else {
                            Vector3::new(y.x, y.y, 0.0)
                        };
                        moment += y.cross(f);
                        arms += y.norm() * f.norm();
                    }
                    let case = format!("{}D {keys}", body.dimension);
                    assert!(sum.norm() < 1e-13 * size, "{case}: {:e}", sum.norm() / size);
                    if kinematics == "finite" {
                        let error = moment.norm() / arms;
                        assert!(error < 1e-12, "{case}: angular momentum {error:e}");
                    }
                    let mut energy = |size: f64| -> f64 {
                        solid.set_displacement(&at(size), &[]);
                        let energies = solid
                            .evaluate(Wanted::energy(EnergyKind::Total))
                            .energy
                            .iter()
                            .zip(volumes);
                        energies.map(|([w, _], v)| w * v).sum()
                    };
                    let step = 1e-3;
                    let slope = (energy(step) - energy(-step)) / (2.0 * step);
                    let places = body.points.position.iter();
                    let power: f64 = forces
                        .iter()
                        .zip(places)
                        .map(|(f, x)| {
                            let direction = 1e-5 * scattered(x, 5.0);
                            (0..body.dimension)
                                .map(|a| f[a] * direction[a])
                                .sum::<f64>()
                        })
                        .sum();
                    let error = (slope + power).abs() / power.abs();
                    assert!(error < 1e-6, "{case}: {error:e}");
                }
            }
        }
    }
}

/// Without stabilisation, which at bare surfaces of a cloud takes the weights of its own families.
#[test]
fn one_spacing_gives_the_forces_of_the_lattice() {
    for (cells, dimension) in [([18, 15, 1], 2), ([10, 9, 8], 3)] {
        let steel = format!("density = 8000\nyoungs_modulus = {YOUNG}\npoissons_ratio = 0.3");
        let lattice = block(cells, dimension, 1e-3, Store::Lattice, &steel);
        let none = Jitter {
            amplitude: 0.0,
            seed: 1,
        };
        let cloud = lattice.clone().jittered(none).expect("valid");
        for formulation in FORMULATIONS {
            for kinematics in ["linear", "finite"] {
                let keys = format!(
                    "formulation = '{formulation}'\nkinematics = '{kinematics}'\ncorrection = 'point'\nhorizon = 3\n\
                    stabilisation = 0"
                );
                let forces = [&lattice, &cloud].map(|body| {
                    let u = displacement(body, |x| {
                        1e-6 * x.map(|x| (700.0 * x).sin()).sum() * Vector3::new(1.0, -0.5, 0.3)
                    });
                    force(&mut *solid(body, &keys), &u)
                });
                let largest = forces[0].iter().map(|f| f.norm()).fold(0.0, f64::max);
                for (x, expected) in lattice.points.position.iter().zip(&forces[0]) {
                    let near = |y: &Vector3<f64>| (x - y).norm() < 1e-9;
                    let same = cloud
                        .points
                        .position
                        .iter()
                        .position(near)
                        .expect("the points coincide");
                    let error = (forces[1][same] - expected).norm() / largest;
                    assert!(error < 1e-12, "{dimension}D {keys}: {error:e}");
                }
            }
        }
    }
}

/// Table of docs/theory/horizons.md, "Ghost forces": the largest residual force of uniform strain along x beside a plane
/// where the spacing doubles, by the spacing of its point over Young's modulus and strain.
#[test]
fn ghost_forces_beside_a_change_of_spacing_are_those_of_the_published_scheme() {
    let table = [
        ("bond", 1.0 / 3.0, [0.251, 0.25, 0.047, 0.017]),
        ("ordinary", 0.25, [0.231, 0.25, 0.047, 0.016]),
        ("correspondence", 1.0 / 3.0, [0.25, 0.28, 0.074, 0.015]),
    ];
    let horizons = ["2", "3", "{ length = 0.02 }", "{ length = 0.03 }"];
    for (formulation, ratio, expected) in table {
        let body = two_spacings([0.6, 0.3, 1e-3], 0.005, 0.0, ratio);
        for (horizon, expected) in horizons.iter().zip(expected) {
            let keys = format!(
                "formulation = '{formulation}'\ncorrection = 'uniaxial'\nhorizon = {horizon}"
            );
            let u = displacement(&body, |x| Vector3::new(1e-6 * x.x, 0.0, 0.0));
            let forces = force(&mut *solid(&body, &keys), &u);
            let points = body.points.position.iter().zip(&body.points.spacing);
            let residual = points.zip(&forces).filter(|((x, _), _)| {
                // away from the free surfaces
                (x.x - 0.3).abs() < 0.1 && (x.y - 0.15).abs() < 0.05
            });
            let found = residual
                .map(|((_, spacing), f)| f.norm() * spacing / (YOUNG * 1e-6))
                .fold(0.0, f64::max);
            assert!(
                (found / expected - 1.0).abs() < 0.1,
                "{keys}: {found} {expected}"
            );
        }
    }
}
