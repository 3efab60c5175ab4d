//! Loads of the bonds of a laminate over their limits.

use perimelt_core::{Bond, BondKernel};

use super::kernels::{Crossing, PRESSURE, elastic};
use crate::plies::{is_along, plane_direction};

/// Load of bonds over their limits.
pub(super) trait BondLoad<const I: usize>: Sync {
    /// That of a bond with inputs at both ends.
    fn ratio(&self, bond: &Bond, own: &[f64; I], other: &[f64; I]) -> f64;
}

/// Stands for the load of points whose bonds never break.
pub(super) const UNBREAKABLE: f64 = f64::NEG_INFINITY;

/// The larger load of the interface at either end.
pub(super) struct MixedLoad;

impl BondLoad<1> for MixedLoad {
    #[inline(always)]
    fn ratio(&self, _: &Bond, [own]: &[f64; 1], [other]: &[f64; 1]) -> f64 {
        match own.min(*other) {
            UNBREAKABLE => 0.0,
            _ => own.max(*other),
        }
    }
}

/// Excess of bonds over their limits, relative.
pub(super) struct Excess<'a, L>(pub(super) &'a L);

impl<const I: usize, L: BondLoad<I>> BondKernel<I, 1> for Excess<'_, L> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        [(self.0.ratio(bond, &own, &other) - 1.0).max(0.0)]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; 1]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Inputs of [`Load`]: displacement and stress-free strain, and the limits of the stretch.
pub(super) const LOAD_INPUTS: usize = LIMITS + 2;
/// Limits in tension and in compression, both positive, infinite where bonds never break.
pub(super) const LIMITS: usize = PRESSURE;

/// Stretch of the bonds of a ply over the means of the limits of both ends.
pub(super) struct Load<const FINITE: bool> {
    /// Unit vector along the bonds that break, if not all do.
    pub(super) along: Option<[f64; 2]>,
}

impl<const FINITE: bool> BondLoad<LOAD_INPUTS> for Load<FINITE> {
    #[inline(always)]
    fn ratio(&self, bond: &Bond, own: &[f64; LOAD_INPUTS], other: &[f64; LOAD_INPUTS]) -> f64 {
        let is_across = |fibre| !is_along(fibre, plane_direction(bond));
        if self.along.is_some_and(is_across) {
            return 0.0;
        }
        let stretch = elastic::<FINITE, _>(bond, own, other).stretch;
        let [tension, compression] = [0, 1].map(|n| 0.5 * (own[LIMITS + n] + other[LIMITS + n]));
        (stretch / tension).max(-stretch / compression)
    }
}

/// Inputs of [`InterfaceLoad`]: displacements of two layers, and the limit of the angle, infinite where bonds never break.
pub(super) const SHEAR_LOAD_INPUTS: usize = 7;

/// Angle of pairs of crossing bonds over the mean of the limits of both ends.
pub(super) struct InterfaceLoad<const FINITE: bool>(pub(super) Crossing);

impl<const FINITE: bool> BondLoad<SHEAR_LOAD_INPUTS> for InterfaceLoad<FINITE> {
    #[inline(always)]
    fn ratio(
        &self,
        bond: &Bond,
        own: &[f64; SHEAR_LOAD_INPUTS],
        other: &[f64; SHEAR_LOAD_INPUTS],
    ) -> f64 {
        let angle = self.0.pair::<FINITE, _>(bond, own, other).angle;
        angle.abs() / (0.5 * (own[6] + other[6]))
    }
}
