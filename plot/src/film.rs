//! Films: pictures one after the other in one file.

use std::io::Write;

use crate::colour::ColourMap;
use crate::palette::Palette;
use crate::picture::{Picture, PictureError};

/// File format of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// 256 colours
    Gif,
    /// animated PNG
    Png,
}

/// What holds for all pictures of a film.
#[derive(Clone, Copy, Debug)]
pub struct FilmSettings {
    /// file format
    pub format: FilmFormat,
    /// colours of the values
    pub map: ColourMap,
    /// number of pictures
    pub pictures: usize,
    /// pictures in a second
    pub rate: u16,
}

/// A film being written.
pub struct Film<W: Write> {
    size: [u32; 2],
    rate: u16,
    encoder: Encoder<W>,
}

enum Encoder<W: Write> {
    Gif(gif::Encoder<W>, Palette),
    Png(png::Writer<W>),
}

impl<W: Write> Film<W> {
    /// Begins a film of pictures of this size (pixels).
    ///
    /// # Errors
    /// A size that the format does not have, or a file that cannot be written.
    pub fn new(file: W, settings: FilmSettings, size: [u32; 2]) -> Result<Self, PictureError> {
        let FilmSettings { map, rate, .. } = settings;
        let encoder = match settings.format {
            FilmFormat::Gif => {
                let palette = Palette::new(map);
                let [width, height] = sides(size)?;
                let mut encoder = gif::Encoder::new(file, width, height, palette.bytes())?;
                encoder.set_repeat(gif::Repeat::Infinite)?;
                Encoder::Gif(encoder, palette)
            }
            FilmFormat::Png => {
                let mut encoder = png::Encoder::new(file, size[0], size[1]);
                encoder.set_color(png::ColorType::Rgb);
                let pictures = u32::try_from(settings.pictures).unwrap_or(u32::MAX);
                encoder.set_animated(pictures, 0)?;
                encoder.set_frame_delay(1, rate)?;
                Encoder::Png(encoder.write_header()?)
            }
        };
        Ok(Self {
            size,
            rate,
            encoder,
        })
    }

    /// Adds a picture of the width of the film. It is cut off at the height of the film, or has white below it.
    ///
    /// # Errors
    /// A mark that cannot be drawn, or a file that cannot be written.
    pub fn add(&mut self, picture: &Picture) -> Result<(), PictureError> {
        let [width, height] = self.size;
        let mut pixels = picture.pixels()?;
        pixels.resize(3 * width as usize * height as usize, 255);
        match &mut self.encoder {
            Encoder::Gif(encoder, palette) => {
                let ([width, height], pixels) = (sides(self.size)?, palette.indices(&pixels));
                let mut frame = gif::Frame::from_indexed_pixels(width, height, pixels, None);
                frame.delay = 100 / self.rate;
                encoder.write_frame(&frame)?;
            }
            Encoder::Png(writer) => writer.write_image_data(&pixels)?,
        }
        Ok(())
    }

    /// Writes the end of the file.
    ///
    /// # Errors
    /// A file that cannot be written, or has another number of pictures than announced.
    pub fn finish(self) -> Result<(), PictureError> {
        match self.encoder {
            Encoder::Gif(encoder, _) => Ok(encoder.into_inner().map(drop)?),
            Encoder::Png(writer) => Ok(writer.finish()?),
        }
    }
}

/// Sides of a GIF.
fn sides([width, height]: [u32; 2]) -> Result<[u16; 2], PictureError> {
    let side = |pixels: u32| u16::try_from(pixels).map_err(|_| PictureError::TooLarge);
    Ok([side(width)?, side(height)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn films_have_the_size_of_their_first_picture() {
        for (format, signature) in [
            (FilmFormat::Gif, &b"GIF89a"[..]),
            (FilmFormat::Png, b"\x89PNG"),
        ] {
            let settings = FilmSettings {
                format,
                map: ColourMap::Viridis,
                pictures: 2,
                rate: 10,
            };
            let mut file = Vec::new();
            let mut film = Film::new(&mut file, settings, [30, 20]).expect("encoded");
            for height in [20, 27] {
                film.add(&Picture::new(30, height)).expect("encoded");
            }
            film.finish().expect("both pictures");
            assert!(file.starts_with(signature));
            let large = Film::new(Vec::new(), settings, [30, 70_000]);
            assert_eq!(large.is_err(), format == FilmFormat::Gif);
        }
    }
}
