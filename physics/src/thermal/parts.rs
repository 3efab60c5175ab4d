//! Conduction where a part of the matter at a point is powder or austenite, and between such points.

use perimelt_core::material::Property;
use perimelt_core::{Bond, BondKernel};

use super::interfaces::in_series;

/// A part of the matter that conducts by properties of its own.
#[derive(Debug)]
pub(super) struct Part {
    /// Of each material, W/(m K).
    conductivity: Vec<Property>,
    /// By point.
    fraction: Vec<f64>,
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

impl Part {
    /// None of it anywhere.
    pub(super) fn new(conductivity: Vec<Property>, points: usize) -> Self {
        Part {
            conductivity,
            fraction: vec![0.0; points],
        }
    }

    /// Takes over the fraction at each point.
    pub(super) fn set_fraction(&mut self, fraction: impl Iterator<Item = f64>) {
        self.fraction.clear();
        self.fraction.extend(fraction);
    }

    /// Conductivity of a point whose other matter conducts by `rest`, W/(m K), of which the given part is `whole`.
    pub(super) fn mixed(
        &self,
        point: usize,
        (material, temperature): (usize, f64),
        (rest, whole): (f64, f64),
    ) -> f64 {
        let fraction = whole * self.fraction[point];
        if fraction <= 0.0 {
            return rest;
        }
        (1.0 - fraction) * rest + fraction * self.conductivity[material].at(temperature, 0.0)
    }
}
