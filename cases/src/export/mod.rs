//! A logged run for other tools: a time series for ParaView, or tables.
//!
//! [`export()`] writes into a folder
//!
//! - `vtk`: `<body>-<number>.vtu` for every time and `<log>.pvd`, which ParaView opens as one
//!   time series of all bodies
//! - `csv`: `<body>-<number>.csv` for every time (positions and fields of the points), and
//!   `<body>-times.csv`, the times by number
//! - `exaca`: `<body>-solidification.csv`, all solidification events of the points of `thermal_history`, as ExaCA reads them
//! - always: `probe-<name>.csv`, `balance.csv`, `progress.csv`
//!
//! Points of a lattice are connected to hexahedra (`mesh.rs`). Positions are as logged, that is displaced: do not warp by
//! `displacement` again in ParaView. The array `reference_position` has the positions in the undeformed body; in tables,
//! they are the positions less the displacements.

mod csv;
mod exaca;
mod mesh;
#[cfg(test)]
mod tests;
mod vtu;

use std::{
    fs::File,
    io::{self, BufWriter},
    path::PathBuf,
};

use perimelt_core::log::{BodyInfo, Log, LogError};

use crate::argument::{self, UnknownBody, suggestion};
use crate::file_names::FileNames;
use crate::log_file::skip_damaged;
use crate::moment::{MomentError, note_other_times, states_at};
use crate::output::write_whole;
use crate::output::{beside, create_folder};
use crate::quantity::survey::Reference;
use crate::{log_file::open_log, terminal::tell};
use mesh::Mesh;

/// What to export.
#[derive(Clone, Debug, clap::Args)]
pub struct ExportArgs {
    /// log of the run
    pub log: PathBuf,
    /// folder for the files [default: the log's name with `-export`]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// what to write
    #[arg(long, value_enum, default_value_t)]
    pub format: ExportFormat,
    /// bodies [default: all]
    #[arg(long)]
    pub body: Vec<String>,
    /// fields [default: all]
    #[arg(long)]
    pub field: Vec<String>,
    /// logged times nearest to these, s [default: all]
    #[arg(
        long,
        value_delimiter = ',',
        conflicts_with = "every",
        allow_negative_numbers = true
    )]
    pub at: Vec<f64>,
    /// export every n-th logged time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub every: u32,
}

/// File format of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// for ParaView
    #[default]
    Vtk,
    /// comma-separated values
    Csv,
    /// solidification events for ExaCA, of bodies with `thermal_history`
    Exaca,
}

/// Why a run could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// No logged state at a time.
    #[error(transparent)]
    Moment(#[from] MomentError),
    /// No such body.
    #[error(transparent)]
    UnknownBody(#[from] UnknownBody),
    /// No such field in any of the bodies.
    #[error("the log has no field `{field}`; it has: {}{}", known.join(", "), suggestion(field, known))]
    UnknownField {
        /// the requested name
        field: String,
        /// the known names
        known: Vec<String>,
    },
    /// No body has solidification events.
    #[error(
        "no body of the log has solidification events: add the physics `thermal_history`, and log its fields {}",
        exaca::FIELDS.join(", ")
    )]
    NoEvents,
    /// A file or folder cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// where
        path: PathBuf,
        /// why not
        source: io::Error,
    },
}

/// Result of an export.
#[derive(Clone, Debug, Default)]
pub struct Exported {
    /// the files, the ParaView collection last
    pub files: Vec<PathBuf>,
    /// whether points are at displaced positions
    pub is_displaced: bool,
}

/// Writes the files.
///
/// # Errors
/// The log cannot be read, has no such body, field or time, or a file cannot be written.
pub fn export(args: &ExportArgs) -> Result<Exported, ExportError> {
    let log = open_log(&args.log)?;
    let bodies = argument::bodies(&log, &args.body)?;
    check_fields(&log, &bodies, &args.field)?;
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| beside(&args.log, "-export"));
    create_folder(&out).map_err(|source| ExportError::Io {
        path: out.clone(),
        source,
    })?;
    let mut folder = Folder {
        path: out,
        names: FileNames::default(),
        written: Vec::new(),
    };

    folder.write_series(&log)?;
    if let Some(body) = bodies.first() {
        note_other_times(log.times(&body.name), &args.at);
    }
    let mut is_displaced = false;
    match args.format {
        ExportFormat::Exaca => export_events(&log, &bodies, &mut folder)?,
        ExportFormat::Vtk | ExportFormat::Csv => {
            let mut collection = Vec::new();
            for (part, body) in bodies.into_iter().enumerate() {
                let reference = Reference::new(&log, body)?;
                is_displaced |= reference.is_of_solid();
                let states = export_states(&log, body, &reference, args, &mut folder)?;
                let states = states.into_iter();
                collection.extend(states.map(|(time, file)| vtu::DataSet { time, part, file }));
            }
            if args.format == ExportFormat::Vtk {
                // readers need ascending times
                collection.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.part.cmp(&b.part)));
                let stem = args.log.file_stem().unwrap_or_default().to_string_lossy();
                folder.write(&stem, "pvd", |file| {
                    vtu::write_collection(file, &collection)
                })?;
            }
        }
    }
    Ok(Exported {
        files: folder.written,
        is_displaced,
    })
}

/// Writes the states of a body as meshes or tables; times (s) and names of the files.
fn export_states(
    log: &Log,
    body: &BodyInfo,
    reference: &Reference,
    args: &ExportArgs,
    folder: &mut Folder,
) -> Result<Vec<(f64, String)>, ExportError> {
    let times = log.times(&body.name);
    let mut written = Vec::new();
    for index in chosen_times(times, args)? {
        let Some(mut cloud) = skip_damaged(log.cloud(&body.name, index))? else {
            continue;
        };
        // the cells need spacings and displacements, exported or not
        let positions = reference.positions(&cloud).into_owned();
        let mesh = Mesh::new(body, &cloud, &positions);
        if !args.field.is_empty() {
            cloud
                .fields
                .retain(|field| args.field.contains(&field.name));
        }
        let state = format!("{}-{index:05}", body.name);
        let file = match args.format {
            ExportFormat::Csv => folder.write(&state, "csv", |file| csv::cloud(file, &cloud))?,
            _ => {
                let shown = reference.is_of_solid().then_some(&positions[..]);
                folder.write(&state, "vtu", |file| {
                    vtu::write_cloud(file, &cloud, &mesh, shown)
                })?
            }
        };
        written.push((cloud.time, file));
    }
    if args.format == ExportFormat::Csv {
        folder.write(&format!("{}-times", body.name), "csv", |file| {
            csv::times(file, times)
        })?;
    }
    Ok(written)
}

/// Writes the solidification events of bodies that have them, from all logged states.
fn export_events(log: &Log, bodies: &[&BodyInfo], folder: &mut Folder) -> Result<(), ExportError> {
    let mut has_events = false;
    for body in bodies {
        let reference = Reference::new(log, body)?;
        let mut events = exaca::Events::default();
        let mut is_told = false;
        for index in 0..log.times(&body.name).len() {
            let Some(cloud) = skip_damaged(log.cloud(&body.name, index))? else {
                continue;
            };
            is_told |= events.take(&cloud, &reference.positions(&cloud)).is_some();
        }
        if !is_told {
            continue;
        }
        has_events = true;
        if events.lost > 0 {
            tell(&format!(
                "body {}: {} solidifications happened between two logged states and another one of the same point, and are \
                 left out: a shorter `log.interval` has them",
                body.name, events.lost
            ));
        }
        folder.write(&format!("{}-solidification", body.name), "csv", |file| {
            events.write(file)
        })?;
    }
    match has_events {
        true => Ok(()),
        false => Err(ExportError::NoEvents),
    }
}

/// Every requested field must be logged for at least one of the bodies.
fn check_fields(log: &Log, bodies: &[&BodyInfo], asked: &[String]) -> Result<(), ExportError> {
    let mut known = Vec::new();
    for body in bodies
        .iter()
        .filter(|body| !log.times(&body.name).is_empty())
    {
        known.extend(
            log.first_cloud(&body.name)?
                .fields
                .into_iter()
                .map(|field| field.name),
        );
    }
    known.sort();
    known.dedup();
    match asked.iter().find(|field| !known.contains(field)) {
        Some(field) => Err(ExportError::UnknownField {
            field: field.clone(),
            known,
        }),
        None => Ok(()),
    }
}

/// Numbers of the clouds to export.
fn chosen_times(times: &[f64], args: &ExportArgs) -> Result<Vec<usize>, MomentError> {
    if args.at.is_empty() {
        let every = args.every.max(1) as usize;
        return Ok((0..times.len()).step_by(every).collect());
    }
    states_at(times, &args.at)
}

/// The folder of the files.
struct Folder {
    path: PathBuf,
    names: FileNames,
    written: Vec<PathBuf>,
}

impl Folder {
    /// Writes probes, balance and progress.
    fn write_series(&mut self, log: &Log) -> Result<(), ExportError> {
        for (name, series) in log.probes() {
            self.write(&format!("probe-{name}"), "csv", |file| {
                csv::series(file, series)
            })?;
        }
        if !log.balance().columns.is_empty() {
            self.write("balance", "csv", |file| csv::series(file, log.balance()))?;
        }
        if !log.progress().is_empty() {
            self.write("progress", "csv", |file| {
                csv::progress(file, log.progress())
            })?;
        }
        Ok(())
    }

    /// Writes a file and returns its name.
    fn write(
        &mut self,
        name: &str,
        extension: &str,
        write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
    ) -> Result<String, ExportError> {
        let name = self.names.of(name, extension);
        let path = self.path.join(&name);
        write_whole(&path, write).map_err(|source| ExportError::Io {
            path: path.clone(),
            source,
        })?;
        self.written.push(path);
        Ok(name)
    }
}
