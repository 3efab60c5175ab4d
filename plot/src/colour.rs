//! Colour maps: perceptually uniform, so that equal steps of a field look equally large.

/// Red, green, blue.
pub type Colour = [u8; 3];

pub(crate) const BLACK: Colour = [38, 38, 42];
pub(crate) const GREY: Colour = [120, 120, 126];
pub(crate) const LIGHT_GREY: Colour = [226, 226, 230];
pub(crate) const WHITE: Colour = [255, 255, 255];

/// Lines of charts: the palette of Okabe and Ito (2008), which colour-blind readers can
/// distinguish, without its yellow, which is too pale for a line on white.
pub const LINES: [Colour; 6] =
    colours([0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0x56b4e9, 0xe69f00]);

/// Isotherms: distinct from each other and, with a dark seam, from the colour maps.
pub(crate) const ISOTHERMS: [Colour; 8] = colours([
    0xffffff, 0x6ee1ff, 0x96ff96, 0xff8cd7, 0xffeb5a, 0xaf96ff, 0x00cdb4, 0xffa55a,
]);

/// A colour map, linear between equidistant control points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColourMap {
    /// black, red, yellow: temperatures
    Inferno,
    /// blue, green, yellow: any other magnitude
    Viridis,
    /// blue, white, red: quantities of both signs
    BlueRed,
}

/// Control points of matplotlib's `inferno` (N. Smith, S. van der Walt; public domain).
const INFERNO: [Colour; 17] = colours([
    0x000004, 0x0b0724, 0x210c4a, 0x3d0965, 0x57106e, 0x71196e, 0x8a226a, 0xa32c61, 0xbc3754,
    0xd24644, 0xe45a31, 0xf1731d, 0xf98e09, 0xfcac11, 0xf9cb35, 0xf2ea69, 0xfcffa4,
]);

/// Control points of matplotlib's `viridis` (N. Smith, S. van der Walt, E. Firing; public domain).
const VIRIDIS: [Colour; 17] = colours([
    0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
    0x1fa088, 0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725,
]);

/// Control points of a blue-white-red map with even lightness on both sides.
const BLUE_RED: [Colour; 9] = colours([
    0x053061, 0x2a71b2, 0x6bacd1, 0xc2ddec, 0xf7f6f6, 0xfbccb4, 0xe48066, 0xba2832, 0x67001f,
]);

/// Colours from their usual notation, `0xrrggbb`.
const fn colours<const N: usize>(hexadecimal: [u32; N]) -> [Colour; N] {
    let mut colours = [BLACK; N];
    let mut index = 0;
    while index < N {
        let [_, red, green, blue] = hexadecimal[index].to_be_bytes();
        colours[index] = [red, green, blue];
        index += 1;
    }
    colours
}

/// The colour at a fraction of the way from one to another.
pub(crate) fn mixed(from: Colour, to: Colour, fraction: f64) -> Colour {
    [0, 1, 2].map(|channel| {
        let (from, to) = (f64::from(from[channel]), f64::from(to[channel]));
        (from + fraction * (to - from)).round() as u8
    })
}

impl ColourMap {
    /// Equidistant control points.
    pub fn control_points(self) -> &'static [Colour] {
        match self {
            Self::Inferno => &INFERNO,
            Self::Viridis => &VIRIDIS,
            Self::BlueRed => &BLUE_RED,
        }
    }

    /// Colour at a fraction of the range, from 0 to 1; values outside are clamped.
    pub fn colour(self, fraction: f64) -> Colour {
        let points = self.control_points();
        let place = fraction.clamp(0.0, 1.0) * (points.len() - 1) as f64;
        let first = (place as usize).min(points.len() - 2);
        mixed(points[first], points[first + 1], place - first as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_begin_and_end_with_their_end_colours_and_clamp() {
        for (map, begin, end) in [
            (ColourMap::Inferno, [0, 0, 4], [252, 255, 164]),
            (ColourMap::Viridis, [68, 1, 84], [253, 231, 37]),
            (ColourMap::BlueRed, [5, 48, 97], [103, 0, 31]),
        ] {
            assert_eq!([-3.0, 0.0].map(|at| map.colour(at)), [begin; 2]);
            assert_eq!([1.0, 7.0].map(|at| map.colour(at)), [end; 2]);
        }
        assert_eq!(ColourMap::BlueRed.colour(0.5), [247, 246, 246]);
    }

    #[test]
    fn sequential_maps_get_lighter_all_the_way() {
        let lightness = |[r, g, b]: Colour| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        for map in [ColourMap::Inferno, ColourMap::Viridis] {
            let along = (0..=32).map(|i| lightness(map.colour(f64::from(i) / 32.0)));
            assert!(along.is_sorted_by(|a, b| b > a), "{map:?}");
        }
    }
}
