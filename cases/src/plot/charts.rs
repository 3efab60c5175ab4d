//! The charts of a run.

use perimelt_core::log::{BodyInfo, LoggedCloud, Series};

use super::{
    colour::LINES,
    curves::{Chart, Panel},
};
use crate::log_names::BALANCE_LIMIT;
use crate::log_names::RELATIVE_ERROR;
use crate::melt_pool::MeltPool;
use crate::quantity::isotherm::Isotherm;
use crate::quantity::scalar::Scalar;
use crate::quantity::survey::BodySurvey;
use crate::unit::{self, Shown};

/// Errors of the balances relative to what was stored or supplied, over time, with the limit that `perimelt verify` sets.
pub(super) fn balance_chart(balance: &Series) -> Chart {
    /// errors of zero are drawn at this height of the logarithmic axis
    const NONE: f64 = 1e-17;
    let errors = balance.columns.iter().filter_map(|column| {
        let name = column.name.strip_suffix(RELATIVE_ERROR)?;
        let values = column.values.iter().map(|x| x.abs().max(NONE)).collect();
        Some((unit::pretty_name(name), values))
    });
    let mut lines: Vec<(String, Vec<f64>)> = errors.collect();
    if lines.is_empty() {
        lines = computed_errors(balance);
        let floor = |error: &mut f64| *error = error.max(NONE);
        lines
            .iter_mut()
            .for_each(|(_, errors)| errors.iter_mut().for_each(floor));
    }
    let time = unit::time(balance.times.iter().fold(0.0, |last, t| t.max(last)));
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
    Chart {
        title: "Errors of the balances, relative to what was stored or supplied".into(),
        horizontal_label: unit::label("time", time.unit),
        horizontal: balance.times.iter().map(|t| t * time.factor).collect(),
        panels: lines.chunks(LINES.len()).map(panel).collect(),
    }
}

/// Relative errors for a log of an older version, which does not contain them: over the largest of what was stored or
/// supplied up to each time.
fn computed_errors(balance: &Series) -> Vec<(String, Vec<f64>)> {
    let errors = balance.columns.iter().filter_map(|column| {
        let quantity = column.name.strip_suffix(".error")?;
        let part = |part: &str| {
            let name = format!("{quantity}.{part}");
            balance.columns.iter().find(|column| column.name == name)
        };
        let (stored, initial, supplied) = (part("stored")?, part("initial")?, part("supplied")?);
        let mut size = 0.0_f64;
        let error = |(row, error): (usize, &f64)| {
            let excess = (stored.values[row] - initial.values[row]).abs();
            size = size.max(excess).max(supplied.values[row].abs());
            if size > 0.0 { error.abs() / size } else { 0.0 }
        };
        let values = column.values.iter().enumerate().map(error).collect();
        Some((unit::pretty_name(quantity), values))
    });
    errors.collect()
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
    let distances = series
        .columns
        .iter()
        .map(|c| c.name.parse().unwrap_or(f64::NAN));
    let distances: Vec<f64> = distances.collect();
    let lengths = unit::length(distances.iter().fold(0.0, |longest, d| d.max(longest)));
    let si_unit = series.columns.first().map_or("", |column| &column.unit);
    let values = |row: usize| series.columns.iter().map(move |column| column.values[row]);
    let finite = rows
        .iter()
        .flat_map(|row| values(*row))
        .filter(|x| x.is_finite());
    let largest = finite.fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let shown = Shown::new(si_unit, largest, celsius);
    let line = |row: &usize| {
        let name = format!("t = {}", unit::time_text(series.times[*row]));
        (name, values(*row).map(|x| shown.of(x)).collect())
    };
    let title = match rows {
        [row] => format!("{title}, t = {}", unit::time_text(series.times[*row])),
        _ => title,
    };
    Chart {
        title,
        horizontal_label: unit::label("distance", lengths.unit),
        horizontal: distances.iter().map(|d| d * lengths.factor).collect(),
        panels: vec![Panel {
            label: unit::label(field, &shown.unit).trim().to_owned(),
            lines: rows.iter().map(line).collect(),
            ..Panel::default()
        }],
    }
}

/// A scalar along a one-dimensional body.
pub(super) fn line_chart(
    title: String,
    cloud: &LoggedCloud,
    scalar: &Scalar,
    celsius: bool,
) -> Chart {
    let mut order: Vec<usize> = (0..cloud.positions.len()).collect();
    let x = |point: usize| cloud.positions[point][0];
    order.sort_by(|&a, &b| x(a).total_cmp(&x(b)));
    let lengths = unit::length(
        order
            .iter()
            .fold(0.0_f64, |size, &point| size.max(x(point).abs())),
    );
    let largest = scalar
        .values
        .iter()
        .fold(0.0_f64, |size, x| size.max(x.abs()));
    let shown = Shown::new(&scalar.unit, largest, celsius);
    let values = order
        .iter()
        .map(|&point| shown.of(scalar.values[point]))
        .collect();
    let label = unit::label(&scalar.label, &shown.unit);
    Chart {
        title,
        horizontal_label: unit::label("x", lengths.unit),
        horizontal: order
            .iter()
            .map(|&point| x(point) * lengths.factor)
            .collect(),
        panels: vec![Panel {
            label,
            lines: vec![(String::new(), values)],
            ..Panel::default()
        }],
    }
}

/// Length, width and depth over time; empty if no point ever melts.
pub(super) fn melt_pool_chart(
    body: &BodyInfo,
    survey: &BodySurvey,
    isotherm: Option<&Isotherm>,
    celsius: bool,
) -> Chart {
    let pools = || survey.pools.iter().filter_map(|(_, pool, _)| *pool);
    let Some(isotherm) = isotherm.filter(|_| pools().next().is_some()) else {
        return Chart::default();
    };
    let shown = Shown::new("K", isotherm.temperature, celsius);
    let lengths = unit::length(pools().fold(0.0, |size, pool| pool.length().max(size)));
    let times = unit::time(
        survey
            .pools
            .iter()
            .fold(0.0, |last, (time, ..)| time.max(last)),
    );
    let mut lines = Vec::new();
    let mut add = |name: &str, size: fn(&MeltPool) -> Option<f64>| {
        if pools().any(|pool| size(&pool).is_some()) {
            let value = |(_, pool, _): &(f64, Option<MeltPool>, [f64; 3])| {
                pool.as_ref()
                    .and_then(size)
                    .map_or(f64::NAN, |size| size * lengths.factor)
            };
            lines.push((name.to_owned(), survey.pools.iter().map(value).collect()));
        }
    };
    add("length", |pool| Some(pool.length()));
    add("width", |pool| pool.width);
    add("depth", |pool| pool.depth);
    Chart {
        title: format!(
            "Melt pool of {} ({} {} {})",
            unit::pretty_name(&body.name),
            isotherm.name_or_isotherm(),
            unit::signed_number(shown.of(isotherm.temperature), 5),
            shown.unit
        ),
        horizontal_label: unit::label("time", times.unit),
        horizontal: survey
            .pools
            .iter()
            .map(|(time, ..)| time * times.factor)
            .collect(),
        panels: vec![Panel {
            label: unit::label("size", lengths.unit),
            lines,
            ..Panel::default()
        }],
    }
}
