//! Pictures of a logged run: fields of the bodies, probes, melt pool, balance.
//!
//! [`plot()`] writes into a folder, as PNG or SVG:
//!
//! - `<body>-<field>-<time>`: the points of a body coloured by a field, a plane body as it is, a
//!   three-dimensional one as its surface from above and as the section y = const through its
//!   hottest point; in pictures of the temperature with solidus and liquidus as lines
//! - `<body>-melt-pool`: length, width and depth of the melt pool over time
//! - `probe-<name>`: the probes over time
//! - `balance-error`: errors of the balances over time, logarithmic

mod axes;
mod charts;
pub(crate) mod colour;
mod contour;
mod curves;
mod error;
#[cfg(test)]
pub(crate) mod fixture;
pub(crate) mod isotherm;
mod picture;
pub(crate) mod scalar;
mod section;
mod snapshot;
pub(crate) mod survey;
pub(crate) mod unit;

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::run::record::SPACING;
use perimelt_core::log::{BodyInfo, Log, LoggedCloud};

use crate::cell_grid::CellGrid;
use crate::melt_pool::Travel;
use crate::moment::state_at;
use charts::{balance_chart, line_chart, melt_pool_chart};
use curves::Chart;
pub use error::PlotError;
use isotherm::Isotherm;
use picture::Picture;
use scalar::{Scalar, scalar};
use snapshot::{ColourScale, Snapshot};
use survey::{Reference, survey};

/// What to plot.
#[derive(Clone, Debug, clap::Args)]
pub struct PlotArgs {
    /// log of the run
    pub log: PathBuf,
    /// folder for the pictures [default: the log's name with `-plots`]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// file format of the pictures
    #[arg(long, value_enum, default_value_t)]
    pub format: PictureFormat,
    /// bodies [default: all]
    #[arg(long)]
    pub body: Vec<String>,
    /// fields, or components such as `displacement.x` [default: temperature and displacement]
    #[arg(long)]
    pub field: Vec<String>,
    /// times of the field pictures, s [default: when the field peaks, and the end]
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true)]
    pub at: Vec<f64>,
    /// temperatures of the lines in field pictures; the first bounds the melt pool, K [default:
    /// solidus and liquidus of the case file]
    #[arg(long, value_delimiter = ',')]
    pub isotherm: Vec<f64>,
    /// show the body deformed, its displacements this many times as large
    #[arg(long, allow_negative_numbers = true)]
    pub deform: Option<f64>,
    /// axis along which the heat source travels, for the length of the melt pool
    #[arg(long, value_enum, default_value_t)]
    pub travel: Travel,
    /// width of the pictures, pixels
    #[arg(long, default_value_t = 1200, value_parser = clap::value_parser!(u32).range(500..=6000))]
    pub width: u32,
}

/// File format of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum PictureFormat {
    /// pixels
    #[default]
    Png,
    /// lines and letters, for print
    Svg,
}

impl PictureFormat {
    fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Svg => "svg",
        }
    }
}

/// Writes the pictures; their paths.
///
/// # Errors
/// The log cannot be read, has no such body or field, or a picture cannot be written.
pub fn plot(args: &PlotArgs) -> Result<Vec<PathBuf>, PlotError> {
    let log = Log::open(&args.log)?;
    let bodies = chosen_bodies(&log, &args.body)?;
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| beside(&args.log, "-plots"));
    fs::create_dir_all(&out).map_err(|source| PlotError::Io {
        action: "create",
        path: out.clone(),
        source,
    })?;
    let mut plotter = Plotter {
        log: &log,
        args,
        out,
        written: Vec::new(),
    };
    plotter.check_fields(&bodies)?;
    for body in bodies {
        plotter.plot_body(body)?;
    }
    for (name, series) in log.probes() {
        let chart = Chart::of_series(unit::pretty_name(name), series, false);
        plotter.write_chart(&format!("probe-{name}"), &chart)?;
    }
    plotter.write_chart("balance-error", &balance_chart(log.balance()))?;
    Ok(plotter.written)
}

/// The bodies asked for, or all.
fn chosen_bodies<'a>(log: &'a Log, asked: &[String]) -> Result<Vec<&'a BodyInfo>, PlotError> {
    if asked.is_empty() {
        return Ok(log.run().bodies.iter().collect());
    }
    let find = |name: &String| {
        log.run()
            .bodies
            .iter()
            .find(|body| body.name == *name)
            .ok_or_else(|| {
                let known = log.bodies().map(String::from).collect();
                PlotError::UnknownBody {
                    body: name.clone(),
                    known,
                }
            })
    };
    asked.iter().map(find).collect()
}

/// `run.mcap` with `-plots`: `run-plots`, in the same folder.
pub(crate) fn beside(log: &Path, suffix: &str) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    log.with_file_name(format!("{stem}{suffix}"))
}

struct Plotter<'a> {
    log: &'a Log,
    args: &'a PlotArgs,
    out: PathBuf,
    written: Vec<PathBuf>,
}

impl Plotter<'_> {
    /// Every field asked for must be in at least one of the bodies.
    fn check_fields(&self, bodies: &[&BodyInfo]) -> Result<(), PlotError> {
        let mut clouds = Vec::new();
        for body in bodies
            .iter()
            .filter(|body| !self.log.times(&body.name).is_empty())
        {
            clouds.push(self.log.first_cloud(&body.name)?);
        }
        let missing = |name: &&String| clouds.iter().all(|cloud| scalar(cloud, name).is_none());
        match self.args.field.iter().find(missing) {
            Some(field) if !clouds.is_empty() => {
                let names = clouds
                    .iter()
                    .flat_map(|cloud| &cloud.fields)
                    .map(|f| f.name.clone());
                let mut known: Vec<_> = names.collect();
                known.sort();
                known.dedup();
                Err(PlotError::UnknownField {
                    field: field.clone(),
                    known,
                })
            }
            _ => Ok(()),
        }
    }

    fn plot_body(&mut self, body: &BodyInfo) -> Result<(), PlotError> {
        let times = self.log.times(&body.name);
        if times.is_empty() {
            return Ok(());
        }
        let fields = self.fields(&self.log.first_cloud(&body.name)?);
        let isotherms = isotherm::isotherms(self.log, &body.name, &self.args.isotherm);
        let bound = isotherms.first().map(|isotherm| isotherm.temperature);
        let survey = survey(self.log, body, &fields, bound, self.args.travel)?;
        for field in &fields {
            let mut wanted: Vec<usize> = if self.args.at.is_empty() {
                survey
                    .peak
                    .get(field)
                    .copied()
                    .into_iter()
                    .chain([times.len() - 1])
                    .collect()
            } else {
                let at = self.args.at.iter().map(|&at| state_at(times, at));
                at.filter_map(Result::transpose).collect::<Result<_, _>>()?
            };
            wanted.sort_unstable();
            wanted.dedup();
            self.plot_field(body, field, &wanted, &isotherms)?;
        }
        let chart = melt_pool_chart(body, &survey, isotherms.first());
        self.write_chart(&format!("{}-melt-pool", body.name), &chart)
    }

    /// The fields of a cloud to draw.
    fn fields(&self, cloud: &LoggedCloud) -> Vec<String> {
        let there = |name: &&str| scalar(cloud, name).is_some();
        let asked: Vec<&str> = self.args.field.iter().map(String::as_str).collect();
        let wanted = if asked.is_empty() {
            vec!["temperature", "displacement"]
        } else {
            asked
        };
        let mut chosen: Vec<String> = wanted.into_iter().filter(there).map(String::from).collect();
        if chosen.is_empty() && self.args.field.is_empty() {
            chosen.extend(cloud.fields.first().map(|field| field.name.clone()));
        }
        chosen
    }

    /// One picture for each of these clouds, all with the same colours.
    fn plot_field(
        &mut self,
        body: &BodyInfo,
        field: &str,
        wanted: &[usize],
        isotherms: &[Isotherm],
    ) -> Result<(), PlotError> {
        let mut shown: Vec<(LoggedCloud, Scalar)> = Vec::new();
        for &index in wanted {
            let Ok(cloud) = self.log.cloud(&body.name, index) else {
                continue; // the survey told of it
            };
            // of a body without material nothing is shown
            if cloud.positions.is_empty() {
                continue;
            }
            if let Some(scalar) = scalar(&cloud, field) {
                shown.push((cloud, scalar));
            }
        }
        let values = || {
            shown
                .iter()
                .flat_map(|(_, scalar)| &scalar.values)
                .filter(|x| x.is_finite())
        };
        let (from, to) = (
            values().copied().fold(f64::INFINITY, f64::min),
            values().copied().fold(f64::NEG_INFINITY, f64::max),
        );
        let (from, to) = if from <= to { (from, to) } else { (0.0, 1.0) };
        let scale = ColourScale::new(field, from, to);
        let reference = Reference::new(self.log, body)?;
        for (cloud, scalar) in &shown {
            let name = format!(
                "{}-{field}-{}",
                body.name,
                unit::time_text(cloud.time).replace(' ', "")
            );
            let title = format!(
                "{}, t = {}",
                unit::pretty_name(&body.name),
                unit::time_text(cloud.time)
            );
            if body.dimension == 1 {
                self.write_chart(&name, &line_chart(title, cloud, scalar))?;
                continue;
            }
            let positions = reference.positions(cloud);
            let grid = grid_of(body, cloud, positions).ok_or_else(|| PlotError::Scattered {
                body: body.name.clone(),
                time: cloud.time,
            })?;
            let heat = scalar::scalar(cloud, "temperature");
            let heat = heat.as_ref().map_or(&scalar.values, |heat| &heat.values);
            let views = section::views(&grid, body.dimension, &scalar.values, heat);
            let displacement = self
                .args
                .deform
                .and_then(|factor| deformation(cloud, factor));
            let deformed = match (&displacement, self.args.deform) {
                (Some(_), Some(factor)) => {
                    format!(", deformed {} ×", unit::number(factor, 4))
                }
                _ => String::new(),
            };
            let (factor, shown_unit) = unit::value(&scalar.unit, from.abs().max(to.abs()));
            let snapshot = Snapshot {
                title: format!("{title}{deformed}"),
                views: &views,
                label: unit::label(&scalar.label, &shown_unit),
                factor,
                scale,
                isotherms: if field == "temperature" {
                    isotherms
                } else {
                    &[]
                },
                displacement: displacement.as_deref(),
            };
            self.write(&name, &snapshot.draw(self.args.width))?;
        }
        Ok(())
    }

    fn write_chart(&mut self, name: &str, chart: &Chart) -> Result<(), PlotError> {
        match chart.draw(self.args.width) {
            Some(picture) => self.write(name, &picture),
            None => Ok(()),
        }
    }

    fn write(&mut self, name: &str, picture: &Picture) -> Result<(), PlotError> {
        let name = name.replace(['/', '\\'], "-");
        let path = self
            .out
            .join(format!("{name}.{}", self.args.format.extension()));
        picture.write(&path, self.args.format)?;
        self.written.push(path);
        Ok(())
    }
}

/// The grid of a body's points, by the spacings that a cloud has logged with them.
fn grid_of(body: &BodyInfo, cloud: &LoggedCloud, positions: &[[f64; 3]]) -> Option<CellGrid> {
    let spacing = cloud.fields.iter().find(|f| f.name == SPACING);
    match spacing {
        Some(spacing) => CellGrid::of_spacings(positions, &spacing.values),
        None => CellGrid::new(positions, body.spacing),
    }
}

/// Displacements (m) times `factor`; `None` for a body without.
fn deformation(cloud: &LoggedCloud, factor: f64) -> Option<Vec<[f64; 3]>> {
    let field = cloud
        .fields
        .iter()
        .find(|f| f.name == "displacement" && f.components == 3)?;
    Some(
        field
            .values
            .chunks_exact(3)
            .map(|u| [u[0], u[1], u[2]].map(|x| factor * x))
            .collect(),
    )
}

#[cfg(test)]
mod tests;
