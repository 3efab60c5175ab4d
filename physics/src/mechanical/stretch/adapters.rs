//! Kernels with fewer inputs, or more, than those of an elastic solid whose points all differ.

use perimelt_core::{Bond, BondKernel};

use super::{EIGENSTRAIN, INPUTS};

/// A kernel of which all inputs but the first are the same for all points.
pub struct Uniform<'a, K>(pub &'a K, pub [f64; INPUTS]);

/// A kernel with a strain that differs by direction besides the eigenstrain, such as an inelastic one: inputs from [`INPUTS`] on
/// are its components xx, yy, zz, xy, yz, zx. A bond has its part `n . E n` along the undeformed bond.
pub struct WithStrain<K>(pub K);

/// Inputs of [`WithStrain`] kernels.
pub const STRAIN_INPUTS: usize = INPUTS + 6;

impl<K, const I: usize, const O: usize> BondKernel<I, O> for Uniform<'_, K>
where
    K: BondKernel<INPUTS, O>,
{
    const RARE: bool = K::RARE;
    const PAIRED: usize = K::PAIRED;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        self.0.bond(bond, self.all(own), self.all(other))
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; O]; 2] {
        self.0.ends(bond, self.all(own), self.all(other))
    }

    #[inline(always)]
    fn add_ends(&self, bond: &Bond, own: [f64; I], other: [f64; I], sums: [&mut [f64; O]; 2]) {
        self.0.add_ends(bond, self.all(own), self.all(other), sums);
    }
}

impl<K> Uniform<'_, K> {
    #[inline(always)]
    fn all<const I: usize>(&self, first: [f64; I]) -> [f64; INPUTS] {
        std::array::from_fn(|i| if i < I { first[i] } else { self.1[i] })
    }
}

impl<K: BondKernel<INPUTS, O>, const O: usize> BondKernel<STRAIN_INPUTS, O> for WithStrain<K> {
    const RARE: bool = K::RARE;
    const PAIRED: usize = K::PAIRED;

    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; STRAIN_INPUTS],
        other: [f64; STRAIN_INPUTS],
    ) -> [f64; O] {
        let [own, other] = strained(bond, [own, other]);
        self.0.bond(bond, own, other)
    }

    #[inline(always)]
    fn ends(
        &self,
        bond: &Bond,
        own: [f64; STRAIN_INPUTS],
        other: [f64; STRAIN_INPUTS],
    ) -> [[f64; O]; 2] {
        let [own, other] = strained(bond, [own, other]);
        self.0.ends(bond, own, other)
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; STRAIN_INPUTS],
        other: [f64; STRAIN_INPUTS],
        sums: [&mut [f64; O]; 2],
    ) {
        let [own, other] = strained(bond, [own, other]);
        self.0.add_ends(bond, own, other, sums);
    }
}

/// Inputs of both ends, with their strain along the bond added to the eigenstrain.
#[inline(always)]
fn strained(bond: &Bond, ends: [[f64; STRAIN_INPUTS]; 2]) -> [[f64; INPUTS]; 2] {
    let [x, y, z] = bond.xi.map(|xi| xi / bond.length);
    let along = [x * x, y * y, z * z, 2.0 * x * y, 2.0 * y * z, 2.0 * z * x];
    ends.map(|inputs| {
        let mut end = std::array::from_fn(|i| inputs[i]);
        for (n, e) in along.iter().zip(&inputs[INPUTS..]) {
            end[EIGENSTRAIN] += n * e;
        }
        end
    })
}
