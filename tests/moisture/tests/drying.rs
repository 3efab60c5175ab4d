//! Plugins of a stranger are listed, run from a case file, logged and resumed like our own.

use std::path::Path;
use std::process::{Command, Output};

use perimelt_core::log::Log;

/// Runs the binary of this crate in `folder`.
fn moisture(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_moisture"));
    let output = command.current_dir(folder).args(arguments).output();
    let output = output.expect("the binary starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    output
}

fn last_checkpoint(log: &Log) -> Vec<u8> {
    let last = log.last_checkpoint().expect("it has a checkpoint");
    log.checkpoint(last).expect("it reads")
}

/// Heights (m) along the strip at the start, after the first interval, and at the end.
fn bow(log: &Log) -> Vec<f64> {
    let series = &log.probes()["along the strip"];
    let at = |column: usize, row: usize| series.columns[column].values[row];
    let (middle, end) = (series.columns.len() / 2, series.columns.len() - 1);
    let rows = 0..series.times.len();
    rows.map(|row| at(middle, row) - 0.5 * (at(0, row) + at(end, row)))
        .collect()
}

#[test]
fn plugins_of_a_stranger_are_listed_and_explained() {
    let here = Path::new(".");
    let list = String::from_utf8(moisture(here, &["list"]).stdout).expect("text");
    for name in ["moisture_diffusion", "swelling", "moisture_diffusivity"] {
        assert!(list.contains(name), "`{name}` is in\n{list}");
    }
    let help = String::from_utf8(moisture(here, &["explain", "swelling"]).stdout).expect("text");
    assert!(help.contains("Strain for each kg/m³ of moisture"), "{help}");
}

#[test]
fn a_wetted_strip_keeps_its_moisture_and_straightens() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let case = concat!(env!("CARGO_MANIFEST_DIR"), "/drying.toml");
    let run = |arguments: &[&str]| moisture(folder.path(), arguments);
    run(&["run", case, "--quiet", "--out", "whole.mcap"]);
    let whole = Log::open(folder.path().join("whole.mcap")).expect("the log opens");

    let [stored, supplied, error] = ["stored", "supplied", "error"].map(|part| {
        let columns = &whole.balance().columns;
        let column = columns
            .iter()
            .find(|c| c.name.contains("moisture") && c.name.contains(part));
        let names: Vec<_> = columns.iter().map(|c| &c.name).collect();
        column
            .unwrap_or_else(|| panic!("`{part}` of moisture is in {names:?}"))
            .values
            .clone()
    });
    // half of 0.1 m x 0.01 m x 0.02 m with 50 kg/m³, half with 110 kg/m³
    assert!((stored[0] - 2e-5 * 80.0).abs() < 1e-15, "{} kg", stored[0]);
    // pairs cancel to rounding
    assert!(supplied.iter().all(|s| *s == 0.0));
    assert!(
        error.iter().all(|e| e.abs() < 1e-10 * stored[0]),
        "{error:?}"
    );

    // the wet side below is longer: the middle lies lower than the ends, less and less so
    let bow = bow(&whole);
    println!("bow, m: {bow:?}");
    assert!(bow[1] < -1e-5, "{bow:?}");
    assert!(bow[1..].windows(2).all(|b| b[0] < b[1]), "{bow:?}");

    run(&[
        "run",
        case,
        "--quiet",
        "--until",
        "43200",
        "--out",
        "part.mcap",
    ]);
    run(&["resume", "part.mcap", "--quiet"]);
    let resumed = Log::open(folder.path().join("part.mcap")).expect("the log opens");
    assert!(
        last_checkpoint(&resumed) == last_checkpoint(&whole),
        "the resumed run ends elsewhere"
    );
    assert_eq!(resumed.balance(), whole.balance());
}
