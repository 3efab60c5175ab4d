//! Description of a run for the page, as JSON.

use perimelt_core::log::{BodyInfo, Ending, Log, LogError, Series};
use perimelt_plot::{ColourMap, LINES};
use serde_json::{Value, json};

use super::store::{Pools, Store};
use crate::case::of_log::{case_of, early_end};
use crate::component::Number;
use crate::log_names::{REPORTS, SPACING};
use crate::melt_pool::{LoggedSources, SourceState, Travel};
use crate::quantity::isotherm::Isotherm;
use crate::summary::{SIZES, Size};
use crate::unit::duration;
use crate::unit::{RULES, pretty_name, pretty_unit};

/// `/run.json`.
///
/// # Errors
/// The first state of a body cannot be read.
pub(super) fn run(store: &Store) -> Result<Value, LogError> {
    let log = store.refreshed();
    let run = log.run();
    // a case that this program cannot read has no title and no end
    let case = case_of(&log).ok();
    let title = case.as_ref().map(|case| case.case.title.clone());
    let title = title.filter(|title| !title.is_empty());
    let mut bodies = Vec::new();
    for info in &run.bodies {
        bodies.push(body(store, &log, info)?);
    }
    let map = |name: &str, map: ColourMap| json!({ "name": name, "colours": map.control_points() });
    let last = log.progress().last();
    let end = case.map(|case| case.time.end);
    Ok(json!({
        "title": title.unwrap_or_else(|| log.case_name().to_owned()),
        "case": log.case_name(),
        "file": log.path().file_name().map(|name| name.to_string_lossy()),
        "version": run.version,
        "started": run.started,
        "finished": log.finished(),
        "stopped": early_end(&log).is_some(),
        "ending": ending(&log),
        "damaged": log.damage().len(),
        "seconds_since_change": store.age().map(|age| age.as_secs_f64()),
        "end": end,
        "time": last.map(|progress| progress.time),
        "step": last.map(|progress| progress.step),
        "wall_time": last.map(|progress| duration(progress.wall_seconds)),
        "bodies": bodies,
        "maps": [
            map("inferno", ColourMap::Inferno),
            map("viridis", ColourMap::Viridis),
            map("blue-red", ColourMap::BlueRed),
        ],
        "lines": LINES,
        "units": RULES,
    }))
}

/// `/sources.json`: the moving heat sources at the times of the states.
pub(super) fn sources(log: &Log) -> Value {
    let sources = LoggedSources::of_log(log);
    let mut times: Vec<f64> = log
        .bodies()
        .flat_map(|body| log.times(body))
        .copied()
        .collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let source = |s: &SourceState| json!({ "position": s.position, "beam": s.beam, "travel": s.travel, "on": s.is_on });
    let at = |time: &f64| {
        let sources: Vec<Value> = sources.at(*time).iter().map(source).collect();
        json!({ "time": time, "sources": sources })
    };
    Value::Array(times.iter().map(at).collect())
}

fn ending(log: &Log) -> Option<String> {
    match log.ending() {
        Ending::Damaged { at, what } => Some(format!("the log is damaged at byte {at}: {what}")),
        Ending::Finished | Ending::Unfinished { .. } => None,
    }
}

fn body(store: &Store, log: &Log, info: &BodyInfo) -> Result<Value, LogError> {
    let times = log.times(&info.name);
    let outline = store.outline(&info.name)?;
    let fields = outline.fields.iter().filter(|field| field.name != SPACING);
    let fields: Vec<Value> = fields
        .map(|field| field_of(&field.name, &field.unit, field.components))
        .collect();
    let isotherm = |i: Isotherm| json!({ "name": i.name, "temperature": i.temperature });
    let isotherms = store.isotherms(&info.name).into_iter().map(isotherm);
    Ok(json!({
        "name": info.name,
        "label": pretty_name(&info.name),
        "dimension": info.dimension,
        "spacing": info.spacing,
        "points": info.points,
        // points of different spacings have a field of them
        "has_spacings": info.fields.iter().any(|field| field.name == SPACING),
        "plies": info.plies,
        "times": times,
        "fields": fields,
        "isotherms": isotherms.collect::<Vec<_>>(),
    }))
}

/// A field with its scalars: first the one that stands for it, by the name that `Scalar` gives it.
fn field_of(name: &str, unit: &str, components: usize) -> Value {
    let whole = match components {
        3 => "magnitude",
        9 => "von Mises",
        _ => "",
    };
    let parts = Number::names(components)
        .into_iter()
        .filter(|part| !matches!(*part, "magnitude" | "von_mises"))
        .map(|part| json!({ "name": format!("{name}.{part}"), "label": pretty_name(part) }));
    let scalars: Vec<Value> = std::iter::once(json!({ "name": name, "label": whole }))
        .chain(parts)
        .collect();
    json!({
        "name": name,
        "label": pretty_name(name),
        "unit": unit,
        "shown_unit": pretty_unit(unit),
        "components": components,
        "scalars": scalars,
    })
}

/// `/series.json`.
pub(super) fn series(log: &Log) -> Value {
    let mut all = Vec::new();
    for (name, series) in log.probes() {
        let kind = if name == REPORTS { "reports" } else { "probe" };
        all.push(one_series(&pretty_name(name), kind, series));
    }
    if !log.balance().columns.is_empty() {
        all.push(one_series("balance", "balance", log.balance()));
    }
    Value::Array(all)
}

fn one_series(name: &str, kind: &str, series: &Series) -> Value {
    let columns = series.columns.iter().map(|column| {
        json!({
            "name": column.name,
            "label": pretty_name(&column.name),
            "unit": column.unit,
            "shown_unit": pretty_unit(&column.unit),
            "values": column.values,
        })
    });
    let columns: Vec<Value> = columns.collect();
    json!({ "name": name, "kind": kind, "times": series.times, "columns": columns })
}

/// `/melt-pool/<body>`, in the form of a series; no columns if nothing melts.
///
/// # Errors
/// The log cannot be read.
pub(super) fn melt_pool(store: &Store, body: &BodyInfo, travel: Travel) -> Result<Value, LogError> {
    let isotherms = store.isotherms(&body.name);
    let Some(isotherm) = isotherms.first() else {
        return Ok(json!({ "times": [], "columns": [] }));
    };
    let pools = store.pools(body, travel)?;
    let columns: Vec<Value> = SIZES
        .iter()
        .filter_map(|(n, s)| size(&pools, n, *s))
        .collect();
    Ok(json!({
        "name": format!("melt pool of {}", pretty_name(&body.name)),
        "kind": "pool",
        "isotherm": { "name": isotherm.name, "temperature": isotherm.temperature },
        "times": pools.iter().map(|(time, _)| *time).collect::<Vec<_>>(),
        "columns": columns,
    }))
}

fn size(pools: &Pools, name: &str, size: Size) -> Option<Value> {
    let values: Vec<Option<f64>> = pools
        .iter()
        .map(|(_, pool)| pool.as_ref().and_then(size))
        .collect();
    let is_there = values.iter().any(Option::is_some);
    is_there.then(
        || json!({ "name": name, "label": name, "unit": "m", "shown_unit": "m", "values": values }),
    )
}
