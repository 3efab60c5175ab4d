//! The 256 colours of a GIF. All pictures of a film have the same ones, because a palette for each picture makes them flicker.

use std::collections::HashMap;

use crate::colour::{BLACK, Colour, ColourMap, GREY, ISOTHERMS, WHITE, mixed};

/// Colours of the colour map among those of a palette.
const OF_MAP: usize = 208;
/// Greys from the colour of letters to that of paper.
const GREYS: usize = 256 - OF_MAP - ISOTHERMS.len() - 1;

/// Colours by number.
#[derive(Clone, Debug)]
pub(crate) struct Palette {
    colours: Vec<Colour>,
    /// numbers of the colours found before
    known: HashMap<Colour, u8>,
}

impl Palette {
    /// The palette for pictures with a colour map.
    pub(crate) fn new(map: ColourMap) -> Self {
        let of_map = (0..OF_MAP).map(|i| map.colour(i as f64 / (OF_MAP - 1) as f64));
        let greys = (0..GREYS).map(|i| mixed(BLACK, WHITE, i as f64 / (GREYS - 1) as f64));
        let colours = of_map.chain(greys).chain(ISOTHERMS).chain([GREY]);
        Self {
            colours: colours.collect(),
            known: HashMap::new(),
        }
    }

    /// Red, green and blue of each colour.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.colours.as_flattened()
    }

    /// Number of the nearest colour of each pixel.
    pub(crate) fn indices(&mut self, pixels: &[u8]) -> Vec<u8> {
        let Self { colours, known } = self;
        let (pixels, _) = pixels.as_chunks();
        let index = |pixel: &Colour| {
            *known
                .entry(*pixel)
                .or_insert_with(|| nearest(colours, pixel))
        };
        pixels.iter().map(index).collect()
    }
}

fn nearest(colours: &[Colour], colour: &Colour) -> u8 {
    let distance = |other: &Colour| -> u32 {
        let channels = other.iter().zip(colour);
        channels
            .map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2))
            .sum()
    };
    let closest = colours.iter().enumerate().min_by_key(|(_, c)| distance(c));
    closest.map_or(0, |(index, _)| index as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_palette_has_what_pictures_consist_of() {
        let mut palette = Palette::new(ColourMap::Inferno);
        assert_eq!(palette.bytes().len(), 3 * 256);
        let first = ColourMap::Inferno.colour(0.0);
        let exact = [WHITE, BLACK, GREY, ISOTHERMS[3], first];
        let indices = palette.indices(exact.as_flattened());
        for (index, colour) in indices.into_iter().zip(exact) {
            assert_eq!(palette.colours[usize::from(index)], colour);
        }
    }
}
