//! Colour maps: perceptually uniform, so that equal steps of a field look equally large.

/// Red, green, blue.
pub(crate) type Colour = (u8, u8, u8);

pub(crate) const BLACK: Colour = (38, 38, 42);
pub(crate) const GREY: Colour = (120, 120, 126);
pub(crate) const LIGHT_GREY: Colour = (226, 226, 230);
pub(crate) const WHITE: Colour = (255, 255, 255);

/// Lines of charts: the palette of Okabe and Ito (2008), which colour-blind readers can
/// distinguish, without its yellow, which is too pale for a line on white.
pub(crate) const LINES: [Colour; 6] = [
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (230, 159, 0),
];

/// Isotherms: distinct from each other and, with a dark seam, from the colour maps.
pub(crate) const ISOTHERMS: [Colour; 8] = [
    (255, 255, 255),
    (110, 225, 255),
    (150, 255, 150),
    (255, 140, 215),
    (255, 235, 90),
    (175, 150, 255),
    (0, 205, 180),
    (255, 165, 90),
];

/// A colour map, linear between equidistant control points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ColourMap {
    /// black, red, yellow: temperatures
    Inferno,
    /// blue, green, yellow: any other magnitude
    Viridis,
    /// blue, white, red: quantities of both signs
    BlueRed,
}

/// Control points of matplotlib's `inferno` (N. Smith, S. van der Walt; public domain).
const INFERNO: [Colour; 17] = [
    (0, 0, 4),
    (11, 7, 36),
    (33, 12, 74),
    (61, 9, 101),
    (87, 16, 110),
    (113, 25, 110),
    (138, 34, 106),
    (163, 44, 97),
    (188, 55, 84),
    (210, 70, 68),
    (228, 90, 49),
    (241, 115, 29),
    (249, 142, 9),
    (252, 172, 17),
    (249, 203, 53),
    (242, 234, 105),
    (252, 255, 164),
];

/// Control points of matplotlib's `viridis` (N. Smith, S. van der Walt, E. Firing; public domain).
const VIRIDIS: [Colour; 17] = [
    (68, 1, 84),
    (72, 24, 106),
    (71, 45, 123),
    (66, 64, 134),
    (59, 82, 139),
    (51, 99, 141),
    (44, 114, 142),
    (38, 130, 142),
    (33, 145, 140),
    (31, 160, 136),
    (40, 174, 128),
    (63, 188, 115),
    (94, 201, 98),
    (132, 212, 75),
    (173, 220, 48),
    (216, 226, 25),
    (253, 231, 37),
];

/// Control points of a blue-white-red map with even lightness on both sides.
const BLUE_RED: [Colour; 9] = [
    (5, 48, 97),
    (42, 113, 178),
    (107, 172, 209),
    (194, 221, 236),
    (247, 246, 246),
    (251, 204, 180),
    (228, 128, 102),
    (186, 40, 50),
    (103, 0, 31),
];

impl ColourMap {
    /// Equidistant control points.
    pub(crate) fn control_points(self) -> &'static [Colour] {
        match self {
            Self::Inferno => &INFERNO,
            Self::Viridis => &VIRIDIS,
            Self::BlueRed => &BLUE_RED,
        }
    }

    /// Colour at a fraction of the range, from 0 to 1; values outside are clamped.
    pub(crate) fn colour(self, fraction: f64) -> Colour {
        let points = self.control_points();
        let place = fraction.clamp(0.0, 1.0) * (points.len() - 1) as f64;
        let first = (place as usize).min(points.len() - 2);
        let weight = place - first as f64;
        let (from, to) = (points[first], points[first + 1]);
        let mix = |from: u8, to: u8| {
            (f64::from(from) + weight * (f64::from(to) - f64::from(from))).round() as u8
        };
        (mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_begin_and_end_with_their_end_colours_and_clamp() {
        for (map, begin, end) in [
            (ColourMap::Inferno, (0, 0, 4), (252, 255, 164)),
            (ColourMap::Viridis, (68, 1, 84), (253, 231, 37)),
            (ColourMap::BlueRed, (5, 48, 97), (103, 0, 31)),
        ] {
            assert_eq!(map.colour(0.0), begin);
            assert_eq!(map.colour(-3.0), begin);
            assert_eq!(map.colour(1.0), end);
            assert_eq!(map.colour(7.0), end);
        }
        assert_eq!(ColourMap::BlueRed.colour(0.5), (247, 246, 246));
    }

    #[test]
    fn sequential_maps_get_lighter_all_the_way() {
        let lightness = |(r, g, b): Colour| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        for map in [ColourMap::Inferno, ColourMap::Viridis] {
            let along: Vec<f64> = (0..=32)
                .map(|i| lightness(map.colour(f64::from(i) / 32.0)))
                .collect();
            assert!(along.windows(2).all(|pair| pair[1] > pair[0]), "{map:?}");
        }
    }
}
