//! The numbers that a process engineer reads off a log: temperatures, melt pool, fusion zone, heat-affected zone, cooling,
//! distortion, stress, energies, interfaces between fluids.

use std::io::Write;

use perimelt_core::log::{BodyInfo, Log, LogError, LoggedCloud};

use crate::case::of_log::case_of;
use crate::log_names::RELATIVE_ERROR;
use crate::melt_pool::{LoggedSources, MeltPool, SourceState, Travel, steady};
use crate::quantity::isotherm::isotherms;
use crate::quantity::scalar::scalar;
use crate::quantity::survey::{BodySurvey, survey};
use crate::tables;
use crate::unit;

mod distortion;
mod fillet;
mod flow;
mod heat;
mod history;
mod mechanics;
mod passes;
mod stress;
#[cfg(test)]
mod testing;
mod zones;

/// Fraction of the points that ranges leave out at either end.
const OUTSIDE: f64 = 0.1;

/// Fewest logged states with a steady melt pool whose median is given.
const FEWEST_STEADY: usize = 3;

/// Fewest logged states with a melt pool whose middle half is given where there is no steady part.
const FEWEST: usize = 8;

/// A number read off a log.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ReadOff {
    /// Body or source that it belongs to; empty for the run.
    pub of: String,
    /// Name for programs, such as "pool.width.steady", which stays as it is when the wording of `quantity` changes.
    pub id: String,
    /// Name in words.
    pub quantity: String,
    /// The value in the SI unit; NaN where it is left out.
    pub value: f64,
    /// SI unit.
    pub unit: String,
    /// Smallest and largest value; given for medians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Time at which the value occurs, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Position at which the value occurs, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<[f64; 3]>,
    /// Distance from the start of the line of a probe, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
    /// Reason why the value is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// Reason why the value is unreliable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// Options of [`read_off`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SummaryOptions {
    /// Isotherm (K) that bounds melt pool and fusion zone; the solidus of the body's material when left out.
    pub isotherm: Option<f64>,
    /// Isotherm (K) that bounds the heat-affected zone; `Ac1` of the body's steel when left out.
    pub haz: Option<f64>,
    /// Direction of travel where there is no source that moves.
    pub travel: Travel,
}

/// Names of a number.
struct Label {
    /// [`ReadOff::id`].
    id: String,
    /// [`ReadOff::quantity`].
    name: String,
}

impl Label {
    fn new(id: impl Into<String>, name: impl Into<String>) -> Self {
        Label {
            id: id.into(),
            name: name.into(),
        }
    }
}

/// The logged data of a body.
struct BodyRecord<'a> {
    log: &'a Log,
    sources: &'a LoggedSources,
    body: &'a BodyInfo,
    /// The last state.
    last: &'a LoggedCloud,
}

impl ReadOff {
    fn new(of: &str, label: Label, value: f64, unit: &str) -> Self {
        ReadOff {
            of: of.into(),
            id: label.id,
            quantity: label.name,
            value,
            unit: unit.into(),
            range: None,
            time: None,
            place: None,
            distance: None,
            left_out: None,
            warning: None,
        }
    }

    /// A quantity that has no value, for a reason.
    fn left_out(of: &str, label: Label, unit: &str, reason: &str) -> Self {
        ReadOff {
            left_out: Some(reason.into()),
            ..ReadOff::new(of, label, f64::NAN, unit)
        }
    }

    fn at(self, time: f64) -> Self {
        ReadOff {
            time: Some(time),
            ..self
        }
    }

    fn within(self, place: [f64; 3]) -> Self {
        ReadOff {
            place: Some(place),
            ..self
        }
    }

    fn along(self, distance: f64) -> Self {
        ReadOff {
            distance: Some(distance),
            ..self
        }
    }
}

/// Reads the numbers off a log.
///
/// # Errors
/// A log that cannot be read.
pub fn read_off(log: &Log, options: &SummaryOptions) -> Result<Vec<ReadOff>, LogError> {
    let mut found = Vec::new();
    let logged_sources = LoggedSources::of_log(log);
    let passes = passes::passes(log);
    for body in &log.run().bodies {
        let times = log.times(&body.name);
        let (Some(&end), Some(last)) = (times.last(), times.len().checked_sub(1)) else {
            continue;
        };
        let isotherm = isotherms(log, &body.name, options.isotherm.as_slice());
        let isotherm = isotherm.first().map(|i| i.temperature);
        let last = log.cloud(&body.name, last)?;
        let record = BodyRecord {
            log,
            sources: &logged_sources,
            body,
            last: &last,
        };
        let survey = temperatures(&record, isotherm, options, &mut found)?;
        if let Some(survey) = survey {
            passes::of_body(log, body, &survey, &passes, &mut found)?;
        }
        zones::zones(&record, isotherm, options, &mut found)?;
        history::history(&record, &mut found);
        mechanics::before_release(log, body, &mut found)?;
        fillet::fillet(&record, &mut found)?;
        distortion::distortion(&record, options.travel, &mut found)?;
        let mut extreme = |field: &str, quantity: &str, unit: &str| {
            found.extend(largest(body, &last, field).map(|(value, place)| {
                // fractions at the level of rounding are zero
                let value = if unit == "1" && value < 1e-12 {
                    0.0
                } else {
                    value
                };
                let name = Label::new(format!("{field}.end"), quantity);
                let number = ReadOff::new(&body.name, name, value, unit);
                number.at(end).within(place)
            }));
        };
        extreme("displacement", "largest displacement at the end", "m");
        if body.fields.iter().all(|field| field.name != "displacement") {
            extreme("velocity", "largest speed at the end", "m/s");
        }
        extreme("damage", "largest damage at the end", "1");
        extreme("hardness", "largest hardness at the end", "HV");
        extreme(
            "martensite",
            "largest fraction of martensite at the end",
            "1",
        );
        stress::stresses(&record, &mut found);
    }
    mechanics::stress_along_lines(log, &mut found);
    mechanics::beyond_yield(log, &mut found);
    flow::flow(log, &mut found);
    heat::sources(log, &mut found)?;
    passes::heat_input(log, &passes, &mut found);
    found.extend(errors(log));
    Ok(found)
}

/// Largest finite value of a field in a state, and its position (m) in the present configuration.
fn largest(body: &BodyInfo, cloud: &LoggedCloud, field: &str) -> Option<(f64, [f64; 3])> {
    // a rigid motion of a fluid or of a free body is no distortion
    let is_solid = field != "displacement" || body.fields.iter().any(|f| f.name == "stress");
    let scalar = scalar(cloud, field).filter(|_| is_solid)?;
    let values = scalar.values.iter().copied().zip(&cloud.positions);
    let (value, place) = values
        .filter(|(v, _)| v.is_finite())
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((value, *place))
}

fn temperatures(
    record: &BodyRecord<'_>,
    isotherm: Option<f64>,
    options: &SummaryOptions,
    found: &mut Vec<ReadOff>,
) -> Result<Option<BodySurvey>, LogError> {
    let &BodyRecord {
        log,
        sources,
        body,
        last,
    } = record;
    let Some(at_end) = largest(body, last, "temperature") else {
        return Ok(None);
    };
    let fields = ["temperature".into()];
    let survey = survey(log, body, &fields, isotherm, options.travel)?;
    if let Some(&index) = survey.peak.get("temperature") {
        let cloud = log.cloud(&body.name, index)?;
        let logged = largest(body, &cloud, "temperature");
        // also between the logged states
        let recorded = largest(body, last, "peak_temperature");
        let of = |(peak, place)| {
            let name = Label::new("temperature.largest", "highest logged temperature");
            ReadOff::new(&body.name, name, peak, "K").within(place)
        };
        let hottest = match (logged, recorded) {
            (Some(logged), Some(recorded)) if recorded.0 > logged.0 => Some(of(recorded)),
            (logged, _) => logged.map(|logged| of(logged).at(cloud.time)),
        };
        let peak = hottest.as_ref().map(|hottest| hottest.value);
        found.extend(hottest);
        found.extend(
            peak.into_iter()
                .flat_map(|peak| left_tables(log, body, peak)),
        );
    }
    let name = Label::new("temperature.end", "highest temperature at the end");
    found.push(ReadOff::new(&body.name, name, at_end.0, "K").at(last.time));
    let states: Vec<_> = survey
        .pools
        .iter()
        .map(|state| {
            let source = SourceState::nearest(sources.at(state.time), state.hottest)?;
            Some((state.pool.as_ref()?, source))
        })
        .collect();
    let is_steady = steady(&states);
    for (name, size) in SIZES {
        let sizes: Vec<(usize, f64, f64)> = (survey.pools.iter().enumerate())
            .filter_map(|(index, state)| Some((index, state.time, size(state.pool.as_ref()?)?)))
            .collect();
        if let Some(&(_, time, value)) = sizes.iter().max_by(|a, b| a.2.total_cmp(&b.2)) {
            let name = Label::new(
                format!("pool.{name}.largest"),
                format!("largest {name} of the melt pool"),
            );
            found.push(ReadOff::new(&body.name, name, value, "m").at(time));
        }
        let of_steady = sizes.iter().filter(|(index, ..)| is_steady.contains(index));
        let of_steady: Vec<f64> = of_steady.map(|(.., value)| *value).collect();
        if of_steady.len() >= FEWEST_STEADY {
            let name = Label::new(
                format!("pool.{name}.steady"),
                format!("{name} of the melt pool, steady part"),
            );
            found.push(median(&body.name, name, of_steady, "m", 0.0));
        } else if sizes.len() >= FEWEST {
            let middle = sizes.len() / 4..sizes.len() - sizes.len() / 4;
            let middle: Vec<f64> = sizes[middle].iter().map(|(.., value)| *value).collect();
            let name = Label::new(
                format!("pool.{name}.middle"),
                format!("{name} of the melt pool, middle half of its time"),
            );
            found.push(median(&body.name, name, middle, "m", 0.0));
        }
    }
    Ok(Some(survey))
}

/// The ends (K) of tables of material properties that the highest temperature (K) lies beyond.
fn left_tables(log: &Log, body: &BodyInfo, peak: f64) -> Vec<ReadOff> {
    let case = case_of(log).ok();
    let materials = case.and_then(|case| case.materials_of(&body.name).ok());
    let has_field = |name: &str| body.fields.iter().any(|f| f.name == name);
    let range = [peak.min(293.15), peak];
    let mut left = tables::left_by(&materials.unwrap_or_default(), has_field, range);
    left.retain(|table| peak > table.rows[1]);
    let read_off = |table: tables::LeftTable| {
        let quantity = format!(
            "end of the table `{}` of {}, which the run left",
            table.property, table.material
        );
        let id = format!("table_end.{}.{}", table.material, table.property);
        let name = Label::new(id, quantity);
        ReadOff::new(&body.name, name, table.rows[1], "K")
    };
    left.into_iter().map(read_off).collect()
}

pub(crate) type Size = fn(&MeltPool) -> Option<f64>;

/// Extents of a melt pool.
pub(crate) const SIZES: [(&str, Size); 3] = [
    ("length", |pool| Some(pool.length())),
    ("width", |pool| pool.width),
    ("depth", |pool| pool.depth),
];

/// The median of some values and their range without the outermost parts.
fn median(of: &str, label: Label, mut values: Vec<f64>, unit: &str, outside: f64) -> ReadOff {
    values.sort_by(f64::total_cmp);
    let at = |fraction: f64| values[((values.len() - 1) as f64 * fraction).round() as usize];
    ReadOff {
        range: Some([at(outside), at(1.0 - outside)]),
        ..ReadOff::new(of, label, at(0.5), unit)
    }
}

/// Relative errors at the end of the balances that have changed.
fn errors(log: &Log) -> impl Iterator<Item = ReadOff> + '_ {
    let balance = log.balance();
    balance.columns.iter().filter_map(move |column| {
        let quantity = column.name.strip_suffix(".error")?;
        let last = |part: &str| {
            let name = format!("{quantity}.{part}");
            let column = balance.columns.iter().find(|c| c.name == name)?;
            column.values.last().copied()
        };
        let change = (last("stored")? - last("initial")?).abs();
        let size = change.max(last("supplied")?.abs());
        let logged = last(&RELATIVE_ERROR[1..]);
        let error = logged.unwrap_or(column.values.last()?.abs() / size);
        let name = Label::new(
            format!("error.{quantity}"),
            format!("relative error of {quantity}"),
        );
        (size > 0.0).then(|| ReadOff::new("", name, error, "1"))
    })
}

/// Prints the numbers in practical units.
///
/// # Errors
/// The output cannot be written.
pub fn print(found: &[ReadOff], out: &mut impl Write) -> std::io::Result<()> {
    let widest = found
        .iter()
        .map(|r| r.quantity.chars().count())
        .max()
        .unwrap_or(0);
    for (index, read_off) in found.iter().enumerate() {
        let is_new = index == 0 || found[index - 1].of != read_off.of;
        if is_new {
            let gap = if index == 0 { "" } else { "\n" };
            let of = if read_off.of.is_empty() {
                "run"
            } else {
                &read_off.of
            };
            writeln!(out, "{gap}{of}")?;
        }
        write!(out, "  {:widest$}  ", read_off.quantity)?;
        match &read_off.left_out {
            Some(reason) => write!(out, "left out: {reason}")?,
            None => print_value(read_off, out)?,
        }
        writeln!(out)?;
        if let Some(warning) = &read_off.warning {
            writeln!(out, "  {:widest$}  warning: {warning}", "")?;
        }
    }
    Ok(())
}

/// Prints a value with its range, time and position.
fn print_value(read_off: &ReadOff, out: &mut impl Write) -> std::io::Result<()> {
    let (factor, unit) = unit::value(&read_off.unit, read_off.value);
    let number = |value: f64| unit::number(value * factor, 4);
    let unit = if unit.is_empty() {
        unit
    } else {
        format!(" {unit}")
    };
    write!(out, "{}{unit}", number(read_off.value))?;
    if let Some([low, high]) = read_off.range {
        write!(out, " ({} to {})", number(low), number(high))?;
    }
    if let Some(time) = read_off.time {
        write!(out, " at {}", unit::time_text(time))?;
    }
    if let Some(place) = read_off.place {
        let length = unit::length(place.iter().fold(0.0, |size: f64, x| size.max(x.abs())));
        let [x, y, z] = place.map(|x| unit::number(x * length.factor, 4));
        write!(out, ", ({x}, {y}, {z}) {}", length.unit)?;
    }
    if let Some(distance) = read_off.distance {
        let distance = unit::length_text(distance);
        write!(out, ", {distance} from the start of the line")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::fixture;

    #[test]
    fn numbers_of_a_log_are_read_off() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("spot.mcap");
        fixture::write_log(&path, [12, 6, 4]);
        let log = Log::open(&path).expect("a log");
        let found = read_off(
            &log,
            &SummaryOptions {
                isotherm: Some(1000.0),
                ..SummaryOptions::default()
            },
        )
        .expect("readable");
        let value = |quantity: &str| {
            let mut of_plate = found.iter().filter(|r| r.of == "plate");
            let found = of_plate.find(|r| r.quantity == quantity);
            found
                .unwrap_or_else(|| panic!("{quantity} in {found:?}"))
                .value
        };
        let hottest = (0..log.times("plate").len()).map(|index| {
            let cloud = log.cloud("plate", index).expect("a cloud");
            let scalar = scalar(&cloud, "temperature").expect("a temperature");
            scalar.values.into_iter().fold(0.0, f64::max)
        });
        assert_eq!(
            value("highest logged temperature"),
            hottest.fold(0.0, f64::max)
        );
        assert!(value("largest length of the melt pool") > value("largest depth of the melt pool"));
        let mut text = Vec::new();
        print(&found, &mut text).expect("it writes to memory");
        let text = String::from_utf8(text).expect("text");
        assert!(text.starts_with("plate\n"), "{text}");
        assert!(text.contains(" mm at "), "{text}");
    }

    #[test]
    fn a_median_has_a_range() {
        let values = (1..=101).map(f64::from).rev().collect();
        let found = median("a", Label::new("b", "b"), values, "s", 0.1);
        assert_eq!((found.value, found.range), (51.0, Some([11.0, 91.0])));
    }
}
