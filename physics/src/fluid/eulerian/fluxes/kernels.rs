//! Kernels of the sums over the bonds.

use perimelt_core::{Bond, BondKernel};

use crate::fluid::viscosity::of_bond;
use crate::shape_tensor::{COMPONENTS, components, is_diagonal};

/// Where the inputs of [`Outflow`] and [`Carry`] begin: the flux of mass `m + D s`, density, velocity; and how many each has.
pub(super) struct FlowInputs<const D: usize>;

impl<const D: usize> FlowInputs<D> {
    pub(super) const DENSITY: usize = D;
    pub(super) const VELOCITY: usize = Self::DENSITY + 1;
    pub(super) const OUTFLOW: usize = Self::VELOCITY;
    pub(super) const CARRY: usize = Self::VELOCITY + D;
}

/// Where the inputs of [`Viscosity`] and [`MappedViscosity`] begin: velocity, viscosity, tensor Q; and how many each has.
pub(crate) struct ViscosityInputs<const D: usize>;

impl<const D: usize> ViscosityInputs<D> {
    pub(crate) const VISCOSITY: usize = D;
    pub(crate) const STRETCH: usize = Self::VISCOSITY + 1;
    pub(in crate::fluid::eulerian) const PLAIN: usize = Self::STRETCH;
    pub(super) const MAPPED: usize = Self::STRETCH + components(D);
}

/// Where the sums of [`Viscosity`] begin: force, work.
pub(in crate::fluid::eulerian) struct ViscositySums<const D: usize>;

impl<const D: usize> ViscositySums<D> {
    pub(in crate::fluid::eulerian) const WORK: usize = D;
    pub(in crate::fluid::eulerian) const COUNT: usize = Self::WORK + 1;
}

/// `sum_j N_ij`, from `m + D s` and density.
pub(super) struct Outflow {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
    /// `2 D`, m²/s.
    pub(super) diffusion: f64,
}

impl Outflow {
    #[inline(always)]
    fn flux<const D: usize, const I: usize>(
        &self,
        bond: &Bond,
        own: &[f64; I],
        other: &[f64; I],
    ) -> f64 {
        let density = FlowInputs::<D>::DENSITY;
        let carried: f64 = (0..D).map(|a| (own[a] + other[a]) * bond.xi[a]).sum();
        bond.weight * self.inverse * (carried - self.diffusion * (other[density] - own[density]))
    }
}

/// The kernel in this number of dimensions.
pub(super) struct In<const D: usize, K>(pub(super) K);

impl<const D: usize, const I: usize> BondKernel<I, 1> for In<D, Outflow> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        [self.0.flux::<D, I>(bond, &own, &other)]
    }
}

/// `sum_j N_ij (v_i + v_j)/2`, from `m + D s`, density and velocity.
pub(super) struct Carry(pub(super) Outflow);

impl<const D: usize, const I: usize> BondKernel<I, D> for In<D, Carry> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let half = 0.5 * self.0.0.flux::<D, I>(bond, &own, &other);
        let velocity = FlowInputs::<D>::VELOCITY;
        std::array::from_fn(|a| half * (own[velocity + a] + other[velocity + a]))
    }
}

/// Force and work of viscosity, from velocity and viscosity; for the viscosity of bonds see [`of_bond`].
pub(in crate::fluid::eulerian) struct Viscosity<const D: usize, const IN_SERIES: bool> {
    /// `2 / a`, 1/m.
    pub(in crate::fluid::eulerian) laplacian: f64,
}

impl<const D: usize, const I: usize, const O: usize, const IN_SERIES: bool> BondKernel<I, O>
    for Viscosity<D, IN_SERIES>
{
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let viscosity = ViscosityInputs::<D>::VISCOSITY;
        let viscosity = of_bond::<IN_SERIES>(own[viscosity], other[viscosity]);
        let viscous = bond.weight * self.laplacian * viscosity;
        let mut sums = [0.0; O];
        for a in 0..D {
            let difference = other[a] - own[a];
            sums[a] = viscous * difference;
            // each end gets half of the work of the pair
            sums[ViscositySums::<D>::WORK] += 0.5 * sums[a] * difference;
        }
        sums
    }
}

/// `-sum_j w/a (p_i + p_j) xi`, from the pressure.
pub(super) struct Push {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

impl<const D: usize> BondKernel<1, D> for Push {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; D] {
        let part = -bond.weight * self.inverse * (own[0] + other[0]);
        std::array::from_fn(|a| part * bond.xi[a])
    }
}

/// [`Viscosity`] with the tensor of a mapping ([`crate::fluid::eulerian::point_motion`]): from velocity, viscosity and the tensor Q, by which the
/// weight of a bond along n is `w (1 + n . Q n)`.
pub(super) struct MappedViscosity<const D: usize> {
    /// `2 / a`, 1/m.
    pub(super) laplacian: f64,
}

impl<const D: usize, const I: usize, const O: usize> BondKernel<I, O> for MappedViscosity<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let mut stretch = 0.0;
        for (n, &(a, b)) in COMPONENTS[..components(D)].iter().enumerate() {
            let times = if is_diagonal(n) { 0.5 } else { 1.0 };
            let q = ViscosityInputs::<D>::STRETCH + n;
            let mean = times * (own[q] + other[q]);
            stretch += mean * bond.xi[a] * bond.xi[b];
        }
        let factor = 1.0 + stretch * bond.inverse_length * bond.inverse_length;
        let viscosity = Viscosity::<D, false> {
            laplacian: self.laplacian * factor,
        };
        viscosity.bond(bond, own, other)
    }
}

/// `-sum_j w/a (C_i p_i + C_j p_j) xi`, from the rows of C times the pressure.
pub(super) struct MappedPush {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

impl<const D: usize, const I: usize> BondKernel<I, D> for MappedPush {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let weight = -bond.weight * self.inverse;
        std::array::from_fn(|a| {
            let along = |b: usize| (own[a * D + b] + other[a * D + b]) * bond.xi[b];
            weight * (0..D).map(along).sum::<f64>()
        })
    }
}
