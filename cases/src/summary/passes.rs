//! Read-offs by pass: heat input, interpass temperature, melt pool, cooling time.
//!
//! A pass of a heat source lies between two waits of its path for an interpass temperature, or, on a path without waits, between
//! two logged states without power. Jumps between two logged states begin no pass.

use perimelt_core::log::{BodyInfo, Log, LogError, Series};

use super::heat::finest_cell;
use super::{Label, ReadOff, SIZES, median};
use crate::log_file::{plugins_of, skip_damaged};
use crate::log_names::REPORTS;
use crate::quantity::scalar::scalar;
use crate::quantity::survey::{BodySurvey, Reference};

/// Fewest logged states with power of each pass.
const FEWEST_STATES: usize = 3;

/// Most passes that are listed.
const MOST_PASSES: usize = 50;

/// A pass of a source.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pass {
    pub source: String,
    /// Number of the pass, from 1.
    pub number: usize,
    /// Start and end of the time with power, s, and start of the next pass.
    pub times: [f64; 3],
    /// Place of the source in the first logged state with power, m.
    pub place: Option<[f64; 3]>,
    /// Whether the path waited for a temperature before it.
    waited: bool,
}

/// Start of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PassStart {
    /// Time, s.
    start: f64,
    /// Whether the path waited for a temperature before it.
    waited: bool,
}

/// Reports of one source.
pub(super) struct SourceReports<'a> {
    pub series: &'a Series,
    pub source: &'a str,
}

impl SourceReports<'_> {
    /// The last value of a quantity.
    pub(super) fn last(&self, what: &str) -> Option<f64> {
        self.column(what)?.last().copied()
    }

    fn column(&self, what: &str) -> Option<&[f64]> {
        let is_it = |name: &str| {
            let rest = name.strip_prefix(self.source);
            rest.and_then(|rest| rest.strip_prefix('.')) == Some(what)
        };
        let column = self.series.columns.iter().find(|c| is_it(&c.name))?;
        Some(&column.values)
    }

    /// A cumulative quantity at the start or end (s) of a pass: the value of an adjacent state in which the source is off, else
    /// linear between logged states.
    fn at(&self, what: &str, time: f64) -> Option<f64> {
        let (times, values) = (&self.series.times, self.column(what)?);
        let next = times.partition_point(|t| *t < time);
        let last = *values.last()?;
        match next.checked_sub(1) {
            None => values.first().copied(),
            Some(_) if next >= times.len() => Some(last),
            Some(before) if self.is_off(before) => Some(values[before]),
            Some(_) if self.is_off(next) => Some(values[next]),
            Some(before) => {
                let part = (time - times[before]) / (times[next] - times[before]);
                Some(values[before] + part * (values[next] - values[before]))
            }
        }
    }

    fn is_off(&self, row: usize) -> bool {
        self.column("on")
            .is_some_and(|on| on.get(row) == Some(&0.0))
    }

    fn passes(&self) -> Vec<Pass> {
        let Some(is_on) = self.column("on") else {
            return Vec::new();
        };
        let times = &self.series.times;
        let end = times.last().copied().unwrap_or_default();
        let on: Vec<usize> = (0..is_on.len()).filter(|&row| is_on[row] > 0.0).collect();
        // the first pass, and those before which the path waited or the source was off: parts of a path that follow each
        // other at once are one pass
        let begins = |number: usize| {
            let start = *self.column(&format!("pass.{number}.start"))?.last()?;
            let waited = self.column(&format!("pass.{number}.temperature")).is_some();
            start.is_finite().then_some(PassStart { start, waited })
        };
        let was_off = |start: f64| {
            let next = times.partition_point(|time| *time <= start);
            [next.checked_sub(1), Some(next)]
                .into_iter()
                .flatten()
                .any(|row| self.is_off(row))
        };
        let known: Vec<PassStart> = (1..)
            .map_while(|number| Some((number, begins(number)?)))
            .filter(|(number, begin)| *number == 1 || begin.waited || was_off(begin.start))
            .map(|(_, begin)| begin)
            .collect();
        // rows with power of each pass
        let mut parts: Vec<Vec<usize>> = Vec::new();
        for &row in &on {
            let goes_on =
                parts
                    .last()
                    .and_then(|part| part.last())
                    .is_some_and(|&last| match known.len() {
                        0 | 1 => last + 1 == row,
                        _ => !known
                            .iter()
                            .any(|b| times[last] < b.start && b.start <= times[row]),
                    });
            match parts.last_mut() {
                Some(part) if goes_on => part.push(row),
                _ => parts.push(vec![row]),
            }
        }
        let start_of = |part: &[usize]| {
            let first = times[part[0]];
            let of_path = known.iter().rev().find(|begin| begin.start <= first);
            let before = part[0].checked_sub(1).map_or(first, |row| times[row]);
            let of_path = of_path.filter(|_| known.len() > 1).copied();
            of_path.unwrap_or(PassStart {
                start: before,
                waited: false,
            })
        };
        let begins: Vec<PassStart> = parts.iter().map(|part| start_of(part)).collect();
        let pass = |(index, part): (usize, &Vec<usize>)| {
            let axis = |name| Some(self.column(&format!("position.{name}"))?[part[0]]);
            let place = || Some([axis("x")?, axis("y")?, axis("z")?]);
            let last = part[part.len() - 1];
            Pass {
                source: self.source.into(),
                number: index + 1,
                times: [
                    begins[index].start,
                    times.get(last + 1).copied().unwrap_or(end),
                    begins.get(index + 1).map_or(end, |next| next.start),
                ],
                place: place(),
                waited: begins[index].waited,
            }
        };
        let is_resolved = parts.iter().all(|part| part.len() >= FEWEST_STATES);
        let passes: Vec<Pass> = parts.iter().enumerate().map(pass).collect();
        // a single pass is the whole run
        let is_listed = is_resolved && (2..=MOST_PASSES).contains(&passes.len());
        passes.into_iter().filter(|_| is_listed).collect()
    }
}

/// The passes of all sources that have several.
pub(super) fn passes(log: &Log) -> Vec<Pass> {
    let Some(series) = log.probes().get(REPORTS) else {
        return Vec::new();
    };
    let names = series.columns.iter();
    let sources = names.filter_map(|c| c.name.strip_suffix(".on"));
    let of = |source| SourceReports { series, source }.passes();
    sources.flat_map(of).collect()
}

/// Heat input per length of each pass.
pub(super) fn heat_input(log: &Log, passes: &[Pass], found: &mut Vec<ReadOff>) {
    let Some(series) = log.probes().get(REPORTS) else {
        return;
    };
    let cell = finest_cell(log);
    for pass in passes {
        let source = &*pass.source;
        let reports = SourceReports { series, source };
        let [start, _, next] = pass.times;
        let within = |what| Some(reports.at(what, next)? - reports.at(what, start)?);
        let Some(energy) = within("energy.deposited") else {
            continue;
        };
        let energy = energy + within("energy.mirrored").unwrap_or(0.0);
        if let Some(path) = within("path").filter(|path| *path > cell) {
            let name = Label::new(
                format!("pass.{}.energy_per_length", pass.number),
                format!("pass {}: energy deposited per length", pass.number),
            );
            found.push(ReadOff::new(source, name, energy / path, "J/m"));
        }
    }
}

/// Melt pool, cooling time and interpass temperature of each pass on a body.
///
/// # Errors
/// A log that cannot be read.
pub(super) fn of_body(
    log: &Log,
    body: &BodyInfo,
    survey: &BodySurvey,
    passes: &[Pass],
    found: &mut Vec<ReadOff>,
) -> Result<(), LogError> {
    let sources = |pass: &Pass| passes.iter().any(|other| other.source != pass.source);
    let label = |pass: &Pass, id: &str, quantity: &str| {
        let number = pass.number;
        match sources(pass) {
            true => Label::new(
                format!("{}.pass.{number}.{id}", pass.source),
                format!("{}, pass {number}: {quantity}", pass.source),
            ),
            false => Label::new(
                format!("pass.{number}.{id}"),
                format!("pass {number}: {quantity}"),
            ),
        }
    };
    let cooling = cooling_times(log, body, passes)?;
    for (index, pass) in passes.iter().enumerate() {
        let [start, end, _] = pass.times;
        if index > 0 && !pass.waited && passes[index - 1].source == pass.source {
            let before = temperature_before(log, body, pass)?;
            found.extend(before.map(|(time, temperature)| {
                let quantity = "temperature at its start, before it";
                let name = label(pass, "interpass_temperature", quantity);
                ReadOff::new(&body.name, name, temperature, "K").at(time)
            }));
        }
        let in_pass = |time: f64| time > start && time <= end;
        for (name, size) in SIZES {
            let pools = survey.pools.iter().filter(|state| in_pass(state.time));
            let sizes = pools.filter_map(|state| size(state.pool.as_ref()?));
            let sizes: Vec<f64> = sizes.collect();
            if sizes.len() >= FEWEST_STATES {
                let (id, quantity) = (format!("pool.{name}"), format!("{name} of the melt pool"));
                let name = label(pass, &id, &quantity);
                found.push(median(&body.name, name, sizes, "m", 0.0));
            }
        }
        if !cooling[index].is_empty() {
            let quantity = "cooling time (t8/5 unless the case says otherwise)";
            let name = label(pass, "cooling_time", quantity);
            let times = cooling[index].clone();
            found.push(median(&body.name, name, times, "s", super::OUTSIDE));
        }
    }
    Ok(())
}

/// The temperature (K) of the point nearest to the start of a pass in the last logged state (s) before it.
fn temperature_before(
    log: &Log,
    body: &BodyInfo,
    pass: &Pass,
) -> Result<Option<(f64, f64)>, LogError> {
    let times = log.times(&body.name);
    let before = times.partition_point(|time| *time <= pass.times[0]);
    let (Some(state), Some(place)) = (before.checked_sub(1), pass.place) else {
        return Ok(None);
    };
    let Some(cloud) = skip_damaged(log.cloud(&body.name, state))? else {
        return Ok(None);
    };
    let distance = |x: &[f64; 3]| (0..3).map(|a| (x[a] - place[a]).powi(2)).sum::<f64>();
    let points = cloud.positions.iter().enumerate();
    let nearest = points.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
    let temperature = scalar(&cloud, "temperature");
    Ok(nearest
        .zip(temperature)
        .map(|((point, _), t)| (cloud.time, t.values[point])))
}

/// Numbers of the points of a body that do not change while points get and lose material.
struct PointNumbers<'a> {
    body: &'a BodyInfo,
    reference: Reference,
}

impl PointNumbers<'_> {
    fn of(&self, cloud: &perimelt_core::log::LoggedCloud) -> Vec<usize> {
        let positions = self.reference.positions(cloud);
        let Some(lattice) = &self.body.lattice else {
            return (0..positions.len()).collect();
        };
        let [nx, ny, nz] = lattice.cells;
        let number = |x: &[f64; 3]| {
            let cell = |a: usize| ((x[a] - lattice.origin[a]) / lattice.spacing).round() as usize;
            // a point outside, of a window that has moved, shares the last number
            let (i, j, k) = (cell(0), cell(1), cell(2));
            if i < nx && j < ny && k < nz {
                (k * ny + j) * nx + i
            } else {
                nx * ny * nz
            }
        };
        positions.iter().map(number).collect()
    }
}

/// Cooling times (s) of the points that cooled from the upper to the lower temperature of `thermal_history` after each pass and
/// before the next one.
fn cooling_times(log: &Log, body: &BodyInfo, passes: &[Pass]) -> Result<Vec<Vec<f64>>, LogError> {
    let mut found = vec![Vec::new(); passes.len()];
    let mut history = plugins_of(log, "physics", "thermal_history", &body.name);
    let cooling = history.find_map(|physics| {
        let of = |index: usize| physics["cooling"][index].as_f64();
        Some([of(0)?, of(1)?])
    });
    let Some([upper, lower]) = cooling.filter(|_| !passes.is_empty()) else {
        return Ok(found);
    };
    let numbers = PointNumbers {
        body,
        reference: Reference::new(log, body)?,
    };
    let cells = body.lattice.as_ref();
    let count = cells.map_or(body.points, |l| l.cells.iter().product::<usize>() + 1);
    // by point: last temperature, time since which it is below the upper one, and pass of the last cooling with its time
    let mut last = vec![f64::NAN; count];
    let mut since = vec![f64::NAN; count];
    let mut cooled: Vec<Option<(usize, f64)>> = vec![None; count];
    let mut before = f64::NAN;
    let pass_at = |time: f64| passes.iter().rposition(|pass| pass.times[0] < time);
    let mut now = None;
    for state in 0..log.times(&body.name).len() {
        let Some(cloud) = skip_damaged(log.cloud(&body.name, state))? else {
            continue;
        };
        let Some(temperature) = scalar(&cloud, "temperature") else {
            return Ok(found);
        };
        let pass = pass_at(cloud.time);
        if pass != now {
            collect(&mut cooled, &mut found);
            now = pass;
        }
        for (number, t) in numbers.of(&cloud).into_iter().zip(temperature.values) {
            let Some(previous) = last.get(number).copied() else {
                continue;
            };
            let crossing =
                |level: f64| before + (previous - level) / (previous - t) * (cloud.time - before);
            if t >= upper {
                since[number] = f64::NAN;
            } else if previous >= upper {
                since[number] = crossing(upper);
            }
            if t < lower && previous >= lower && since[number].is_finite() {
                cooled[number] = pass.map(|pass| (pass, crossing(lower) - since[number]));
                since[number] = f64::NAN;
            }
            last[number] = t;
        }
        before = cloud.time;
    }
    collect(&mut cooled, &mut found);
    Ok(found)
}

/// Moves the cooling times of the points to those of their passes.
fn collect(cooled: &mut [Option<(usize, f64)>], found: &mut [Vec<f64>]) {
    for (pass, time) in cooled.iter_mut().filter_map(Option::take) {
        found[pass].push(time);
    }
}

#[cfg(test)]
mod tests {
    use crate::log_names::REPORTS;
    use crate::summary::testing::{Field, Plate, SeriesRow, number, positions};
    use crate::summary::{ReadOff, SummaryOptions, read_off};
    use serde_json::json;

    /// Temperature of all points: hot in the states with power, then cooling by 200 K a second.
    const TEMPERATURES: [f64; 16] = [
        300.0, 1700.0, 1700.0, 1700.0, 1150.0, 950.0, 750.0, 550.0, 1700.0, 1700.0, 1700.0,
        1173.15, 1073.15, 973.15, 873.15, 573.15,
    ];

    /// Two passes of 3 s, 4 mm/s and 100 W, then 200 W.
    fn rows(jump: bool) -> Vec<SeriesRow<'static>> {
        let (mut energy, mut path) = (0.0, 0.0);
        let row = |state: usize| {
            let power = match state {
                1..=3 => 100.0,
                8..=10 => 200.0,
                _ => 0.0,
            };
            energy += power;
            path += if power > 0.0 { 4e-3 } else { 0.0 };
            let travel = if jump && power == 0.0 {
                [0.0, 1.0, 0.0]
            } else {
                [1.0, 0.0, 0.0]
            };
            let vectors = [
                ("position", [3e-3, 2.5e-3, 0.0]),
                ("travel", travel),
                ("beam", [0.0, 0.0, -1.0]),
            ];
            let components = vectors.into_iter().flat_map(|(name, vector)| {
                let axes = ["x", "y", "z"].into_iter().zip(vector);
                axes.map(move |(axis, x)| (format!("torch.{name}.{axis}"), "1", x))
            });
            let numbers = [
                (
                    "torch.on".to_string(),
                    "1",
                    f64::from(u8::from(power > 0.0)),
                ),
                ("torch.path".into(), "m", path),
                ("torch.energy.asked".into(), "J", energy),
                ("torch.energy.deposited".into(), "J", 0.8 * energy),
            ];
            components.chain(numbers).collect()
        };
        (0..TEMPERATURES.len()).map(row).collect()
    }

    fn found(series: Vec<SeriesRow<'static>>) -> Vec<ReadOff> {
        let state =
            |t: &f64| -> Vec<Field> { vec![("temperature", "K", 1, vec![*t; positions().len()])] };
        let plate = Plate {
            states: TEMPERATURES.iter().map(state).collect(),
            plugins: json!({ "physics": [{ "type": "thermal_history", "cooling": [1073.15, 773.15] }] }),
            series: Some((REPORTS, series)),
            ..Plate::default()
        };
        let folder = tempfile::tempdir().expect("a folder");
        let log = plate.log(&folder.path().join("plate.mcap"));
        read_off(&log, &SummaryOptions::default()).expect("readable")
    }

    #[test]
    fn each_pass_has_its_heat_input_pool_cooling_time_and_temperature_before() {
        let found = found(rows(true));
        // 80 % of 100 W over 4 mm/s
        for (pass, heat) in [(1, 20e3), (2, 40e3)] {
            let input = number(&found, &format!("pass {pass}: energy deposited per length"));
            assert!((input.value / heat - 1.0).abs() < 1e-9, "{input:?}");
        }
        let before = number(&found, "pass 2: temperature at its start, before it");
        assert_eq!((before.value, before.time), (550.0, Some(7.0)));
        let length = number(&found, "pass 1: length of the melt pool");
        assert!((length.value - 6e-3).abs() < 1e-9, "{length:?}");
        // linear between the states: from 1073.15 K in [1150, 950] to 773.15 K in [950, 750], and from a state to [873, 573]
        let cooling = |pass: usize| {
            let name = "cooling time (t8/5 unless the case says otherwise)";
            number(&found, &format!("pass {pass}: {name}")).value
        };
        assert!((cooling(1) - 1.5).abs() < 1e-6, "{}", cooling(1));
        assert!(
            (cooling(2) - (2.0 + 1.0 / 3.0)).abs() < 1e-6,
            "{}",
            cooling(2)
        );
    }

    #[test]
    fn a_single_pass_and_passes_between_two_states_are_not_listed() {
        let is_listed = |found: &[ReadOff]| found.iter().any(|r| r.quantity.starts_with("pass "));
        let of_power = |power: fn(usize) -> f64| {
            let mut rows = rows(false);
            for (state, row) in rows.iter_mut().enumerate() {
                let column = row.iter_mut().find(|(name, ..)| name == "torch.on");
                column.expect("there").2 = power(state);
            }
            found(rows)
        };
        assert!(!is_listed(&of_power(|state| f64::from(u8::from(
            state < 8
        )))));
        assert!(!is_listed(&of_power(|state| (state % 2) as f64)));
        assert!(is_listed(&of_power(|state| f64::from(u8::from(
            state % 5 != 0
        )))));
    }
}
