//! Kernels of the sums over the bonds.

use perimelt_core::{Bond, BondKernel};

/// Where the inputs of the kernels begin: pressure, density, coordinates of mirror points, acceleration by forces, velocity before
/// the pressure acts, velocity that is carried; and how many each kernel has.
pub(super) struct Inputs<const D: usize>;

impl<const D: usize> Inputs<D> {
    pub(super) const PRESSURE: usize = 0;
    pub(super) const DENSITY: usize = 1;
    pub(super) const PLACE: usize = 2;
    pub(super) const ACCELERATION: usize = Self::PLACE + D;
    pub(super) const PREDICTED: usize = Self::ACCELERATION + D;
    pub(super) const CARRIED: usize = Self::PREDICTED + D;
    pub(super) const PUSH: usize = Self::PREDICTED;
    pub(super) const VOLUME: usize = Self::CARRIED;
    pub(super) const CARRY: usize = Self::CARRIED + D;
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
    let specific = 2.0 / (own[density] + other[density]);
    0.5 * work - specific * (other[pressure] - own[pressure])
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
        bond.weight * self.inverse * along
    }
}

impl<const D: usize, const I: usize> BondKernel<I, 1> for Volume<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        [self.flux(bond, &own, &other)]
    }
}

/// `sum_j N_ij (v_j - v_i)/2`.
pub(super) struct Carry<const D: usize>(pub(super) Volume<D>);

impl<const D: usize, const I: usize> BondKernel<I, D> for Carry<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let density = Inputs::<D>::DENSITY;
        let mass = 0.5 * (own[density] + other[density]) * self.0.flux(bond, &own, &other);
        let mut sums = [0.0; D];
        for (a, sum) in sums.iter_mut().enumerate() {
            let v = Inputs::<D>::CARRIED + a;
            *sum = 0.5 * mass * (other[v] - own[v]);
        }
        sums
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
        let part = bond.weight * self.inverse * push::<D, I>(&own, &other);
        let mut sums = [0.0; D];
        for (sum, xi) in sums.iter_mut().zip(bond.xi) {
            *sum = part * xi;
        }
        sums
    }
}

/// `sum_j 2 b beta_ij (q_i - q_j)`, from q and the density.
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
