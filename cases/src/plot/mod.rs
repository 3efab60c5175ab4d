//! Pictures of a logged run: fields of the bodies, probes, melt pool, balance.
//!
//! [`plot()`] writes into a folder, as PNG or SVG:
//!
//! - `<body>-<field>-<time>`: the points of a body coloured by a field, a plane body as it is, a
//!   three-dimensional one as its surface from above and in sections, by default along and across the path of its
//!   hottest point, through it, a laminate as its plies; in pictures of the temperature with isotherms
//! - `<body>-melt-pool`: length, width and depth of the melt pool over time
//! - `probe-<name>`: the probes over time, those along a line over the distance at some times
//! - `balance-error`: relative errors of the balances over time, logarithmic
//!
//! A file that shows its picture already is not written again.
//!
//! With `--film` it writes one animated picture instead.

mod args;
pub(crate) mod charts;
mod error;
mod fields;
mod film;
#[cfg(test)]
pub(crate) mod fixture;
mod plies;

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use perimelt_core::log::{BodyInfo, Log, LogError, LoggedCloud, Series};
use perimelt_plot::{Chart, DENSITY, Picture};

use crate::argument;
use crate::case::of_log::case_of;
use crate::file_names::FileNames;
use crate::log_file::open_log;
use crate::moment::{note_other_times, states_at};
use crate::output::{beside, create_folder, write_whole};
use crate::probe::{ProbeKind, is_line};
use crate::quantity::isotherm;
use crate::quantity::scalar::{check_scalars, scalar};
use crate::quantity::survey::{BodySurvey, displacement, survey};
use crate::terminal::clean;
use crate::unit;
pub use args::{PictureFormat, PictureKind, PlotArgs};
use charts::{balance_chart, line_probe_chart, melt_pool_chart, series_chart};
pub use error::PlotError;
use fields::FieldPlot;

/// A file with a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plotted {
    /// the file
    pub path: PathBuf,
    /// whether it showed this picture already, and was not written again
    pub unchanged: bool,
}

/// Width from which on letters and lines grow with a picture whose resolution is not given, pixels.
const USUAL_WIDTH: u32 = 1200;

/// Least width of the layout of a picture, pixels: letters need as much.
const LEAST_WIDTH: u32 = 500;

/// Width of the layout of pictures, pixels.
fn layout_width(args: &PlotArgs) -> Result<u32, PlotError> {
    let Some(dpi) = args.dpi else {
        return Ok(args.width.min(USUAL_WIDTH));
    };
    let width = (f64::from(args.width) * DENSITY / f64::from(dpi)).round() as u32;
    if width < LEAST_WIDTH {
        let least = f64::from(LEAST_WIDTH) * f64::from(dpi) / DENSITY;
        return Err(PlotError::Narrow {
            width: args.width,
            dpi,
            least: least.ceil() as u32,
        });
    }
    Ok(width)
}

/// Writes the pictures.
///
/// # Errors
/// The log cannot be read, has no such body or field, or a picture cannot be written.
pub fn plot(args: &PlotArgs) -> Result<Vec<Plotted>, PlotError> {
    let layout_width = layout_width(args)?;
    let log = open_log(&args.log)?;
    let bodies = argument::bodies(&log, &args.body)?;
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| beside(&args.log, "-plots"));
    // a case that this program cannot read has no title
    let case = case_of(&log).ok();
    let title = case.map_or_else(String::new, |case| case.case.title);
    let mut plotter = Plotter {
        log: &log,
        args,
        title,
        out,
        layout_width,
        names: FileNames::default(),
        written: Vec::new(),
    };
    check_scalars(&log, bodies.iter().map(|body| &*body.name), &args.field)?;
    if let Some(film) = &args.film {
        plotter.film(&bodies, film)?;
        return Ok(plotter.written);
    }
    create_folder(&plotter.out).map_err(|source| PlotError::Io {
        action: "create",
        path: plotter.out.clone(),
        source,
    })?;
    if let Some(body) = bodies.first() {
        note_other_times(log.times(&body.name), &args.at);
    }
    for body in bodies {
        plotter.plot_body(body)?;
    }
    if plotter.wants(PictureKind::Probes) {
        for (name, series) in log.probes() {
            let chart = plotter.probe_chart(name, series)?;
            plotter.write_chart(&format!("probe-{name}"), &chart)?;
        }
    }
    if plotter.wants(PictureKind::Balance) {
        plotter.write_chart("balance-error", &balance_chart(log.balance()))?;
    }
    if plotter.written.is_empty() && !args.only.is_empty() {
        return Err(PlotError::NoneOfKind {
            kinds: args.only.clone(),
        });
    }
    Ok(plotter.written)
}

struct Plotter<'a> {
    log: &'a Log,
    args: &'a PlotArgs,
    /// title of the case
    title: String,
    out: PathBuf,
    /// width of the layout of pictures, pixels
    layout_width: u32,
    names: FileNames,
    written: Vec<Plotted>,
}

impl Plotter<'_> {
    /// Whether pictures of a kind are wanted.
    fn wants(&self, kind: PictureKind) -> bool {
        self.args.only.is_empty() || self.args.only.contains(&kind)
    }

    fn plot_body(&mut self, body: &BodyInfo) -> Result<(), PlotError> {
        let times = self.log.times(&body.name);
        let is_wanted = self.wants(PictureKind::Fields) || self.wants(PictureKind::MeltPool);
        if times.is_empty() || !is_wanted {
            return Ok(());
        }
        let mut fields = self.fields(&self.log.first_cloud(&body.name)?);
        if !self.wants(PictureKind::Fields) {
            fields.clear();
        }
        let asked = self.isotherms();
        let isotherms = isotherm::isotherms(self.log, &body.name, &asked);
        let bound = isotherm::bound(self.log, &body.name, &asked);
        let temperature = bound.as_ref().map(|isotherm| isotherm.temperature);
        let survey = survey(self.log, body, &fields, temperature, self.args.travel)?;
        // the source is at the section across its path
        let middle = survey.middle().map(|hottest| hottest.index);
        let half_way = |field: &str| middle.filter(|_| field == "temperature");
        for field in &fields {
            let last = times.len() - 1;
            let wanted: BTreeSet<usize> = match &self.args.at[..] {
                // the macrograph is complete at the end only
                [] if field == fields::HIGHEST_TEMPERATURES => [last].into(),
                [] => {
                    let peak = survey.peak.get(field).copied();
                    let chosen = peak.into_iter().chain(half_way(field)).chain([last]);
                    chosen.collect()
                }
                at => states_at(times, at)?.into_iter().collect(),
            };
            let plot = self.field_plot(body, field, &isotherms, &survey)?;
            self.plot_field(plot, wanted, &survey)?;
        }
        if !self.wants(PictureKind::MeltPool) {
            return Ok(());
        }
        let chart = melt_pool_chart(body, &survey, bound.as_ref(), self.args.celsius);
        self.write_chart(&format!("{}-melt-pool", body.name), &chart)
    }

    /// The temperatures of the requested isotherms, K.
    fn isotherms(&self) -> Vec<f64> {
        let celsius = unit::Shown::new("K", 0.0, self.args.celsius);
        let asked = self.args.isotherm.iter();
        asked.map(|t| celsius.inverse(*t)).collect()
    }

    /// The fields of a cloud to draw.
    fn fields(&self, cloud: &LoggedCloud) -> Vec<String> {
        let there = |name: &&str| scalar(cloud, name).is_some();
        let mut wanted: Vec<&str> = self.args.field.iter().map(String::as_str).collect();
        if wanted.is_empty() {
            wanted = vec!["temperature", fields::HIGHEST_TEMPERATURES, "displacement"];
        }
        let mut chosen: Vec<String> = wanted.into_iter().filter(there).map(String::from).collect();
        if chosen.is_empty() && self.args.field.is_empty() {
            chosen.extend(cloud.fields.first().map(|field| field.name.clone()));
        }
        chosen
    }

    /// One picture of a field for each of these clouds.
    fn plot_field(
        &mut self,
        mut plot: FieldPlot<'_>,
        wanted: BTreeSet<usize>,
        survey: &BodySurvey,
    ) -> Result<(), PlotError> {
        for index in wanted {
            plot.cuts = self.cuts(survey.hottest_of(index));
            let cloud = match self.log.cloud(&plot.body.name, index) {
                // the survey has reported it
                Err(LogError::Damaged { .. }) => continue,
                cloud => cloud?,
            };
            let time = unit::time_text(cloud.time);
            let name = format!("{}-{}-{time}", plot.body.name, plot.field);
            if let Some(picture) = self.draw_field(&plot, &cloud)? {
                self.write(&name, &picture)?;
            }
        }
        Ok(())
    }

    /// A probe over time; one along a line over the distance from its start, at the requested times or at five times.
    fn probe_chart(&self, name: &str, series: &Series) -> Result<Chart, PlotError> {
        /// number of times that are shown by default
        const TIMES: usize = 5;
        let title = unit::pretty_name(name);
        let columns = series.columns.iter().map(|column| column.name.as_str());
        if !is_line(columns) || series.times.is_empty() {
            return Ok(series_chart(title, series, self.args.celsius));
        }
        let last = series.times.len() - 1;
        let rows: BTreeSet<usize> = match &self.args.at[..] {
            [] => (1..=TIMES).map(|part| part * last / TIMES).collect(),
            at => states_at(&series.times, at)?.into_iter().collect(),
        };
        let rows = Vec::from_iter(rows);
        let field = self.probed_field(name).unwrap_or_default();
        let celsius = self.args.celsius;
        Ok(line_probe_chart(title, series, &rows, &field, celsius))
    }

    /// Field and component of a line probe, from the case.
    fn probed_field(&self, name: &str) -> Option<String> {
        let case = case_of(self.log).ok()?;
        let is_line = |kind: &ProbeKind| matches!(kind, ProbeKind::Line(_));
        let mut probes = case.probes.iter();
        let probe = probes.find(|probe| probe.name == name && is_line(&probe.kind))?;
        let field = unit::pretty_name(probe.field.as_deref()?);
        Some(match &probe.component {
            Some(component) => format!("{field} {}", unit::pretty_name(component)),
            None => field,
        })
    }

    /// A chart of the width of the pictures; `None` if it would be empty.
    fn draw_chart(&self, chart: &Chart) -> Option<Picture> {
        let picture = chart.draw(&self.title, self.layout_width)?;
        Some(picture.scaled_to(self.args.width))
    }

    fn write_chart(&mut self, name: &str, chart: &Chart) -> Result<(), PlotError> {
        match self.draw_chart(chart) {
            Some(picture) => self.write(name, &picture),
            None => Ok(()),
        }
    }

    fn write(&mut self, name: &str, picture: &Picture) -> Result<(), PlotError> {
        let extension = args::name(&self.args.format);
        let path = self.out.join(self.names.of(name, &extension));
        let unchanged = !write_picture(picture, &path, self.args.format)?;
        self.written.push(Plotted { path, unchanged });
        Ok(())
    }
}

/// Writes a picture, unless the file shows it already; whether it was written.
///
/// # Errors
/// The picture cannot be drawn, or the file cannot be written.
pub(crate) fn write_picture(
    picture: &Picture,
    path: &Path,
    format: PictureFormat,
) -> Result<bool, PlotError> {
    let file = match format {
        PictureFormat::Png => picture.png(),
        // titles and names of others
        PictureFormat::Svg => picture.svg().map(|text| clean(&text).into_bytes()),
    };
    let file = file.map_err(|source| PlotError::Drawing {
        path: path.into(),
        source,
    })?;
    if std::fs::read(path).is_ok_and(|found| found == file) {
        return Ok(false);
    }
    let written = write_whole(path, |to| to.write_all(&file));
    written.map_err(|source| PlotError::Io {
        action: "write",
        path: path.into(),
        source,
    })?;
    Ok(true)
}

/// Displacements (m) times a factor; `None` without a factor, or for a body without displacements.
fn deformation(cloud: &LoggedCloud, factor: Option<f64>) -> Option<Vec<[f64; 3]>> {
    let factor = factor?;
    let displacements = displacement(cloud)?;
    Some(
        displacements
            .map(|u| [u[0], u[1], u[2]].map(|x| factor * x))
            .collect(),
    )
}

#[cfg(test)]
mod tests;
