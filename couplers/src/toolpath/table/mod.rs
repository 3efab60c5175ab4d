//! Toolpath from a file: times, places and powers, or a scan path in another [`TableFormat`].
//!
//! A header names quantity and unit of each column, in any order and case; `columns.rs`. Entries are separated by commas or blanks.

mod columns;
mod scan_path;
#[cfg(test)]
mod tests;
mod timed;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Track, WaitUntil};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_finite, check_positive};
use timed::Between;

/// Interval of the commands of the scanners of AM-Bench, s.
const SCANNER_STEP: f64 = 1e-5;

/// How a file describes a path. A header names quantity and unit of each column, such as `X(mm)`, `Power(W)` or `Pmod`, in any order and
/// case; a file without one has the columns given here.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableFormat {
    /// Columns `time` (s), `x`, `y`, `z` (m), `power` (W) and `wait` with a header; power and place are linear between rows.
    #[default]
    Csv,
    /// Columns `time` (s), `x`, `y`, `z` (m), `power` (W): the power of a row holds until the next one, the place is linear between
    /// rows. The series of events of programs for additive manufacturing.
    Events,
    /// Scan path of AdditiveFOAM: rows `mode x y z power parameter`, in m and W. Mode 0 is a move to the place
    /// with the parameter as speed (m/s), mode 1 a rest there with the parameter as duration (s).
    #[serde(rename = "additivefoam")]
    AdditiveFoam,
    /// Scan path with segments of adamantine: two lines with the number of segments, then rows `mode x y z pmod param` as those of
    /// `additivefoam`, in m, with a factor of the power of the source. Its event series are `events` with `power_as = "factor"`.
    Adamantine,
    /// Path of 3DThesis: rows `Mode X(mm) Y(mm) Z(mm) Pmod Time(s)` as those of `adamantine`, in mm.
    #[serde(rename = "3dthesis")]
    Thesis,
    /// Commands of a scanner at intervals of `time_step`, as of AM-Bench: rows of X (mm), Y (mm), power (W) and a trigger that is not
    /// used. The power of a row holds until the next one.
    Xypt,
}

/// What the power of a row is in a file whose header does not say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PowerAs {
    /// W.
    Watts,
    /// A factor of the power of the source.
    Factor,
}

/// Times, places and powers from a file.
///
/// In the formats `csv` and `events`: columns `time` (s), `x`, `y`, `z` (m) and `power` (W) or `factor` (of the power of the source), in any
/// order, named in the first line; lines that start with `#` are skipped. Without a `power` column of `csv`, or with an empty entry, the
/// power is that of the source. With a `wait` column the path waits at rows where it is 1, see `wait_until`. Two rows with the
/// same time are a jump, with which the source is switched on and off at full power.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// File with a row for each time or segment; relative to the folder of the case file.
    pub file: PathBuf,
    /// Format of the file; default `csv`.
    #[serde(default)]
    pub format: TableFormat,
    /// What the power is in a file of the format `events` without a header; default `watts`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_as: Option<PowerAs>,
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

impl Table {
    pub(super) fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, SetupError> {
        self.check_keys()?;
        let path = base_dir.join(&self.file);
        let content = match perimelt_core::input::read_text(&path, perimelt_core::input::LIMIT) {
            Ok(content) => content,
            Err(source) => {
                let message = format!(
                    "cannot read the toolpath table {}: {source}",
                    path.display()
                );
                return Err(SetupError::other("file", message));
            }
        };
        self.read(&content, &path, default_power)
    }

    fn read(&self, content: &str, path: &Path, power: Option<f64>) -> Result<Track, SetupError> {
        let layout = match self.format {
            TableFormat::Csv => &timed::CSV,
            TableFormat::Events => &timed::EVENTS,
            TableFormat::AdditiveFoam => &scan_path::ADDITIVEFOAM,
            TableFormat::Adamantine => &scan_path::ADAMANTINE,
            TableFormat::Thesis => &scan_path::THESIS,
            TableFormat::Xypt => &scan_path::XYPT,
        };
        let numbers = layout.read(content, path, self.power_as == Some(PowerAs::Factor))?;
        let wait = self.wait_until.as_ref();
        match self.format {
            TableFormat::Csv => timed::timed(&numbers, power, wait, Between::Linear),
            TableFormat::Events => timed::timed(&numbers, power, None, Between::Held),
            TableFormat::AdditiveFoam | TableFormat::Adamantine | TableFormat::Thesis => {
                scan_path::segments(&numbers, power)
            }
            TableFormat::Xypt => {
                let step =
                    check_positive("time_step", self.time_step.unwrap_or(SCANNER_STEP), "s")?;
                let z = check_finite("z", self.z.unwrap_or(0.0))?;
                scan_path::scanner(&numbers, power, step, z)
            }
        }
    }

    /// Refuses keys of other formats.
    fn check_keys(&self) -> Result<(), SetupError> {
        let (csv, xypt) = (TableFormat::Csv, TableFormat::Xypt);
        for (key, is_given, format, name) in [
            ("wait_until", self.wait_until.is_some(), csv, "csv"),
            (
                "power_as",
                self.power_as.is_some(),
                TableFormat::Events,
                "events",
            ),
            ("time_step", self.time_step.is_some(), xypt, "xypt"),
            ("z", self.z.is_some(), xypt, "xypt"),
        ] {
            if is_given && self.format != format {
                let message = format!("`{key}` belongs to `format = \"{name}\"`");
                return Err(SetupError::value(key, message, format!("no `{key}`")));
            }
        }
        Ok(())
    }
}
