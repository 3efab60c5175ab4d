use std::path::Path;

use perimelt_core::log::{
    BodyInfo, CloudView, Coordinates, Entry, FieldInfo, FieldView, Precision, RunInfo, Writer,
};

use super::*;

/// A log of a bar of four points whose temperature and balance are shifted by `shift` at the end.
fn write(path: &Path, name: &str, times: &[f64], points: usize, shift: f64) {
    let run = RunInfo {
        bodies: vec![BodyInfo {
            name: name.into(),
            dimension: 1,
            spacing: 1.0,
            points,
            fields: vec![FieldInfo {
                name: "temperature".into(),
                unit: "K".into(),
                components: 1,
            }],
            ..BodyInfo::default()
        }],
        ..RunInfo::default()
    };
    let mut writer = Writer::create(path, &run, "bar.toml", "").expect("a new file");
    let positions: Vec<[f64; 3]> = (0..points).map(|i| [i as f64, 0.0, 0.0]).collect();
    for &time in times {
        let shift = if time == times[times.len() - 1] {
            shift
        } else {
            0.0
        };
        let mut values = vec![400.0; points];
        values[0] += shift;
        let fields = [FieldView {
            name: "temperature",
            components: 1,
            values: &values,
        }];
        let cloud = CloudView {
            time,
            positions: Coordinates::Listed(&positions),
            fields: &fields,
        };
        writer
            .points(name, Precision::F64, &cloud)
            .expect("written");
        let line = [
            Entry::new("0e0", "K", 0.0),
            Entry::new("1e0", "K", 500.0 + shift),
        ];
        writer.probe("across", time, &line).expect("written");
        let balance = [
            Entry::new("heat.energy.stored", "J", 1000.0),
            Entry::new("heat.energy.error", "J", 1e-13 * shift),
        ];
        writer.balance(time, &balance).expect("written");
    }
    writer.finish().expect("written");
}

fn args(folder: &Path) -> DiffArgs {
    DiffArgs {
        first: folder.join("a.mcap"),
        second: folder.join("b.mcap"),
        tolerance: 0.0,
        body: Vec::new(),
        field: Vec::new(),
        times: false,
    }
}

fn text(comparison: &LogComparison, args: &DiffArgs) -> String {
    let mut out = Vec::new();
    print(comparison, args, &mut out).expect("memory");
    String::from_utf8(out).expect("text")
}

#[test]
fn norms_are_those_of_the_difference() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = args(folder.path());
    write(&args.first, "bar", &[0.0, 1.0, 2.0], 4, 0.0);
    write(&args.second, "bar", &[0.0, 1.0, 2.0], 4, 2.0);
    let comparison = diff(&args).expect("comparable");
    let of = |name: &str| {
        comparison
            .compared
            .iter()
            .find(|c| c.name == name)
            .expect("compared")
    };
    let worst = of("temperature").worst().expect("times");
    assert_eq!((worst.time, worst.largest, worst.rms), (2.0, 2.0, 1.0));
    // relative to the largest value in both logs, 402 K
    assert_eq!(of("temperature").worst_relative(), 2.0 / 402.0);
    assert_eq!(of("position").worst_relative(), 0.0);
    // the zero at the start of the line is compared by the size of the line
    assert_eq!(of("along 2 positions").worst_relative(), 2.0 / 502.0);
    // an error of rounding size by the heat that is balanced
    assert_eq!(of("heat.energy.error").worst_relative(), 2e-13 / 1000.0);
    assert!(comparison.unmatched.is_empty());
    assert!(!comparison.is_equal(0.0) && comparison.is_equal(0.01));
    let table = text(&comparison, &args);
    assert!(table.contains("different: 3 of 5 quantities"), "{table}");
}

#[test]
fn a_log_equals_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut args = args(folder.path());
    write(&args.first, "bar", &[0.0, 1.0], 4, f64::NAN);
    args.second = args.first.clone();
    let comparison = diff(&args).expect("comparable");
    assert!(comparison.is_equal(0.0));
    assert!(text(&comparison, &args).ends_with("equal: 5 quantities\n"));
}

#[test]
fn what_only_one_log_has_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = args(folder.path());
    write(&args.first, "bar", &[0.0, 1.0, 2.0], 4, 0.0);
    write(&args.second, "bar", &[0.0, 2.0], 5, 0.0);
    let comparison = diff(&args).expect("comparable");
    let told = comparison.unmatched.join("\n");
    assert!(
        told.contains("balance: 2 times are in both logs, 1 only in the first"),
        "{told}"
    );
    assert!(told.contains("first at 0 s with 4 and 5 points"), "{told}");
    assert!(!comparison.is_equal(1.0));
}

#[test]
fn logs_without_anything_in_common_are_errors_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = args(folder.path());
    write(&args.first, "bar", &[0.0, 1.0], 4, 0.0);
    write(&args.second, "rod", &[0.0, 1.0], 4, 0.0);
    let error = diff(&args).expect_err("other bodies").to_string();
    assert!(error.contains("no body in common") && error.contains("bar") && error.contains("rod"));
    write(&args.second, "bar", &[0.5, 1.5], 4, 0.0);
    let error = diff(&args).expect_err("other times").to_string();
    assert!(
        error.contains("no time in common") && error.contains("2 times from 0.5 to 1.5 s"),
        "{error}"
    );
    let mut wrong = args.clone();
    wrong.tolerance = f64::NAN;
    assert!(diff(&wrong).is_err());
    write(&args.second, "bar", &[0.0, 1.0], 4, 0.0);
    let mut wrong = args;
    wrong.field = vec!["temprature".into()];
    let error = diff(&wrong).expect_err("misspelt").to_string();
    assert!(
        error.contains("`temprature`; they have: position, temperature"),
        "{error}"
    );
}
