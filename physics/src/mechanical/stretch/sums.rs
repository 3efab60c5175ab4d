//! Sums over a family that the dilatation and the bounds of frequencies need.

use perimelt_core::{Bond, BondKernel};

use super::{INPUTS, dyad, stretched, stretched_by};

/// `sum_j w s`.
pub struct Dilation<const FINITE: bool>;

/// The contributions of the axes to [`Dilation`].
pub struct Expansion<const FINITE: bool>;

/// `sum_j w`.
pub struct TotalWeight;

/// `sum_j w n (x) n` as xx, yy, zz, xy, yz, zx.
pub struct Directions;

/// `sum_j w / |xi|`.
pub struct WeightOverLength;

impl<const FINITE: bool> BondKernel<3, 1> for Dilation<FINITE> {
    const PAIRED: usize = if FINITE { 1 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [[f64; 1]; 2] {
        let stretch = stretched::<FINITE, 3, _>(bond, (&own, &other)).stretch();
        [[bond.weight * stretch], [bond.dual * stretch]]
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; 3],
        other: [f64; 3],
        [[here], [there]]: [&mut [f64; 1]; 2],
    ) {
        let change = stretched_by::<FINITE, true, 3, _>(bond, (&own, &other));
        let stretch = change.stretch_by::<true>();
        *here = bond.weight.mul_add(stretch, *here);
        *there = bond.dual.mul_add(stretch, *there);
    }
}

impl<const FINITE: bool> BondKernel<3, 3> for Expansion<FINITE> {
    const PAIRED: usize = if FINITE { 3 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 3] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [[f64; 3]; 2] {
        let parts = stretched::<FINITE, 3, _>(bond, (&own, &other)).parts();
        [
            std::array::from_fn(|a| bond.weight * parts[a]),
            std::array::from_fn(|a| bond.dual * parts[a]),
        ]
    }
}

impl BondKernel<0, 1> for TotalWeight {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
        [bond.weight]
    }
}

impl BondKernel<INPUTS, 6> for Directions {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; INPUTS], _: [f64; INPUTS]) -> [f64; 6] {
        dyad(bond.weight, &bond.xi.map(|xi| xi / bond.length))
    }
}

impl BondKernel<INPUTS, 1> for WeightOverLength {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; INPUTS], _: [f64; INPUTS]) -> [f64; 1] {
        [bond.weight / bond.length]
    }
}
