//! An animated picture of a field over the logged times.

use std::fs::File;
use std::io::{BufWriter, Error};
use std::iter::once;
use std::path::Path;

use perimelt_core::log::{BodyInfo, LoggedCloud};
use perimelt_plot::{Film, FilmFormat, FilmSettings, Picture, range};

use super::fields::FieldPlot;
use super::{PlotError, Plotted, Plotter, deformation};
use crate::log_file::skip_damaged;
use crate::output::write_whole;
use crate::quantity::isotherm;
use crate::quantity::scalar::scalar;
use crate::quantity::survey::survey;

/// File format of a film, by the end of its name.
fn format_of(path: &Path) -> Result<FilmFormat, PlotError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("gif") => Ok(FilmFormat::Gif),
        Some("png" | "apng") => Ok(FilmFormat::Png),
        _ => Err(PlotError::FilmFormat { path: path.into() }),
    }
}

impl Plotter<'_> {
    /// Draws a film of the first field of the first of these bodies that has more than one dimension.
    pub(super) fn film(&mut self, bodies: &[&BodyInfo], path: &Path) -> Result<(), PlotError> {
        let format = format_of(path)?;
        let is_drawn =
            |body: &&&BodyInfo| body.dimension > 1 && !self.log.times(&body.name).is_empty();
        let body = bodies.iter().find(is_drawn).ok_or(PlotError::NoFilm)?;
        let fields = self.fields(&self.log.first_cloud(&body.name)?);
        let field = fields.first().ok_or(PlotError::NoFilm)?;
        let isotherms = isotherm::isotherms(self.log, &body.name, &self.isotherms());
        let survey = survey(self.log, body, &fields[..1], None, self.args.travel)?;
        let mut plot = self.field_plot(body, field, &isotherms, &survey)?;
        let states = self.survey_film(&mut plot)?;
        let first = self.log.cloud(&body.name, states[0])?;
        let values = scalar(&first, field).ok_or(PlotError::NoFilm)?;
        let settings = FilmSettings {
            format,
            map: self.scale(&plot, &values).map,
            pictures: states.len(),
            rate: self.args.rate,
        };
        let write = |file: &mut BufWriter<&File>| {
            let written = self.write_film(&plot, &states, settings, file);
            written.map_err(Error::other)
        };
        write_whole(path, write).map_err(|error| {
            let unwritten = |source| PlotError::Io {
                action: "write",
                path: path.into(),
                source,
            };
            error.downcast().unwrap_or_else(unwritten)
        })?;
        self.written.push(Plotted {
            path: path.into(),
            unchanged: false,
        });
        Ok(())
    }

    fn write_film(
        &self,
        plot: &FieldPlot<'_>,
        states: &[usize],
        settings: FilmSettings,
        file: &mut BufWriter<&File>,
    ) -> Result<(), PlotError> {
        let drawing = |source| PlotError::Drawing {
            path: self.args.film.clone().unwrap_or_default(),
            source,
        };
        let picture = |&index: &usize| -> Result<Picture, PlotError> {
            let cloud = self.log.cloud(&plot.body.name, index)?;
            self.draw_field(plot, &cloud)?.ok_or(PlotError::NoFilm)
        };
        let mut pictures = states.iter().map(picture);
        let first = pictures.next().ok_or(PlotError::NoFilm)??;
        let mut film = Film::new(file, settings, first.size()).map_err(drawing)?;
        for picture in once(Ok(first)).chain(pictures) {
            film.add(&picture?).map_err(drawing)?;
        }
        film.finish().map_err(drawing)
    }

    /// Finds colours and extent that hold for all pictures, and the numbers of the states to show. Before a state that cannot be
    /// shown, the one before it stays for longer.
    fn survey_film(&self, plot: &mut FieldPlot<'_>) -> Result<Vec<usize>, PlotError> {
        let last = self.log.times(&plot.body.name).len() - 1;
        let frames = (self.args.frames as usize).min(last + 1);
        let mut extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut states = Vec::new();
        for index in (0..frames).map(|frame| frame * last / (frames - 1).max(1)) {
            let cloud = skip_damaged(self.log.cloud(&plot.body.name, index))?;
            let cloud = cloud.filter(|cloud| !cloud.positions.is_empty());
            let scalar = cloud.as_ref().and_then(|cloud| scalar(cloud, plot.field));
            states.push(scalar.as_ref().map(|_| index));
            if let (Some(cloud), Some(scalar)) = (cloud, scalar) {
                plot.range = range(
                    scalar
                        .values
                        .into_iter()
                        .chain(plot.range.into_iter().flatten()),
                );
                self.extend(plot, &cloud, &mut extent);
            }
        }
        plot.is_film = true;
        plot.extent = (extent[0][0] <= extent[1][0]).then_some(extent);
        let first = states.iter().flatten().next();
        let mut shown = *first.ok_or(PlotError::NoFilm)?;
        let shown = states.into_iter().map(|state| {
            shown = state.unwrap_or(shown);
            shown
        });
        Ok(shown.collect())
    }

    /// Extends a box (m) by the cells of a cloud as they are drawn.
    fn extend(&self, plot: &FieldPlot<'_>, cloud: &LoggedCloud, extent: &mut [[f64; 3]; 2]) {
        let moved = deformation(cloud, self.args.deform);
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
