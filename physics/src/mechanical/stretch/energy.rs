//! Energy of the bonds and the stress that they carry.

use perimelt_core::{Bond, BondKernel};

use super::{
    BondLaw, BondLaws, Ends, INPUTS, PRESSURE, STIFFNESS, dyad, elastic_stretch, stretched,
    stretched_in,
};

/// Energy density `c/4 sum_j w |xi| s^2` (J/m³) of the bonds of a point at their total stretch, and the stress
/// `c/2 sum_j w |xi| s` conjugate to the eigenstrain (Pa); in a bond-based solid with the mean c of both ends.
pub struct Energy<const FINITE: bool> {
    /// The law of the bonds.
    pub law: BondLaws,
}

/// Peridynamic stress `sum_j T_ij (x) xi` (Pa) as xx, yy, zz, xy, yz, zx (S1 of docs/theory/stress.md): the
/// momentum that the point's own bonds carry; or half of that of both ends, `1/2 sum_j (T_ij - T_ji) (x) xi` (S2).
pub struct Stress {
    /// Finite kinematics.
    pub finite: bool,
    /// S2, which is more accurate where horizons change. The sums of S1 and S2 over a body are equal.
    pub symmetric: bool,
}

impl<const FINITE: bool> BondKernel<INPUTS, 2> for Energy<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _>(bond, ends).stretch();
        let density = 0.25 * own[STIFFNESS] * bond.weight * bond.length * stretch * stretch;
        [density, self.law.conjugate_stress(bond, stretch, ends)]
    }
}

/// Energy density `c/4 sum_j w |xi| (s - e)^2` (J/m³) of the bonds of a point at their elastic stretch, and zero; in a
/// bond-based solid with the means of c and w of both ends.
pub struct ElasticEnergy<const FINITE: bool> {
    /// The law of the bonds.
    pub law: BondLaws,
}

impl<const FINITE: bool> BondKernel<INPUTS, 2> for ElasticEnergy<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _>(bond, ends).stretch();
        [self.law.elastic_energy(bond, stretch, ends), 0.0]
    }
}

impl BondKernel<INPUTS, 6> for Stress {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let change = stretched_in(self.finite, bond, Ends::new(&own, &other));
        let elastic = elastic_stretch(change.stretch(), Ends::new(&own, &other));
        let carried = |weight: f64, point: &[f64; INPUTS]| {
            weight * (0.5 * point[STIFFNESS] * elastic * bond.length + point[PRESSURE])
        };
        let tension = match self.symmetric {
            true => 0.5 * (carried(bond.weight, &own) + carried(bond.dual, &other)),
            false => carried(bond.weight, &own),
        };
        dyad(tension, &change.vector(1.0))
    }
}
