//! Correspondence solids that lost bonds.

use super::gradient::RISE;
use nalgebra::Vector3;
use perimelt_core::body::{Body, Jitter, Store};
use perimelt_core::solver::{Reducer, largest_eigenvalue};
use perimelt_core::{Setup, World};

use super::Mechanical;
use super::fracture::FractureState;
use super::solid::{
    EnergyKind, PointStates, Solid, Stiffness, StressFreeStrain, StressKind, Wanted,
};
use crate::testing::{block, read};

const STEEL: &str =
    "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\ncritical_stretch = 1e-3";
const CELLS: [[usize; 3]; 2] = [[18, 15, 1], [12, 9, 8]];
const STORES: [&str; 3] = ["lattice", "list", "cloud"];

/// A block of 1 mm spacing.
fn body(cells: [usize; 3], store: &str) -> Body {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let kind = if store == "list" {
        Store::List
    } else {
        Store::Lattice
    };
    let body = block(cells, dimension, 1e-3, kind, STEEL);
    let jitter = Jitter {
        amplitude: 0.2,
        seed: 1,
    };
    match store {
        "cloud" => body.jittered(jitter).expect("valid"),
        _ => body,
    }
}

/// A solid of `body` that lost the bonds for which `is_broken` says so of the places of their ends.
fn damaged(
    body: &Body,
    keys: &str,
    is_broken: impl Fn(Vector3<f64>, Vector3<f64>) -> bool,
) -> Box<dyn Solid> {
    let keys = format!("formulation = 'correspondence'\nfracture = {{}}\n{keys}");
    let mechanical: Mechanical = read(&keys);
    let mut world = World::new(vec![body.clone()]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    let mut solid = mechanical.ready(&mut setup).expect("valid").run.solid;
    let family = solid.base().family();
    let (mut broken, point_in) = (family.unbroken(), family.points_of_slots());
    let position = &body.points.position;
    for point in 0..position.len() {
        family.for_each_bond(point, |number, _, slot| {
            if is_broken(position[point], position[point_in[slot] as usize]) {
                broken.break_bond(point, number);
            }
        });
    }
    let state = FractureState {
        broken: vec![broken],
        ..FractureState::intact(solid.base().family().unbroken(), position.len())
    };
    solid.replace_fracture_state(state).expect("it breaks");
    solid
}

/// A number from 0 to 1 without order for each bond, the same from both of its ends.
fn scattered(p: Vector3<f64>, q: Vector3<f64>) -> f64 {
    let sum = (p + q) * 1e3;
    let spread = 12.9898 * sum.x + 78.233 * sum.y + 37.719 * sum.z;
    (spread.sin() * 43758.5453).fract().abs()
}

/// Random damage that leaves this fraction of the bonds.
fn leaving(fraction: f64) -> impl Fn(Vector3<f64>, Vector3<f64>) -> bool {
    move |p, q| scattered(p, q) > fraction
}

/// Displacement of the points of a body.
fn displacement(body: &Body, of: impl Fn(Vector3<f64>) -> [f64; 3]) -> Vec<f64> {
    let points = body.points.position.iter();
    points
        .flat_map(|x| {
            let u = of(*x);
            std::array::from_fn::<f64, 3, _>(|a| if a < body.dimension { u[a] } else { 0.0 })
        })
        .collect()
}

fn force(solid: &mut dyn Solid, displacement: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    force
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Every body and store, with horizons of 2 and 3 spacings.
fn all(mut test: impl FnMut(&Body, &str)) {
    for cells in CELLS {
        for store in STORES {
            for horizon in ["horizon = 2\n", "horizon = 3\n"] {
                test(&body(cells, store), horizon);
            }
        }
    }
}

#[test]
fn nothing_passes_a_crack_and_its_sides_are_strained_exactly() {
    all(|body, horizon| {
        let middle = 0.5e-3 * CELLS[body.dimension - 2][0] as f64;
        let is_left = |x: Vector3<f64>| x.x < middle;
        let mut solid = damaged(body, horizon, |p, q| is_left(p) != is_left(q));
        // one half far away
        let apart = displacement(body, |x| {
            if is_left(x) {
                [0.0; 3]
            } else {
                [0.5, 0.3, -0.2]
            }
        });
        assert_eq!(largest(&force(&mut *solid, &apart)), 0.0);
        assert_eq!(
            solid
                .evaluate(Wanted::energy(EnergyKind::Total))
                .energy
                .iter()
                .map(|e| e[0])
                .fold(0.0, f64::max),
            0.0
        );

        // a strain (xx, yy, zz, xy) of its own in each of them
        let strain = |left: bool| match left {
            true => [1e-4, -2e-4, 3e-4, 0.5e-4],
            false => [-2e-4, 1e-4, 0.0, 3e-4],
        };
        let strained = displacement(body, |x| {
            let [xx, yy, zz, xy] = strain(is_left(x));
            [xx * x.x + xy * x.y, yy * x.y + xy * x.x, zz * x.z]
        });
        solid.set_displacement(&strained, &[]);
        let stress = solid
            .evaluate(Wanted::stress(StressKind::Spatial))
            .stress
            .to_vec();
        for (point, stress) in stress.iter().enumerate() {
            let [xx, yy, zz, xy] = strain(is_left(body.points.position.at(point)));
            let moduli = solid.base().moduli_of(point);
            let trace = xx + yy + if body.dimension == 3 { zz } else { 0.0 };
            let expected = [
                moduli.lame * trace + 2.0 * moduli.shear * xx,
                moduli.lame * trace + 2.0 * moduli.shear * yy,
                2.0 * moduli.shear * xy,
            ];
            for (found, expected) in [stress[0], stress[1], stress[3]].iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-10 * 2e11 * 3e-4,
                    "{found} {expected}"
                );
            }
        }
    });
}

#[test]
fn points_of_damaged_bodies_are_strained_exactly_or_loose() {
    all(|body, horizon| {
        let mut solid = damaged(body, horizon, leaving(0.25));
        let strained = displacement(body, |x| [1e-4 * x.x, 1e-4 * x.y, 1e-4 * x.z]);
        solid.set_displacement(&strained, &[]);
        let moduli = solid.base().moduli_of(0);
        let exact = moduli.bulk * body.dimension as f64 * 1e-4;
        let stress = solid.evaluate(Wanted::stress(StressKind::Spatial)).stress;
        let is_exact = |s: &&[f64; 6]| (s[0] / exact - 1.0).abs() < 1e-10;
        let strained = stress.iter().filter(is_exact).count();
        let loose = stress.iter().filter(|s| **s == [0.0; 6]).count();
        assert_eq!(strained + loose, stress.len());
        assert!(strained > 20 && loose > 20, "{strained} {loose}");
    });
}

#[test]
fn forces_of_damaged_bodies_are_the_derivative_of_their_energy_and_cancel() {
    all(|body, horizon| {
        for kinematics in ["linear", "finite"] {
            let keys = format!("{horizon}kinematics = '{kinematics}'");
            let mut solid = damaged(body, &keys, leaving(0.5));
            let mut at = |size: f64| {
                let moved = displacement(body, |x| {
                    [
                        1e-6 * (900.0 * x.y).sin() + size * (2000.0 * x.x).cos(),
                        2e-4 * x.x + size * (1500.0 * x.y).sin(),
                        0.1 * x.z * x.x,
                    ]
                });
                let force = force(&mut *solid, &moved);
                let energy = solid
                    .evaluate(Wanted::energy(EnergyKind::Total))
                    .energy
                    .iter()
                    .zip(&body.points.volume);
                (force, energy.map(|([w, _], v)| w * v).sum::<f64>())
            };
            let size = 1e-8;
            let ((force, _), (_, up), (_, down)) = (at(0.0), at(size), at(-size));
            let points = body.points.position.iter().zip(&body.points.volume);
            let (mut power, mut sum, mut scale) = (0.0, [0.0; 3], 0.0);
            for ((x, v), f) in points.zip(force.chunks_exact(3)) {
                power += v * (f[0] * (2000.0 * x.x).cos() + f[1] * (1500.0 * x.y).sin());
                (0..3).for_each(|axis| sum[axis] += v * f[axis]);
                scale += v * (f[0].abs() + f[1].abs() + f[2].abs());
            }
            let slope = (up - down) / (2.0 * size);
            // third order in the size for finite kinematics, rounding of the difference
            assert!(
                (slope + power).abs() < 1e-5 * power.abs(),
                "{keys}: {slope} {power}"
            );
            assert!(largest(&sum) < 1e-13 * scale, "{keys}: {sum:?} {scale}");
        }
    });
}

#[test]
fn rigid_rotation_of_a_damaged_body_meets_no_force() {
    let (sin, cos) = 0.7f64.sin_cos();
    all(|body, horizon| {
        let keys = format!("{horizon}kinematics = 'finite'");
        let mut solid = damaged(body, &keys, leaving(0.5));
        let turned = displacement(body, |x| {
            [
                (cos - 1.0) * x.x - sin * x.y,
                sin * x.x + (cos - 1.0) * x.y,
                0.0,
            ]
        });
        let force = force(&mut *solid, &turned);
        // stress of a strain of one bit over a spacing, some bonds to sum, and ten times that for tensors
        // that are hardly regular
        assert!(
            largest(&force) < 2e11 * 1e-16 / 1e-3 * 3000.0,
            "{}",
            largest(&force)
        );
    });
}

#[test]
fn damaged_bodies_are_stable_at_the_stable_step() {
    all(|body, horizon| {
        let square = |fraction: f64| {
            let mut solid = damaged(body, horizon, leaving(fraction));
            let free = |i: usize| if i % 3 < body.dimension { 1.0 } else { 0.0 };
            let inverse: Vec<f64> = (0..3 * body.points.len()).map(free).collect();
            largest_eigenvalue(&inverse, &Reducer::default(), |u, out| {
                solid.set_displacement(u, &[]);
                solid.stiffness(Stiffness::Elastic, out);
            })
        };
        let whole = square(1.0);
        for fraction in [0.7, 0.5, 0.3, 0.15] {
            let risen = square(fraction) / whole;
            assert!(risen < RISE, "{horizon} {fraction}: {risen}");
        }
    });
}

#[test]
fn bonds_exceed_their_limit_by_their_thermoelastic_stretch() {
    all(|body, horizon| {
        for kinematics in ["linear", "finite"] {
            let keys = format!("{horizon}kinematics = '{kinematics}'");
            let mut solid = damaged(body, &keys, leaving(0.8));
            solid.set_points(PointStates {
                eigenstrain: Some(&vec![2e-3; body.points.len()]),
                ..PointStates::default()
            });
            for (strain, beyond) in [(2.9e-3, 0.0), (3.1e-3, 1e-4)] {
                let u = displacement(body, |x| (strain * x).into());
                force(&mut *solid, &u);
                let fracture = solid.base().fracture().expect("it breaks");
                for (point, excess) in fracture.excess.iter().enumerate() {
                    let mut bonds = 0;
                    solid.base().family().for_each_bond(point, |number, _, _| {
                        let whole = !fracture.broken().is_broken(point, number);
                        bonds += usize::from(whole);
                    });
                    let expected = beyond * bonds as f64;
                    assert!(
                        (excess - expected).abs() < 1e-13 * 100.0,
                        "{excess} {expected}"
                    );
                }
            }
        }
    });
}

#[test]
fn breaking_by_the_energy_of_bonds_is_refused() {
    let keys = "formulation = 'correspondence'\nfracture.criterion = 'energy'";
    let mechanical: Mechanical = read(keys);
    let steel = format!("{STEEL}\nfracture_energy = 1e4");
    let mut world = World::new(vec![block([9, 9, 1], 2, 1e-3, Store::Lattice, &steel)]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    let error = mechanical.ready(&mut setup).err().expect("no such energy");
    assert!(
        format!("{error:?}").contains("fracture.criterion"),
        "{error:?}"
    );
}

/// The energy of a displacement that alternates from row to row, which has no gradient, is that of the springs alone.
#[test]
fn springs_follow_the_modulus_of_their_body() {
    let spring = |keys: &str, poissons_ratio: &str| {
        let mut body = body([9, 8, 1], "lattice");
        let metal = format!(
            "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = {poissons_ratio}\nyield_stress = 1e12"
        );
        body.materials = vec![crate::testing::material(&metal)];
        let u = displacement(&body, |x| {
            [(x.x * 1e3 * std::f64::consts::PI).sin(), 0.0, 0.0]
        });
        let mechanical: Mechanical = read(&format!("formulation = 'correspondence'\n{keys}"));
        let mut world = World::new(vec![body]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("mechanical");
        let mut solid = mechanical.ready(&mut setup).expect("valid").run.solid;
        solid.set_displacement(&u, &[]);
        let wanted = Wanted {
            energy: Some(EnergyKind::Total),
            ..Wanted::default()
        };
        // in the middle
        solid.evaluate(wanted).energy[9 * 4 + 4][0]
    };
    // plane stress
    let bulk = |nu: f64| 1e11 / (1.0 - nu);
    let shear = |nu: f64| 1e11 / (1.0 + nu);
    let usual = spring("", "0.3") / (0.1 * bulk(0.3));
    // steel that is hot
    let rising = "{ temperature = [300, 1300], value = [0.3, 0.49] }";
    for (keys, nu, expected) in [
        ("", "0.4", 0.1 * bulk(0.4)),
        ("", "0.45", 0.1 * shear(0.45)),
        ("", rising, 0.1 * bulk(0.3)),
        ("stabilisation = 0.3", "0.3", 0.3 * bulk(0.3)),
        ("plasticity = {}", "0.3", 0.1 * bulk(0.3)),
        ("plasticity = {}", "0.45", 0.1 * shear(0.45)),
    ] {
        let found = spring(keys, nu) / usual;
        assert!(
            (found / expected - 1.0).abs() < 1e-9,
            "{keys}: {found} {expected}"
        );
    }
}

/// A body without lateral contraction, whose upper half swells and which is held along x and z, has no stress along y: the strain
/// of the rows beside the jump is a mean over the family, and so is what is free of stress in metal that flows. A swelling
/// that differs by direction has the same.
#[test]
fn a_strain_that_jumps_has_the_mean_of_the_gradient() {
    let jump = |x: &Vector3<f64>| if x.y > 6e-3 { 1e-3 } else { 0.0 };
    for (cells, keys, least, most) in [
        ([9, 12, 1], "", 0.29, 0.31),
        ([9, 12, 9], "", 0.26, 0.28),
        ([9, 12, 1], "plasticity = {}", 0.0, 0.01),
        // the fractions of mean and gradient differ by 0.012 here
        ([9, 12, 9], "plasticity = {}", 0.0, 0.015),
    ] {
        let mut body = body(cells, "lattice");
        let metal =
            "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0\nyield_stress = 1e12";
        body.materials = vec![crate::testing::material(metal)];
        let u = displacement(&body, |x| [0.0, 1e-3 * (x.y - 6e-3).max(0.0), 0.0]);
        let position = body.points.position.to_vec();
        let isotropic: Vec<f64> = position.iter().map(jump).collect();
        let along_y = position.iter().map(|x| [0.0, jump(x), 0.0, 0.0, 0.0, 0.0]);
        let along_y: Vec<[f64; 6]> = along_y.collect();
        let states = [
            PointStates {
                eigenstrain: Some(&isotropic),
                ..PointStates::default()
            },
            PointStates {
                stress_free: Some(StressFreeStrain {
                    strain: &along_y,
                    prescribed: &along_y,
                }),
                ..PointStates::default()
            },
        ];
        for (states, kind) in states.into_iter().zip(["isotropic", "along y"]) {
            let mechanical: Mechanical = read(&format!("formulation = 'correspondence'\n{keys}"));
            let mut world = World::new(vec![body.clone()]);
            let mut setup = Setup::new(&mut world, std::path::Path::new("."));
            setup.next_plugin("mechanical");
            let mut run = mechanical.ready(&mut setup).expect("valid").run;
            setup.finish().expect("complete");
            run.load_plasticity(&world, None, 1.0);
            let mut solid = run.solid;
            solid.set_points(states);
            solid.set_displacement(&u, &[]);
            solid.evaluate(Wanted::force(&mut vec![0.0; u.len()]));
            let stress = solid.evaluate(Wanted::stress(StressKind::Spatial)).stress;
            let middle = |x: &Vector3<f64>| {
                (x.x - 4.5e-3).abs() < 1e-4 && (cells[2] == 1 || (x.z - 4.5e-3).abs() < 1e-4)
            };
            let inner = |x: &Vector3<f64>| middle(x) && (x.y - 6e-3).abs() < 3e-3;
            let points = stress.iter().zip(&position).filter(|(_, x)| inner(x));
            let largest = points.fold(0.0f64, |m, (s, _)| m.max(s[1].abs())) / (2e11 * 1e-3);
            assert!(
                (least..most).contains(&largest),
                "{cells:?} {keys} {kind}: {largest}"
            );
        }
    }
}
