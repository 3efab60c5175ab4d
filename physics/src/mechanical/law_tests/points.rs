//! Points that follow a law of their own.

use nalgebra::{Matrix3, Rotation3, Vector3};
use perimelt_core::body::{Body, Store};
use perimelt_core::law::{Constant, StateVariable};
use perimelt_core::{
    Coupler, RunError, RunningCoupler, Setup, SetupError, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{check_derivatives, force, solid};
use crate::mechanical::Mechanical;
use crate::mechanical::classical::{COMPONENTS, symmetric};
use crate::mechanical::moduli::{Moduli, Plane};
use crate::mechanical::plasticity::StressState;
use crate::mechanical::points::{
    BodyPoint, FreeStrain, LawPoint, Measure, NeoHookean, PointLaw, PointResponse, StepStates,
};
use crate::mechanical::solid::PointStates;
use crate::testing::{block, read, run, simulation, values};

const RUBBER: &str = "density = 1000\nyoungs_modulus = 1e6\npoissons_ratio = 0.4\nyield_stress = 2";
const NEO_HOOKEAN: &str =
    "formulation = 'correspondence'\nkinematics = 'finite'\nlaw.neo_hookean = {}";

/// Relaxation of the deviator: the viscous strain follows it with a time constant.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Maxwell {}

impl PointLaw for Maxwell {
    // the time constant, in a property that the physics do not use
    const CONSTANTS: &'static [Constant] = &[Constant::required("yield_stress")];
    const STATE: &'static [StateVariable] =
        &[StateVariable::tensor("strain", "1", "viscous strain")];
    const STRAIN: Measure = Measure::Strain;

    fn evolve(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &mut [f64]) {
        let rate = point.step / point.constants[0];
        let deviator = strain - Matrix3::identity() * (strain.trace() / 3.0);
        for (viscous, at) in state.iter_mut().zip(COMPONENTS) {
            *viscous = (*viscous + rate * deviator[at]) / (1.0 + rate);
        }
    }

    fn stress(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64> {
        let elastic = strain - viscous(state);
        let isotropic = point.lame() * elastic.trace();
        elastic * (2.0 * point.shear_modulus) + Matrix3::identity() * isotropic
    }

    fn energy(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> f64 {
        0.5 * self
            .stress(point, strain, state)
            .dot(&(strain - viscous(state)))
    }

    fn steepest(&self, _: &LawPoint<'_>) -> f64 {
        1.0
    }
}

fn viscous(state: &[f64]) -> Matrix3<f64> {
    symmetric(&std::array::from_fn(|c| state[c]))
}

crate::register_point_law!("test_maxwell", Maxwell);

fn rubber(cells: [usize; 3]) -> Body {
    let dimension = if cells[2] > 1 { 3 } else { 2 };
    block(cells, dimension, 1e-3, Store::Lattice, RUBBER)
}

fn at() -> BodyPoint<'static> {
    BodyPoint {
        point: LawPoint {
            constants: &[],
            temperature: None,
            step: 1.0,
            shear_modulus: 3e5,
            bulk_modulus: 2e6,
            finite: true,
            axes: Matrix3::identity(),
            number: 0,
            position: [0.0; 3],
            spacing: 1e-3,
            start: 0.0,
        },
        stress_state: StressState::Full,
        free: FreeStrain::isotropic(0.1),
    }
}

fn gradient() -> Matrix3<f64> {
    Matrix3::new(0.2, -0.3, 0.1, 0.25, -0.2, 0.15, 0.05, 0.4, 0.3)
}

/// Stress against the energy and tangents against the stress, in three dimensions and in plane stress.
#[test]
fn neo_hookean_points_have_the_stress_of_their_energy() {
    let law: NeoHookean = read("");
    let law: &dyn PointResponse = &law;
    let flat = |mut h: Matrix3<f64>| {
        (0..3).for_each(|a| (h[(a, 2)], h[(2, a)]) = (0.0, 0.0));
        h
    };
    for stress_state in [StressState::Full, StressState::Plane] {
        let at = BodyPoint {
            stress_state,
            ..at()
        };
        let is_flat = stress_state == StressState::Plane;
        let h = if is_flat {
            flat(gradient())
        } else {
            gradient()
        };
        let piola = |h: &Matrix3<f64>| law.piola(&at, &law.complete(&at, h, &[]), &[]);
        let energy = |h: &Matrix3<f64>| law.energy(&at, &law.complete(&at, h, &[]), &[]);
        let stress = piola(&h);
        if is_flat {
            assert!(stress[(2, 2)].abs() < 1e-9 * stress.norm(), "{stress}");
        }
        let change = Matrix3::new(0.3, 0.8, -0.5, -0.2, 0.4, 0.9, 0.6, -0.7, 0.1);
        let change = if is_flat { flat(change) } else { change };
        let step = 1e-5;
        let [up, down] = [step, -step].map(|step| h + change * step);
        let rate = (energy(&up) - energy(&down)) / (2.0 * step);
        assert!((rate / stress.dot(&change) - 1.0).abs() < 1e-8, "{rate}");
        let difference = (piola(&up) - piola(&down)) / (2.0 * step);
        let tangent = law.tangent(
            &at,
            &h,
            StepStates {
                start: &[],
                end: &[],
            },
            &change,
        );
        let error = (tangent - difference).norm() / difference.norm();
        assert!(error < 1e-7, "{stress_state:?}: {error}");
    }
}

#[test]
fn stresses_turn_with_the_point() {
    let law: NeoHookean = read("");
    let law: &dyn PointResponse = &law;
    let turn = Rotation3::from_euler_angles(0.4, 1.0, -0.3).into_inner();
    let turned = turn * (Matrix3::identity() + gradient()) - Matrix3::identity();
    let (stress, of_turned) = (
        law.piola(&at(), &gradient(), &[]),
        law.piola(&at(), &turned, &[]),
    );
    assert!((of_turned - turn * stress).norm() < 1e-12 * stress.norm());
}

#[test]
fn forces_are_the_derivative_of_the_energy_and_tangents_that_of_forces() {
    let laws = [
        "kinematics = 'finite'\nlaw.neo_hookean = {}",
        "law.test_maxwell = {}",
        "law.test_maxwell = {}\nkinematics = 'finite'",
    ];
    let correspondence = laws.map(|law| format!("formulation = 'correspondence'\n{law}"));
    // eigenstrains in disorder make modes without strain, which turn with the points
    let staggered = laws.into_iter().chain(["kinematics = 'finite'"]);
    let staggered = staggered.map(|law| format!("formulation = 'staggered'\n{law}"));
    for keys in correspondence.into_iter().chain(staggered) {
        for cells in [[7, 6, 5], [9, 8, 1]] {
            for plane in ["stress", "strain"] {
                check_derivatives(&rubber(cells), &format!("plane = '{plane}'\n{keys}"), true);
            }
        }
    }
}

#[test]
fn a_body_that_expands_freely_has_no_stress() {
    let strain = 0.1;
    for (cells, plane) in [
        ([6, 5, 4], "stress"),
        ([6, 5, 1], "stress"),
        ([6, 5, 1], "strain"),
    ] {
        let body = rubber(cells);
        let mut solid = solid(&body, &format!("plane = '{plane}'\n{NEO_HOOKEAN}"));
        // in plane strain nothing expands across, so that only the stress across is left
        let ratio = 0.4;
        let across = Moduli::new(1e6, ratio, 2, Plane::Strain).swelling;
        let expansion = if plane == "strain" {
            1e-7 * across
        } else {
            strain
        };
        let eigenstrain = if plane == "strain" { 1e-7 } else { strain };
        solid.set_points(PointStates {
            eigenstrain: Some(&vec![eigenstrain; body.points.len()]),
            ..PointStates::default()
        });
        let points = body.points.position.iter();
        let in_body = |(a, x): (usize, f64)| {
            if a < body.dimension {
                expansion * x
            } else {
                0.0
            }
        };
        let expanded: Vec<f64> = points
            .flat_map(|x| [x.x, x.y, x.z].into_iter().enumerate().map(in_body))
            .collect();
        let free = force(&mut *solid, &expanded);
        let held = force(&mut *solid, &vec![0.0; expanded.len()]);
        let largest = |f: &[f64]| f.iter().fold(0.0f64, |l, f| l.max(f.abs()));
        // of the second order in the eigenstrain in plane strain
        assert!(largest(&free) < 1e-6 * largest(&held), "{cells:?} {plane}");
    }
}

/// Holds all points at a strain along x.
#[derive(Debug, Serialize, Deserialize)]
struct Held {
    strain: f64,
    #[serde(skip)]
    fields: Option<[Write<Vector3<f64>>; 2]>,
}

#[typetag::serialize(name = "test_held")]
impl Coupler for Held {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let constraint = setup.add(0, &keys::CONSTRAINT)?;
        self.fields = Some([constraint, setup.add(0, &keys::HELD_DISPLACEMENT)?]);
        Ok(self)
    }
}

impl RunningCoupler for Held {
    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        let [constraint, held] = self.fields.expect("prepared");
        let (mut constraint, mut held) = (world.write(constraint), world.write(held));
        for (i, x) in world.body(0).points.position.iter().enumerate() {
            constraint[i] += Vector3::repeat(1.0);
            held[i] += Vector3::new(self.strain * x.x, 0.0, 0.0);
        }
        Ok(())
    }
}

/// After n steps of dt the viscous strain of a held body has the fraction 1 - (1 + dt/t)^-n of the deviator, and the stress
/// has the rest.
#[test]
fn the_state_of_a_law_is_a_field_that_evolves_once_in_a_step() {
    let strain = 1e-3;
    for (formulation, kinematics) in [
        ("correspondence", "linear"),
        ("correspondence", "finite"),
        ("staggered", "linear"),
    ] {
        let keys = format!(
            "formulation = '{formulation}'\nkinematics = '{kinematics}'\nlaw.test_maxwell = {{}}\nstep = 0.5"
        );
        let mechanical: Mechanical = read(&keys);
        let held = Held {
            strain,
            fields: None,
        };
        let mut body = simulation(
            rubber([6, 5, 4]),
            vec![Box::new(mechanical)],
            vec![Box::new(held)],
            2.0,
        );
        run(&mut body);
        let of_green = if kinematics == "finite" {
            0.5 * strain
        } else {
            0.0
        };
        let deviator = strain * (1.0 + of_green) * 2.0 / 3.0;
        let left = 1.25f64.powi(-4);
        let viscous = values(&body, "test_maxwell.strain");
        let moduli = Moduli::new(1e6, 0.4, 3, Plane::Stress);
        // of the spatial stress in finite kinematics
        let turned = if kinematics == "finite" {
            1.0 + strain
        } else {
            1.0
        };
        let expected = 2.0 * moduli.shear * deviator * left + moduli.bulk * 1.5 * deviator;
        let stresses = values(&body, "stress");
        let states = viscous.chunks(9).zip(stresses.chunks(9));
        let positions = &body.world().body(0).points.position;
        // corners at the surface move as the points before them
        let is_strained = |x: &Vector3<f64>| {
            let inside = |(x, end): (&f64, f64)| *x > 1e-3 && *x < end - 1e-3;
            formulation != "staggered" || x.iter().zip([6e-3, 5e-3, 4e-3]).all(inside)
        };
        let points = states.zip(positions).filter(|(_, x)| is_strained(x));
        for ((viscous, stress), _) in points {
            let error = viscous[0] / (deviator * (1.0 - left)) - 1.0;
            assert!(error.abs() < 1e-9, "{kinematics}: {error}");
            let error = stress[0] / (expected * turned) - 1.0;
            assert!(error.abs() < 1e-9, "{kinematics}: {error}");
        }
    }
}

/// The largest frequency goes with the root of the largest stiffness.
#[test]
fn the_stable_step_follows_the_steepest_law() {
    let body = rubber([7, 6, 5]);
    let density = vec![1000.0; body.points.len()];
    let largest = |law: &str| {
        let keys = format!("formulation = 'correspondence'\nkinematics = 'finite'\n{law}");
        solid(&body, &keys).largest_frequency(&density, &[])
    };
    let ratio = largest("law.neo_hookean = { least_stretch = 0.5 }") / largest("");
    let moduli = Moduli::new(1e6, 0.4, 3, Plane::Stress);
    let steepest = moduli.shear * 5.0 + moduli.lame * 4.0 * (1.0 + 2f64.ln());
    let steepest = steepest / (2.0 * moduli.shear + moduli.lame);
    assert!((ratio / steepest.sqrt() - 1.0).abs() < 1e-12, "{ratio}");
}
