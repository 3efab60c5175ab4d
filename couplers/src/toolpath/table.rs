//! Toolpath from a file: by default a CSV file with the header `time,x,y,z,power`, motion and power linear between rows; or
//! a scan path in another [`TableFormat`].

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use perimelt_core::input;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{ToolpathError, Track, WaitUntil, finite, positive, scan_path};

/// Interval of the commands of the scanners of AM-Bench, s.
const SCANNER_STEP: f64 = 1e-5;

/// How a file describes a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableFormat {
    /// Columns `time` (s), `x`, `y`, `z` (m), `power` (W) and `wait` of a CSV file with a header.
    #[default]
    Csv,
    /// Scan path of AdditiveFOAM: a header and rows `mode x y z power parameter`, in m and W. Mode 0 is a move to the position
    /// with the parameter as speed (m/s), mode 1 a rest there with the parameter as duration (s).
    #[serde(rename = "additivefoam")]
    AdditiveFoam,
    /// Commands of a scanner at intervals of `time_step`, as of AM-Bench: rows of X (mm), Y (mm), power (W) and a trigger that is not
    /// used. The power of a row holds until the next one.
    Xypt,
}

/// Times, positions and powers from a file.
///
/// In the format `csv`: columns `time` (s), `x`, `y`, `z` (m) and `power` (W), in any order, named in the first line;
/// lines that start with `#` are skipped. Without a `power` column, or with an empty entry, the
/// power is that of the source. With a `wait` column the path waits at rows where it is 1, see `wait_until`. Two rows with the same time are a jump, with which the source is switched
/// on and off at full power.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// CSV file; relative to the folder of the case file.
    pub file: PathBuf,
    /// Format of the file; default `csv`.
    #[serde(default)]
    pub format: TableFormat,
    /// Time between two rows of the format `xypt` (s); default 1e-5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
    /// Height of a path of the format `xypt` (m); default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
    /// What the path waits for at rows whose column `wait` is 1; their times and all later ones are then delayed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    time: f64,
    x: f64,
    y: f64,
    z: f64,
    power: Option<f64>,
    #[serde(default)]
    wait: Option<f64>,
}

impl Table {
    pub(super) fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, ToolpathError> {
        self.check_keys()?;
        let path = base_dir.join(&self.file);
        let content = match input::read_text(&path, input::LIMIT) {
            Ok(content) => content,
            Err(source) => return Err(ToolpathError::TableOpen { path, source }),
        };
        match self.format {
            TableFormat::Csv => read(&content, &path, (default_power, self.wait_until.as_ref())),
            TableFormat::AdditiveFoam => scan_path::additivefoam(&content, &path),
            TableFormat::Xypt => {
                let step = positive("time_step", self.time_step.unwrap_or(SCANNER_STEP))?;
                let z = finite("z", self.z.unwrap_or(0.0))?;
                scan_path::xypt(&content, &path, (step, z))
            }
        }
    }

    /// Refuses keys of other formats.
    fn check_keys(&self) -> Result<(), ToolpathError> {
        let (csv, xypt) = (TableFormat::Csv, TableFormat::Xypt);
        for (key, is_given, format, name) in [
            ("wait_until", self.wait_until.is_some(), csv, "csv"),
            ("time_step", self.time_step.is_some(), xypt, "xypt"),
            ("z", self.z.is_some(), xypt, "xypt"),
        ] {
            if is_given && self.format != format {
                return Err(ToolpathError::TableKey { key, format: name });
            }
        }
        Ok(())
    }
}

fn read(
    content: &str,
    path: &Path,
    (default_power, wait): (Option<f64>, Option<&WaitUntil>),
) -> Result<Track, ToolpathError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(content.as_bytes());
    // the reader gives the position before the comments above a record, so lines are counted up to its end
    let (mut end, mut line) = (0, 1);
    let mut line_at = |position: &csv::Position| {
        let read = content
            .get(..position.byte() as usize)
            .unwrap_or(content)
            .trim_end();
        line += read.get(end..).unwrap_or("").matches('\n').count() as u64;
        end = read.len();
        line
    };
    let row_error = |line, error| ToolpathError::TableRow {
        path: path.into(),
        line,
        source: Box::new(error),
    };
    let headers = reader
        .headers()
        .cloned()
        .map_err(|error| row_error(1, error))?;
    let header_line = line_at(reader.position());
    let mut record = csv::StringRecord::new();
    let mut track: Option<(TrackBuilder, f64, f64)> = None;
    let mut rows = 0;
    loop {
        let more = reader.read_record(&mut record);
        let line = line_at(reader.position());
        if !more.map_err(|error| row_error(line, error))? {
            break;
        }
        let row: Row = record.deserialize(Some(&headers)).map_err(|error| {
            let in_header = matches!(error.kind(),
                csv::ErrorKind::Deserialize { err, .. } if err.field().is_none());
            row_error(if in_header { header_line } else { line }, error)
        })?;
        let power = checked(&row, default_power, path, line)?;
        let place = Vector3::new(row.x, row.y, row.z);
        match &mut track {
            None => track = Some((TrackBuilder::new(row.time, place), row.time, power)),
            Some((_, time, _)) if row.time < *time => {
                let (path, previous) = (path.into(), *time);
                return Err(ToolpathError::TableTime {
                    path,
                    line,
                    time: row.time,
                    previous,
                });
            }
            Some((track, time, before)) => {
                track.glide(place, row.time - *time, [*before, power]);
                (*time, *before) = (row.time, power);
            }
        }
        if row.wait.is_some_and(|w| w > 0.0) {
            if wait.is_none() {
                let path = path.into();
                return Err(ToolpathError::TableWait { path, line });
            }
            track
                .iter_mut()
                .for_each(|(track, ..)| track.begin_pass(wait));
        }
        rows += 1;
    }
    track
        .and_then(|(track, ..)| track.finish())
        .ok_or_else(|| ToolpathError::TableShort {
            path: path.into(),
            rows,
        })
}

/// The power of a row (W), after a look at all its numbers.
fn checked(
    row: &Row,
    default_power: Option<f64>,
    path: &Path,
    line: u64,
) -> Result<f64, ToolpathError> {
    let power = row
        .power
        .or(default_power)
        .ok_or_else(|| ToolpathError::NoPower {
            key: "power".into(),
        })?;
    let table_value = |column, value, expected| {
        Err(ToolpathError::TableValue {
            path: path.into(),
            line,
            column,
            value,
            expected,
        })
    };
    for (column, value) in [("time", row.time), ("x", row.x), ("y", row.y), ("z", row.z)] {
        if !value.is_finite() {
            return table_value(column, value, "a finite number");
        }
    }
    if !(power.is_finite() && power >= 0.0) {
        return table_value("power", power, "a finite number, zero or greater");
    }
    Ok(power)
}
