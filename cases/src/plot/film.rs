//! An animated picture of a field over the logged times.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use perimelt_core::log::{BodyInfo, LoggedCloud};

use super::{
    PlotError, Plotted, Plotter,
    args::ValueRange,
    colour::ColourMap,
    deformation,
    fields::{Drawn, FieldPlot},
    palette::Palette,
    scale::ColourScale,
};
use crate::log_file::skip_damaged;
use crate::output::WholeFile;
use crate::quantity::isotherm;
use crate::quantity::scalar::scalar;
use crate::quantity::survey::survey;

/// File format of a film, by the end of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FilmFormat {
    Gif,
    Png,
}

impl FilmFormat {
    fn of(path: &Path) -> Result<Self, PlotError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("gif") => Ok(Self::Gif),
            Some("png" | "apng") => Ok(Self::Png),
            _ => Err(PlotError::FilmFormat { path: path.into() }),
        }
    }
}

/// A picture of a film: red, green and blue of all pixels.
struct FilmFrame {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl FilmFrame {
    /// The picture with another height: cut off, or with white below it.
    fn fitted(mut self, width: u32, height: u32) -> Self {
        if self.width == width {
            self.pixels
                .resize(3 * width as usize * height as usize, 255);
            self.height = height;
        }
        self
    }
}

impl Plotter<'_> {
    /// Draws a film of the first field of the first of these bodies that has more than one dimension.
    pub(super) fn film(&mut self, bodies: &[&BodyInfo], path: &Path) -> Result<(), PlotError> {
        let format = FilmFormat::of(path)?;
        let is_drawn =
            |body: &&&BodyInfo| body.dimension > 1 && !self.log.times(&body.name).is_empty();
        let body = bodies.iter().find(is_drawn).ok_or(PlotError::NoFilm)?;
        let fields = self.fields(&self.log.first_cloud(&body.name)?);
        let field = fields.first().ok_or(PlotError::NoFilm)?;
        let isotherms = isotherm::isotherms(self.log, &body.name, &self.isotherms());
        let survey = survey(self.log, body, &fields[..1], None, self.args.travel)?;
        let mut plot = self.field_plot(body, field, &isotherms, &survey)?;
        let chosen = self.chosen(body);
        self.survey_film(&mut plot, &chosen)?;
        let map = match (self.args.range, plot.range) {
            (Some(asked), _) => ColourScale::asked(field, asked).map,
            (None, Some(range)) => ColourScale::new(field, range.from, range.to).map,
            (None, None) => ColourMap::Viridis,
        };
        let mut film = Film::create(path, format, map, chosen.len(), self.args.rate)?;
        for index in chosen {
            // the picture before a damaged state stays for longer
            let Some(cloud) = skip_damaged(self.log.cloud(&body.name, index))? else {
                film.repeat()?;
                continue;
            };
            match self.draw_field(&plot, &cloud)? {
                Some(Drawn::Picture(picture)) => {
                    let pixels = picture.pixels().map_err(|what| PlotError::Drawing {
                        path: path.into(),
                        what,
                    })?;
                    let (width, height) = picture.size();
                    film.add(FilmFrame {
                        width,
                        height,
                        pixels,
                    })?;
                }
                _ => film.repeat()?,
            }
        }
        film.finish()?;
        self.written.push(Plotted {
            path: path.into(),
            unchanged: false,
        });
        Ok(())
    }

    /// Numbers of the states that are shown.
    fn chosen(&self, body: &BodyInfo) -> Vec<usize> {
        let last = self.log.times(&body.name).len() - 1;
        let frames = (self.args.frames as usize).min(last + 1);
        let index = |frame: usize| frame * last / (frames - 1).max(1);
        (0..frames).map(index).collect()
    }

    /// Finds colours and extent that hold for all pictures.
    fn survey_film(&self, plot: &mut FieldPlot<'_>, chosen: &[usize]) -> Result<(), PlotError> {
        let mut range = ValueRange {
            from: f64::INFINITY,
            to: f64::NEG_INFINITY,
        };
        let mut extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for &index in chosen {
            let Some(cloud) = skip_damaged(self.log.cloud(&plot.body.name, index))? else {
                continue;
            };
            let values = scalar(&cloud, plot.field).map_or(Vec::new(), |scalar| scalar.values);
            for value in values.into_iter().filter(|value| value.is_finite()) {
                range.from = range.from.min(value);
                range.to = range.to.max(value);
            }
            self.extend(plot, &cloud, &mut extent);
        }
        plot.is_film = true;
        plot.range = (range.from <= range.to).then_some(range);
        plot.extent = (extent[0][0] <= extent[1][0]).then_some(extent);
        Ok(())
    }

    /// Extends a box (m) by the cells of a cloud as they are drawn.
    fn extend(&self, plot: &FieldPlot<'_>, cloud: &LoggedCloud, extent: &mut [[f64; 3]; 2]) {
        let moved = self
            .args
            .deform
            .and_then(|factor| deformation(cloud, factor));
        let half = 0.5 * plot.body.spacing;
        for (point, position) in plot.reference.positions(cloud).iter().enumerate() {
            for axis in 0..3 {
                let x = position[axis] + moved.as_ref().map_or(0.0, |moved| moved[point][axis]);
                if x.is_finite() {
                    extent[0][axis] = extent[0][axis].min(x - half);
                    extent[1][axis] = extent[1][axis].max(x + half);
                }
            }
        }
    }
}

/// A film being written.
struct Film {
    path: PathBuf,
    whole: WholeFile,
    format: FilmFormat,
    palette: Palette,
    /// number of pictures
    pictures: usize,
    /// pictures in a second
    rate: u16,
    file: Option<BufWriter<File>>,
    encoder: Option<Encoder>,
    last: Option<FilmFrame>,
    /// pictures before the first one
    missing: usize,
}

enum Encoder {
    Gif(Box<gif::Encoder<BufWriter<File>>>),
    Png(Box<png::Writer<BufWriter<File>>>),
}

impl Film {
    fn create(
        path: &Path,
        format: FilmFormat,
        map: ColourMap,
        pictures: usize,
        rate: u16,
    ) -> Result<Self, PlotError> {
        let failed = |source| PlotError::Io {
            action: "create",
            path: path.into(),
            source,
        };
        let whole = WholeFile::begin(path).map_err(failed)?;
        let file = whole.writable().map_err(failed)?;
        Ok(Self {
            path: path.into(),
            whole,
            format,
            palette: Palette::new(map),
            pictures,
            rate,
            file: Some(BufWriter::new(file)),
            encoder: None,
            last: None,
            missing: 0,
        })
    }

    /// Adds a picture; the first one gives the size of all.
    fn add(&mut self, frame: FilmFrame) -> Result<(), PlotError> {
        if let Some(file) = self.file.take() {
            self.encoder = Some(self.encoder(file, &frame)?);
        }
        let frame = match &self.last {
            Some(last) => frame.fitted(last.width, last.height),
            None => frame,
        };
        self.last = Some(frame);
        for _ in 0..=std::mem::take(&mut self.missing) {
            self.encode()?;
        }
        Ok(())
    }

    /// Adds the last picture once more.
    fn repeat(&mut self) -> Result<(), PlotError> {
        if self.last.is_none() {
            self.missing += 1;
        }
        self.encode()
    }

    fn encoder(&self, file: BufWriter<File>, frame: &FilmFrame) -> Result<Encoder, PlotError> {
        match self.format {
            FilmFormat::Gif => {
                let side = |pixels: u32| {
                    u16::try_from(pixels)
                        .map_err(|_| self.failed("the pictures are too large for a GIF"))
                };
                let encoder = gif::Encoder::new(
                    file,
                    side(frame.width)?,
                    side(frame.height)?,
                    &self.palette.bytes(),
                );
                let mut encoder = encoder.map_err(|error| self.failed(error))?;
                encoder
                    .set_repeat(gif::Repeat::Infinite)
                    .map_err(|error| self.failed(error))?;
                Ok(Encoder::Gif(Box::new(encoder)))
            }
            FilmFormat::Png => {
                let mut encoder = png::Encoder::new(file, frame.width, frame.height);
                encoder.set_color(png::ColorType::Rgb);
                let frames = u32::try_from(self.pictures).unwrap_or(u32::MAX);
                let animated = encoder
                    .set_animated(frames, 0)
                    .and_then(|()| encoder.set_frame_delay(1, self.rate));
                animated.map_err(|error| self.failed(error))?;
                let writer = encoder.write_header().map_err(|error| self.failed(error))?;
                Ok(Encoder::Png(Box::new(writer)))
            }
        }
    }

    fn encode(&mut self) -> Result<(), PlotError> {
        let (Some(encoder), Some(frame)) = (&mut self.encoder, &self.last) else {
            return Ok(());
        };
        let written = match encoder {
            Encoder::Gif(encoder) => {
                // the sizes fit, as checked at the first picture
                let (width, height) = (frame.width as u16, frame.height as u16);
                let pixels = self.palette.indices(&frame.pixels);
                let mut picture = gif::Frame::from_indexed_pixels(width, height, pixels, None);
                picture.delay = 100 / self.rate;
                encoder.write_frame(&picture).map_err(|e| e.to_string())
            }
            Encoder::Png(writer) => writer
                .write_image_data(&frame.pixels)
                .map_err(|e| e.to_string()),
        };
        written.map_err(|what| self.failed(what))
    }

    fn finish(mut self) -> Result<(), PlotError> {
        match self.encoder.take() {
            None => return Err(PlotError::NoFilm),
            Some(Encoder::Gif(encoder)) => {
                let flushed = encoder.into_inner().and_then(|mut file| Ok(file.flush()?));
                flushed.map_err(|error| self.failed(error))?;
            }
            Some(Encoder::Png(writer)) => writer.finish().map_err(|error| self.failed(error))?,
        }
        let Film { path, whole, .. } = self;
        whole.put_in_place().map_err(|source| PlotError::Io {
            action: "write",
            path,
            source,
        })
    }

    fn failed(&self, what: impl std::fmt::Display) -> PlotError {
        PlotError::Drawing {
            path: self.path.clone(),
            what: what.to_string(),
        }
    }
}
