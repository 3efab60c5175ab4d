//! A picture as a list of marks, written as PNG or SVG.
//!
//! Coordinates are pixels of the picture as it is laid out, from its upper left corner, with fractions; a picture for print has
//! several of its pixels for each of those ([`Picture::scaled_to`]). The backends of `plotters` only take whole pixels and smooth
//! few edges, so marks are drawn several times as large; PNG is averaged down, SVG scaled by its header.
//!
//! Files contain a fingerprint of their picture, so that a file that shows it already is not written again.

use std::io::{Cursor, Write};
use std::{fs, path::Path};

use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, FontStyle, FontTransform, IntoDrawingArea,
    IntoFont, PathElement, Polygon, RGBColor, Rectangle, SVGBackend, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, TextStyle, register_font};
use plotters::{coord::Shift, drawing::DrawingAreaErrorKind};

use super::{PictureFormat, PlotError, colour::Colour};
use crate::output::write_whole;
use crate::terminal::clean;

/// Pixels that are drawn for one of the layout, at least.
const SCALE: u32 = 3;
/// Pixels that are drawn for one of the picture, at least.
const LEAST_SCALE: u32 = 2;
/// Pixels per inch of a picture as it is laid out.
pub(super) const DENSITY: f64 = 96.0;
/// Name of the fingerprint in a file.
const FINGERPRINT: &str = "Perimelt";
/// Text after the fingerprint in an SVG file.
const END: &str = "</metadata>\n</svg>";
const FONT: &str = "sans-serif";
const REGULAR: &[u8] = include_bytes!("../../assets/fonts/Roboto-Regular-subset.ttf");
const MEDIUM: &[u8] = include_bytes!("../../assets/fonts/Roboto-Medium-subset.ttf");

/// Position of a text relative to its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Anchor {
    /// to the right, middle height
    Left,
    /// around it
    Middle,
    /// to the left, middle height
    Right,
}

#[derive(Clone, Debug)]
enum Mark {
    Rectangle {
        corners: [[f64; 2]; 2],
        colour: Colour,
    },
    Line {
        points: Vec<[f64; 2]>,
        width: f64,
        colour: Colour,
    },
    Area {
        points: Vec<[f64; 2]>,
        colour: Colour,
    },
    Text {
        text: String,
        at: [f64; 2],
        size: f64,
        bold: bool,
        upright: bool,
        anchor: Anchor,
        colour: Colour,
    },
}

/// A picture being made.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    width: u32,
    height: u32,
    /// width of the finished picture, pixels
    pixels_wide: u32,
    marks: Vec<Mark>,
}

/// Style of a text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TextLook {
    /// height of the letters, pixels
    pub size: f64,
    /// heavier letters
    pub bold: bool,
    /// where the text is
    pub anchor: Anchor,
    /// colour of the letters
    pub colour: Colour,
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
    pub(crate) fn scaled_to(self, pixels_wide: u32) -> Self {
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
    pub(crate) fn size(&self) -> (u32, u32) {
        let height = f64::from(self.height) * self.density();
        (self.pixels_wide, height.round() as u32)
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
        let ((width, height), scale) = (self.size(), self.oversampling());
        (width * scale, height * scale)
    }

    pub(crate) fn rectangle(&mut self, corners: [[f64; 2]; 2], colour: Colour) {
        self.marks.push(Mark::Rectangle { corners, colour });
    }

    pub(crate) fn line(&mut self, points: Vec<[f64; 2]>, width: f64, colour: Colour) {
        if points.len() >= 2 {
            self.marks.push(Mark::Line {
                points,
                width,
                colour,
            });
        }
    }

    pub(crate) fn area(&mut self, points: Vec<[f64; 2]>, colour: Colour) {
        self.marks.push(Mark::Area { points, colour });
    }

    pub(crate) fn dot(&mut self, [x, y]: [f64; 2], radius: f64, colour: Colour) {
        let corner = |i: u32| {
            let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
            [x + radius * angle.cos(), y + radius * angle.sin()]
        };
        self.area((0..24).map(corner).collect(), colour);
    }

    pub(crate) fn text(&mut self, text: impl Into<String>, at: [f64; 2], look: TextLook) {
        let TextLook {
            size,
            bold,
            anchor,
            colour,
        } = look;
        let text = text.into();
        self.marks.push(Mark::Text {
            text,
            at,
            size,
            bold,
            upright: false,
            anchor,
            colour,
        });
    }

    /// A text read from below.
    pub(crate) fn upright_text(&mut self, text: impl Into<String>, at: [f64; 2], look: TextLook) {
        let TextLook {
            size,
            bold,
            anchor,
            colour,
        } = look;
        let text = text.into();
        self.marks.push(Mark::Text {
            text,
            at,
            size,
            bold,
            upright: true,
            anchor,
            colour,
        });
    }

    /// Writes the picture, unless the file shows it already; whether it was written.
    pub(crate) fn write(&self, path: &Path, format: PictureFormat) -> Result<bool, PlotError> {
        let drawing = |source: &dyn std::fmt::Display| PlotError::Drawing {
            path: path.into(),
            what: source.to_string(),
        };
        let fingerprint = self.fingerprint();
        if fingerprint_of(path, format).as_deref() == Some(&*fingerprint) {
            return Ok(false);
        }
        register_fonts();
        let drawn = self.drawn_size();
        match format {
            PictureFormat::Svg => {
                let mut text = String::new();
                let area = SVGBackend::with_string(&mut text, drawn).into_drawing_area();
                self.draw(&area).map_err(|error| drawing(&error))?;
                drop(area);
                let size = self.size();
                let large = format!(r#"width="{}" height="{}""#, drawn.0, drawn.1);
                let real = format!(r#"width="{}" height="{}""#, size.0, size.1);
                let text = text.replacen(&large, &real, 1);
                let end = format!("<metadata>{FINGERPRINT} {fingerprint}{END}");
                let text = text.replacen("</svg>", &end, 1);
                let text = clean(&text);
                let written = write_whole(path, |file| file.write_all(text.as_bytes()));
                written.map_err(|source| PlotError::Io {
                    action: "write",
                    path: path.into(),
                    source,
                })?;
            }
            PictureFormat::Png => {
                let pixels = self.pixels().map_err(|error| drawing(&error))?;
                self.write_png(path, &pixels, fingerprint)?;
            }
        }
        Ok(true)
    }

    /// Hash of the marks and the size, and the version of the program: equal pictures are not written again.
    fn fingerprint(&self) -> String {
        let text = format!("{} {:?}", env!("CARGO_PKG_VERSION"), self);
        // FNV-1a: the hashes of the standard library may change with its version
        let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        format!("{hash:016x}")
    }

    /// Red, green and blue of all pixels, row by row.
    ///
    /// # Errors
    /// The reason why the picture cannot be drawn.
    pub(crate) fn pixels(&self) -> Result<Vec<u8>, String> {
        register_fonts();
        let (wide, tall) = self.drawn_size();
        let mut pixels = vec![0; 3 * wide as usize * tall as usize];
        let area = BitMapBackend::with_buffer(&mut pixels, (wide, tall)).into_drawing_area();
        self.draw(&area).map_err(|error| error.to_string())?;
        drop(area);
        Ok(averaged(&pixels, wide as usize, self.oversampling()))
    }

    fn write_png(&self, path: &Path, pixels: &[u8], fingerprint: String) -> Result<(), PlotError> {
        let (width, height) = self.size();
        let per_metre = (self.density() * DENSITY / 0.0254).round() as u32;
        let written = write_whole(path, |file| {
            let mut encoder = png::Encoder::new(file, width, height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_pixel_dims(Some(png::PixelDimensions {
                xppu: per_metre,
                yppu: per_metre,
                unit: png::Unit::Meter,
            }));
            encoder.add_text_chunk(FINGERPRINT.into(), fingerprint.clone())?;
            let mut writer = encoder.write_header()?;
            writer.write_image_data(pixels)?;
            Ok(writer.finish()?)
        });
        written.map_err(|source| PlotError::Io {
            action: "write",
            path: path.into(),
            source,
        })
    }

    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let scale = self.density() * f64::from(self.oversampling());
        let place = |p: &[f64; 2]| ((p[0] * scale).round() as i32, (p[1] * scale).round() as i32);
        let paint = |colour: &Colour| RGBColor(colour.0, colour.1, colour.2);
        area.fill(&paint(&super::colour::WHITE))?;
        for mark in &self.marks {
            match mark {
                Mark::Rectangle {
                    corners: [a, b],
                    colour,
                } => {
                    let corners = [place(a), place(b)];
                    area.draw(&Rectangle::new(corners, paint(colour).filled()))?;
                }
                Mark::Line {
                    points,
                    width,
                    colour,
                } => {
                    let mut points: Vec<_> = points.iter().map(place).collect();
                    points.dedup();
                    if points.len() >= 2 {
                        let width = (width * scale).round().max(1.0) as u32;
                        let style = paint(colour).stroke_width(width);
                        area.draw(&PathElement::new(points, style))?;
                    }
                }
                Mark::Area { points, colour } => {
                    let points: Vec<_> = points.iter().map(place).collect();
                    area.draw(&Polygon::new(points, paint(colour).filled()))?;
                }
                Mark::Text {
                    text,
                    at,
                    size,
                    bold,
                    upright,
                    anchor,
                    colour,
                } => {
                    let style = if *bold {
                        FontStyle::Bold
                    } else {
                        FontStyle::Normal
                    };
                    let mut font = (FONT, size * scale, style).into_font();
                    let across = match anchor {
                        Anchor::Left => HPos::Left,
                        Anchor::Middle => HPos::Center,
                        Anchor::Right => HPos::Right,
                    };
                    if *upright {
                        font = font.transform(FontTransform::Rotate270);
                    }
                    let colour = paint(colour);
                    let style = TextStyle::from(font)
                        .color(&colour)
                        .pos(Pos::new(across, VPos::Center));
                    area.draw(&Text::new(text.as_str(), place(at), style))?;
                }
            }
        }
        area.present()
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
    let (width, _) = (FONT, size * f64::from(SCALE))
        .into_font()
        .box_size(text)
        .unwrap_or_default();
    f64::from(width) / f64::from(SCALE)
}

/// The fingerprint in a file; `None` if there is no such file, or it has none.
fn fingerprint_of(path: &Path, format: PictureFormat) -> Option<String> {
    let bytes = fs::read(path).ok()?;
    match format {
        // the end of a file that was written completely
        PictureFormat::Png if bytes.ends_with(b"IEND\xaeB`\x82") => {
            let reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
            let mut texts = reader.info().uncompressed_latin1_text.iter();
            let found = texts.find(|text| text.keyword == FINGERPRINT)?;
            Some(found.text.clone())
        }
        PictureFormat::Png => None,
        PictureFormat::Svg => {
            let text = String::from_utf8(bytes).ok()?;
            let (_, after) = text.rsplit_once(&format!("<metadata>{FINGERPRINT} "))?;
            Some(after.split_once(END)?.0.to_owned())
        }
    }
}

/// Means over squares of `scale` by `scale` pixels.
fn averaged(pixels: &[u8], width: usize, scale: u32) -> Vec<u8> {
    let area = scale * scale;
    let scale = scale as usize;
    let row = width * 3;
    let mut small = Vec::with_capacity(pixels.len() / (scale * scale));
    for rows in pixels.chunks_exact(row * scale) {
        for x in 0..width / scale {
            for channel in 0..3 {
                let mut sum = 0_u32;
                for dy in 0..scale {
                    for dx in 0..scale {
                        sum += u32::from(rows[dy * row + (x * scale + dx) * 3 + channel]);
                    }
                }
                small.push((sum / area) as u8);
            }
        }
    }
    small
}
