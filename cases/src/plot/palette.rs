//! The 256 colours of a GIF. All pictures of a film have the same ones, because a palette for each picture makes them flicker.

use std::collections::HashMap;

use super::colour::{BLACK, Colour, ColourMap, GREY, ISOTHERMS, WHITE};

/// Colours of the colour map among those of a palette.
const OF_MAP: usize = 208;
/// Greys from the colour of letters to that of paper.
const GREYS: usize = 256 - OF_MAP - ISOTHERMS.len() - 1;

/// Colours by number.
#[derive(Clone, Debug)]
pub(super) struct Palette {
    colours: Vec<Colour>,
    /// numbers of the colours found before
    known: HashMap<Colour, u8>,
}

impl Palette {
    /// The palette for pictures with a colour map.
    pub(super) fn new(map: ColourMap) -> Self {
        let of_map = (0..OF_MAP).map(|i| map.colour(i as f64 / (OF_MAP - 1) as f64));
        let mix = |from: u8, to: u8, i: usize| {
            let fraction = i as f64 / (GREYS - 1) as f64;
            (f64::from(from) + fraction * (f64::from(to) - f64::from(from))).round() as u8
        };
        let grey = |i: usize| {
            let (from, to) = (BLACK, WHITE);
            (
                mix(from.0, to.0, i),
                mix(from.1, to.1, i),
                mix(from.2, to.2, i),
            )
        };
        let greys = (0..GREYS).map(grey);
        let colours = of_map.chain(greys).chain(ISOTHERMS).chain([GREY]);
        Self {
            colours: colours.collect(),
            known: HashMap::new(),
        }
    }

    /// Red, green and blue of each colour.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.colours
            .iter()
            .flat_map(|&(r, g, b)| [r, g, b])
            .collect()
    }

    /// Number of the nearest colour of each pixel.
    pub(super) fn indices(&mut self, pixels: &[u8]) -> Vec<u8> {
        let Self { colours, known } = self;
        let pixel = |pixel: &[u8]| {
            let colour = (pixel[0], pixel[1], pixel[2]);
            *known
                .entry(colour)
                .or_insert_with(|| nearest(colours, colour))
        };
        pixels.chunks_exact(3).map(pixel).collect()
    }
}

fn nearest(colours: &[Colour], colour: Colour) -> u8 {
    let away = |a: u8, b: u8| i32::from(a.abs_diff(b)).pow(2);
    let distance = |c: &Colour| away(c.0, colour.0) + away(c.1, colour.1) + away(c.2, colour.2);
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
        let exact = [
            WHITE,
            BLACK,
            GREY,
            ISOTHERMS[3],
            ColourMap::Inferno.colour(0.0),
        ];
        let pixels: Vec<u8> = exact.iter().flat_map(|&(r, g, b)| [r, g, b]).collect();
        let indices = palette.indices(&pixels);
        for (index, colour) in indices.into_iter().zip(exact) {
            assert_eq!(palette.colours[usize::from(index)], colour);
        }
    }
}
