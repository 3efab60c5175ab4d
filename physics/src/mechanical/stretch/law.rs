//! Laws of bonds: [`BondLaw`] is the law, [`BondForce`] what kernels need of it in a formulation.

use std::fmt::Debug;

use perimelt_core::law::Constant;
use perimelt_core::{Bond, Number, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Ends, INPUTS, PRESSURE, STIFFNESS, elastic_stretch};

/// Constants of a law in the order of their declaration, zero behind its last.
pub type BondConstants = [f64; 4];

/// The law of the force along a bond, as a function of its elastic stretch: the stretch without the eigenstrain.
///
/// Forces are given as the stretch at which a linear bond has the same force. The slope at no stretch is one: it belongs to
/// Young's modulus. In `ordinary` solids the pressure of the dilatation, which is linear, adds to the force.
///
/// Methods are called for each bond: without `#[inline(always)]` a kernel is compiled without vector instructions and is
/// several times slower.
pub trait BondLaw: Copy + Debug + Send + Sync + Serialize + 'static {
    /// Properties of materials that the law needs besides the elastic ones, at most four. Each is one number for all
    /// materials of a body.
    const CONSTANTS: &'static [Constant] = &[];
    /// Whether the force is the stretch.
    const IS_LINEAR: bool = false;

    /// Checks the keys, and computes from them what each bond needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Force at a stretch. Written for any number, so that devices can compute it, too.
    fn force<N: Number>(&self, constants: &BondConstants, stretch: N) -> N;

    /// Mean of the force from no stretch to this one: times the stretch, it is the energy.
    fn mean_force(&self, constants: &BondConstants, stretch: f64) -> f64;

    /// Derivative of the force by the stretch.
    fn slope(&self, constants: &BondConstants, stretch: f64) -> f64;

    /// The largest slope at the stretches for which the law is meant, at least one: the stable step of explicit motion
    /// follows from it.
    fn steepest(&self, constants: &BondConstants) -> f64;
}

/// Stress in proportion to the strain; in bonds, force in proportion to the stretch.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {}

impl BondLaw for Linear {
    const IS_LINEAR: bool = true;

    #[inline(always)]
    fn force<N: Number>(&self, _: &BondConstants, stretch: N) -> N {
        stretch
    }

    #[inline(always)]
    fn mean_force(&self, _: &BondConstants, stretch: f64) -> f64 {
        0.5 * stretch
    }

    #[inline(always)]
    fn slope(&self, _: &BondConstants, _: f64) -> f64 {
        1.0
    }

    fn steepest(&self, _: &BondConstants) -> f64 {
        1.0
    }
}

/// A law with the constants of a body.
#[derive(Clone, Copy, Debug)]
pub struct BodyLaw<L> {
    law: L,
    constants: BondConstants,
}

impl<L: BondLaw> BodyLaw<L> {
    /// The law with its constants.
    pub const fn new(law: L, constants: BondConstants) -> Self {
        BodyLaw { law, constants }
    }

    /// See [`BondLaw::force`].
    #[inline(always)]
    pub fn force<N: Number>(&self, stretch: N) -> N {
        self.law.force(&self.constants, stretch)
    }

    /// See [`BondLaw::mean_force`].
    #[inline(always)]
    pub fn mean_force(&self, stretch: f64) -> f64 {
        self.law.mean_force(&self.constants, stretch)
    }

    /// See [`BondLaw::slope`].
    #[inline(always)]
    pub fn slope(&self, stretch: f64) -> f64 {
        self.law.slope(&self.constants, stretch)
    }

    /// See [`BondLaw::steepest`].
    pub fn steepest(&self) -> f64 {
        self.law.steepest(&self.constants)
    }
}

/// Forces and energies of the bonds of a formulation by a law.
pub trait BondForce: Copy + Debug + Send + Sync + 'static {
    /// The law of the bonds.
    type Law: BondLaw;
    /// The forces of the same formulation with a linear law, for bodies that flow or whose eigenstrain differs by direction.
    type OfLinear: BondForce;
    /// See [`BondForce::OfLinear`].
    const OF_LINEAR: Self::OfLinear;
    /// Whether the dilatation of points adds a pressure.
    const HAS_PRESSURE: bool;

    /// The law of the bonds with its constants.
    fn law(&self) -> &BodyLaw<Self::Law>;

    /// Force density along the bond (N/m³) of a force of the law, with a factor on the pressure of the ends.
    fn along<N: Number>(
        &self,
        bond: &Bond<N>,
        ends: Ends<'_, INPUTS, N>,
        force: N,
        pressure: f64,
    ) -> N;

    /// Stiffness of the bond in the energy of its point, over its length.
    fn energy_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64;

    /// Stiffness of the bond in the stress conjugate to the eigenstrain of its point, over its length.
    fn conjugate_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64;

    /// Force density along the bond, N/m³.
    #[inline(always)]
    fn tension<N: Number>(&self, bond: &Bond<N>, stretch: N, ends: Ends<'_, INPUTS, N>) -> N {
        let force = self.law().force(elastic_stretch(stretch, ends));
        self.along(bond, ends, force, 1.0)
    }

    /// Mean of [`BondForce::tension`] from no stretch to this one, where `tension` is at its end, N/m³.
    #[inline(always)]
    fn mean_tension(&self, bond: &Bond, stretch: f64, ends: Ends<'_>, tension: f64) -> f64 {
        // known without another evaluation of the bond
        if Self::Law::IS_LINEAR {
            return 0.5 * tension;
        }
        let force = self.law().mean_force(elastic_stretch(stretch, ends));
        self.along(bond, ends, force, 0.5)
    }

    /// Energy density that the bond gives its point at the elastic stretch, J/m³.
    #[inline(always)]
    fn elastic_energy(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        let elastic = elastic_stretch(stretch, ends);
        let of_bond = self.energy_stiffness(bond, ends) * bond.length;
        0.5 * of_bond * self.law().mean_force(elastic) * elastic
    }

    /// Contribution of the bond at its total stretch to the stress conjugate to the eigenstrain of its point, Pa.
    #[inline(always)]
    fn conjugate_stress(&self, bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
        0.5 * self.conjugate_stiffness(bond, ends) * bond.length * self.law().force(stretch)
    }
}

/// Bonds of a bond-based solid, with the mean stiffness and eigenstrain of their ends (Wang (2025), eqs. 7.14, 7.15). The
/// mean of the products at both ends differs by several percent where both change within a horizon, as at a melt pool.
#[derive(Clone, Copy, Debug)]
pub struct Pairs<L>(pub BodyLaw<L>);

/// Bonds of an ordinary state-based solid: the force states of both ends, with the pressure of their dilatation.
#[derive(Clone, Copy, Debug)]
pub struct States<L>(pub BodyLaw<L>);

const LINEAR: BodyLaw<Linear> = BodyLaw::new(Linear {}, [0.0; 4]);

impl<L: BondLaw> BondForce for Pairs<L> {
    type Law = L;
    type OfLinear = Pairs<Linear>;
    const OF_LINEAR: Pairs<Linear> = Pairs(LINEAR);
    const HAS_PRESSURE: bool = false;

    #[inline(always)]
    fn law(&self) -> &BodyLaw<L> {
        &self.0
    }

    #[inline(always)]
    fn along<N: Number>(&self, bond: &Bond<N>, ends: Ends<'_, INPUTS, N>, force: N, _: f64) -> N {
        bond.mean() * ends.mean(STIFFNESS) * force
    }

    /// Both ends have the mean weight together; at layers the own weight is that of the energy of the forces.
    #[inline(always)]
    fn energy_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64 {
        bond.weight * ends.mean(STIFFNESS)
    }

    #[inline(always)]
    fn conjugate_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64 {
        ends.mean(STIFFNESS) * bond.mean()
    }
}

impl<L: BondLaw> BondForce for States<L> {
    type Law = L;
    type OfLinear = States<Linear>;
    const OF_LINEAR: States<Linear> = States(LINEAR);
    const HAS_PRESSURE: bool = true;

    #[inline(always)]
    fn law(&self) -> &BodyLaw<L> {
        &self.0
    }

    #[inline(always)]
    fn along<N: Number>(
        &self,
        bond: &Bond<N>,
        ends: Ends<'_, INPUTS, N>,
        force: N,
        pressure: f64,
    ) -> N {
        // computed once if the stiffness is the same at both ends
        let end = |stiffness: N| stiffness * 0.5 * force;
        let tension =
            bond.weight * end(ends.own[STIFFNESS]) + bond.dual * end(ends.other[STIFFNESS]);
        let of_ends = bond.weight * ends.own[PRESSURE] + bond.dual * ends.other[PRESSURE];
        tension + of_ends * pressure * bond.inverse_length
    }

    #[inline(always)]
    fn energy_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64 {
        bond.weight * ends.own[STIFFNESS]
    }

    #[inline(always)]
    fn conjugate_stiffness(&self, bond: &Bond, ends: Ends<'_>) -> f64 {
        self.energy_stiffness(bond, ends)
    }
}
