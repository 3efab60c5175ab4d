//! Laminates against classical lamination theory, and forces against energies.

use nalgebra::{DMatrix, DVector};
use perimelt_core::body::{Layup, Stations};
use perimelt_core::law::{Constant, Constants};
use perimelt_core::material::Property;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, Correction, Family, FamilySpec, Horizon};

use super::weights::PlyStiffness;
use super::*;
use crate::mechanical::moduli::Elasticity;
use crate::mechanical::solid::PointStates;
use crate::mechanical::solid::{EnergyKind, Solid, Stiffness, StressFreeStrain, Wanted};
use crate::testing::material;

/// Graphite/epoxy of [Gao2020], chapter 4.
pub(super) const GRAPHITE: &str = "
youngs_modulus_1 = 181e9
youngs_modulus_2 = 10.3e9
poissons_ratio_12 = 0.28
shear_modulus_12 = 7.17e9
shear_modulus_13 = 2e9
shear_modulus_23 = 1.3e9
youngs_modulus_3 = 3.4e9
";

/// Young's modulus of [`GRAPHITE`] along the fibres, Pa.
pub(super) const ALONG: f64 = 181e9;

pub(super) const SPACING: f64 = 1e-3;

pub(super) fn plate(angles: &[f64], thickness: &[f64], stations: Stations, side: usize) -> Body {
    let height: f64 = thickness.iter().sum();
    let side = side as f64 * SPACING;
    let shape = Shape::Box(BoxShape {
        min: [0.0, 0.0, -0.5 * height],
        max: [side, side, 0.5 * height],
    });
    let layup = Layup {
        angles: angles.to_vec(),
        ply_thickness: thickness.to_vec(),
        stations,
    };
    let mut body = Body::stack("plate", &shape, SPACING, &layup).expect("a plate");
    body.materials = vec![material(GRAPHITE)];
    body
}

pub(super) fn laminate(body: &Body, finite: bool) -> Laminate {
    laminate_that_breaks(body, finite, None)
}

/// A laminate whose bonds break, if `failure` is given.
pub(super) fn laminate_that_breaks(
    body: &Body,
    finite: bool,
    failure: Option<PlyStrength>,
) -> Laminate {
    let layers = body.layers().expect("layers");
    let spec = FamilySpec {
        horizon: Horizon::Spacings(3.0),
        correction: Correction::Point,
        ..FamilySpec::new(3.0 * SPACING)
    };
    let plane = Family::build(layers.plane(), &spec).expect("a family");
    let elasticity = Elasticity::bond_based(vec![Property::Constant(ALONG)], 3);
    let constitution = Constitution {
        finite,
        failure,
        ..Constitution::elastic(elasticity)
    };
    let plies = PlyPoints::new(body, constants_of(body, law::CONSTANTS)).expect("positive");
    Laminate::new(body, layers, plane.into(), constitution, plies).expect("bonds")
}

/// The constants of the materials of a body.
pub(super) fn constants_of(body: &Body, constants: &[Constant]) -> Constants {
    Constants::of(body, "", "", constants).expect("all constants")
}

/// Displacements of all points by a function of their position (m).
pub(super) fn displaced(body: &Body, at: impl Fn(f64, f64, f64) -> [f64; 3]) -> Vec<f64> {
    let points = body.points.position.iter();
    points.flat_map(|x| at(x.x, x.y, x.z)).collect()
}

/// Deterministic numbers between -1 and 1.
pub(super) fn noise(count: usize) -> Vec<f64> {
    let number = |i: usize| ((i as f64 * 12.9898).sin() * 43758.5453).fract();
    (0..count).map(number).collect()
}

/// Energy of the body, J.
pub(super) fn energy(body: &Body, laminate: &mut Laminate, displacement: &[f64]) -> f64 {
    laminate.set_displacement(displacement, &[]);
    let density = laminate
        .evaluate(Wanted::energy(EnergyKind::Elastic))
        .energy;
    let points = density.iter().zip(&body.points.volume);
    points.map(|([energy, _], volume)| energy * volume).sum()
}

pub(super) fn force(laminate: &mut Laminate, displacement: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; displacement.len()];
    laminate.set_displacement(displacement, &[]);
    laminate.evaluate(Wanted::force(&mut force));
    force
}

/// [`GRAPHITE`] in the plane.
fn graphite() -> PlyStiffness {
    PlyStiffness {
        moduli: [ALONG, 10.3e9],
        poissons_ratio: 0.28,
        shear: 7.17e9,
    }
}

/// Q of a ply turned by an angle (rad), for xx, yy and 2 xy [Jones1999].
fn turned_stiffness(angle: f64) -> DMatrix<f64> {
    let q = graphite().reduced();
    let own = DMatrix::from_row_slice(
        3,
        3,
        &[
            q.along, q.coupling, 0.0, q.coupling, q.across, 0.0, 0.0, 0.0, q.shear,
        ],
    );
    let (s, c) = angle.sin_cos();
    let turn = DMatrix::from_row_slice(
        3,
        3,
        &[
            c * c,
            s * s,
            c * s,
            s * s,
            c * c,
            -c * s,
            -2.0 * c * s,
            2.0 * c * s,
            c * c - s * s,
        ],
    );
    turn.transpose() * own * turn
}

/// The matrices A, B and D of a laminate, by integrals over its plies.
fn stiffness(layers: &Layers) -> DMatrix<f64> {
    let mut abd = DMatrix::zeros(6, 6);
    for ply in layers.plies() {
        let (low, high) = (ply.low, ply.low + ply.thickness);
        let integral =
            |power: i32| (high.powi(power + 1) - low.powi(power + 1)) / f64::from(power + 1);
        let q = turned_stiffness(ply.angle);
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut part = abd.view_mut((3 * row, 3 * column), (3, 3));
            part += &q * integral((row + column) as i32);
        }
    }
    abd
}

/// Energy per area at the middle of the plate under strains and curvatures (xx, yy, 2 xy each).
fn energy_per_area(body: &Body, laminate: &mut Laminate, strain: &[f64]) -> f64 {
    let [xx, yy, xy, kxx, kyy, kxy] = strain[..] else {
        panic!("six numbers");
    };
    let centre = 0.5 * body.bounds().1.x;
    let displacement = displaced(body, |x, y, z| {
        let (x, y) = (x - centre, y - centre);
        let (xx, yy, xy) = (xx + z * kxx, yy + z * kyy, xy + z * kxy);
        [
            xx * x + 0.5 * xy * y,
            0.5 * xy * x + yy * y,
            -0.5 * (kxx * x * x + kyy * y * y + kxy * x * y),
        ]
    });
    laminate.set_displacement(&displacement, &[]);
    let density = laminate
        .evaluate(Wanted::energy(EnergyKind::Elastic))
        .energy;
    let layers = body.layers().expect("layers");
    let middle = layers.points_of_layer() / 2;
    let own = layers.layers().iter().enumerate();
    own.map(|(number, layer)| {
        density[number * layers.points_of_layer() + middle][0] * layer.thickness
    })
    .sum()
}

#[test]
fn two_stations_have_the_stiffness_of_classical_lamination_theory() {
    let [d1, d2] = [1e-3, 0.4e-3];
    for (angles, thickness) in [
        (&[0.0][..], &[d1][..]),
        (&[0.0, 90.0], &[d1, d1]),
        (&[45.0, -45.0], &[d1, d2]),
        (&[0.0, 45.0, -45.0, 90.0], &[d1, d2, d1, d2]),
        (&[0.0, 90.0, 90.0, 0.0], &[d2, d1, d1, d2]),
    ] {
        let body = plate(angles, thickness, Stations::Two, 21);
        let mut laminate = laminate(&body, false);
        let abd = stiffness(body.layers().expect("layers"));
        for (scale, number) in [(0.0, 0), (1e3, 1), (1.0, 2), (1e3, 3), (1e6, 4)] {
            let strain = noise(7 * number + 13).split_off(7 * number + 7);
            let strain: Vec<f64> = strain
                .iter()
                .enumerate()
                .map(|(c, e)| 1e-3 * e * if c < 3 { 1.0 } else { scale })
                .collect();
            let expected = {
                let strain = DVector::from_column_slice(&strain);
                0.5 * (strain.transpose() * &abd * &strain)[0]
            };
            let found = energy_per_area(&body, &mut laminate, &strain);
            assert!(
                (found / expected - 1.0).abs() < 1e-10,
                "{angles:?}: {found} {expected}"
            );
        }
    }
}

/// A ply at 90 degrees is one at 0 degrees with x and y exchanged.
#[test]
fn a_ply_across_is_a_ply_along_with_its_axes_exchanged() {
    let [along, across] = [0.0, 90.0].map(|angle| plate(&[angle], &[1e-3], Stations::Two, 7));
    let points = along.points.len();
    let exchanged = |point: usize| {
        let (layer, place) = (point / 49, point % 49);
        layer * 49 + place % 7 * 7 + place / 7
    };
    for finite in [false, true] {
        let state: Vec<f64> = noise(3 * points).iter().map(|u| 1e-5 * u).collect();
        let mut turned = vec![0.0; 3 * points];
        for point in 0..points {
            let other = exchanged(point);
            for (axis, of) in [(0, 1), (1, 0), (2, 2)] {
                turned[3 * other + axis] = state[3 * point + of];
            }
        }
        let first = force(&mut laminate(&along, finite), &state);
        let second = force(&mut laminate(&across, finite), &turned);
        let size = first.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        for point in 0..points {
            for (axis, of) in [(0, 1), (1, 0), (2, 2)] {
                let error = second[3 * exchanged(point) + axis] - first[3 * point + of];
                assert!(error.abs() < 1e-12 * size, "{finite}: {error} of {size}");
            }
        }
    }
}

/// A ply at 45 degrees, on the diagonals of the lattice, is one at 0 degrees that is turned: displacements that are
/// quadratic in the position have the force of the continuum on both lattices.
#[test]
fn a_ply_at_45_degrees_is_a_ply_along_that_is_turned() {
    let side = 17;
    let middle = 0.5 * side as f64 * SPACING;
    let centre = 3 * (side * side / 2);
    // factors of x^2, x y and y^2 in the displacements along x, y and z
    let factors = [[2.0, -1.0, 0.5], [0.3, 1.5, -2.0], [0.0; 3]];
    let quadratic = |x: f64, y: f64| factors.map(|[a, b, c]| a * x * x + b * x * y + c * y * y);
    let [along, turned] = [0.0_f64, 45.0].map(|angle| {
        let body = plate(&[angle], &[1e-3], Stations::One, side);
        let (s, c) = angle.to_radians().sin_cos();
        let state = displaced(&body, |x, y, _| {
            let (x, y) = (x - middle, y - middle);
            let [u, v, w] = quadratic(c * x + s * y, c * y - s * x);
            [c * u - s * v, s * u + c * v, w]
        });
        let force = force(&mut laminate(&body, false), &state);
        let [u, v] = [force[centre], force[centre + 1]];
        [c * u + s * v, c * v - s * u]
    });
    let size = along[0].hypot(along[1]);
    for (along, turned) in along.iter().zip(turned) {
        let error = turned - along;
        // the calibration of bonds along the fibres at their ends is felt in the middle
        assert!(error.abs() < 2e-3 * size, "{error} of {size}");
    }
}

/// A ply of one station bends without energy of its own.
#[test]
fn one_station_has_the_stiffness_of_sheets_in_the_middle_of_the_plies() {
    let body = plate(&[0.0, 90.0], &[1e-3, 1e-3], Stations::One, 21);
    let mut laminate = laminate(&body, false);
    let found = energy_per_area(&body, &mut laminate, &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    let q = graphite().reduced();
    let expected = 0.5 * (q.along + q.across) * 1e-3 * (0.5e-3 * 2.0_f64).powi(2);
    assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
}

#[test]
fn forces_are_the_derivative_of_the_energy_in_both_kinematics() {
    let body = plate(&[0.0, 45.0, 90.0], &[1e-3, 0.5e-3, 1e-3], Stations::Two, 6);
    let points = body.points.len();
    for (finite, size) in [(false, 1e-5), (true, 2e-4)] {
        let mut laminate = laminate(&body, finite);
        let strain: Vec<[f64; 6]> = noise(6 * points)
            .chunks(6)
            .map(|c| std::array::from_fn(|i| 1e-3 * c[i]))
            .collect();
        let free: Vec<f64> = noise(points).iter().map(|e| 1e-3 * e).collect();
        laminate.set_points(PointStates {
            eigenstrain: Some(&free),
            stress_free: Some(StressFreeStrain {
                strain: &strain,
                prescribed: &strain,
            }),
            ..PointStates::default()
        });
        let state: Vec<f64> = noise(3 * points).iter().map(|u| size * u).collect();
        let of_state = force(&mut laminate, &state);
        let total = |axis: usize| -> f64 {
            let forces = of_state.chunks(3).zip(&body.points.volume);
            forces.map(|(f, volume)| f[axis] * volume).sum()
        };
        let size_of_force: f64 = of_state
            .chunks(3)
            .zip(&body.points.volume)
            .map(|(f, volume)| f[0].abs() * volume)
            .sum();
        for axis in 0..3 {
            assert!(total(axis).abs() < 1e-12 * size_of_force, "momentum");
        }
        let direction: Vec<f64> = noise(3 * points + 5).split_off(5);
        let power: f64 = (0..3 * points)
            .map(|i| of_state[i] * direction[i] * body.points.volume[i / 3])
            .sum();
        let step = 1e-8;
        let moved = |sign: f64| -> Vec<f64> {
            let both = state.iter().zip(&direction);
            both.map(|(u, d)| u + sign * step * d).collect()
        };
        let [up, down] = [1.0, -1.0].map(|sign| energy(&body, &mut laminate, &moved(sign)));
        let rate = (up - down) / (2.0 * step);
        // the difference of two energies
        assert!(
            (rate / -power - 1.0).abs() < 1e-6,
            "{finite}: {rate} {power}"
        );
    }
}

#[test]
fn rotations_take_no_energy_and_uniform_expansion_no_stress() {
    let body = plate(&[0.0, 90.0], &[1e-3, 0.5e-3], Stations::Two, 6);
    let points = body.points.len();
    let (sin, cos) = 0.7_f64.sin_cos();
    // about an axis in the plane of the plate
    let turned = displaced(&body, |x, _, z| {
        [(cos - 1.0) * x + sin * z, 0.0, -sin * x + (cos - 1.0) * z]
    });
    let mut finite = laminate(&body, true);
    let scale = force(
        &mut finite,
        &displaced(&body, |x, _, _| [0.1 * x, 0.0, 0.0]),
    );
    let scale = scale.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let found = force(&mut finite, &turned);
    assert!(found.iter().all(|f| f.abs() < 1e-11 * scale));

    let mut linear = laminate(&body, false);
    let strain = [2e-3, 2e-3, 5e-3, 0.0, 0.0, 0.0];
    let strains = vec![strain; points];
    linear.set_points(PointStates {
        eigenstrain: Some(&vec![0.0; points]),
        stress_free: Some(StressFreeStrain {
            strain: &strains,
            prescribed: &strains,
        }),
        ..PointStates::default()
    });
    let expanded = displaced(&body, |x, y, z| [2e-3 * x, 2e-3 * y, 5e-3 * z]);
    let found = force(&mut linear, &expanded);
    assert!(found.iter().all(|f| f.abs() < 1e-11 * scale));
}

#[test]
fn the_stiffness_is_that_of_the_forces_and_its_frequency_is_bounded() {
    let body = plate(&[0.0, 45.0], &[1e-3, 0.5e-3], Stations::Two, 8);
    let mut laminate = laminate(&body, false);
    let points = body.points.len();
    let density = vec![1620.0; points];
    let bound = laminate.largest_frequency(&density, &[]);
    let mut mode = noise(3 * points);
    let mut frequency = 0.0;
    for _ in 0..300 {
        let force = force(&mut laminate, &mode);
        let mut product = vec![0.0; mode.len()];
        laminate.stiffness(Stiffness::Elastic, &mut product);
        assert!(product.iter().zip(&force).all(|(k, f)| *k == -f));
        let size = product.iter().map(|k| k * k).sum::<f64>().sqrt();
        let before = mode.iter().map(|u| u * u).sum::<f64>().sqrt();
        frequency = (size / before / 1620.0).sqrt();
        mode = product.iter().map(|k| k / size).collect();
    }
    assert!(bound >= frequency, "{bound} {frequency}");
    assert!(bound < 1.8 * frequency, "{bound} {frequency}");
}

/// A shift of the upper layer against the lower one: the traction is the shear modulus times the angle.
#[test]
fn interfaces_carry_the_shear_of_their_modulus() {
    let body = plate(&[0.0], &[1e-3], Stations::Two, 21);
    let layers = body.layers().expect("layers").clone();
    let points = layers.points_of_layer();
    let mut laminate = laminate(&body, false);
    let distance = layers.layers()[1].z - layers.layers()[0].z;
    let shifted = displaced(&body, |_, _, z| {
        [1e-6, 2e-6, 3e-6].map(|d| d * f64::from(z > 0.0))
    });
    let found = force(&mut laminate, &shifted);
    let expected = [2e9 * 1e-6, 1.3e9 * 2e-6, 3.4e9 * 3e-6].map(|f| f / distance / 0.5e-3);
    let middle = points / 2;
    for axis in 0..3 {
        let lower = found[3 * middle + axis];
        let upper = found[3 * (points + middle) + axis];
        assert!(
            (lower / expected[axis] - 1.0).abs() < 1e-10,
            "{axis}: {lower}"
        );
        assert!(
            (upper / expected[axis] + 1.0).abs() < 1e-10,
            "{axis}: {upper}"
        );
    }
}
