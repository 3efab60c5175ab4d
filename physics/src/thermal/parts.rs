//! Conduction in powder and between powder and dense metal.

use perimelt_core::material::Property;
use perimelt_core::{Bond, BondKernel};

use super::interfaces::in_series;

/// Powder between dense metal.
#[derive(Debug)]
pub(super) struct Powder {
    /// Of each material, W/(m K).
    conductivity: Vec<Property>,
    /// By point, 0 in powder, 1 in dense metal.
    consolidated: Vec<f64>,
}

/// Conduction with a conductivity at each point, where they differ by orders of magnitude: the halves of a bond conduct in
/// series.
pub(super) struct Series;

impl BondKernel<2, 1> for Series {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let twice = 2.0 * in_series([own[1], other[1]], [1.0, 1.0]);
        [twice * bond.mean() * bond.inverse_length * (other[0] - own[0])]
    }
}

impl Powder {
    /// Dense metal everywhere.
    pub(super) fn new(conductivity: Vec<Property>, points: usize) -> Self {
        Powder {
            conductivity,
            consolidated: vec![1.0; points],
        }
    }

    /// Takes over which points are powder (0) and which are dense (1).
    pub(super) fn consolidate(&mut self, consolidated: &[f64]) {
        self.consolidated.copy_from_slice(consolidated);
    }

    /// Conductivity of a point whose dense metal conducts by `dense`, W/(m K).
    pub(super) fn mixed(
        &self,
        point: usize,
        (material, temperature): (usize, f64),
        dense: f64,
    ) -> f64 {
        let share = self.consolidated[point];
        if share >= 1.0 {
            return dense;
        }
        share * dense + (1.0 - share) * self.conductivity[material].at(temperature, 0.0)
    }
}
