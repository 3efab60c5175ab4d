//! Sums of the coefficients of bonds, which limit explicit steps.

use perimelt_core::family::Mirrored;
use perimelt_core::solver::Reducer;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::Conduction;
use super::derivatives::SecondDerivatives;
use crate::thermal::interfaces::RowSumAcross;

/// Sum of the coefficients of a point's bonds, W/(m³ K), with the mean conductivity of the ends, which is at least that of
/// halves in series.
struct RowSum;

impl BondKernel<1, 1> for RowSum {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * bond.inverse_length * (own + other)]
    }
}

impl Conduction {
    /// Sum of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(in crate::thermal) fn largest_row_sums(
        &mut self,
        family: &Family,
        material: &[u16],
        reducer: &Reducer,
    ) -> Vec<[f64; 1]> {
        if let Some(plies) = &self.plies {
            return plies.largest_row_sums(family, material);
        }
        let broken = self.broken.as_ref();
        let stiffness = self
            .states
            .as_mut()
            .map_or(1.0, |s| s.stiffness(family, broken, reducer));
        let largest = &self.largest;
        if let Some(SecondDerivatives { pddo, .. }) = &self.derivatives {
            let own = material[..reducer.owned()].par_iter().enumerate();
            let sum =
                |(point, &m): (usize, &u16)| [largest[m as usize] * pddo.laplacian_sum(point)];
            let mut sums: Vec<[f64; 1]> = own.map(sum).collect();
            sums.resize(material.len(), [0.0]);
            return sums;
        }
        let factor = stiffness * self.calibration;
        let conductivity = |point: usize| factor * largest[material[point] as usize];
        let mut slots = SlotField::default();
        slots.load(family, conductivity, Mirrored::Scalar);
        let mut sums = vec![[0.0]; material.len()];
        match &mut self.interfaces {
            Some(interfaces) => {
                interfaces.load(family);
                family.sum(&RowSumAcross, [&slots, interfaces.slots()], &mut sums);
            }
            None => family.sum(&RowSum, [&slots], &mut sums),
        }
        sums
    }

    /// The sum of the coefficients of one point's bonds, as [`Conduction::largest_row_sums`] in a family that grows,
    /// W/(m³ K).
    pub(in crate::thermal) fn row_sum(
        &self,
        family: &Family,
        material: &[u16],
        point: usize,
    ) -> f64 {
        let ends = |p: usize| {
            let conductivity = self.calibration * self.largest[material[p] as usize];
            let interfaces = self.interfaces.as_ref();
            [conductivity, interfaces.map_or(1.0, |i| i.of(p))]
        };
        let own = ends(point);
        let mut sum = 0.0;
        family.for_each_bond(point, |_, bond, slot| {
            let other = family.mirrored_point(slot).map_or(own, ends);
            let [part] = match self.interfaces {
                Some(_) => RowSumAcross.bond(bond, own, other),
                None => RowSum.bond(bond, [own[0]], [other[0]]),
            };
            sum += part;
        });
        sum
    }
}
