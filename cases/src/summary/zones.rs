//! Fusion zone and heat-affected zone, from the highest temperatures that `thermal_history` recorded.

use perimelt_core::log::{BodyInfo, Log, LogError};

use super::{BodyRecord, Label, ReadOff, SummaryOptions};
use crate::melt_pool::{Aim, Root, Zone};
use crate::quantity::isotherm::ac1;
use crate::quantity::scalar::scalar;
use crate::quantity::survey::Reference;

/// Reads off both zones. The isotherm (K) is that of the fusion zone.
pub(super) fn zones(
    record: &BodyRecord<'_>,
    isotherm: Option<f64>,
    options: &SummaryOptions,
    found: &mut Vec<ReadOff>,
) -> Result<(), LogError> {
    let &BodyRecord {
        log,
        sources,
        body,
        last,
    } = record;
    let Some(highest) = scalar(last, "peak_temperature") else {
        return Ok(());
    };
    let reference = Reference::new(log, body)?;
    let path = sources.path();
    let aim = Aim {
        sources: if path.is_empty() {
            sources.at(last.time)
        } else {
            &path
        },
        ..Aim::fixed(options.travel)
    };
    let measured = |level: f64| {
        let gauge = reference.gauge(body, last, level)?;
        gauge.zone(&highest.values, aim)
    };
    let fusion = isotherm.and_then(measured);
    if let Some(zone) = &fusion {
        let name = Label::new("fusion_zone", "fusion zone");
        extents(zone, body, &name, found);
        penetration(zone, body, found);
    }
    let Some((temperature, name)) = border(log, body, options.haz) else {
        return Ok(());
    };
    let heat_affected = Label::new(
        "heat_affected_zone",
        "heat-affected zone, fusion zone included",
    );
    // a border above the isotherm bounds no zone around the fusion zone
    if isotherm.is_some_and(|isotherm| temperature >= isotherm) {
        let reason = "its border is not below that of the fusion zone";
        found.push(ReadOff::left_out(&body.name, heat_affected, "m", reason));
        return Ok(());
    }
    let Some(zone) = measured(temperature) else {
        return Ok(());
    };
    let border = Label::new(
        "heat_affected_zone.border",
        format!("border of the heat-affected zone{name}"),
    );
    found.push(ReadOff::new(&body.name, border, temperature, "K"));
    extents(&zone, body, &heat_affected, found);
    let beside = fusion.as_ref().and_then(|inner| zone.width_beside(inner));
    found.extend(beside.map(|width| {
        let name = Label::new(
            "heat_affected_zone.width_beside",
            "width of the heat-affected zone beside the fusion zone",
        );
        ReadOff::new(&body.name, name, width, "m")
    }));
    Ok(())
}

/// Length, width, depth and area of a zone.
fn extents(zone: &Zone, body: &BodyInfo, label: &Label, found: &mut Vec<ReadOff>) {
    let Label { id, name } = label;
    let is_flat = body.dimension < 3;
    let path = "the path turns, which leaves no single direction of travel";
    let sections = "no section follows one direction of the path alone";
    for (part, size, value, unit, reason) in [
        ("length", "length", zone.length, "m", path),
        ("width", "width", zone.width(), "m", sections),
        ("depth", "depth", zone.depth(), "m", ""),
        (
            "area",
            "area of the cross-section",
            zone.area(),
            "m2",
            sections,
        ),
    ] {
        let name = Label::new(format!("{id}.{part}"), format!("{size} of the {name}"));
        match value {
            Some(value) => found.push(ReadOff::new(&body.name, name, value, unit)),
            // a body of fewer dimensions does not have all sizes
            None if zone.turns && !reason.is_empty() && !(is_flat && unit == "m2") => {
                found.push(ReadOff::left_out(&body.name, name, unit, reason));
            }
            None => {}
        }
    }
}

/// Penetration of the fusion zone, and the root where it is complete.
fn penetration(zone: &Zone, body: &BodyInfo, found: &mut Vec<ReadOff>) {
    let mut add = |name: Label, value: f64, unit: &str| {
        found.push(ReadOff::new(&body.name, name, value, unit));
    };
    if let Some(penetration) = zone.penetration.filter(|p| p.fraction.is_finite()) {
        let name = Label::new(
            "fusion_zone.penetration",
            "largest depth of the fusion zone over the thickness of the metal there",
        );
        add(name, penetration.fraction, "1");
    }
    if let Some(Root { width, fraction }) = zone.root {
        let name = Label::new(
            "root.length_fraction",
            "full penetration, fraction of the length of the fusion zone",
        );
        add(name, fraction, "1");
        let name = Label::new("root.width", "largest width of the root");
        add(name, width, "m");
    }
}

/// Temperature (K) that bounds the heat-affected zone, and its name in brackets: the requested one, or `Ac1` of the physics
/// `metallurgy` or of the composition of the first steel of the body.
fn border(log: &Log, body: &BodyInfo, asked: Option<f64>) -> Option<(f64, &'static str)> {
    if let Some(temperature) = asked {
        return Some((temperature, ""));
    }
    Some((ac1(log, &body.name)?, " (Ac1)"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log_names::REPORTS;
    use crate::summary::testing::{Field, Plate, SPACING, number, positions};
    use crate::summary::{print, read_off};
    use perimelt_core::Face;
    use serde_json::json;
    use std::f64::consts::PI;

    /// Half axes of the fusion zone in its section, m.
    const HALF: [f64; 2] = [8.2 * SPACING, 5.3 * SPACING];

    /// 1500 K on half an ellipse with the half axes, 1000 K on one that is the square root of two larger.
    fn highest() -> Vec<Field> {
        let temperature =
            |p: [f64; 3]| 2000.0 - 500.0 * ((p[1] / HALF[0]).powi(2) + (p[2] / HALF[1]).powi(2));
        let values = positions().into_iter().map(temperature).collect();
        vec![("peak_temperature", "K", 1, values)]
    }

    fn plate() -> Plate<'static> {
        Plate {
            states: vec![highest()],
            symmetry: vec![Face::YMin],
            ..Plate::default()
        }
    }

    fn asked(haz: Option<f64>) -> SummaryOptions {
        SummaryOptions {
            haz,
            ..SummaryOptions::default()
        }
    }

    #[test]
    fn both_zones_of_a_seam_are_as_large_as_their_ellipses() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = plate().log(&folder.path().join("plate.mcap"));
        let found = read_off(&log, &asked(Some(1000.0))).expect("readable");
        let [b, c] = HALF;
        let root = 2.0_f64.sqrt();
        let included = "heat-affected zone, fusion zone included";
        for (quantity, expected) in [
            ("length of the fusion zone", 24.0 * SPACING),
            ("width of the fusion zone", 2.0 * b),
            ("depth of the fusion zone", c),
            (
                "area of the cross-section of the fusion zone",
                0.5 * PI * b * c,
            ),
            (&*format!("length of the {included}"), 24.0 * SPACING),
            (&*format!("width of the {included}"), 2.0 * root * b),
            (&*format!("depth of the {included}"), root * c),
            (
                &*format!("area of the cross-section of the {included}"),
                PI * b * c,
            ),
            (
                "width of the heat-affected zone beside the fusion zone",
                (root - 1.0) * b,
            ),
        ] {
            let ratio = number(&found, quantity).value / expected;
            // linear between the centres of cells, five and more cells in each half axis
            assert!(
                (ratio - 1.0).abs() < 0.01,
                "{quantity}: {ratio} times {expected}"
            );
        }
    }

    #[test]
    fn the_border_is_the_temperature_asked_for_or_that_of_the_physics_or_of_the_steel() {
        let folder = tempfile::tempdir().expect("a folder");
        let with = |plugins: serde_json::Value, haz: Option<f64>| {
            let path = folder.path().join("plate.mcap");
            let _ = std::fs::remove_file(&path);
            let log = Plate { plugins, ..plate() }.log(&path);
            let found = read_off(&log, &asked(haz)).expect("readable");
            let border = found.iter().find(|r| r.quantity.starts_with("border"));
            border.map(|r| (r.quantity.clone(), r.value))
        };
        let border = "border of the heat-affected zone";
        let physics = |body: serde_json::Value| {
            json!({ "physics": [
                { "type": "metallurgy", "body": body, "austenite": { "start": 1010.0, "end": 1100.0 } },
            ] })
        };
        let ac1 = || format!("{border} (Ac1)");
        assert_eq!(
            with(physics(json!(null)), Some(990.0)),
            Some((border.into(), 990.0))
        );
        assert_eq!(with(physics(json!(null)), None), Some((ac1(), 1010.0)));
        assert_eq!(with(physics(json!("plate")), None), Some((ac1(), 1010.0)));
        // Andrews (1965): 723 + 29.1 Si in degrees Celsius
        let of_steel = with(physics(json!("other")), None).expect("a steel");
        assert_eq!(of_steel.0, ac1());
        assert!(
            (of_steel.1 - (723.0 + 29.1 * 0.5 + 273.15)).abs() < 1e-9,
            "{of_steel:?}"
        );
        assert_eq!(with(json!(null), Some(1600.0)), None);
    }

    #[test]
    fn a_path_that_turns_leaves_out_what_has_no_single_direction() {
        let folder = tempfile::tempdir().expect("a folder");
        let row = |travel: [f64; 3]| {
            let vectors = [
                ("position", [3e-3, 0.0, 0.0]),
                ("travel", travel),
                ("beam", [0.0, 0.0, -1.0]),
            ];
            let components = vectors.into_iter().flat_map(|(name, vector)| {
                let axes = ["x", "y", "z"].into_iter().zip(vector);
                axes.map(move |(axis, x)| (format!("torch.{name}.{axis}"), "1", x))
            });
            let numbers = [
                ("torch.on".into(), "1", 1.0),
                ("torch.path".into(), "m", 0.0),
            ];
            components.chain(numbers).collect::<Vec<_>>()
        };
        let rows = vec![row([1.0, 0.0, 0.0]), row([0.0, 1.0, 0.0])];
        let turning = Plate {
            states: vec![highest(), highest()],
            series: Some((REPORTS, rows)),
            ..plate()
        };
        let log = turning.log(&folder.path().join("plate.mcap"));
        let found = read_off(&log, &asked(None)).expect("readable");
        for size in ["length", "width", "area of the cross-section"] {
            let number = number(&found, &format!("{size} of the fusion zone"));
            assert!(
                number.value.is_nan() && number.left_out.is_some(),
                "{number:?}"
            );
        }
        assert!(number(&found, "depth of the fusion zone").value > 0.0);
        let mut text = Vec::new();
        print(&found, &mut text).expect("it writes to memory");
        let text = String::from_utf8(text).expect("text");
        assert!(text.contains("  left out: the path turns"), "{text}");
    }
}
