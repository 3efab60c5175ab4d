//! The charts of a run.

use perimelt_core::log::{BodyInfo, Column, LoggedCloud, Series};
use perimelt_plot::{Chart, LINES, Panel};

use crate::log_names::{BALANCE_LIMIT, RELATIVE_ERROR};
use crate::melt_pool::MeltPool;
use crate::quantity::isotherm::Isotherm;
use crate::quantity::scalar::Scalar;
use crate::quantity::survey::BodySurvey;
use crate::unit::{self, Shown};

/// Names and values of lines.
type Lines = Vec<(String, Vec<f64>)>;

/// A panel with lines in an SI unit, in the unit that suits their size; its label is this unit.
pub(crate) fn panel(si: &str, mut lines: Lines, celsius: bool) -> Panel {
    let shown = Shown::for_values(si, lines.iter().flat_map(|(_, values)| values), celsius);
    for value in lines.iter_mut().flat_map(|(_, values)| values) {
        *value = shown.of(*value);
    }
    Panel {
        label: shown.unit,
        lines,
        ..Panel::default()
    }
}

/// [`panel`] with the name of the values before the unit.
fn named_panel(name: &str, si: &str, lines: Lines, celsius: bool) -> Panel {
    let panel = panel(si, lines, celsius);
    Panel {
        label: unit::label(name, &panel.label).trim().to_owned(),
        ..panel
    }
}

/// A chart over numbers called `name` in an SI unit.
fn chart(title: String, name: &str, si: &str, numbers: &[f64], panels: Vec<Panel>) -> Chart {
    let shown = Shown::for_values(si, numbers, false);
    Chart {
        title,
        horizontal_label: unit::label(name, &shown.unit),
        horizontal: numbers.iter().map(|number| shown.of(*number)).collect(),
        panels,
    }
}

/// A series over time, one panel for each unit, or several where a panel would have more lines than there are colours.
pub(super) fn series_chart(title: String, series: &Series, celsius: bool) -> Chart {
    let mut units: Vec<&str> = Vec::new();
    for column in &series.columns {
        if !units.contains(&&*column.unit) {
            units.push(&column.unit);
        }
    }
    let mut panels = Vec::new();
    for si in units {
        let columns: Vec<&Column> = series.columns.iter().filter(|c| c.unit == si).collect();
        panels.extend(columns.chunks(LINES.len()).map(|columns| {
            let line = |c: &&Column| (unit::pretty_name(&c.name), c.values.clone());
            let lines: Lines = columns.iter().map(line).collect();
            match columns {
                [column] => named_panel(&unit::pretty_name(&column.name), si, lines, celsius),
                _ => panel(si, lines, celsius),
            }
        }));
    }
    chart(title, "time", "s", &series.times, panels)
}

/// Errors of the balances relative to what was stored or supplied, over time, with the limit that `perimelt verify` sets.
pub(super) fn balance_chart(balance: &Series) -> Chart {
    /// errors of zero are drawn at this height of the logarithmic axis
    const NONE: f64 = 1e-17;
    let errors = balance.columns.iter().filter_map(|column| {
        let name = column.name.strip_suffix(RELATIVE_ERROR)?;
        let values = column.values.iter().map(|error| error.abs().max(NONE));
        Some((unit::pretty_name(name), values.collect()))
    });
    let lines: Lines = errors.collect();
    let panel = |lines: &[(String, Vec<f64>)]| Panel {
        label: match lines {
            [(name, _)] => format!("relative error of {name}"),
            _ => "relative error".into(),
        },
        logarithmic: true,
        lines: lines.to_vec(),
        limit: Some(("limit".into(), BALANCE_LIMIT)),
        ..Panel::default()
    };
    let panels = lines.chunks(LINES.len()).map(panel).collect();
    let title = "Errors of the balances, relative to what was stored or supplied".into();
    chart(title, "time", "s", &balance.times, panels)
}

/// Values of a line probe over the distance from its start, at some of its times. The field and its component are not
/// contained in the series.
pub(super) fn line_probe_chart(
    title: String,
    series: &Series,
    rows: &[usize],
    field: &str,
    celsius: bool,
) -> Chart {
    let columns = || series.columns.iter();
    let distances: Vec<f64> = columns()
        .map(|column| column.name.parse().unwrap_or(f64::NAN))
        .collect();
    let time = |row: usize| format!("t = {}", unit::time_text(series.times[row]));
    let line = |row: &usize| {
        let values = columns().map(|column| column.values[*row]).collect();
        (time(*row), values)
    };
    let title = match rows {
        [row] => format!("{title}, {}", time(*row)),
        _ => title,
    };
    let si = columns().next().map_or("", |column| &column.unit);
    let panel = named_panel(field, si, rows.iter().map(line).collect(), celsius);
    chart(title, "distance", "m", &distances, vec![panel])
}

/// A scalar along a one-dimensional body.
pub(super) fn line_chart(
    title: String,
    cloud: &LoggedCloud,
    scalar: &Scalar,
    celsius: bool,
) -> Chart {
    let points = cloud.positions.iter().zip(&scalar.values);
    let mut points: Vec<(f64, f64)> = points.map(|([x, ..], value)| (*x, *value)).collect();
    points.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let (places, values): (Vec<f64>, _) = points.into_iter().unzip();
    let lines = vec![(String::new(), values)];
    let panel = named_panel(&scalar.label, &scalar.unit, lines, celsius);
    chart(title, "x", "m", &places, vec![panel])
}

/// Length, width and depth over time; empty if no point ever melts.
pub(super) fn melt_pool_chart(
    body: &BodyInfo,
    survey: &BodySurvey,
    isotherm: Option<&Isotherm>,
    celsius: bool,
) -> Chart {
    let pools = || survey.pools.iter().map(|state| state.pool.as_ref());
    let Some(isotherm) = isotherm.filter(|_| pools().any(|pool| pool.is_some())) else {
        return Chart::default();
    };
    let line = |name: &str, size: fn(&MeltPool) -> Option<f64>| {
        let sizes = || pools().map(|pool| pool.and_then(size));
        let is_known = sizes().any(|size| size.is_some());
        let values = sizes().map(|size| size.unwrap_or(f64::NAN)).collect();
        is_known.then_some((name.to_owned(), values))
    };
    let lines = [
        line("length", |pool| Some(pool.length())),
        line("width", |pool| pool.width),
        line("depth", |pool| pool.depth),
    ];
    let panel = named_panel("size", "m", lines.into_iter().flatten().collect(), false);
    let shown = Shown::new("K", isotherm.temperature, celsius);
    let title = format!(
        "Melt pool of {} ({} {} {})",
        unit::pretty_name(&body.name),
        isotherm.name_or_isotherm(),
        unit::signed_number(shown.of(isotherm.temperature), 5),
        shown.unit
    );
    let times: Vec<f64> = survey.pools.iter().map(|state| state.time).collect();
    chart(title, "time", "s", &times, vec![panel])
}
