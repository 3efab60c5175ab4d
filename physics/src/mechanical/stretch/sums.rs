//! Sums over a family that the dilatation and the bounds of frequencies need.

use perimelt_core::{Bond, BondKernel};

use super::{EIGENSTRAIN, Ends, INPUTS, dyad, elastic_stretch, stretched, stretched_by};
use crate::mechanical::base::{Bonds, SolidBase};
use crate::mechanical::specialise::specialise;

/// `sum_j w s`.
pub struct Dilation<const FINITE: bool>;

/// `sum_j w (s - e)` with the eigenstrain e of bonds.
pub struct ElasticDilation<const FINITE: bool>;

/// The contributions of the axes to [`Dilation`], and zero.
pub struct Expansion<const FINITE: bool>;

/// The contributions of the axes to [`Dilation`], and `sum_j w e`.
pub struct ElasticExpansion<const FINITE: bool>;

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
        let stretch = stretched::<FINITE, 3, _, _>(bond, Ends::new(&own, &other)).stretch();
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
        let change = stretched_by::<FINITE, true, 3, _, _>(bond, Ends::new(&own, &other));
        let stretch = change.stretch_by::<true>();
        *here = bond.weight.mul_add(stretch, *here);
        *there = bond.dual.mul_add(stretch, *there);
    }
}

impl<const FINITE: bool> BondKernel<INPUTS, 1> for ElasticDilation<FINITE> {
    const PAIRED: usize = if FINITE { 1 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 1] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [[f64; 1]; 2] {
        let ends = Ends::new(&own, &other);
        let elastic = elastic_stretch(stretched::<FINITE, 3, _, _>(bond, ends).stretch(), ends);
        [[bond.weight * elastic], [bond.dual * elastic]]
    }
}

impl<const FINITE: bool> BondKernel<3, 4> for Expansion<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 4] {
        let [x, y, z] = stretched::<FINITE, 3, _, _>(bond, Ends::new(&own, &other)).parts();
        [x, y, z, 0.0].map(|part| bond.weight * part)
    }
}

impl<const FINITE: bool> BondKernel<INPUTS, 4> for ElasticExpansion<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 4] {
        let [x, y, z] = stretched::<FINITE, 3, _, _>(bond, Ends::new(&own, &other)).parts();
        let eigenstrain = 0.5 * (own[EIGENSTRAIN] + other[EIGENSTRAIN]);
        [x, y, z, eigenstrain].map(|part| bond.weight * part)
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

/// Sum of what the stretches of bonds exceed a limit by, in either direction.
struct Overstretch<const FINITE: bool>(f64);

impl<const FINITE: bool> BondKernel<3, 1> for Overstretch<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let stretch = stretched::<FINITE, 3, _, _>(bond, Ends::new(&own, &other)).stretch();
        [(stretch.abs() - self.0).max(0.0)]
    }
}

/// The point of which unbroken bonds exceed a stretch the most, in finite or linear kinematics; `None` if no bond does.
pub(in crate::mechanical) fn find_overstretched(
    base: &SolidBase,
    displacement: [&[f64]; 3],
    limit: f64,
) -> Option<usize> {
    let Bonds { family, broken } = base.bonds();
    let finite = base.is_finite();
    let mut sums = vec![[0.0]; family.points()];
    specialise!(FINITE = finite =>
        family.sum_unbroken(&Overstretch::<FINITE>(limit), displacement, broken, &mut sums));
    let beyond = sums.iter().enumerate().filter(|(_, sum)| sum[0] > 0.0);
    let most = beyond.max_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    most.map(|(point, _)| point)
}

/// Sum of what the displacements of the ends of bonds relative to each other, over their length, exceed a limit by.
struct Displaced(f64);

impl Displaced {
    #[inline(always)]
    fn relative(bond: &Bond, own: [f64; 3], other: [f64; 3]) -> f64 {
        let square = (0..3).fold(0.0, |sum, a| sum + (other[a] - own[a]).powi(2));
        square.sqrt() * bond.inverse_length
    }
}

impl BondKernel<3, 1> for Displaced {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        [(Self::relative(bond, own, other) - self.0).max(0.0)]
    }
}

/// Largest displacement of the ends of an unbroken bond relative to each other, over its length; `None` if it is not
/// beyond a limit.
pub(in crate::mechanical) fn relative_displacement_beyond(
    bonds: Bonds<'_>,
    displacement: [&[f64]; 3],
    limit: f64,
) -> Option<f64> {
    let Bonds { family, broken } = bonds;
    let mut sums = vec![[0.0]; family.points()];
    family.sum_unbroken(&Displaced(limit), displacement, broken, &mut sums);
    let at = |slot: usize| displacement.map(|axis| axis[slot]);
    let beyond = sums.iter().enumerate().filter(|(_, sum)| sum[0] > 0.0);
    let largest = beyond.map(|(point, _)| {
        let own = at(family.slot_of(point));
        let mut largest = 0.0f64;
        family.for_each_bond(point, |number, bond, slot| {
            if broken.is_none_or(|b| !b.is_broken(point, number)) {
                largest = largest.max(Displaced::relative(bond, own, at(slot)));
            }
        });
        largest
    });
    largest.reduce(f64::max)
}
