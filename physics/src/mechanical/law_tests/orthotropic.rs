//! Points with a stiffness along three axes.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::body::{Body, Store};
use perimelt_core::orientation::axes;
use perimelt_core::solver::{Reducer, largest_eigenvalue};

use super::{check_derivatives_of, force, scattered, solid};
use crate::mechanical::classical::{COMPONENTS, symmetric};
use crate::mechanical::plasticity::StressState;
use crate::mechanical::points::{BodyPoint, FreeStrain, LawPoint, Orthotropic, PointResponse};
use crate::mechanical::solid::{PointStates, Solid, Stiffness, StressFreeStrain};
use crate::testing::{block, read};

/// E1, E2, E3, nu12, nu13, nu23, G12, G13, G23.
const CONSTANTS: [f64; 9] = [181e9, 10.3e9, 8e9, 0.28, 0.2, 0.4, 7.17e9, 6e9, 3e9];
const PLY: &str = "density = 1600\nyoungs_modulus_1 = 181e9\nyoungs_modulus_2 = 10.3e9\nyoungs_modulus_3 = 8e9\npoissons_ratio_12 = 0.28\n\
                   poissons_ratio_13 = 0.2\npoissons_ratio_23 = 0.4\nshear_modulus_12 = 7.17e9\nshear_modulus_13 = 6e9\nshear_modulus_23 = 3e9";

fn ply(cells: [usize; 3]) -> Body {
    let dimension = if cells[2] > 1 { 3 } else { 2 };
    block(cells, dimension, 1e-3, Store::Lattice, PLY)
}

fn at(orientation: Vector3<f64>, stress_state: StressState) -> BodyPoint<'static> {
    let [bulk_modulus, shear_modulus] = [10.3e9 / 1.5, 10.3e9 / 2.5];
    BodyPoint {
        point: LawPoint {
            constants: &CONSTANTS,
            temperature: None,
            step: 1.0,
            shear_modulus,
            bulk_modulus,
            finite: false,
            axes: axes(&orientation),
            number: 0,
            position: [0.0; 3],
            spacing: 1e-3,
            start: 0.0,
        },
        stress_state,
        free: FreeStrain::isotropic(0.0),
    }
}

/// Turns the material of all points, differently at each one.
fn scatter_axes(solid: &mut dyn Solid, points: usize) {
    let numbers = scattered(3 * points, 2.0, 5.0);
    let orientation = numbers.chunks(3).map(Vector3::from_column_slice);
    let orientation: Vec<_> = orientation.collect();
    let points = &mut solid.base_mut().law_points;
    points
        .as_mut()
        .expect("a law of points")
        .set_orientation(&orientation);
}

/// The strains of a stress along the axes follow from the definitions of the constants; along other axes the law is the same law
/// turned.
#[test]
fn stresses_are_those_of_engineering_constants() {
    let law: Orthotropic = read("");
    let law: &dyn PointResponse = &law;
    let [e1, e2, e3, nu12, nu13, nu23, g12, g13, g23] = CONSTANTS;
    // columns: strains of unit stresses xx, yy, zz, xy, yz, zx; of shear, half of the angle
    let strains = [
        [1.0 / e1, -nu12 / e1, -nu13 / e1, 0.0, 0.0, 0.0],
        [-nu12 / e1, 1.0 / e2, -nu23 / e2, 0.0, 0.0, 0.0],
        [-nu13 / e1, -nu23 / e2, 1.0 / e3, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.5 / g12, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.5 / g23, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.5 / g13],
    ];
    for orientation in [Vector3::zeros(), Vector3::new(0.7, -0.4, 1.9)] {
        let (at, turn) = (at(orientation, StressState::Full), axes(&orientation));
        for (component, strain) in strains.iter().enumerate() {
            let stress = law.piola(&at, &(turn * symmetric(strain) * turn.transpose()), &[]);
            let stress = turn.transpose() * stress * turn;
            for (c, place) in COMPONENTS.into_iter().enumerate() {
                let expected = if c == component { 1.0 } else { 0.0 };
                let error = (stress[place] - expected).abs();
                assert!(error < 1e-12, "{orientation}: {stress}");
            }
        }
    }
}

/// `1/E_x = cos^4/E1 + (1/G12 - 2 nu12/E1) sin^2 cos^2 + sin^4/E2`, and the numbers of docs/theory/mechanics.md.
#[test]
fn a_ply_off_its_axis_has_the_modulus_of_classical_theory() {
    let law: Orthotropic = read("");
    let law: &dyn PointResponse = &law;
    for (angle, modulus) in [
        (10.0f64, 107.8375e9),
        (30.0, 28.78011e9),
        (45.0, 16.73722e9),
    ] {
        let at = at(
            Vector3::new(0.0, 0.0, angle.to_radians()),
            StressState::Plane,
        );
        // the compliance in the plane, from the stresses of unit strains
        let unit = [(0, 0), (1, 1), (0, 1)];
        let column = |(a, b): (usize, usize)| {
            let mut strain = Matrix3::zeros();
            (strain[(a, b)], strain[(b, a)]) = if a == b { (1e-3, 1e-3) } else { (5e-4, 5e-4) };
            let stress = law.piola(&at, &law.complete(&at, &strain, &[]), &[]) / 1e-3;
            Vector3::new(stress[(0, 0)], stress[(1, 1)], stress[(0, 1)])
        };
        let stiffness = Matrix3::from_columns(&unit.map(column));
        let found = 1.0 / stiffness.try_inverse().expect("regular")[(0, 0)];
        assert!((found / modulus - 1.0).abs() < 1e-6, "{angle}: {found:e}");
    }
}

#[test]
fn forces_are_the_derivative_of_the_energy_and_tangents_that_of_forces() {
    for formulation in ["correspondence", "staggered"] {
        for kinematics in ["linear", "finite"] {
            for (cells, plane) in [
                ([6, 5, 4], "stress"),
                ([8, 7, 1], "stress"),
                ([8, 7, 1], "strain"),
            ] {
                let body = ply(cells);
                let keys = format!(
                    "formulation = '{formulation}'\nkinematics = '{kinematics}'\nplane = '{plane}'\nlaw.orthotropic = {{}}"
                );
                let mut solid = solid(&body, &keys);
                scatter_axes(&mut *solid, body.points.len());
                check_derivatives_of(&mut *solid, &body, &keys, true);
            }
        }
    }
}

/// A body that has no stress as it grows differently along its axes.
#[test]
fn a_body_expands_freely_by_a_strain_with_components() {
    for (law, kinematics) in [
        ("law.orthotropic = {}", "linear"),
        ("law.orthotropic = {}", "finite"),
        ("law.neo_hookean = {}", "finite"),
    ] {
        for formulation in ["correspondence", "staggered"] {
            for cells in [[6, 5, 4], [6, 5, 1]] {
                let materials = format!("{PLY}\nyoungs_modulus = 1e9\npoissons_ratio = 0.3");
                let dimension = if cells[2] > 1 { 3 } else { 2 };
                let body = block(cells, dimension, 1e-3, Store::Lattice, &materials);
                let keys =
                    format!("formulation = '{formulation}'\nkinematics = '{kinematics}'\n{law}");
                let mut solid = solid(&body, &keys);
                if law.contains("orthotropic") {
                    scatter_axes(&mut *solid, body.points.len());
                }
                let (own, isotropic) = ([0.03, -0.02, 0.05, 0.0, 0.0, 0.0], 0.01);
                let points = body.points.len();
                solid.set_points(PointStates {
                    eigenstrain: Some(&vec![isotropic; points]),
                    stress_free: Some(StressFreeStrain {
                        strain: &vec![own; points],
                        prescribed: &vec![own; points],
                    }),
                    ..PointStates::default()
                });
                let nodes = solid.base().nodes.positions(&body).to_vec();
                let expanded: Vec<f64> = nodes
                    .iter()
                    .flat_map(|x| {
                        let along = |a: usize| {
                            if a < dimension {
                                (own[a] + isotropic) * x[a]
                            } else {
                                0.0
                            }
                        };
                        [0, 1, 2].map(along)
                    })
                    .collect();
                let free = force(&mut *solid, &expanded);
                let held = force(&mut *solid, &vec![0.0; expanded.len()]);
                let largest = |f: &[f64]| f.iter().fold(0.0f64, |l, f| l.max(f.abs()));
                assert!(largest(&free) < 1e-8 * largest(&held), "{keys} {cells:?}");
            }
        }
    }
}

/// The largest frequency is at least that of the law, and not far above it. Staggered solids bound it by the product of two largest
/// ratios.
#[test]
fn the_stable_step_is_that_of_the_stiffest_direction() {
    for (formulation, most) in [("correspondence", 1.6), ("staggered", 4.0)] {
        for (cells, plane) in [
            ([7, 6, 5], "stress"),
            ([9, 8, 1], "stress"),
            ([9, 8, 1], "strain"),
        ] {
            let body = ply(cells);
            let keys =
                format!("formulation = '{formulation}'\nplane = '{plane}'\nlaw.orthotropic = {{}}");
            let mut solid = solid(&body, &keys);
            let density = solid
                .base()
                .nodes
                .densities(&vec![1600.0; body.points.len()], &[]);
            let bound = solid.largest_frequency(&density, &[]);
            let inverse_density: Vec<f64> = (0..3 * density.len())
                .map(|i| match i % 3 < body.dimension {
                    true => 1.0 / density[i / 3],
                    false => 0.0,
                })
                .collect();
            force(&mut *solid, &vec![0.0; 3 * density.len()]);
            solid.linearise(0.0);
            let exact = largest_eigenvalue(&inverse_density, &Reducer::default(), |u, out| {
                solid.set_displacement(u, &[]);
                solid.stiffness(Stiffness::Tangent, out);
            });
            let ratio = bound / exact.sqrt();
            assert!(
                (0.99..most).contains(&ratio),
                "{formulation} {cells:?} {plane}: {ratio}"
            );
        }
    }
}
