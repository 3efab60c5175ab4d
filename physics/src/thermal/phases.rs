//! Conduction of points that contain powder or austenite.

use perimelt_core::material::{Property, in_series};
use perimelt_core::{Bond, BondKernel};

/// A phase with its own conductivity.
#[derive(Debug)]
pub(super) struct ConductingPhase {
    /// Conductivity by material, W/(m K).
    conductivity: Vec<Property>,
    /// Fraction of the phase at each point.
    fraction: Vec<f64>,
}

/// Conduction between points whose conductivities differ by orders of magnitude: the halves of a bond conduct in series.
pub(super) struct Series;

impl BondKernel<2, 1> for Series {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let twice = 2.0 * in_series([own[1], other[1]], [1.0, 1.0]);
        [twice * bond.mean() * bond.inverse_length * (other[0] - own[0])]
    }
}

impl ConductingPhase {
    /// A phase with the fraction zero at all points.
    pub(super) fn new(conductivity: Vec<Property>, points: usize) -> Self {
        ConductingPhase {
            conductivity,
            fraction: vec![0.0; points],
        }
    }

    /// Sets the fraction at each point.
    pub(super) fn set_fraction(&mut self, fraction: impl Iterator<Item = f64>) {
        self.fraction.clear();
        self.fraction.extend(fraction);
    }

    /// Conductivity of a point, W/(m K). `rest` is the conductivity of the other phases; the fraction of this phase is
    /// relative to the fraction `whole` of the point.
    pub(super) fn mixed(
        &self,
        point: usize,
        material: usize,
        temperature: f64,
        rest: f64,
        whole: f64,
    ) -> f64 {
        let fraction = whole * self.fraction[point];
        if fraction <= 0.0 {
            return rest;
        }
        (1.0 - fraction) * rest + fraction * self.conductivity[material].at(temperature, 0.0)
    }
}
