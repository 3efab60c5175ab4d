//! Values by colour.

use super::args::ValueRange;
use super::colour::{Colour, ColourMap};

/// Values by colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ColourScale {
    pub map: ColourMap,
    pub from: f64,
    pub to: f64,
}

impl ColourScale {
    /// The scale for values of a field between `from` and `to`; symmetric if they have both signs.
    pub(crate) fn new(name: &str, from: f64, to: f64) -> Self {
        let size = from.abs().max(to.abs());
        if from < 0.0 && to > 0.0 && from.abs().min(to) > 0.02 * size {
            return Self {
                map: ColourMap::BlueRed,
                from: -size,
                to: size,
            };
        }
        // what only differs by rounding is constant
        let to = if to - from > 1e-9 * size {
            to
        } else {
            from + if size > 0.0 { size } else { 1.0 }
        };
        let map = sequential(name);
        Self { map, from, to }
    }

    /// The scale of a requested range.
    pub(crate) fn asked(name: &str, ValueRange { from, to }: ValueRange) -> Self {
        let is_symmetric = (from + to).abs() < 1e-6 * (to - from);
        let map = if is_symmetric {
            ColourMap::BlueRed
        } else {
            sequential(name)
        };
        Self { map, from, to }
    }

    /// The scale of the finite ones of these values.
    pub(crate) fn of(name: &str, values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|x| x.is_finite());
        let from = finite().fold(f64::INFINITY, f64::min);
        let to = finite().fold(f64::NEG_INFINITY, f64::max);
        if from <= to {
            Self::new(name, from, to)
        } else {
            Self::new(name, 0.0, 1.0)
        }
    }

    pub(super) fn colour(&self, value: f64) -> Colour {
        self.map.colour((value - self.from) / (self.to - self.from))
    }
}

fn sequential(name: &str) -> ColourMap {
    if name == "temperature" {
        ColourMap::Inferno
    } else {
        ColourMap::Viridis
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_suit_the_values() {
        let of = |values: &[f64]| ColourScale::of("stress.xx", values);
        let both = of(&[-1.0, f64::NAN, 3.0]);
        assert_eq!(
            (both.map, both.from, both.to),
            (ColourMap::BlueRed, -3.0, 3.0)
        );
        assert_eq!((of(&[2.0, 5.0]).from, of(&[2.0, 5.0]).to), (2.0, 5.0));
        assert!(of(&[2.0, 2.0]).to > 2.0 && of(&[]).to > of(&[]).from);
        let asked = |from, to| ColourScale::asked("temperature", ValueRange { from, to });
        assert_eq!(asked(300.0, 900.0).map, ColourMap::Inferno);
        assert_eq!(asked(-5.0, 5.0).map, ColourMap::BlueRed);
        assert_eq!(
            (asked(-5.0, 9.0).from, asked(-5.0, 9.0).map),
            (-5.0, ColourMap::Inferno)
        );
    }
}
