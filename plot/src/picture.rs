//! A picture as a list of marks, encoded as PNG or SVG.
//!
//! Coordinates are pixels of the picture as it is laid out, from its upper left corner, with fractions; a picture for print has
//! several of its pixels for each of those ([`Picture::scaled_to`]). The backends of `plotters` only take whole pixels and smooth
//! few edges, so marks are drawn several times as large; PNG is averaged down, SVG scaled by its header.

use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, FontStyle, FontTransform, IntoDrawingArea,
    IntoFont, PathElement, Polygon, RGBColor, Rectangle, SVGBackend, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, TextStyle, register_font};
use plotters::{coord::Shift, drawing::DrawingAreaErrorKind};

use crate::colour::{BLACK, Colour, WHITE};

/// Pixels that are drawn for one of the layout, at least.
const SCALE: u32 = 3;
/// Pixels that are drawn for one of the picture, at least.
const LEAST_SCALE: u32 = 2;
/// Pixels per inch of a picture as it is laid out.
pub const DENSITY: f64 = 96.0;
const FONT: &str = "sans-serif";
const REGULAR: &[u8] = include_bytes!("../assets/fonts/Roboto-Regular-subset.ttf");
const MEDIUM: &[u8] = include_bytes!("../assets/fonts/Roboto-Medium-subset.ttf");

/// Why a picture or a film cannot be encoded.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// `plotters` cannot draw a mark.
    #[error(transparent)]
    Drawing(Box<dyn std::error::Error + Send + Sync>),
    /// A PNG file.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// A GIF file.
    #[error(transparent)]
    Gif(#[from] gif::EncodingError),
    /// A side has more than 65,535 pixels.
    #[error("the pictures are too large for a GIF")]
    TooLarge,
}

/// Position of a text relative to its point, at middle height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Anchor {
    /// to the right
    Left,
    /// around it
    Middle,
    /// to the left
    Right,
}

/// Style of a text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TextLook {
    /// height of the letters, pixels
    pub size: f64,
    /// heavier letters
    pub bold: bool,
    /// read from below
    pub upright: bool,
    /// where the text is
    pub anchor: Anchor,
}

/// The style of most texts.
pub(crate) fn look(size: f64, anchor: Anchor) -> TextLook {
    TextLook {
        size,
        bold: false,
        upright: false,
        anchor,
    }
}

#[derive(Clone, Debug)]
enum Mark {
    Rectangle([[f64; 2]; 2], Colour),
    Line(Vec<[f64; 2]>, f64, Colour),
    Area(Vec<[f64; 2]>, Colour),
    Text(String, [f64; 2], TextLook),
}

/// A picture being made.
#[derive(Clone, Debug)]
pub struct Picture {
    width: u32,
    height: u32,
    /// width of the finished picture, pixels
    pixels_wide: u32,
    marks: Vec<Mark>,
}

impl Picture {
    /// A white picture of this size in pixels.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            pixels_wide: width,
            marks: Vec::new(),
        }
    }

    /// The picture with this many pixels across; letters and lines are scaled with it.
    #[must_use]
    pub fn scaled_to(self, pixels_wide: u32) -> Self {
        Self {
            pixels_wide,
            ..self
        }
    }

    /// Width of the layout, pixels.
    pub(crate) fn width(&self) -> f64 {
        f64::from(self.width)
    }

    /// Width and height of the finished picture, pixels.
    pub fn size(&self) -> [u32; 2] {
        let height = f64::from(self.height) * self.density();
        [self.pixels_wide, height.round() as u32]
    }

    /// Pixels of the finished picture for one of the layout.
    fn density(&self) -> f64 {
        f64::from(self.pixels_wide) / f64::from(self.width)
    }

    /// Pixels that are drawn for one of the finished picture.
    fn oversampling(&self) -> u32 {
        ((f64::from(SCALE) / self.density()).ceil() as u32).clamp(LEAST_SCALE, SCALE)
    }

    /// Width and height of what is drawn, pixels.
    fn drawn_size(&self) -> (u32, u32) {
        self.size().map(|side| side * self.oversampling()).into()
    }

    pub(crate) fn rectangle(&mut self, corners: [[f64; 2]; 2], colour: Colour) {
        self.marks.push(Mark::Rectangle(corners, colour));
    }

    /// The edges of a rectangle.
    pub(crate) fn outline(&mut self, [left, top, right, bottom]: [f64; 4], colour: Colour) {
        let corners = [
            [left, top],
            [right, top],
            [right, bottom],
            [left, bottom],
            [left, top],
        ];
        self.line(corners, 1.0, colour);
    }

    pub(crate) fn line(&mut self, points: impl Into<Vec<[f64; 2]>>, width: f64, colour: Colour) {
        self.marks.push(Mark::Line(points.into(), width, colour));
    }

    /// Dashes of a length from the beginning of each `pitch`, pixels.
    pub(crate) fn dashes(
        &mut self,
        [start, end]: [[f64; 2]; 2],
        [dash, pitch]: [f64; 2],
        width: f64,
        colour: Colour,
    ) {
        let length = (end[0] - start[0]).hypot(end[1] - start[1]);
        let along = |distance: f64| {
            let fraction = (distance / length).min(1.0);
            [0, 1].map(|axis| start[axis] + fraction * (end[axis] - start[axis]))
        };
        for number in 0..(length / pitch).ceil() as usize {
            let from = number as f64 * pitch;
            self.line([along(from), along(from + dash)], width, colour);
        }
    }

    pub(crate) fn area(&mut self, points: impl Into<Vec<[f64; 2]>>, colour: Colour) {
        self.marks.push(Mark::Area(points.into(), colour));
    }

    pub(crate) fn dot(&mut self, [x, y]: [f64; 2], radius: f64, colour: Colour) {
        let corner = |i: u32| {
            let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
            [x + radius * angle.cos(), y + radius * angle.sin()]
        };
        self.area((0..24).map(corner).collect::<Vec<_>>(), colour);
    }

    pub(crate) fn text(&mut self, text: impl Into<String>, at: [f64; 2], look: TextLook) {
        self.marks.push(Mark::Text(text.into(), at, look));
    }

    /// The picture as the text of an SVG file. Titles and labels stand in it as they were given.
    ///
    /// # Errors
    /// A mark that cannot be drawn.
    pub fn svg(&self) -> Result<String, PictureError> {
        let (drawn, size) = (self.drawn_size(), self.size());
        let mut text = String::new();
        self.draw(SVGBackend::with_string(&mut text, drawn))?;
        let large = format!(r#"width="{}" height="{}""#, drawn.0, drawn.1);
        let real = format!(r#"width="{}" height="{}""#, size[0], size[1]);
        Ok(text.replacen(&large, &real, 1))
    }

    /// The picture as the bytes of a PNG file.
    ///
    /// # Errors
    /// A mark that cannot be drawn, or a picture that is too large.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let [width, height] = self.size();
        let per_metre = (self.density() * DENSITY / 0.0254).round() as u32;
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: per_metre,
            yppu: per_metre,
            unit: png::Unit::Meter,
        }));
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels()?)?;
        writer.finish()?;
        Ok(file)
    }

    /// Red, green and blue of all pixels, row by row.
    pub(crate) fn pixels(&self) -> Result<Vec<u8>, PictureError> {
        let (wide, tall) = self.drawn_size();
        let mut pixels = vec![0; 3 * wide as usize * tall as usize];
        self.draw(BitMapBackend::with_buffer(&mut pixels, (wide, tall)))?;
        Ok(averaged(
            &pixels,
            wide as usize,
            self.oversampling() as usize,
        ))
    }

    fn draw<B>(&self, backend: B) -> Result<(), PictureError>
    where
        B: DrawingBackend,
        B::ErrorType: 'static,
    {
        register_fonts();
        let area = backend.into_drawing_area();
        let scale = self.density() * f64::from(self.oversampling());
        area.fill(&paint(WHITE))
            .and_then(|()| {
                self.marks
                    .iter()
                    .try_for_each(|mark| mark.draw(&area, scale))
            })
            .and_then(|()| area.present())
            .map_err(|error| PictureError::Drawing(error.into()))
    }
}

fn paint([red, green, blue]: Colour) -> RGBColor {
    RGBColor(red, green, blue)
}

impl Mark {
    /// Draws the mark, `scale` times as large as it is laid out.
    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        scale: f64,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let place = |p: [f64; 2]| p.map(|x| (x * scale).round() as i32).into();
        match self {
            Self::Rectangle(corners, colour) => {
                area.draw(&Rectangle::new(corners.map(place), paint(*colour).filled()))
            }
            Self::Line(points, width, colour) => {
                let mut points: Vec<(i32, i32)> = points.iter().copied().map(place).collect();
                points.dedup();
                // a line within one pixel
                if points.len() < 2 {
                    return Ok(());
                }
                let width = (width * scale).round().max(1.0) as u32;
                area.draw(&PathElement::new(
                    points,
                    paint(*colour).stroke_width(width),
                ))
            }
            Self::Area(points, colour) => {
                let points: Vec<(i32, i32)> = points.iter().copied().map(place).collect();
                area.draw(&Polygon::new(points, paint(*colour).filled()))
            }
            Self::Text(text, at, look) => {
                let style = if look.bold {
                    FontStyle::Bold
                } else {
                    FontStyle::Normal
                };
                let mut font = (FONT, look.size * scale, style).into_font();
                if look.upright {
                    font = font.transform(FontTransform::Rotate270);
                }
                let across = match look.anchor {
                    Anchor::Left => HPos::Left,
                    Anchor::Middle => HPos::Center,
                    Anchor::Right => HPos::Right,
                };
                let colour = paint(BLACK);
                let style = TextStyle::from(font).color(&colour);
                let style = style.pos(Pos::new(across, VPos::Center));
                area.draw(&Text::new(text.as_str(), place(*at), style))
            }
        }
    }
}

/// Makes the letters in `assets` those of all pictures.
fn register_fonts() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        for (style, font) in [(FontStyle::Normal, REGULAR), (FontStyle::Bold, MEDIUM)] {
            // a font that cannot be read is a mistake in this program; drawing then reports it
            let _ = register_font(FONT, style, font);
        }
    });
}

/// Width of a text in pixels.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    register_fonts();
    let font = (FONT, size * f64::from(SCALE)).into_font();
    let (width, _) = font.box_size(text).unwrap_or_default();
    f64::from(width) / f64::from(SCALE)
}

/// Means over squares of `scale` by `scale` pixels.
fn averaged(pixels: &[u8], width: usize, scale: usize) -> Vec<u8> {
    let row = 3 * width;
    let mut small = Vec::with_capacity(pixels.len() / (scale * scale));
    for rows in pixels.chunks_exact(row * scale) {
        for x in 0..width / scale {
            for channel in 0..3 {
                let mut sum = 0;
                for dy in 0..scale {
                    for dx in 0..scale {
                        sum += usize::from(rows[dy * row + (x * scale + dx) * 3 + channel]);
                    }
                }
                small.push((sum / (scale * scale)) as u8);
            }
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        let mut picture = Picture::new(40, 20);
        picture.rectangle([[10.0, 5.0], [20.0, 15.0]], [200, 0, 0]);
        picture.text("T < 5 µm", [22.0, 10.0], look(8.0, Anchor::Left));
        picture
    }

    #[test]
    fn marks_cover_their_pixels() {
        let pixels = picture().pixels().expect("drawn");
        let at = |x: usize, y: usize| &pixels[3 * (40 * y + x)..][..3];
        assert_eq!(pixels.len(), 3 * 40 * 20);
        assert_eq!((at(15, 10), at(5, 10)), (&[200, 0, 0][..], &WHITE[..]));
        assert!((22..40).any(|x| at(x, 10) != WHITE), "letters");
    }

    #[test]
    fn dashes_end_with_their_line() {
        let mut picture = Picture::new(100, 20);
        picture.dashes([[10.0, 5.0], [70.0, 5.0]], [16.0, 25.0], 1.0, BLACK);
        let ends = picture.marks.iter().map(|mark| match mark {
            Mark::Line(points, ..) => [points[0][0], points[1][0]],
            _ => panic!("a line"),
        });
        let ends: Vec<_> = ends.collect();
        assert_eq!(ends, [[10.0, 26.0], [35.0, 51.0], [60.0, 70.0]]);
    }

    #[test]
    fn files_have_the_size_and_the_resolution_of_the_scaled_picture() {
        let large = picture().scaled_to(80);
        let file = large.png().expect("encoded");
        let reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info();
        let reader = reader.expect("PNG");
        assert_eq!(reader.info().size(), (80, 40));
        // 192 pixels per inch
        assert_eq!(reader.info().pixel_dims.expect("a resolution").xppu, 7559);
        let svg = large.svg().expect("encoded");
        assert!(svg.starts_with(r#"<svg width="80" height="40""#), "{svg}");
        assert!(svg.contains("T &lt; 5 µm"), "{svg}");
    }

    #[test]
    fn pixels_are_means_of_squares() {
        let large: Vec<u8> = (0..4 * 2 * 3).collect();
        // red of the first square: 0, 3, 12, 15
        assert_eq!(averaged(&large, 4, 2), [7, 8, 9, 13, 14, 15]);
    }
}
