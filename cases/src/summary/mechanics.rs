//! Distortion before parts are released, and residual stress along lines.

use perimelt_core::log::{BodyInfo, Log, LogError};

use super::{Label, ReadOff, largest};
use crate::case::of_log::case_of;
use crate::log_file::plugins_of;
use crate::log_names::REPORTS;
use crate::probe::ProbeKind;
use crate::probe::is_line;

/// Largest displacement in the last logged state before each time at which clamps are released or material is cut off.
pub(super) fn before_release(
    log: &Log,
    body: &BodyInfo,
    found: &mut Vec<ReadOff>,
) -> Result<(), LogError> {
    let times = log.times(&body.name);
    let events = [
        ("clamp", "until", "the release of clamps"),
        ("cut", "time", "the cut"),
    ];
    for (coupler, key, event) in events {
        let couplers = plugins_of(log, "couplers", coupler, &body.name);
        let mut releases: Vec<f64> = couplers.filter_map(|c| c[key].as_f64()).collect();
        releases.sort_by(f64::total_cmp);
        releases.dedup();
        // in the state at the time itself the clamp still holds
        let is_before = |time: f64, release: f64| time <= release + 1e-9 * release.abs();
        releases.retain(|release| times.last().is_some_and(|end| !is_before(*end, *release)));
        let number_of = |index: usize| match releases.len() {
            1 => String::new(),
            _ => format!(" {}", index + 1),
        };
        for (index, release) in releases.iter().enumerate() {
            let before = times.partition_point(|time| is_before(*time, *release));
            let Some(state) = before.checked_sub(1) else {
                continue;
            };
            let cloud = log.cloud(&body.name, state)?;
            let displaced = largest(body, &cloud, "displacement");
            found.extend(displaced.map(|(value, place)| {
                let number = number_of(index);
                let name = Label::new(
                    format!("displacement.before_{coupler}.{}", index + 1),
                    format!("largest displacement before {event}{number}"),
                );
                let displacement = ReadOff::new(&body.name, name, value, "m");
                displacement.at(cloud.time).within(place)
            }));
        }
    }
    Ok(())
}

/// Largest and smallest stress at the end along the lines of probes, with their positions.
pub(super) fn stress_along_lines(log: &Log, found: &mut Vec<ReadOff>) {
    let Ok(case) = case_of(log) else {
        return;
    };
    for probe in &case.probes {
        let is_of_stress = probe.field.as_deref() == Some("stress");
        if !is_of_stress || !matches!(probe.kind, ProbeKind::Line(_)) {
            continue;
        }
        let Some(series) = log.probes().get(&probe.name) else {
            continue;
        };
        let columns = &series.columns;
        let Some(end) = series.times.last().copied() else {
            continue;
        };
        if !is_line(columns.iter().map(|column| &*column.name)) {
            continue;
        }
        let values = columns.iter().filter_map(|column| {
            let value = column.values.last().filter(|value| value.is_finite())?;
            Some((*value, column.name.parse::<f64>().ok()?))
        });
        let component = probe.component.as_deref().unwrap_or_default();
        let largest = values.clone().max_by(|a, b| a.0.total_cmp(&b.0));
        let smallest = values.min_by(|a, b| a.0.total_cmp(&b.0));
        for (which, value) in [("largest", largest), ("smallest", smallest)] {
            found.extend(value.map(|(value, distance)| {
                let name = Label::new(
                    format!("stress.{component}.{which}"),
                    format!("{which} stress {component} at the end"),
                );
                let stress = ReadOff::new(&probe.name, name, value, "Pa");
                stress.at(end).along(distance)
            }));
        }
    }
}

/// Largest von Mises stress over the yield stress of elastic bodies that exceed it, of all logged states.
pub(super) fn beyond_yield(log: &Log, found: &mut Vec<ReadOff>) {
    let Some(reports) = log.probes().get(REPORTS) else {
        return;
    };
    for column in &reports.columns {
        let Some(physics) = column.name.strip_suffix(".stress.over_yield") else {
            continue;
        };
        let states = reports.times.iter().zip(&column.values);
        let largest = states.max_by(|a, b| a.1.total_cmp(b.1));
        if let Some((time, ratio)) = largest.filter(|(_, ratio)| **ratio > 1.0) {
            let name = Label::new(
                "stress.over_yield",
                "largest von Mises stress over the yield stress, without plasticity",
            );
            found.push(ReadOff::new(physics, name, *ratio, "1").at(*time));
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::summary::testing::{Field, Plate, number, positions};
    use crate::summary::{ReadOff, SummaryOptions, print, read_off};
    use serde_json::{Value, json};

    /// States of a plate whose largest displacement is 10, 11, 12, 13 and 14 mm, one point farther in each.
    fn displaced() -> Vec<Vec<Field>> {
        let state = |index: usize| {
            let mut displacement = vec![0.0; 3 * positions().len()];
            displacement[3 * index + 1] = -1e-3 * (10 + index) as f64;
            let stress = vec![0.0; 9 * positions().len()];
            vec![
                ("displacement", "m", 3, displacement),
                ("stress", "Pa", 9, stress),
            ]
        };
        (0..5).map(state).collect()
    }

    fn found(plate: Plate<'_>) -> Vec<ReadOff> {
        let folder = tempfile::tempdir().expect("a folder");
        let log = plate.log(&folder.path().join("plate.mcap"));
        read_off(&log, &SummaryOptions::default()).expect("readable")
    }

    #[test]
    fn the_displacement_before_a_release_is_that_of_the_last_state_that_is_held() {
        let held = |couplers: Value| {
            let plate = Plate {
                states: displaced(),
                plugins: json!({ "couplers": couplers }),
                ..Plate::default()
            };
            let found = found(plate);
            let before = found.iter().filter(|r| r.quantity.contains("before"));
            let before = before.map(|r| {
                assert_eq!(r.of, "plate");
                let time = r.time.expect("a time");
                assert!((r.value - 1e-3 * (10.0 + time)).abs() < 1e-12, "{r:?}");
                let name = r.quantity.strip_prefix("largest displacement before ");
                (name.expect("a displacement").to_string(), time)
            });
            before.collect::<Vec<_>>()
        };
        let clamp = |until: Value| json!({ "type": "clamp", "region": "edge", "until": until });
        let release = |number: &str| format!("the release of clamps{number}");
        // a clamp holds in the step that ends at its release
        assert_eq!(held(json!([clamp(json!(2.0))])), [(release(""), 2.0)]);
        let two = json!([clamp(json!(2.5)), clamp(json!(1.9)), clamp(json!(2.5))]);
        assert_eq!(held(two), [(release(" 1"), 1.0), (release(" 2"), 2.0)]);
        let cut = json!([{ "type": "cut", "body": "plate", "region": "base", "time": 3.0 }]);
        assert_eq!(held(cut), [("the cut".into(), 3.0)]);
        // never, only after the end, of another body
        let other = json!({ "type": "clamp", "body": "other", "until": 1.0 });
        assert_eq!(
            held(json!([clamp(json!(null)), clamp(json!(4.0)), other])),
            []
        );
    }

    #[test]
    fn stress_along_a_line_has_its_largest_and_smallest_value_with_their_distances() {
        let row = |values: [f64; 4]| {
            let distances = [0.0, 1e-3, 2e-3, 3e-3].into_iter().zip(values);
            let columns = distances.map(|(at, value)| (format!("{at:.6e}"), "Pa", value));
            columns.collect::<Vec<_>>()
        };
        let mut rows = vec![row([9e8, 0.0, -9e8, 0.0]); 5];
        rows[4] = row([1e7, 2.5e8, f64::NAN, -1.5e8]);
        let plate = Plate {
            states: displaced(),
            probes: r#"
[[probes]]
name = "across"
field = "stress"
component = "xx"
kind.line = { from = [1e-3, 1e-3, -1e-3], to = [1e-3, 4e-3, -1e-3], number = 4 }
"#,
            series: Some(("across", rows)),
            ..Plate::default()
        };
        let found = found(plate);
        for (which, value, distance) in [("largest", 2.5e8, 1e-3), ("smallest", -1.5e8, 3e-3)] {
            let stress = number(&found, &format!("{which} stress xx at the end"));
            assert_eq!((&*stress.of, stress.value), ("across", value));
            assert_eq!((stress.time, stress.distance), (Some(4.0), Some(distance)));
        }
        let mut text = Vec::new();
        print(&found, &mut text).expect("it writes to memory");
        let text = String::from_utf8(text).expect("text");
        assert!(
            text.contains("250 MPa at 4 s, 1 mm from the start of the line"),
            "{text}"
        );
    }
}
