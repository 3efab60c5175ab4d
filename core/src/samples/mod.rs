//! Fields of numbers by place from files of other programs and of measurements.
//!
//! [`FieldFile`] and [`FieldSeries`] are what a case gives, [`States`] what they lead to: the times at which values are known and, for
//! each, points with values ([`Samples`]). Between the points a field is interpolated (`fit.rs`), between the times it is linear.

mod fault;
mod fit;
mod number_table;
mod tree;
mod vtu;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::input;
pub use fault::{SamplesError, SamplesFault};
pub use number_table::{NotANumber, NumberTable};

use tree::Tree;
pub use vtu::VtkError;

/// A file with values by place: a table (CSV) with the columns `x`, `y`, `z` (m; missing ones are no matter) and one of the values, or
/// a file of VTK (`.vtu`, `.vtp`) with values at points or in cells. A table with a column `time` (s), too, and ParaView's collection
/// (`.pvd`) have values at several times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldFile {
    /// The file, relative to the case file.
    pub file: PathBuf,
    /// Column or array with the values; the one with the name of the field, or the only one, when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
}

/// Files with values by place, one for each of several times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldSeries {
    /// Times of the files, s, strictly increasing. Between them values are linear in time, before the first and after the last
    /// constant.
    pub time: Vec<f64>,
    /// The files, relative to the case file: tables (CSV) or files of VTK, as for one time.
    pub file: Vec<PathBuf>,
    /// Column or array with the values, as for one file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
}

/// Points at which a value is known.
#[derive(Clone, Debug)]
pub struct Samples {
    positions: Vec<Vector3<f64>>,
    /// Whether the positions have this coordinate.
    axes: [bool; 3],
    values: Vec<f64>,
}

/// Names by which a column is chosen.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// The name of the column in the case file.
    pub column: Option<String>,
    /// Name of the column where `column` is not given.
    pub field: String,
}

impl Wanted {
    /// The place of the column among the names of those with values.
    pub(crate) fn choose(&self, known: Vec<String>) -> Result<usize, SamplesFault> {
        let find = |name: &str| known.iter().position(|k| k == name);
        match &self.column {
            Some(name) => find(name).ok_or_else(|| SamplesFault::NoColumn {
                name: name.clone(),
                known,
            }),
            None => match (find(&self.field), &known[..]) {
                (Some(place), _) => Ok(place),
                (None, [_]) => Ok(0),
                (None, _) => Err(SamplesFault::Choice {
                    name: self.field.clone(),
                    known,
                }),
            },
        }
    }
}

/// Name of a column without its unit in brackets; names that other programs give to coordinates are `x`, `y` and `z`.
fn plain_name(header: &str) -> Result<String, SamplesFault> {
    let (name, unit) = match header.split_once(['[', '(']) {
        Some((name, unit)) => (name.trim(), unit.trim_end_matches([']', ')']).trim()),
        None => (header.trim(), ""),
    };
    if !["", "m", "K", "s", "m/s", "Pa", "W/m3", "W/m2", "-", "1"].contains(&unit) {
        return Err(SamplesFault::Unit {
            column: header.into(),
            unit: unit.into(),
        });
    }
    Ok(match name {
        "X" | "Points:0" | "Points_0" => "x",
        "Y" | "Points:1" | "Points_1" => "y",
        "Z" | "Points:2" | "Points_2" => "z",
        name => name,
    }
    .to_string())
}

/// Values at one of the times of a file.
#[derive(Clone, Debug)]
enum SampledState {
    /// Read already.
    Known(Arc<Samples>),
    /// In a file.
    File(PathBuf),
}

/// The times at which values are known.
#[derive(Clone, Debug)]
pub struct States {
    /// s, strictly increasing; one without a meaning for values at all times.
    times: Vec<f64>,
    states: Vec<SampledState>,
    wanted: Wanted,
    /// Path of the given file, or of the first one.
    path: PathBuf,
}

impl States {
    /// The states of a file.
    ///
    /// # Errors
    /// The file cannot be read, or its mistake.
    pub fn of_file(file: &FieldFile, field: &str, folder: &Path) -> Result<States, SamplesError> {
        let path = folder.join(&file.file);
        let wanted = Wanted {
            column: file.column.clone(),
            field: field.into(),
        };
        let states = read_states(&path, &wanted).map_err(|fault| SamplesError {
            path: path.clone(),
            fault,
        })?;
        let (times, states) = states.into_iter().unzip();
        States {
            times,
            states,
            wanted,
            path,
        }
        .checked()
    }

    /// The states of a series.
    ///
    /// # Errors
    /// The first file cannot be read, or its mistake; times that do not increase.
    pub fn of_series(
        series: &FieldSeries,
        field: &str,
        folder: &Path,
    ) -> Result<States, SamplesError> {
        let first = series
            .file
            .first()
            .map_or(folder.to_path_buf(), |f| folder.join(f));
        let (times, files) = (series.time.len(), series.file.len());
        if times != files || times == 0 {
            return Err(SamplesError {
                path: first,
                fault: SamplesFault::Lengths { times, files },
            });
        }
        let file = |f: &PathBuf| SampledState::File(folder.join(f));
        States {
            times: series.time.clone(),
            states: series.file.iter().map(file).collect(),
            wanted: Wanted {
                column: series.column.clone(),
                field: field.into(),
            },
            path: first,
        }
        .checked()
    }

    fn checked(self) -> Result<States, SamplesError> {
        let path = &self.path;
        let error = |path: &Path, fault| SamplesError {
            path: path.into(),
            fault,
        };
        if self.states.is_empty() {
            return Err(error(path, SamplesFault::Empty));
        }
        if let Some(pair) = self
            .times
            .windows(2)
            .find(|pair| pair[0].is_nan() || pair[1].is_nan() || pair[1] <= pair[0])
        {
            return Err(error(
                path,
                SamplesFault::Times {
                    time: pair[0],
                    next: pair[1],
                },
            ));
        }
        // a missing file is reported before the run
        for state in &self.states {
            if let SampledState::File(path) = state {
                std::fs::metadata(path)
                    .map_err(|e| error(path, input::InputError::from(e).into()))?;
            }
        }
        self.samples(0)?;
        Ok(self)
    }

    /// A mistake in the file of a state.
    pub(crate) fn error(&self, index: usize, fault: SamplesFault) -> SamplesError {
        let path = match &self.states[index] {
            SampledState::File(path) => path.clone(),
            SampledState::Known(_) => self.path.clone(),
        };
        SamplesError { path, fault }
    }

    /// Times of the states, s; one for values at all times.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The values at one of the times.
    ///
    /// # Errors
    /// The mistake in the file.
    pub fn samples(&self, index: usize) -> Result<Arc<Samples>, SamplesError> {
        match &self.states[index] {
            SampledState::Known(samples) => Ok(samples.clone()),
            SampledState::File(path) => {
                let of_path = |fault| SamplesError {
                    path: path.clone(),
                    fault,
                };
                let mut states = read_states(path, &self.wanted).map_err(of_path)?;
                match states.pop() {
                    Some((_, SampledState::Known(samples))) if states.is_empty() => Ok(samples),
                    _ => Err(of_path(SamplesFault::Empty)),
                }
            }
        }
    }
}

fn read_states(path: &Path, wanted: &Wanted) -> Result<Vec<(f64, SampledState)>, SamplesFault> {
    let extension = path
        .extension()
        .map_or(String::new(), |e| e.to_string_lossy().to_lowercase());
    match extension.as_str() {
        "vtu" | "vtp" => Ok(vec![(
            0.0,
            SampledState::Known(Arc::new(Samples::of_vtk(
                &input::read_bytes(path, input::LIMIT)?,
                wanted,
            )?)),
        )]),
        "pvd" => {
            let folder = path.parent().unwrap_or(Path::new(""));
            let files = vtu::collection(&input::read_text(path, input::LIMIT)?)?;
            Ok(files
                .into_iter()
                .map(|(time, file)| (time, SampledState::File(folder.join(file))))
                .collect())
        }
        _ => {
            let text = input::read_text(path, input::LIMIT)?;
            let states = Samples::of_table(&NumberTable::new(&text), wanted)?;
            Ok(states
                .into_iter()
                .map(|(time, s)| (time, SampledState::Known(Arc::new(s))))
                .collect())
        }
    }
}

/// Columns of a table that are no values.
const COORDINATES: [&str; 3] = ["x", "y", "z"];

impl Samples {
    /// The values of a table; by time where it has a column `time`.
    ///
    /// # Errors
    /// A column that is missing, or a cell that is not a number.
    pub fn of_table(
        table: &NumberTable<'_>,
        wanted: &Wanted,
    ) -> Result<Vec<(f64, Samples)>, SamplesFault> {
        let names: Vec<String> = table
            .names()
            .iter()
            .map(|n| plain_name(n))
            .collect::<Result<_, _>>()?;
        let find = |name: &str| names.iter().position(|n| n == name);
        let axes = COORDINATES.map(find);
        if axes.iter().all(Option::is_none) {
            return Err(SamplesFault::NoPositions(names));
        }
        let is_value =
            |(_, name): &(usize, &String)| !COORDINATES.contains(&name.as_str()) && *name != "time";
        let columns: Vec<(usize, &String)> = names.iter().enumerate().filter(is_value).collect();
        let chosen = wanted.choose(columns.iter().map(|(_, n)| n.to_string()).collect())?;
        let values = table.column(columns[chosen].0)?;
        let mut positions = vec![Vector3::zeros(); values.len()];
        for (axis, column) in axes.iter().enumerate() {
            let Some(column) = column else { continue };
            let coordinates = table.column(*column)?;
            positions
                .iter_mut()
                .zip(coordinates)
                .for_each(|(p, x)| p[axis] = x);
        }
        if values.is_empty() {
            return Err(SamplesFault::Empty);
        }
        let axes = axes.map(|a| a.is_some());
        let Some(time) = find("time") else {
            return Ok(vec![(
                0.0,
                Samples {
                    positions,
                    axes,
                    values,
                },
            )]);
        };
        let times = table.column(time)?;
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
        let of_time = |rows: &[usize]| {
            let positions = rows.iter().map(|r| positions[*r]).collect();
            let values = rows.iter().map(|r| values[*r]).collect();
            (
                times[rows[0]],
                Samples {
                    positions,
                    axes,
                    values,
                },
            )
        };
        Ok(order
            .chunk_by(|a, b| times[*a] == times[*b])
            .map(of_time)
            .collect())
    }

    fn of_vtk(bytes: &[u8], wanted: &Wanted) -> Result<Samples, SamplesFault> {
        let grid = vtu::read(bytes)?;
        let scalars: Vec<_> = grid
            .fields
            .into_iter()
            .filter(|f| f.components == 1)
            .collect();
        let field = wanted.choose(scalars.iter().map(|f| f.name.clone()).collect())?;
        let field = scalars
            .into_iter()
            .nth(field)
            .expect("it was found among them");
        if let Some(point) = field.values.iter().position(|v| !v.is_finite()) {
            let value = field.values[point];
            return Err(SamplesFault::NotFinite {
                column: field.name,
                point,
                value,
            });
        }
        let positions = if field.of_cells {
            grid.cells
        } else {
            grid.points
        };
        Ok(Samples {
            positions,
            axes: [true; 3],
            values: field.values,
        })
    }

    /// Box around the points, m.
    fn bounds(positions: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
        let first = positions.first().copied().unwrap_or_default();
        positions
            .iter()
            .fold([first; 2], |[low, high], p| [low.inf(p), high.sup(p)])
    }

    /// Values at positions (m) of a body with so many dimensions.
    ///
    /// # Errors
    /// The points of the file lie elsewhere.
    pub fn at(
        &self,
        positions: &[Vector3<f64>],
        dimension: usize,
    ) -> Result<Interpolated, SamplesFault> {
        let used: [bool; 3] = std::array::from_fn(|a| a < dimension && self.axes[a]);
        let flat = |p: &Vector3<f64>| Vector3::from_fn(|a, _| if used[a] { p[a] } else { 0.0 });
        let own: Vec<Vector3<f64>> = self.positions.iter().map(flat).collect();
        let asked: Vec<Vector3<f64>> = positions.iter().map(flat).collect();
        let [low, high] = Samples::bounds(&own);
        let [from, to] = Samples::bounds(&asked);
        let extended = (0..3).filter(|a| used[*a]).count().max(1);
        // the mean distance of the points of the file: nearer positions are not outside
        let lengths = (high - low)
            .iter()
            .copied()
            .filter(|l| *l > 0.0)
            .collect::<Vec<_>>();
        let spacing = match lengths.len() {
            0 => f64::INFINITY,
            n => (lengths.iter().product::<f64>() / own.len() as f64).powf(1.0 / n as f64),
        };
        let beyond = |p: &Vector3<f64>| {
            (0..3)
                .map(|a| (low[a] - p[a]).max(p[a] - high[a]).max(0.0))
                .fold(0.0, f64::max)
        };
        let distances: Vec<f64> = asked.iter().map(beyond).collect();
        let outside = distances.iter().filter(|d| **d > spacing).count();
        let farthest = distances.iter().copied().fold(0.0, f64::max);
        if outside == asked.len() && outside > 0 {
            let file = [low.into(), high.into()];
            return Err(SamplesFault::Elsewhere {
                file,
                body: [from.into(), to.into()],
            });
        }
        let tree = Tree::new(&own);
        let value = |p: &Vector3<f64>| fit::value(&tree, &self.values, extended, &own, p);
        Ok(Interpolated {
            values: asked.par_iter().map(value).collect(),
            outside,
            farthest,
        })
    }
}

/// Values at positions.
#[derive(Clone, Debug)]
pub struct Interpolated {
    /// By position.
    pub values: Vec<f64>,
    /// Number of positions that lie outside of the box around the points of the file by more than the distance of these.
    pub outside: usize,
    /// How far the farthest lies outside, m.
    pub farthest: f64,
}

#[cfg(test)]
mod tests;
