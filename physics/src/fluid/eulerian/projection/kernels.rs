//! Kernels of the sums over the bonds.

use perimelt_core::{Bond, BondKernel};

use crate::fluid::viscosity::of_bond;

/// Where the inputs of the kernels begin: pressure, density, coordinates of mirror points, acceleration by forces, surface tension
/// times curvature, the step H between two fluids, whether the point is open, velocity before the pressure acts, velocity that is carried, fraction of the
/// first fluid and what keeps its layer thin; and how many each kernel has.
pub(super) struct Inputs<const D: usize>;

impl<const D: usize> Inputs<D> {
    pub(super) const PRESSURE: usize = 0;
    pub(super) const DENSITY: usize = 1;
    pub(super) const PLACE: usize = 2;
    pub(super) const ACCELERATION: usize = Self::PLACE + D;
    pub(super) const TENSION: usize = Self::ACCELERATION + D;
    pub(super) const STEP: usize = Self::TENSION + 1;
    pub(super) const OPEN: usize = Self::STEP + 1;
    pub(super) const PREDICTED: usize = Self::OPEN + 1;
    pub(super) const CARRIED: usize = Self::PREDICTED + D;
    pub(super) const PUSH: usize = Self::PREDICTED;
    pub(super) const VOLUME: usize = Self::CARRIED;
    pub(super) const FRACTION: usize = Self::CARRIED + D;
    pub(super) const COMPRESSION: usize = Self::FRACTION + 1;
    pub(super) const CARRY: usize = Self::COMPRESSION + D;
}

/// 1 for a bond between points where something flows, 0 for others.
#[inline(always)]
fn open<const D: usize, const I: usize>(own: &[f64; I], other: &[f64; I]) -> f64 {
    own[Inputs::<D>::OPEN] * other[Inputs::<D>::OPEN]
}

/// `beta_ij [G_ij - (p_j - p_i)]`, m²/s².
#[inline(always)]
fn push<const D: usize, const I: usize>(own: &[f64; I], other: &[f64; I]) -> f64 {
    let (pressure, density) = (Inputs::<D>::PRESSURE, Inputs::<D>::DENSITY);
    let (place, acceleration) = (Inputs::<D>::PLACE, Inputs::<D>::ACCELERATION);
    let mut work = 0.0;
    for a in 0..D {
        let way = other[place + a] - own[place + a];
        work += (own[acceleration + a] + other[acceleration + a]) * way;
    }
    let (tension, step) = (Inputs::<D>::TENSION, Inputs::<D>::STEP);
    let capillary = 0.5 * (own[tension] + other[tension]) * (other[step] - own[step]);
    let specific = 2.0 / (own[density] + other[density]);
    0.5 * work + specific * (capillary - (other[pressure] - own[pressure]))
}

/// `U_ij`, the flux of volume along a bond.
pub(super) struct Volume<const D: usize> {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
    /// `2 dt`, s.
    pub(super) twice: f64,
}

impl<const D: usize> Volume<D> {
    #[inline(always)]
    fn flux<const I: usize>(&self, bond: &Bond, own: &[f64; I], other: &[f64; I]) -> f64 {
        let mut along = self.twice * push::<D, I>(own, other);
        for a in 0..D {
            let v = Inputs::<D>::PREDICTED + a;
            along += (own[v] + other[v]) * bond.xi[a];
        }
        open::<D, I>(own, other) * bond.weight * self.inverse * along
    }
}

impl<const D: usize, const I: usize> BondKernel<I, 1> for Volume<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        [self.flux(bond, &own, &other)]
    }
}

/// How the layer between two fluids is kept thin; nothing where there is one fluid.
#[derive(Clone, Copy, Default)]
pub(super) struct Layer {
    /// Gamma, m/s.
    pub(super) mobility: f64,
    /// `2 eps`, m.
    pub(super) width: f64,
    /// `rho_1 - rho_2`, kg/m³.
    pub(super) jump: f64,
}

/// `sum_j N_ij (v_j - v_i)/2` and `sum_j C_ij`.
pub(super) struct Carry<const D: usize> {
    pub(super) volume: Volume<D>,
    pub(super) layer: Layer,
}

/// Fluxes along a bond.
pub(super) struct Fluxes {
    /// `U_ij / 2`, 1/s.
    pub(super) half_volume: f64,
    /// What keeps the layer between two fluids thin, 1/s.
    thinning: f64,
    /// `C_ij`, 1/s.
    pub(super) first: f64,
}

impl<const D: usize> Carry<D> {
    #[inline(always)]
    pub(super) fn fluxes<const I: usize>(
        &self,
        bond: &Bond,
        own: &[f64; I],
        other: &[f64; I],
    ) -> Fluxes {
        let fraction = Inputs::<D>::FRACTION;
        let mut thinning = self.layer.width * (other[fraction] - own[fraction]);
        for a in 0..D {
            let q = Inputs::<D>::COMPRESSION + a;
            thinning -= bond.xi[a] * (own[q] + other[q]);
        }
        thinning *= open::<D, I>(own, other) * self.layer.mobility * bond.weight;
        thinning *= self.volume.inverse;
        let half_volume = 0.5 * self.volume.flux(bond, own, other);
        Fluxes {
            half_volume,
            thinning,
            first: half_volume * (own[fraction] + other[fraction]) - thinning,
        }
    }
}

impl<const D: usize, const I: usize, const O: usize> BondKernel<I, O> for Carry<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let density = Inputs::<D>::DENSITY;
        let fluxes = self.fluxes(bond, &own, &other);
        let mean_mass = fluxes.half_volume * (own[density] + other[density]);
        let mass = mean_mass - self.layer.jump * fluxes.thinning;
        let mut sums = [0.0; O];
        for (a, sum) in sums.iter_mut().enumerate().take(D) {
            let v = Inputs::<D>::CARRIED + a;
            *sum = 0.5 * mass * (other[v] - own[v]);
        }
        sums[D] = fluxes.first;
        sums
    }
}

/// Viscosity of a point that has frozen, Pa s: so large that the mean of halves in series is twice that of the other end.
pub(super) const RIGID: f64 = 1e150;

/// Where the sums of [`JumpingViscosity`] begin: force, work, gradient of the velocity by rows, gradient of the viscosity.
pub(super) struct JumpSums<const D: usize>;

impl<const D: usize> JumpSums<D> {
    pub(super) const SLOPES: usize = D + 1;
    pub(super) const RISE: usize = Self::SLOPES + D * D;
    pub(super) const COUNT: usize = Self::RISE + D;
}

/// Force and work of viscosity in series, and the gradients of velocity and viscosity, from velocity and viscosity.
pub(super) struct JumpingViscosity {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

impl JumpingViscosity {
    #[inline(always)]
    fn sums<const D: usize, const I: usize, const O: usize>(
        &self,
        bond: &Bond,
        own: [f64; I],
        other: [f64; I],
    ) -> [f64; O] {
        let weight = bond.weight * self.inverse;
        let (is_rigid, beside_rigid) = (own[D] == RIGID, other[D] == RIGID);
        // with a rigid end it is twice the viscosity of the other one: the fluid rests half way between both
        let of_bond = of_bond::<true>(own[D], other[D]);
        let viscous = 2.0
            * weight
            * if is_rigid && beside_rigid {
                0.0
            } else {
                of_bond
            };
        let rise = if is_rigid || beside_rigid {
            0.0
        } else {
            other[D] - own[D]
        };
        let mut sums = [0.0; O];
        for a in 0..D {
            let difference = other[a] - own[a];
            sums[a] = viscous * difference;
            // each end gets half of the work of the pair
            sums[D] += 0.5 * sums[a] * difference;
            let along = weight * bond.xi[a];
            sums[JumpSums::<D>::RISE + a] = along * rise;
            for b in 0..D {
                sums[JumpSums::<D>::SLOPES + D * a + b] = along * (other[b] - own[b]);
            }
        }
        sums
    }
}

impl BondKernel<3, { JumpSums::<2>::COUNT }> for JumpingViscosity {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; JumpSums::<2>::COUNT] {
        self.sums::<2, 3, { JumpSums::<2>::COUNT }>(bond, own, other)
    }
}

impl BondKernel<4, { JumpSums::<3>::COUNT }> for JumpingViscosity {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 4], other: [f64; 4]) -> [f64; JumpSums::<3>::COUNT] {
        self.sums::<3, 4, { JumpSums::<3>::COUNT }>(bond, own, other)
    }
}

/// `sum_j b xi beta_ij [G_ij - (p_j - p_i)]`.
pub(super) struct Push {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

impl<const D: usize, const I: usize> BondKernel<I, D> for Push {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let part = open::<D, I>(&own, &other) * bond.weight * self.inverse;
        let part = part * push::<D, I>(&own, &other);
        let mut sums = [0.0; D];
        for (sum, xi) in sums.iter_mut().zip(bond.xi) {
            *sum = part * xi;
        }
        sums
    }
}

/// `sum_j 2 b beta_ij (q_i - q_j)`, from q and the density, which is infinite where nothing flows.
pub(super) struct Spread {
    /// `2 / a`, 1/m.
    pub(super) laplacian: f64,
}

impl BondKernel<2, 1> for Spread {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let specific = 2.0 / (own[1] + other[1]);
        [bond.weight * self.laplacian * specific * (own[0] - other[0])]
    }
}

/// `sum_j 2 b beta_ij`, from the density.
pub(super) struct Diagonal {
    /// `2 / a`, 1/m.
    pub(super) laplacian: f64,
}

impl BondKernel<1, 1> for Diagonal {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; 1] {
        [bond.weight * self.laplacian * 2.0 / (own[0] + other[0])]
    }
}
