//! Bodies, fields and points that a `measure` key names.

use nalgebra::Vector3;
use perimelt_core::field::FieldIndex;
use perimelt_core::{Body, Face, SetupError, Simulation};

use super::sample::Sampler;
use crate::component::Component;
use crate::melt_pool::MeltPoolGauge;
use crate::probe::interpolation::{Interpolation, Weights};
use crate::probe::{Probe, find_field, points_of};
use crate::probe::{ProbeKind, ProbeSection, RegionProbe, Statistic};
use crate::verify::check::{
    AlternationMeasure, BalanceMeasure, CrossingMeasure, DeviationMeasure, FieldMeasure,
    HistoryMeasure, Measure, MeltPoolMeasure, OnsetMeasure, OverTime, PassingMeasure, PlaceMeasure,
    ReportMeasure, StatisticMeasure, Times, TipMeasure,
};

/// Times of a measurement, and the reduction of its values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    /// First state, s; the first one after the start when left out.
    since: Option<f64>,
    /// Last state, s; the end when left out.
    until: Option<f64>,
    pub(super) over_time: OverTime,
}

impl Schedule {
    /// The schedule that a measurement gives; the state at the end alone where it gives none.
    ///
    /// # Errors
    /// The last state alone does not begin at `since`.
    fn new(times: Option<&Times>) -> Result<Self, SetupError> {
        let (over_time, since) = times.map_or((None, None), |t| (t.over_time, t.since));
        let over_time = match (over_time, since) {
            (Some(OverTime::Last), Some(since)) => {
                let message = format!("`since` = {since} s has no effect on the last state");
                let expected = "\"max\", \"min\", \"mean\" or \"rate\", or no `since`";
                return Err(SetupError::value("measure.over_time", message, expected));
            }
            (Some(over_time), _) => over_time,
            (None, Some(_)) => OverTime::Mean,
            (None, None) => OverTime::Last,
        };
        Ok(Schedule {
            since,
            until: times.and_then(|t| t.time),
            over_time,
        })
    }

    /// Whether the logged state at a time (s) counts, in a run to `end` (s).
    pub(super) fn includes(&self, now: f64, end: f64) -> bool {
        let (until, near) = (self.until.unwrap_or(end), 1e-9 * end);
        let since = match self.over_time {
            OverTime::Last => until,
            _ => self.since.unwrap_or(0.0),
        };
        now >= since - near && now <= until + near
    }
}

/// The sampler of a measurement and the times at which it is used.
///
/// # Errors
/// The key at fault.
pub(super) fn sampler(
    measure: &Measure,
    simulation: &Simulation,
) -> Result<(Sampler, Schedule), SetupError> {
    let moving_body = |name: &Option<String>| find_moving_body(simulation, name.as_deref());
    let (sampler, times) = match measure {
        Measure::Field(m) => (field(m, simulation)?, Some(&m.times)),
        Measure::Passing(m) => (passing(m, simulation)?, Some(&m.times)),
        Measure::Reach(m) => {
            let body = moving_body(&m.body)?;
            let along = direction(m.along, "measure.reach.along")?;
            (Sampler::Reach { body, along }, Some(&m.times))
        }
        Measure::Nearest(m) => {
            let body = moving_body(&m.body)?;
            (Sampler::Nearest { body }, Some(&m.times))
        }
        Measure::History(m) => (history(m, simulation)?, None),
        Measure::Crossing(m) => (crossing(m, simulation)?, None),
        Measure::Onset(m) => (onset(m, simulation)?, None),
        Measure::Tip(m) => (tip(m, simulation)?, Some(&m.times)),
        Measure::Statistic(m) => (statistic(m, simulation)?, Some(&m.times)),
        Measure::Place(m) => (place(m, simulation)?, Some(&m.times)),
        Measure::Deviation(m) => (deviation(m, simulation)?, Some(&m.times)),
        Measure::Alternation(m) => (alternation(m, simulation)?, Some(&m.times)),
        Measure::MeltPool(m) => (melt_pool(m, simulation)?, Some(&m.times)),
        Measure::Balance(m) => (balance(m, simulation)?, None),
        Measure::Passes => (Sampler::Passes, None),
        Measure::Report(m) => (report(m, simulation)?, Some(&m.times)),
    };
    Ok((sampler, Schedule::new(times)?))
}

fn field(m: &FieldMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "field")?;
    let weights = |at| found.weights(at, m.interpolation);
    let subtracted = m.from.map(weights).transpose()?;
    let difference = |&at: &[f64; 3]| {
        let mut weights = weights(at)?;
        if let Some(from) = &subtracted {
            weights.subtract(from);
        }
        Ok(weights)
    };
    Ok(Sampler::Field {
        component: found.component(m.target.component.as_deref())?,
        weights: m
            .at
            .iter()
            .map(difference)
            .collect::<Result<_, SetupError>>()?,
        offset: m.offset,
    })
}

fn passing(m: &PassingMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    find_moving_body(simulation, m.target.body.as_deref())?;
    let found = Found::new(simulation, &m.target.body, &m.target.field, "passing")?;
    Ok(Sampler::Passing {
        body: found.body,
        component: found.component(m.target.component.as_deref())?,
        section: m.clone(),
    })
}

fn history(m: &HistoryMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "history")?;
    let end = simulation.options().end;
    Ok(Sampler::History {
        component: found.component(m.target.component.as_deref())?,
        weights: found.weights(m.at, m.interpolation)?,
        until: m.until.unwrap_or(end) + 1e-9 * end,
    })
}

fn crossing(m: &CrossingMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "crossing")?;
    let interpolation = match found.points().lattice() {
        Some(_) => Interpolation::Cubic,
        None => Interpolation::Linear,
    };
    Ok(Sampler::Crossing {
        component: found.component(m.target.component.as_deref())?,
        weights: found.weights(m.at, interpolation)?,
        level: m.value,
        after: m.after,
        last: (f64::NAN, f64::NAN),
    })
}

fn onset(m: &OnsetMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let region = RegionProbe {
        name: m.region.clone(),
        statistic: Statistic::Max,
        condition: None,
    };
    Ok(Sampler::Onset {
        largest: region_probe(&m.target.body, &m.target.field, None, region, simulation)?,
        above: m.above,
    })
}

fn tip(m: &TipMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "tip")?;
    Ok(Sampler::Tip {
        body: found.body,
        component: found.component(None)?,
        above: m.above,
        along: direction(m.along, "measure.tip.along")?,
        angle_from: m.angle_from,
    })
}

fn statistic(m: &StatisticMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let region = RegionProbe {
        name: m.region.clone(),
        statistic: m.statistic,
        condition: m.condition.clone(),
    };
    Ok(Sampler::Statistic {
        probe: region_probe(
            &m.target.body,
            &m.target.field,
            m.target.component.clone(),
            region,
            simulation,
        )?,
        offset: m.offset,
    })
}

fn place(m: &PlaceMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "place")?;
    Ok(Sampler::Place {
        body: found.body,
        component: found.component(m.target.component.as_deref())?,
        points: found.points_of(m.region.as_deref())?,
        of: m.of,
    })
}

fn deviation(m: &DeviationMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "deviation")?;
    Ok(Sampler::Deviation {
        component: found.component(m.target.component.as_deref())?,
        points: found.points_of(m.region.as_deref())?,
        section: m.clone(),
    })
}

fn alternation(m: &AlternationMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let found = Found::new(simulation, &m.target.body, &m.target.field, "alternation")?;
    let body = found.points();
    let points = found.points_of(m.region.as_deref())?;
    let lower = Face::ALL.into_iter().filter(|face| !face.is_upper());
    let rows = lower.flat_map(|face| {
        let neighbours = move |point| {
            let before = body.neighbour(point, face)?;
            Some([before, point, body.neighbour(point, face.opposite())?])
        };
        let points = points.iter().map(|&point| point as usize);
        points.filter_map(neighbours)
    });
    let rows: Vec<[usize; 3]> = rows.collect();
    if rows.is_empty() {
        let message = format!("no row of three points of body `{}` lies there", body.name);
        let expected = "a region with three points in a row";
        return Err(SetupError::value(found.key("region"), message, expected));
    }
    Ok(Sampler::Alternation {
        component: found.component(m.target.component.as_deref())?,
        rows,
        norm: m.norm,
    })
}

fn melt_pool(m: &MeltPoolMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let key = "measure.melt_pool";
    let body = simulation.world().find_body(m.body.as_deref())?;
    let world = simulation.world();
    let points = world.body(body);
    let gauge = MeltPoolGauge::of_body(world, body, m.isotherm);
    Ok(Sampler::MeltPool {
        temperature: find_field(simulation, body, "temperature", key)?,
        gauge: gauge.ok_or_else(|| MeltPoolGauge::scattered(points, key))?,
        extent: m.extent,
    })
}

fn balance(m: &BalanceMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let balances = simulation.balances().into_iter().flat_map(|(_, b)| b);
    let known = balances.map(|b| b.quantity).collect();
    is_one_of("balance", "measure.balance.quantity", &m.quantity, known)?;
    Ok(Sampler::Balance {
        quantity: m.quantity.clone(),
        largest: 0.0,
    })
}

fn report(m: &ReportMeasure, simulation: &Simulation) -> Result<Sampler, SetupError> {
    let reports = simulation.reports().into_iter().flat_map(|(_, r)| r);
    let known: Vec<String> = reports.map(|r| r.name).collect();
    is_one_of("report", "measure.report.name", &m.name, known.clone())?;
    if let Some(of) = &m.of {
        is_one_of("report", "measure.report.of", of, known)?;
    }
    let (name, of) = (m.name.clone(), m.of.clone());
    Ok(Sampler::Report { name, of })
}

/// A field of a body, with the name of the measurement, for the keys of mistakes.
struct Found<'a> {
    simulation: &'a Simulation,
    body: usize,
    field: FieldIndex,
    measure: &'static str,
}

impl<'a> Found<'a> {
    /// The `field` of a body.
    fn new(
        simulation: &'a Simulation,
        body: &Option<String>,
        field: &str,
        measure: &'static str,
    ) -> Result<Self, SetupError> {
        let body = simulation.world().find_body(body.as_deref())?;
        let key = format!("measure.{measure}.field");
        Ok(Found {
            simulation,
            body,
            field: find_field(simulation, body, field, &key)?,
            measure,
        })
    }

    fn key(&self, name: &str) -> String {
        format!("measure.{}.{name}", self.measure)
    }

    fn points(&self) -> &'a Body {
        self.simulation.world().body(self.body)
    }

    fn component(&self, name: Option<&str>) -> Result<Component, SetupError> {
        Component::new(self.simulation.world(), self.field, name)
    }

    fn weights(&self, at: [f64; 3], interpolation: Interpolation) -> Result<Weights, SetupError> {
        Weights::at(self.points(), at, interpolation, &self.key("at"))
    }

    /// The points of a region; those of the body without one.
    fn points_of(&self, region: Option<&str>) -> Result<Vec<u32>, SetupError> {
        points_of(
            self.simulation.world(),
            self.body,
            region,
            &self.key("region"),
        )
    }
}

/// A direction of any length but zero.
fn direction(along: [f64; 3], key: &str) -> Result<Vector3<f64>, SetupError> {
    let along = Vector3::from(along);
    let length = along.norm();
    if length > 0.0 && length.is_finite() {
        return Ok(along);
    }
    let message = format!("[{}, {}, {}] has no direction", along.x, along.y, along.z);
    let expected = "a finite vector that is not zero";
    Err(SetupError::value(key, message, expected))
}

/// The body called `name`, which must have a displacement.
fn find_moving_body(simulation: &Simulation, name: Option<&str>) -> Result<usize, SetupError> {
    let body = simulation.world().find_body(name)?;
    find_field(simulation, body, "displacement", "measure")?;
    Ok(body)
}

/// A probe of a field (name and component) in a region of a body.
fn region_probe(
    body: &Option<String>,
    field: &str,
    component: Option<String>,
    region: RegionProbe,
    simulation: &Simulation,
) -> Result<Probe, SetupError> {
    let section = ProbeSection {
        name: String::new(),
        body: body.clone(),
        field: Some(field.into()),
        component,
        kind: ProbeKind::Region(region),
    };
    Probe::new(&section, simulation)
}

fn is_one_of(
    what: &'static str,
    key: &str,
    name: &str,
    mut known: Vec<String>,
) -> Result<(), SetupError> {
    if known.iter().any(|k| k == name) {
        return Ok(());
    }
    known.sort();
    known.dedup();
    Err(SetupError::unknown(key, what, name, known))
}
