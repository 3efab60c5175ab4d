//! Comparison of time series: probes and balances.

use perimelt_core::log::{Column, Series};

use crate::log_names::RELATIVE_ERROR;

use super::{LogComparison, common_times, entry, note_times, size};

/// Columns that are compared together.
struct ColumnGroup<'a> {
    name: String,
    unit: &'a str,
    columns: Vec<[&'a Column; 2]>,
    /// reference of relative differences
    scale: f64,
}

/// Compares a time series `of` that both logs have.
pub(super) fn compare_series(of: &str, series: [&Series; 2], comparison: &mut LogComparison) {
    let [first, second] = series;
    let common = common_times(&first.times, &second.times);
    note_times(comparison, of, &first.times, &second.times, common.len());
    for (log, [own, other]) in [("first", [first, second]), ("second", [second, first])] {
        let names: Vec<&str> = own
            .columns
            .iter()
            .filter(|column| other.columns.iter().all(|c| c.name != column.name))
            .map(|column| column.name.as_str())
            .collect();
        if !names.is_empty() {
            let names = names.join(", ");
            comparison
                .unmatched
                .push(format!("{of}: only the {log} log has {names}"));
        }
    }
    let mut compared = Vec::new();
    for group in groups(of, series) {
        for &[i, j] in &common {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            for [first, second] in &group.columns {
                a.push(first.values[i]);
                b.push(second.values[j]);
            }
            let entry = entry(&mut compared, of, &group.name, group.unit);
            entry.add(first.times[i], [&a, &b], group.scale);
        }
    }
    comparison.compared.extend(compared);
}

/// The columns that both have: those of a line together, others one by one.
fn groups<'a>(of: &str, [first, second]: [&'a Series; 2]) -> Vec<ColumnGroup<'a>> {
    let shared: Vec<[&Column; 2]> = first
        .columns
        .iter()
        .filter_map(|column| {
            let other = second.columns.iter().find(|c| c.name == column.name)?;
            Some([column, other])
        })
        .collect();
    let scale_of = |columns: &[[&Column; 2]]| {
        let sizes = columns.iter().map(|[a, b]| size([&a.values, &b.values]));
        sizes.fold(0.0, f64::max)
    };
    if crate::probe::is_line(shared.iter().map(|[column, _]| column.name.as_str())) {
        let scale = scale_of(&shared);
        return vec![ColumnGroup {
            name: format!("along {} positions", shared.len()),
            unit: &shared[0][0].unit,
            columns: shared,
            scale,
        }];
    }
    let quantity = |column: &Column| -> Option<String> {
        let (quantity, _) = column.name.rsplit_once('.')?;
        (of == "balance" && !column.name.ends_with(RELATIVE_ERROR)).then(|| quantity.to_owned())
    };
    let group = |pair: &[&'a Column; 2]| {
        let own = quantity(pair[0]);
        let alike: Vec<_> = shared
            .iter()
            .filter(|other| own.is_some() && quantity(other[0]) == own)
            .copied()
            .collect();
        let is_relative = of == "balance" && pair[0].name.ends_with(RELATIVE_ERROR);
        let scale = if is_relative {
            1.0
        } else {
            scale_of(&alike).max(scale_of(&[*pair]))
        };
        ColumnGroup {
            name: pair[0].name.clone(),
            unit: &pair[0].unit,
            columns: vec![*pair],
            scale,
        }
    };
    shared.iter().map(group).collect()
}
