//! Numbers that the physics `thermal_history` recorded, over the points that have them.

use perimelt_core::log::Log;

use super::{BodyRecord, Label, OUTSIDE, ReadOff, largest, median};
use crate::log_file::plugins_of;
use crate::quantity::scalar::scalar;
use crate::unit;

/// Reads off times and solidification.
pub(super) fn history(record: &BodyRecord<'_>, found: &mut Vec<ReadOff>) {
    let &BodyRecord {
        log, body, last, ..
    } = record;
    let above = name_of_time_above(log, &body.name);
    for (field, quantity) in [
        ("time_above", &*above),
        (
            "cooling_time",
            "cooling time (t8/5 unless the case says otherwise)",
        ),
        ("cooling_rate", "cooling rate at solidification"),
        ("thermal_gradient", "gradient G at solidification"),
        ("solidification_speed", "front speed R at solidification"),
    ] {
        let Some(scalar) = scalar(last, field) else {
            continue;
        };
        let happened = scalar.values.into_iter().filter(|v| *v > 0.0);
        let happened: Vec<f64> = happened.collect();
        if happened.is_empty() {
            continue;
        }
        let unit = &scalar.unit;
        if field == "time_above"
            && let Some((value, place)) = largest(body, last, field)
        {
            let name = Label::new(format!("{field}.largest"), format!("largest {quantity}"));
            let longest = ReadOff::new(&body.name, name, value, unit);
            found.push(longest.within(place));
        }
        let name = Label::new(field, quantity);
        found.push(median(&body.name, name, happened, unit, OUTSIDE));
    }
}

/// `time above the solidus`, or above the temperature that the case gives.
fn name_of_time_above(log: &Log, body: &str) -> String {
    let mut history = plugins_of(log, "physics", "thermal_history", body);
    match history.find_map(|physics| physics["above"].as_f64()) {
        Some(temperature) => format!("time above {} K", unit::number(temperature, 6)),
        None => "time above the solidus".into(),
    }
}

#[cfg(test)]
mod tests {
    use crate::summary::testing::{Plate, number, positions};
    use crate::summary::{SummaryOptions, read_off};
    use serde_json::json;

    #[test]
    fn times_above_a_temperature_are_those_of_the_points_that_reached_it() {
        let folder = tempfile::tempdir().expect("a folder");
        // 101 points with 0.01 s, 0.02 s, ... and the others with none
        let times =
            (0..positions().len()).map(|p| if p <= 100 { 0.01 * (p + 1) as f64 } else { 0.0 });
        let times: Vec<f64> = times.collect();
        for (above, name) in [
            (json!(1200.0), "time above 1200 K"),
            (json!(null), "time above the solidus"),
        ] {
            let plate = Plate {
                states: vec![vec![("time_above", "s", 1, times.clone())]],
                plugins: json!({ "physics": [{ "type": "thermal_history", "above": above }] }),
                ..Plate::default()
            };
            let path = folder.path().join("plate.mcap");
            let _ = std::fs::remove_file(&path);
            let log = plate.log(&path);
            let found = read_off(&log, &SummaryOptions::default()).expect("readable");
            let median = number(&found, name);
            assert_eq!((median.value, &*median.unit), (times[50], "s"));
            assert_eq!(median.range, Some([times[10], times[90]]));
            let longest = number(&found, &format!("largest {name}"));
            assert_eq!(
                (longest.value, longest.place),
                (times[100], Some(positions()[100]))
            );
        }
    }
}
