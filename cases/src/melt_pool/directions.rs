//! Directions in which a melt pool is measured: those of the heat source nearest to its hottest point.

use perimelt_core::log::Log;
use perimelt_core::{Axis, Simulation};

use super::Travel;
use crate::log_names::REPORTS;

/// Cosine of the angle between two directions that count as parallel.
const PARALLEL: f64 = 0.999;

/// Cosine of the largest angle between directions of travel or of beams that count as one, 10 degrees.
pub(super) const ONE_DIRECTION: f64 = 0.985;

/// Directions of a melt pool, unit vectors: its length lies along `travel`, its depth along `beam`, its width along the
/// direction normal to both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// direction of travel
    pub travel: [f64; 3],
    /// direction of the beam, into the material
    pub beam: [f64; 3],
}

impl Directions {
    /// Length along one axis, depth down another.
    #[must_use]
    pub fn along(along: Axis, down: Axis) -> Self {
        let unit = |axis: Axis, sign: f64| {
            let mut unit = [0.0; 3];
            unit[axis.index()] = sign;
            unit
        };
        Directions {
            travel: unit(along, 1.0),
            beam: unit(down, -1.0),
        }
    }

    /// Whether travel and beam lie within 10 degrees along those of `other`.
    pub(crate) fn is_close(&self, other: &Directions) -> bool {
        dot(self.travel, other.travel).abs() >= ONE_DIRECTION
            && dot(self.beam, other.beam) >= ONE_DIRECTION
    }

    /// Direction of the width, a unit vector.
    pub(crate) fn across(&self) -> [f64; 3] {
        let ([a, b, c], [x, y, z]) = (self.travel, self.beam);
        normalised([b * z - c * y, c * x - a * z, a * y - b * x]).unwrap_or([0.0; 3])
    }
}

impl From<Travel> for Directions {
    fn from(travel: Travel) -> Self {
        let along = match travel {
            Travel::X => Axis::X,
            Travel::Y => Axis::Y,
        };
        Self::along(along, Axis::Z)
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn normalised(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| v.map(|x| x / length))
}

/// Reported state of a heat source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceState {
    /// Position, m.
    pub position: [f64; 3],
    /// Unit vector; `None` for a source that never moves.
    pub travel: Option<[f64; 3]>,
    /// Unit vector into the material.
    pub beam: [f64; 3],
    /// Whether its toolpath has power, pulses aside.
    pub is_on: bool,
    /// Length of the path with power up to this state, m.
    pub path: f64,
}

impl SourceState {
    /// The state from the reports of a coupler by name; `None` for a coupler that is no moving source.
    fn read(value: impl Fn(&str) -> Option<f64>) -> Option<Self> {
        let vector = |what: &str| -> Option<[f64; 3]> {
            let [x, y, z] = ["x", "y", "z"].map(|axis| value(&format!("{what}.{axis}")));
            Some([x?, y?, z?])
        };
        Some(SourceState {
            position: vector("position")?,
            travel: normalised(vector("travel")?),
            beam: normalised(vector("beam")?)?,
            is_on: value("on")? > 0.0,
            path: value("path")?,
        })
    }

    /// The source in coordinates relative to a place (m).
    #[must_use]
    pub(crate) fn seen_from(&self, place: [f64; 3]) -> Self {
        let position = [0, 1, 2].map(|axis| self.position[axis] - place[axis]);
        SourceState { position, ..*self }
    }

    /// The source nearest to a place (m) among those that are on, or among all if none is on.
    pub(crate) fn nearest(sources: &[SourceState], place: [f64; 3]) -> Option<&SourceState> {
        let is_any_on = sources.iter().any(|source| source.is_on);
        let distance = |source: &SourceState| {
            let away = [0, 1, 2].map(|axis| source.position[axis] - place[axis]);
            dot(away, away)
        };
        let chosen = sources.iter().filter(|s| s.is_on || !is_any_on);
        chosen.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The directions of this source, `otherwise` for those that it does not have.
    pub(crate) fn directions(&self, otherwise: Directions) -> Directions {
        let own = Directions {
            travel: self.travel.unwrap_or(otherwise.travel),
            beam: self.beam,
        };
        match dot(own.travel, own.beam).abs() > PARALLEL {
            true => otherwise,
            false => own,
        }
    }
}

/// The moving sources of a simulation in its present state.
#[must_use]
pub fn sources_of(simulation: &Simulation) -> Vec<SourceState> {
    let reports = simulation.reports().into_iter();
    let source = reports.filter_map(|(_, reports)| {
        SourceState::read(|name| reports.iter().find(|r| r.name == name).map(|r| r.value))
    });
    source.collect()
}

/// The moving sources of a log in its states.
#[derive(Clone, Debug, Default)]
pub(crate) struct LoggedSources {
    times: Vec<f64>,
    states: Vec<Vec<SourceState>>,
}

impl LoggedSources {
    pub(crate) fn of_log(log: &Log) -> Self {
        let Some(reports) = log.probes().get(REPORTS) else {
            return Self::default();
        };
        let columns = || reports.columns.iter();
        let labels: Vec<&str> = columns()
            .filter_map(|c| c.name.strip_suffix(".travel.x"))
            .collect();
        let state = |row: usize| {
            let of = |label: &&str| {
                SourceState::read(|name| {
                    let name = format!("{label}.{name}");
                    columns().find(|c| c.name == name)?.values.get(row).copied()
                })
            };
            labels.iter().filter_map(of).collect()
        };
        LoggedSources {
            times: reports.times.clone(),
            states: (0..reports.times.len()).map(state).collect(),
        }
    }

    /// All states of sources that are on and move, source by source.
    pub(crate) fn path(&self) -> Vec<SourceState> {
        let most = self.states.iter().map(Vec::len).max().unwrap_or(0);
        let of = |source: usize| {
            self.states
                .iter()
                .filter_map(move |states| states.get(source))
        };
        let all = (0..most).flat_map(of).copied();
        all.filter(|state| state.is_on && state.travel.is_some())
            .collect()
    }

    /// Sources at the time (s) of a logged state.
    pub(crate) fn at(&self, time: f64) -> &[SourceState] {
        // times of clouds and reports are the same number
        let next = self.times.partition_point(|t| *t <= time);
        let before = next.checked_sub(1).and_then(|row| self.states.get(row));
        before.map_or(&[], Vec::as_slice)
    }
}

/// Sources from which the directions of a melt pool follow.
#[derive(Clone, Copy, Debug)]
pub struct Aim<'a> {
    /// Sources that may have made the pool.
    pub sources: &'a [SourceState],
    /// Directions without a source; that of travel also where it never moves.
    pub otherwise: Directions,
}

impl Aim<'_> {
    /// Fixed directions, independent of sources.
    pub fn fixed(directions: impl Into<Directions>) -> Self {
        Aim {
            sources: &[],
            otherwise: directions.into(),
        }
    }

    /// Directions of a pool whose hottest point is at a place (m).
    pub(super) fn at(&self, hottest: [f64; 3]) -> Directions {
        let source = SourceState::nearest(self.sources, hottest);
        source.map_or(self.otherwise, |source| source.directions(self.otherwise))
    }
}
