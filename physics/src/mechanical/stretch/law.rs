//! Laws of bonds: force and energy of a bond from its stretch and the inputs of both ends.
//!
//! A further law is a type that implements [`BondLaw`] and a variant of [`BondLaws`].

use std::fmt::Debug;

use perimelt_core::Bond;

use super::{EIGENSTRAIN, Ends, PRESSURE, STIFFNESS, elastic_stretch};

/// The law of a bond, linear in its stretch. Methods are called for each bond: without `#[inline(always)]` a kernel is
/// compiled without vector instructions and is several times slower.
pub trait BondLaw: Copy + Debug + Send + Sync {
    /// Force density along the bond, N/m³.
    fn tension(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64;

    /// Energy density that the bond gives its point at the elastic stretch, J/m³.
    fn elastic_energy(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64;

    /// Contribution of the bond at its total stretch to the stress conjugate to the eigenstrain of its point, Pa.
    fn conjugate_stress(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64;
}

/// Bonds of a bond-based solid, with the mean stiffness and eigenstrain of their ends (Wang (2025), eqs. 7.14, 7.15). The
/// mean of the products at both ends differs by several percent where both change within a horizon, as at a melt pool.
#[derive(Clone, Copy, Debug)]
pub struct LinearPairs;

/// Bonds of an ordinary state-based solid: the force states of both ends, with the pressure of their dilatation.
#[derive(Clone, Copy, Debug)]
pub struct LinearStates;

/// The law of the bonds of a body.
#[derive(Clone, Copy, Debug)]
pub enum BondLaws {
    /// Bond-based.
    Pairs(LinearPairs),
    /// Ordinary state-based.
    States(LinearStates),
}

/// Elastic energy density of a bond with a stiffness, J/m³.
#[inline(always)]
fn elastic_energy(bond: &Bond, stiffness: f64, elastic: f64) -> f64 {
    let of_bond = bond.weight * stiffness * bond.length;
    0.25 * of_bond * elastic * elastic
}

impl BondLaw for LinearPairs {
    #[inline(always)]
    fn tension(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        bond.mean() * ends.mean(STIFFNESS) * (stretch - ends.mean(EIGENSTRAIN))
    }

    /// Both ends have the mean weight together; at layers the own weight is that of the energy of the forces.
    #[inline(always)]
    fn elastic_energy(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        let stiffness = ends.mean(STIFFNESS);
        elastic_energy(bond, stiffness, elastic_stretch(stretch, ends))
    }

    #[inline(always)]
    fn conjugate_stress(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        let force = ends.mean(STIFFNESS) * bond.mean();
        0.5 * force * bond.length * stretch
    }
}

impl BondLaw for LinearStates {
    #[inline(always)]
    fn tension(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        let elastic = elastic_stretch(stretch, ends);
        // computed once if the stiffness is the same at both ends
        let end = |stiffness: f64| 0.5 * stiffness * elastic;
        let tension =
            bond.weight * end(ends.own[STIFFNESS]) + bond.dual * end(ends.other[STIFFNESS]);
        let pressure = bond.weight * ends.own[PRESSURE] + bond.dual * ends.other[PRESSURE];
        tension + pressure * bond.inverse_length
    }

    #[inline(always)]
    fn elastic_energy(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        elastic_energy(bond, ends.own[STIFFNESS], elastic_stretch(stretch, ends))
    }

    #[inline(always)]
    fn conjugate_stress(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        let force = ends.own[STIFFNESS] * bond.weight;
        0.5 * force * bond.length * stretch
    }
}

/// Evaluates an expression with the law of a body, compiled for each law:
/// `with_law!(laws, law => sum(&Force::<false, _>(law)))`.
macro_rules! with_law {
    ($laws:expr, $law:ident => $body:expr) => {
        match $laws {
            $crate::mechanical::stretch::BondLaws::Pairs($law) => $body,
            $crate::mechanical::stretch::BondLaws::States($law) => $body,
        }
    };
}

pub(in crate::mechanical) use with_law;

/// The law is chosen for each bond: for kernels that are not summed in each step.
impl BondLaw for BondLaws {
    #[inline(always)]
    fn tension(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        with_law!(self, law => law.tension(bond, stretch, ends))
    }

    #[inline(always)]
    fn elastic_energy(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        with_law!(self, law => law.elastic_energy(bond, stretch, ends))
    }

    #[inline(always)]
    fn conjugate_stress(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        with_law!(self, law => law.conjugate_stress(bond, stretch, ends))
    }
}
