//! The charts of a run.

use perimelt_core::log::{BodyInfo, LoggedCloud, Series};

use super::{
    curves::{Chart, Panel},
    isotherm::Isotherm,
    scalar::Scalar,
    survey::Survey,
    unit,
};
use crate::melt_pool::MeltPool;

/// Errors of the balances over time: the columns with `error` in their names.
pub(super) fn balance_chart(balance: &Series) -> Chart {
    let errors = balance
        .columns
        .iter()
        .filter(|column| column.name.contains("error"));
    let errors = Series {
        times: balance.times.clone(),
        columns: errors.cloned().collect(),
    };
    Chart::of_series("Balance errors", &errors, true)
}

/// A scalar along a one-dimensional body.
pub(super) fn line_chart(title: String, cloud: &LoggedCloud, scalar: &Scalar) -> Chart {
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
    let (factor, shown_unit) = unit::value(&scalar.unit, largest);
    let values = order
        .iter()
        .map(|&point| scalar.values[point] * factor)
        .collect();
    let label = unit::label(&scalar.label, &shown_unit);
    Chart {
        title,
        horizontal_label: unit::label("x", lengths.unit),
        horizontal: order
            .iter()
            .map(|&point| x(point) * lengths.factor)
            .collect(),
        panels: vec![Panel {
            label,
            logarithmic: false,
            lines: vec![(String::new(), values)],
        }],
    }
}

/// Length, width and depth over time; empty if no point ever melts.
pub(super) fn melt_pool_chart(
    body: &BodyInfo,
    survey: &Survey,
    isotherm: Option<&Isotherm>,
) -> Chart {
    let pools = || survey.pools.iter().filter_map(|(_, pool)| *pool);
    let Some(isotherm) = isotherm.filter(|_| pools().next().is_some()) else {
        return Chart::default();
    };
    let lengths = unit::length(pools().fold(0.0, |size, pool| pool.length().max(size)));
    let times = unit::time(
        survey
            .pools
            .iter()
            .fold(0.0, |last, (time, _)| time.max(last)),
    );
    let mut lines = Vec::new();
    let mut add = |name: &str, size: fn(&MeltPool) -> Option<f64>| {
        if pools().any(|pool| size(&pool).is_some()) {
            let value = |(_, pool): &(f64, Option<MeltPool>)| {
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
            "Melt pool of {} ({} {} K)",
            unit::pretty_name(&body.name),
            isotherm.name,
            unit::number(isotherm.temperature, 5)
        ),
        horizontal_label: unit::label("time", times.unit),
        horizontal: survey
            .pools
            .iter()
            .map(|(time, _)| time * times.factor)
            .collect(),
        panels: vec![Panel {
            label: unit::label("size", lengths.unit),
            logarithmic: false,
            lines,
        }],
    }
}
