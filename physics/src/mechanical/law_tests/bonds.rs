//! Bonds that follow a law of their own.

use perimelt_core::body::{Body, Store};
use perimelt_core::law::Constant;
use perimelt_core::{Bond, BondKernel, Number};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{check_derivatives, solid};
use crate::mechanical::moduli::{Moduli, Plane};
use crate::mechanical::solid::{PointStates, StressKind, Wanted};
use crate::mechanical::stretch::{
    BodyLaw, BondConstants, BondLaw, CRITICAL, INPUTS, Load, Pairs, STIFFNESS,
};
use crate::testing::block;

const B: f64 = 30.0;
const BRITTLE: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.1\nfracture_energy = 1e8\nyield_stress = 30";
const LAW: &str = "law.test_cubic = { largest_stretch = 0.1 }";

/// Force `s + b s^3`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cubic {
    largest_stretch: f64,
}

impl BondLaw for Cubic {
    // any property that the physics do not use
    const CONSTANTS: &'static [Constant] = &[Constant::required("yield_stress")];

    fn force<N: Number>(&self, [b, ..]: &BondConstants, s: N) -> N {
        s + s * *b * s * s
    }

    fn mean_force(&self, [b, ..]: &BondConstants, s: f64) -> f64 {
        0.5 * s + 0.25 * b * s * s * s
    }

    fn slope(&self, [b, ..]: &BondConstants, s: f64) -> f64 {
        1.0 + 3.0 * b * s * s
    }

    fn steepest(&self, constants: &BondConstants) -> f64 {
        self.slope(constants, self.largest_stretch)
    }
}

crate::register_bond_law!("test_cubic", Cubic);

fn force_at(stretch: f64) -> f64 {
    stretch + B * stretch.powi(3)
}

fn cube() -> Body {
    block([9, 8, 7], 3, 1e-3, Store::Lattice, BRITTLE)
}

#[test]
fn forces_are_the_derivative_of_the_energy_and_tangents_that_of_forces() {
    for formulation in ["bond", "ordinary"] {
        for kinematics in ["linear", "finite"] {
            let keys = format!("formulation = '{formulation}'\nkinematics = '{kinematics}'\n{LAW}");
            // tangents of finite kinematics are differences of forces
            check_derivatives(&cube(), &keys, kinematics == "linear");
        }
    }
}

/// All bonds of a body that expands evenly have the same stretch s. The bonds have `(d + 2) mu` of the modulus `d bulk`, and
/// the pressure of the dilatation, which is linear, has the rest.
#[test]
fn an_even_expansion_has_the_stress_of_the_law() {
    let body = cube();
    let (strain, eigenstrain) = (0.02, -0.01);
    for (formulation, ratio) in [("bond", 0.25), ("ordinary", 0.1)] {
        for kinematics in ["linear", "finite"] {
            let keys = format!("formulation = '{formulation}'\nkinematics = '{kinematics}'\n{LAW}");
            let mut solid = solid(&body, &keys);
            solid.set_points(PointStates {
                eigenstrain: Some(&vec![eigenstrain; body.points.len()]),
                ..PointStates::default()
            });
            let points = body.points.position.iter();
            let expanded: Vec<f64> = points
                .flat_map(|x| [x.x, x.y, x.z].map(|x| strain * x))
                .collect();
            solid.set_displacement(&expanded, &[]);
            solid.evaluate(Wanted::force(&mut vec![0.0; expanded.len()]));
            let stress = solid.evaluate(Wanted::stress(StressKind::Spatial)).stress;
            let moduli = Moduli::new(2e11, ratio, 3, Plane::Stress);
            let stretch = strain - eigenstrain;
            let of_bonds = 5.0 * moduli.shear * force_at(stretch);
            let expected = of_bonds + (3.0 * moduli.bulk - 5.0 * moduli.shear) * stretch;
            let trace = |s: &[f64; 6]| s[0] + s[1] + s[2];
            for stress in stress {
                let error = trace(stress) / (3.0 * expected) - 1.0;
                assert!(error.abs() < 1e-10, "{keys}: {error}");
            }
        }
    }
}

/// The fracture energy is the energy of the bonds of the law at their critical stretch, not that of linear bonds.
#[test]
fn bonds_break_at_the_stretch_that_takes_the_fracture_energy() {
    let body = cube();
    let critical = |law: &str, formulation: &str| {
        let keys = format!("formulation = '{formulation}'\nfracture = {{}}\n{law}");
        let solid = solid(&body, &keys);
        solid.base().fracture().expect("bonds break").critical[0]
    };
    for formulation in ["bond", "ordinary"] {
        let (linear, found) = (critical("", formulation), critical(LAW, formulation));
        let moduli = |ratio| Moduli::new(2e11, ratio, 3, Plane::Stress);
        let bonds = match formulation {
            "bond" => 1.0,
            _ => {
                let moduli = moduli(0.1);
                let crossing = moduli.bond_stiffness(3) * 0.3;
                crossing / (crossing + 2.0 * moduli.dilatation_stiffness(3) * 0.75f64.powi(4))
            }
        };
        let square = found * found;
        let energy = square + bonds * 0.5 * B * square * square;
        let error = energy / (linear * linear) - 1.0;
        assert!(
            error.abs() < 1e-12 && found < 0.9 * linear,
            "{formulation}: {found} {linear}"
        );
    }
}

#[test]
fn the_load_of_a_bond_is_its_energy() {
    let bond = Bond {
        xi: [1e-3, 0.0, 0.0],
        length: 1e-3,
        inverse_length: 1e3,
        weight: 2.0,
        dual: 2.0,
    };
    let law = Cubic {
        largest_stretch: 0.1,
    };
    let (mut own, stretch, stiffness, limit) = ([0.0; INPUTS], 0.05, 3e11, 7.0);
    (own[STIFFNESS], own[CRITICAL]) = (stiffness, limit);
    let mut other = own;
    other[0] = stretch * 1e-3;
    let load = Load {
        finite: false,
        energy: true,
        law: Pairs(BodyLaw::new(law, [B, 0.0, 0.0, 0.0])),
    };
    let [ratio, _] = load.bond(&bond, own, other);
    let energy = 0.5 * stretch * stretch + 0.25 * B * stretch.powi(4);
    assert!((ratio / (stiffness * 1e-3 * energy / limit) - 1.0).abs() < 1e-12);
}

/// The largest frequency goes with the root of the largest slope.
#[test]
fn the_stable_step_follows_the_steepest_slope() {
    let body = cube();
    let density = vec![8000.0; body.points.len()];
    let largest = |law: &str| solid(&body, law).largest_frequency(&density, &[]);
    let ratio = largest(LAW) / largest("");
    let slope: f64 = 1.0 + 3.0 * B * 0.01;
    assert!((ratio / slope.sqrt() - 1.0).abs() < 1e-12, "{ratio}");
}
