//! Energy of the bonds and the stress that they carry.

use perimelt_core::{Bond, BondKernel};

use super::{BondForce, Ends, INPUTS, PRESSURE, STIFFNESS, dyad, elastic_stretch, stretched};

/// Energy density `c/2 sum_j w |xi| phi(s)` (J/m³) of the bonds of a point at their total stretch, and the stress
/// `c/2 sum_j w |xi| f(s)` conjugate to the eigenstrain (Pa), with the force f of the law and its integral phi; the stress of a
/// bond-based solid with the mean c of both ends.
pub struct Energy<const FINITE: bool, L>(pub L);

/// Peridynamic stress `sum_j T_ij (x) xi` (Pa) as xx, yy, zz, xy, yz, zx (S1 of docs/theory/stress.md): the
/// momentum that the point's own bonds carry; or half of that of both ends, `1/2 sum_j (T_ij - T_ji) (x) xi` (S2).
pub struct Stress<const FINITE: bool, L> {
    /// The forces of the bonds.
    pub law: L,
    /// S2, which is more accurate where horizons change. The sums of S1 and S2 over a body are equal.
    pub symmetric: bool,
}

impl<const FINITE: bool, L: BondForce> BondKernel<INPUTS, 2> for Energy<FINITE, L> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _, _>(bond, ends).stretch();
        let mean = self.0.law().mean_force(stretch);
        let density = 0.5 * own[STIFFNESS] * bond.weight * bond.length * mean * stretch;
        [density, self.0.conjugate_stress(bond, stretch, ends)]
    }
}

/// Energy density `c/2 sum_j w |xi| phi(s - e)` (J/m³) of the bonds of a point at their elastic stretch, and zero; in a
/// bond-based solid with the means of c and w of both ends.
pub struct ElasticEnergy<const FINITE: bool, L>(pub L);

/// The stress of [`Energy`] as a tensor, `c/2 sum_j w |xi| f(s) n (x) n` with the undeformed directions n, as xx, yy, zz, xy, yz,
/// zx.
pub struct ConjugateStress<const FINITE: bool, L>(pub L);

impl<const FINITE: bool, L: BondForce> BondKernel<INPUTS, 6> for ConjugateStress<FINITE, L> {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _, _>(bond, ends).stretch();
        let stress = self.0.conjugate_stress(bond, stretch, ends);
        dyad(stress, &bond.xi.map(|xi| xi / bond.length))
    }
}

impl<const FINITE: bool, L: BondForce> BondKernel<INPUTS, 2> for ElasticEnergy<FINITE, L> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _, _>(bond, ends).stretch();
        [self.0.elastic_energy(bond, stretch, ends), 0.0]
    }
}

impl<const FINITE: bool, L: BondForce> BondKernel<INPUTS, 6> for Stress<FINITE, L> {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let change = stretched::<FINITE, 3, _, _>(bond, Ends::new(&own, &other));
        let elastic = elastic_stretch(change.stretch(), Ends::new(&own, &other));
        let force = self.law.law().force(elastic);
        let carried = |weight: f64, point: &[f64; INPUTS]| {
            weight * (0.5 * point[STIFFNESS] * force * bond.length + point[PRESSURE])
        };
        // a branch would keep the compiler from computing points side by side
        let [of_own, of_other] = if self.symmetric { [0.5; 2] } else { [1.0, 0.0] };
        let tension = of_own * carried(bond.weight, &own) + of_other * carried(bond.dual, &other);
        dyad(tension, &change.vector(1.0))
    }
}
