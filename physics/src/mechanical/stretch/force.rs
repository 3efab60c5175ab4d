//! Forces of the bonds and their linear part.

use perimelt_core::{Bond, BondKernel};

use super::{BondLaw, EIGENSTRAIN, Ends, INPUTS, STIFFNESS, dyad, stretched, stretched_by};

/// Force density of the bonds, N/m³.
pub struct Force<const FINITE: bool, L>(pub L);

impl<const FINITE: bool, L: BondLaw, const D: usize> BondKernel<INPUTS, D> for Force<FINITE, L> {
    const PAIRED: usize = if FINITE { D } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let ends = Ends::new(&own, &other);
        let change = stretched::<FINITE, D, _>(bond, ends);
        change.vector(self.0.tension(bond, change.stretch(), ends))
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; INPUTS],
        other: [f64; INPUTS],
        sums: [&mut [f64; D]; 2],
    ) {
        let ends = Ends::new(&own, &other);
        let change = stretched_by::<FINITE, true, D, _>(bond, ends);
        change.add_pull(
            self.0.tension(bond, change.stretch_by::<true>(), ends),
            sums,
        );
    }
}

/// Stiffness times displacement, N/m³: the linear part of minus [`Force`], with the pressure that the
/// displacement makes.
pub struct Stiffness<L>(pub L);

impl<L: BondLaw, const D: usize> BondKernel<INPUTS, D> for Stiffness<L> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, mut own: [f64; INPUTS], mut other: [f64; INPUTS]) -> [f64; D] {
        own[EIGENSTRAIN] = 0.0;
        other[EIGENSTRAIN] = 0.0;
        Force::<false, L>(self.0)
            .bond(bond, own, other)
            .map(|f: f64| -f)
    }
}

/// Contribution of the bonds to the diagonal block of the stiffness, `sum_j (c_i w_ij + c_j w_ji) /
/// (2 |xi|) n n^T`, as xx, yy, zz, xy, yz, zx, N/m⁵.
pub struct Block;

impl BondKernel<INPUTS, 6> for Block {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let ends = own[STIFFNESS] * bond.weight + other[STIFFNESS] * bond.dual;
        dyad(
            0.5 * ends / bond.length,
            &bond.xi.map(|xi| xi / bond.length),
        )
    }
}
