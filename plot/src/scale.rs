//! Values by colour.

use crate::colour::{Colour, ColourMap, GREY};

/// Values by colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourScale {
    /// colours
    pub map: ColourMap,
    /// value of the first colour
    pub from: f64,
    /// value of the last colour
    pub to: f64,
}

/// Smallest and largest of the finite ones of these values; `None` without any.
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.fold(None, |range, value| {
        let [from, to] = range.unwrap_or([value; 2]);
        Some([value.min(from), value.max(to)])
    })
}

impl ColourScale {
    /// The scale for values between `from` and `to`: symmetric, from blue to red, if they have both signs.
    pub fn new(map: ColourMap, [from, to]: [f64; 2]) -> Self {
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
        Self { map, from, to }
    }

    /// The scale of a requested range, from blue to red if it is symmetric.
    pub fn asked(map: ColourMap, [from, to]: [f64; 2]) -> Self {
        let is_symmetric = (from + to).abs() < 1e-6 * (to - from);
        let map = if is_symmetric {
            ColourMap::BlueRed
        } else {
            map
        };
        Self { map, from, to }
    }

    /// The scale of the finite ones of these values.
    pub fn of(map: ColourMap, values: &[f64]) -> Self {
        Self::new(map, range(values.iter().copied()).unwrap_or([0.0, 1.0]))
    }

    /// Colour of a value, grey where it is not finite.
    pub(crate) fn colour(&self, value: f64) -> Colour {
        match value.is_finite() {
            true => self.map.colour((value - self.from) / (self.to - self.from)),
            false => GREY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_suit_the_values() {
        let of = |values: &[f64]| ColourScale::of(ColourMap::Viridis, values);
        let both = of(&[-1.0, f64::NAN, 3.0]);
        assert_eq!(
            (both.map, both.from, both.to),
            (ColourMap::BlueRed, -3.0, 3.0)
        );
        assert_eq!((of(&[2.0, 5.0]).from, of(&[2.0, 5.0]).to), (2.0, 5.0));
        assert!(of(&[2.0, 2.0]).to > 2.0 && of(&[]).to > of(&[]).from);
        let asked = |range| ColourScale::asked(ColourMap::Inferno, range);
        assert_eq!(asked([300.0, 900.0]).map, ColourMap::Inferno);
        assert_eq!(asked([-5.0, 5.0]).map, ColourMap::BlueRed);
        let uneven = asked([-5.0, 9.0]);
        assert_eq!((uneven.from, uneven.map), (-5.0, ColourMap::Inferno));
    }

    #[test]
    fn the_ends_of_a_scale_have_the_ends_of_the_colours() {
        let scale = ColourScale::of(ColourMap::Viridis, &[300.0, 1700.0, f64::INFINITY]);
        let points = ColourMap::Viridis.control_points();
        assert_eq!(
            [300.0, 1700.0].map(|value| scale.colour(value)),
            [points[0], points[16]]
        );
        assert_eq!(scale.colour(1000.0), points[8]);
        assert_eq!(scale.colour(f64::NAN), GREY);
    }
}
