//! Layers whose forces are the derivative of an energy.

use nalgebra::DMatrix;
use perimelt_core::body::{Body, Jitter, Store};
use perimelt_core::family::LayerRule;
use perimelt_core::family::Traction;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, Face, LayerRole, RunError, RunningCoupler, Setup, SetupError, Step, World, keys,
};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use super::solid::{EnergyKind, Solid, Stiffness, Wanted};
use crate::testing::{block, read, set, simulation};

const STEEL: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3";
const CELLS: [[usize; 3]; 2] = [[6, 5, 1], [5, 4, 3]];
const FORMULATIONS: [&str; 3] = ["bond", "ordinary", "correspondence"];

fn body(cells: [usize; 3], is_cloud: bool) -> Body {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let body = block(cells, dimension, 1e-3, Store::Lattice, STEEL);
    let jitter = Jitter {
        amplitude: 0.2,
        seed: 1,
    };
    match is_cloud {
        true => body.jittered(jitter).expect("valid"),
        false => body,
    }
}

/// A solid of `body` with layers behind `faces`.
fn solid(body: &Body, keys: &str, rules: &[LayerRule]) -> Box<dyn Solid> {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body.clone()]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("layers");
    for rule in rules {
        let layer = setup.layer(0, &keys::DISPLACEMENT, rule.face, LayerRole::Prescribed);
        layer.expect("the face is free");
    }
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run.solid
}

fn rule(face: Face, scale: [f64; 3]) -> LayerRule {
    LayerRule {
        scale,
        ..LayerRule::even(face)
    }
}

/// Layers behind faces, by name.
fn layers() -> Vec<(&'static str, Vec<LayerRule>)> {
    let clamp = |face| rule(face, [-1.0; 3]);
    vec![
        ("clamped", vec![clamp(Face::XMin)]),
        ("held along x", vec![rule(Face::XMin, [-1.0, 1.0, 1.0])]),
        ("held along y", vec![rule(Face::XMin, [1.0, -1.0, 1.0])]),
        (
            "held along x and y",
            vec![rule(Face::XMin, [-1.0, -1.0, 1.0])],
        ),
        ("free", vec![rule(Face::XMin, [1.0; 3])]),
        ("constant", vec![rule(Face::XMin, [0.0; 3])]),
        ("constant along x", vec![rule(Face::XMin, [0.0, 1.0, 1.0])]),
        ("constant along y", vec![rule(Face::XMin, [1.0, 0.0, 1.0])]),
        (
            "clamped at both ends",
            vec![clamp(Face::XMin), clamp(Face::XMax)],
        ),
        (
            "clamped all around a corner",
            vec![clamp(Face::XMin), clamp(Face::YMin)],
        ),
        (
            "clamped beside a roller",
            vec![clamp(Face::XMin), rule(Face::YMax, [1.0, -1.0, 1.0])],
        ),
        (
            "pulled at a corner",
            vec![
                clamp(Face::XMin),
                LayerRule {
                    offset: [2e-6, -2e-6, 0.0],
                    ..clamp(Face::YMin)
                },
            ],
        ),
    ]
}

/// Without order, from -1 to 1.
fn scattered(n: usize) -> f64 {
    2.0 * ((12.9898 * n as f64 + 0.7).sin() * 43758.5453)
        .fract()
        .abs()
        - 1.0
}

/// Minus the derivative of the force on each component by each other, N/m.
fn stiffness_matrix(body: &Body, solid: &mut dyn Solid, rules: &[LayerRule]) -> DMatrix<f64> {
    let (points, dimension) = (body.points.len(), body.dimension);
    let components: Vec<usize> = (0..3 * points).filter(|i| i % 3 < dimension).collect();
    let mut apply = |u: &[f64]| {
        let mut out = vec![0.0; 3 * points];
        solid.set_displacement(u, rules);
        solid.stiffness(Stiffness::Elastic, &mut out);
        out
    };
    let still = apply(&vec![0.0; 3 * points]);
    let mut matrix = DMatrix::zeros(components.len(), components.len());
    for (column, &component) in components.iter().enumerate() {
        let mut u = vec![0.0; 3 * points];
        u[component] = 1.0;
        let out = apply(&u);
        for (row, &i) in components.iter().enumerate() {
            matrix[(row, column)] = body.points.volume[i / 3] * (out[i] - still[i]);
        }
    }
    matrix
}

/// 1e-12 of the largest entry is the rounding of sums of some hundred bonds, whose forces are computed in another
/// order at each end.
#[test]
fn the_stiffness_of_bodies_with_layers_is_symmetric_and_not_negative() {
    for cells in CELLS {
        for is_cloud in [false, true] {
            let body = body(cells, is_cloud);
            for formulation in FORMULATIONS {
                for (name, rules) in layers() {
                    let keys = format!(
                        "formulation = '{formulation}'\nhorizon = 2\nsolver.explicit = {{}}"
                    );
                    let mut solid = solid(&body, &keys, &rules);
                    let matrix = stiffness_matrix(&body, &mut *solid, &rules);
                    let (largest, asymmetric) =
                        (matrix.amax(), (&matrix - matrix.transpose()).amax());
                    let about = format!("{cells:?} cloud {is_cloud} {formulation} {name}");
                    assert!(
                        asymmetric < 1e-12 * largest,
                        "{about}: {}",
                        asymmetric / largest
                    );
                    let least = matrix.symmetric_eigenvalues().min();
                    assert!(least > -1e-12 * largest, "{about}: {}", least / largest);
                }
            }
        }
    }
}

/// The bound of frequencies holds with layers; the power iteration finds the largest one to 2 %.
#[test]
fn frequencies_with_layers_are_below_their_bound() {
    for cells in CELLS {
        let body = body(cells, false);
        for formulation in ["bond", "ordinary"] {
            for (name, rules) in layers() {
                let keys =
                    format!("formulation = '{formulation}'\nhorizon = 2\nsolver.explicit = {{}}");
                let mut solid = solid(&body, &keys, &rules);
                let matrix = stiffness_matrix(&body, &mut *solid, &rules);
                let mass = 8000.0 * body.points.volume[0];
                let largest = (matrix.symmetric_eigenvalues().max() / mass).sqrt();
                let bound = solid.largest_frequency(&vec![8000.0; body.points.len()], &rules);
                assert!(
                    largest < bound,
                    "{cells:?} {formulation} {name}: {largest} {bound}"
                );
            }
        }
    }
}

/// The energy is that of the points, so layers that are constant, which have one of their own, are left out.
#[test]
fn forces_with_layers_are_the_derivative_of_the_energy_under_finite_kinematics() {
    for cells in CELLS {
        let body = body(cells, false);
        for formulation in FORMULATIONS {
            for (name, rules) in layers() {
                let is_constant = rules.iter().any(|r| r.scale.contains(&0.0));
                // rows and bodies that end behind an even layer have the energy of symmetric bodies
                if is_constant {
                    continue;
                }
                let keys = format!(
                    "formulation = '{formulation}'\nhorizon = 2\nkinematics = 'finite'\nsolver.explicit = {{}}"
                );
                let mut solid = solid(&body, &keys, &rules);
                let n = 3 * body.points.len();
                // strains of several percent
                let u = |i: usize| match i % 3 < body.dimension {
                    true => 3e-5 * scattered(i),
                    false => 0.0,
                };
                let u: Vec<f64> = (0..n).map(u).collect();
                let mut force = vec![0.0; n];
                solid.set_displacement(&u, &rules);
                solid.evaluate(Wanted::force(&mut force));
                let largest = force.iter().fold(0.0, |max: f64, f| max.max(f.abs()));
                let mut energy = |u: &[f64]| {
                    solid.set_displacement(u, &rules);
                    let energy = solid
                        .evaluate(Wanted::energy(EnergyKind::Total))
                        .energy
                        .iter()
                        .zip(&body.points.volume);
                    energy
                        .map(|([density, _], volume)| density * volume)
                        .sum::<f64>()
                };
                for i in (0..n).filter(|i| i % 3 < body.dimension) {
                    let step = 1e-8;
                    let moved = |by: f64| {
                        let mut u = u.clone();
                        u[i] += by;
                        u
                    };
                    let difference = energy(&moved(step)) - energy(&moved(-step));
                    let derivative = -difference / (2.0 * step * body.points.volume[i / 3]);
                    // the square of the step over the size of a bond
                    let error = (derivative - force[i]).abs() / largest;
                    assert!(error < 1e-6, "{cells:?} {formulation} {name} {i}: {error}");
                }
            }
        }
    }
}

/// A traction of zero by a layer that is not announced, so that explicit motion does not refuse it.
#[derive(Debug, Default, Serialize, Deserialize)]
struct FreeLayer {
    #[serde(skip)]
    layer: Option<LayerHandle>,
}

#[typetag::serialize(name = "test_free_layer")]
impl Coupler for FreeLayer {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        self.layer =
            Some(setup.layer(0, &keys::DISPLACEMENT, Face::XMin, LayerRole::Prescribed)?);
        Ok(self)
    }
}

impl RunningCoupler for FreeLayer {
    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        world.set_traction_layer(self.layer.expect("prepared"), [0.0; 3]);
        Ok(())
    }
}

#[test]
fn energy_that_grows_without_work_stops_the_run() {
    let body = body([12, 8, 1], false);
    let mechanical: Mechanical = read("formulation = 'bond'\nsolver.explicit = {}");
    let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(FreeLayer::default())];
    let mut s = simulation(body, vec![Box::new(mechanical)], couplers, 1.0);
    // so small that the displacement reaches no limit before the first samples of the energy
    set(&mut s, "velocity", |[x, y, _]| [1e-6 * y, -2e-6 * x, 0.0]);
    s.start().expect("starts");
    let error = loop {
        match s.step() {
            Ok(_) => assert!(s.progress().sub_steps[0] < 100_000, "it does not stop"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(error.contains("mechanical failed at t = "), "{error}");
    assert!(error.contains("without work being done on it"), "{error}");
}

#[test]
fn traction_layers_are_refused_in_explicit_motion() {
    let mechanical: Mechanical = read("solver.explicit = {}");
    let mut world = World::new(vec![body([6, 5, 1], false)]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("traction");
    let layer = setup.layer(0, &keys::DISPLACEMENT, Face::XMin, LayerRole::Prescribed);
    let none = Traction {
        stress: [0.0; 3],
        difference: false,
    };
    let rule = LayerRule {
        traction: Some(none),
        ..LayerRule::even(Face::XMin)
    };
    setup.announce_layer(layer.expect("free"), rule);
    setup.next_plugin("mechanical");
    let error = mechanical.ready(&mut setup).err().expect("it is refused");
    assert_eq!(error.key, "solver");
    assert!(error.to_string().contains("face `x-`"), "{error}");
}
