//! Values of an [`InSpace`] at fixed positions.

use std::path::Path;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::InSpace;
use crate::error::RunError;
use crate::folder;
use crate::formula::Formula;
use crate::in_time::InTime;
use crate::input;
use crate::parallel::ParallelLoop;
use crate::samples::{FieldFile, NumberTable, SamplesError, States};
use crate::text::{number, position};

/// Why there is no value.
#[derive(Debug, thiserror::Error)]
pub enum PlacedError {
    /// A file with values by place.
    #[error(transparent)]
    Samples(#[from] SamplesError),
    /// A formula without a value.
    #[error("`{formula}` is {value} at {} m and t = {} s", position(*at), number(*time, 6))]
    NotFinite {
        /// The formula.
        formula: String,
        /// Value of the formula.
        value: f64,
        /// Position, m.
        at: [f64; 3],
        /// Time, s.
        time: f64,
    },
}

impl PlacedError {
    /// The error of a plugin at a time (s).
    pub fn during(self, plugin: &str, time: f64) -> RunError {
        RunError::Plugin {
            plugin: plugin.into(),
            time,
            cause: self.into(),
        }
    }
}

/// Values at fixed positions, as they change in time.
#[derive(Clone, Debug)]
pub struct Placed {
    source: ValueSource,
    positions: Vec<Vector3<f64>>,
    dimension: usize,
    /// Values at the time for which they were computed last, s.
    values: Vec<f64>,
    time: Option<f64>,
    outside: usize,
    farthest: f64,
}

#[derive(Clone, Debug)]
enum ValueSource {
    InTime(InTime),
    Formula(Formula),
    States(States, Option<Window>),
}

/// Values at the two times around the current one.
#[derive(Clone, Debug)]
struct Window {
    first: usize,
    older: Vec<f64>,
    newer: Vec<f64>,
}

impl Placed {
    /// Reads the first values.
    pub(crate) fn new(
        value: &InSpace,
        field: &str,
        case_folder: &Path,
        positions: Vec<Vector3<f64>>,
        dimension: usize,
    ) -> Result<Placed, PlacedError> {
        let source = match value {
            InSpace::Uniform(value) => ValueSource::InTime(value.clone()),
            InSpace::Formula(formula) => ValueSource::Formula(formula.clone()),
            InSpace::File(file) => match rows_in_time(file, case_folder)? {
                Some(rows) => ValueSource::InTime(rows),
                None => ValueSource::States(States::of_file(file, field, case_folder)?, None),
            },
            InSpace::Series(series) => {
                ValueSource::States(States::of_series(series, field, case_folder)?, None)
            }
        };
        let values = vec![0.0; positions.len()];
        Ok(Placed {
            source,
            positions,
            dimension,
            values,
            time: None,
            outside: 0,
            farthest: 0.0,
        })
    }

    /// The values at a time (s), by position.
    ///
    /// # Errors
    /// A file that cannot be read, or a formula without a finite value.
    pub fn at(&mut self, time: f64) -> Result<&[f64], PlacedError> {
        let is_known = self
            .time
            .is_some_and(|known| known == time || !self.changes());
        if !is_known {
            self.compute(time)?;
            self.time = Some(time);
        }
        Ok(&self.values)
    }

    fn compute(&mut self, time: f64) -> Result<(), PlacedError> {
        match &mut self.source {
            ValueSource::InTime(value) => {
                let value = value.at(time);
                self.values.fill(value);
            }
            ValueSource::Formula(formula) => {
                let at = |p: &Vector3<f64>| formula.at((*p).into(), time);
                self.positions.par_iter().map(at).fill(&mut self.values);
            }
            ValueSource::States(states, window) => {
                let times = states.times();
                let after = times
                    .partition_point(|t| *t <= time)
                    .clamp(1, times.len().max(2) - 1);
                let (first, second) = (after - 1, after.min(times.len() - 1));
                if window.as_ref().is_none_or(|w| w.first != first) {
                    let mut read = |index: usize| -> Result<Vec<f64>, PlacedError> {
                        let samples = states.samples(index)?;
                        let at = samples.at(&self.positions, self.dimension);
                        let found = at.map_err(|fault| states.error(index, fault))?;
                        (self.outside, self.farthest) = (found.outside, found.farthest);
                        Ok(found.values)
                    };
                    let older = match window.take() {
                        Some(window) if window.first + 1 == first => window.newer,
                        _ => read(first)?,
                    };
                    let newer = if second == first {
                        older.clone()
                    } else {
                        read(second)?
                    };
                    *window = Some(Window {
                        first,
                        older,
                        newer,
                    });
                }
                let Window { older, newer, .. } = window.as_ref().expect("read above");
                let span = times[second] - times[first];
                let fraction = if span > 0.0 {
                    ((time - times[first]) / span).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let pairs = older.iter().zip(newer);
                // exact at the newer time, too
                let mix = |(a, b): (&f64, &f64)| {
                    if fraction == 1.0 {
                        *b
                    } else {
                        a + fraction * (b - a)
                    }
                };
                self.values
                    .iter_mut()
                    .zip(pairs)
                    .for_each(|(value, pair)| *value = mix(pair));
            }
        }
        match self.values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(index) => Err(PlacedError::NotFinite {
                formula: match &self.source {
                    ValueSource::Formula(formula)
                    | ValueSource::InTime(InTime::Formula(formula)) => formula.text().into(),
                    _ => "the value".into(),
                },
                value: self.values[index],
                at: self.positions[index].into(),
                time,
            }),
        }
    }

    /// Whether the values change in time.
    pub fn changes(&self) -> bool {
        match &self.source {
            ValueSource::InTime(value) => !matches!(value, InTime::Constant(_)),
            ValueSource::Formula(formula) => formula.depends_on_time(),
            ValueSource::States(states, _) => states.times().len() > 1,
        }
    }

    /// The first time later than `after` (s) at which values have a kink, on which steps should land.
    pub fn next_event(&self, after: f64) -> Option<f64> {
        match &self.source {
            ValueSource::InTime(value) => value.next_event(after),
            ValueSource::Formula(_) => None,
            ValueSource::States(states, _) => match states.times() {
                [_] => None,
                times => times.iter().copied().find(|t| *t > after),
            },
        }
    }

    /// A sentence about positions that lie outside of the points of the file that was read last.
    pub fn warning(&self) -> Option<String> {
        (self.outside > 0).then(|| {
            format!(
                "{} of {} points lie outside of the points of the file, by up to {} m; their values are those of its outermost points",
                self.outside,
                self.positions.len(),
                number(self.farthest, 3)
            )
        })
    }
}

/// The rows of a table in time without coordinates.
fn rows_in_time(file: &FieldFile, case_folder: &Path) -> Result<Option<InTime>, PlacedError> {
    let path = case_folder.join(&file.file);
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if extension.is_some_and(|e| ["vtu", "vtp", "pvd"].contains(&e.as_str())) {
        return Ok(None);
    }
    // the reader of values by place reports a file that cannot be read
    let Ok(text) = input::read_text(&path, input::LIMIT) else {
        return Ok(None);
    };
    let header = text.lines().take(100).collect::<Vec<_>>().join("\n");
    let table = NumberTable::new(&header);
    let has = |name: &str| table.find(name).is_some();
    if !has("time")
        || ["x", "y", "z", "X", "Y", "Z", "Points:0"]
            .into_iter()
            .any(has)
    {
        return Ok(None);
    }
    let rows = folder::within(case_folder, || InTime::of_file(file));
    Ok(Some(rows?))
}
