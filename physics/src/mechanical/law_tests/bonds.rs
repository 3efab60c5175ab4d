//! Bonds that follow a law of their own; `tests/cubic` has solids of them.

use perimelt_core::{Bond, BondKernel, Number};
use serde::Serialize;

use crate::mechanical::stretch::{
    BodyLaw, BondConstants, BondLaw, CRITICAL, INPUTS, Load, Pairs, STIFFNESS,
};

const B: f64 = 30.0;

/// Force `s + b s^3`.
#[derive(Clone, Copy, Debug, Serialize)]
struct Cubic {
    largest_stretch: f64,
}

impl BondLaw for Cubic {
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
