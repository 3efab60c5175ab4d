//! Exports are read by VTK, the library behind ParaView, and case files are checked by a public validator of JSON schemas, without
//! our code.
//!
//! `PERIMELT_PYTHON` names a Python with `vtk` and `jsonschema`; else `python3`. Without them the tests are skipped, but
//! fail where `CI` is set. Rerun, 800 MB of packages, reads a log where `PERIMELT_RERUN_PYTHON` names a Python with `rerun-sdk`.

mod program;
mod python;

use std::path::Path;
use std::process::Stdio;

use program::command;

/// Runs the program in a folder and returns what it prints.
fn output(folder: &Path, arguments: &[&str]) -> String {
    let output = command(folder, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn rerun_shows_the_points_of_a_log() {
    let Ok(python) = std::env::var("PERIMELT_RERUN_PYTHON") else {
        eprintln!("skipped: PERIMELT_RERUN_PYTHON is not set");
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // without displacements
    let case = HEATED_BLOCK.replace(
        "[[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = 300\n",
        "",
    );
    std::fs::write(folder.join("block.toml"), case).expect("writable");
    output(folder, &["run", "block.toml", "--quiet"]);
    let told = python::run_script(&python, "read_rerun.py", &[folder.join("block.mcap")]);
    let expected =
        "/block/points: 2 states, 1000 points from 0.0005 0.0005 0.0005 to 0.0195 0.0095 0.0045";
    assert_eq!(told.trim(), expected);
}

const HEATED_BLOCK: &str = r#"
[bodies.block]
shape.box = { min = [0, 0, 0], max = [0.02, 0.01, 0.005] }
spacing = 0.001
material = "steel"
initial.temperature = 600

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 40
youngs_modulus = 2e11
poissons_ratio = 0.3
thermal_expansion = 1.2e-5

[[physics]]
type = "thermal"

[[physics]]
type = "mechanical"

[[couplers]]
type = "thermal_expansion"
reference_temperature = 300

[time]
end = 0.1

[log]
interval = 0.1
"#;

#[test]
fn vtk_contours_and_clips_what_is_exported() {
    let Some(python) = python::with("vtkmodules.vtkIOXML, vtkmodules.vtkFiltersGeneral") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("block.toml"), HEATED_BLOCK).expect("writable");
    output(folder, &["run", "block.toml", "--quiet"]);
    let told = output(folder, &["export", "block.mcap"]);
    assert!(
        told.contains("points are at their displaced positions"),
        "{told}"
    );
    let file = folder.join("block-export/block-00001.vtu");
    let told = python::run_script(&python, "read_export.py", &[file]);
    // cells between 20 x 10 x 5 points
    assert!(told.contains("1000 points, 684 hexahedra"), "{told}");
    assert!(
        told.contains("stress: xx xy xz yx yy yz zx zy zz"),
        "{told}"
    );
}

#[test]
fn every_case_file_is_valid_by_the_printed_schema() {
    let Some(python) = python::with("jsonschema, tomllib") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("schema.json"), output(folder, &["schema"])).expect("writable");
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cases");
    let told = python::run_script(
        &python,
        "validate_cases.py",
        &[folder.join("schema.json"), cases],
    );
    assert!(told.contains(" case files are valid"), "{told}");

    // what the program refuses, the schema does, too
    for (key, wrong) in [
        ("spacing = 0.001", "spacing = 0"),
        ("spacing = 0.001", "spacing = 0.001\ndimension = 4"),
        (
            "spacing = 0.001",
            "spacing = 0.001\nthickness = -1.0\ndimension = 2",
        ),
        ("end = 0.1", "end = 0"),
        ("end = 0.1", "end = 0.1\nsafety = 1.5"),
        ("interval = 0.1", "interval = -1.0"),
        ("interval = 0.1", "checkpoint = 0"),
        ("interval = 0.1", "interval = \"often\""),
        ("type = \"thermal\"", "type = \"thermical\""),
    ] {
        let case = HEATED_BLOCK.replace(key, wrong);
        let file = folder.join("wrong.toml");
        std::fs::write(&file, case).expect("writable");
        let checked = command(folder, &["check", "wrong.toml"])
            .status()
            .expect("it starts");
        assert!(!checked.success(), "{wrong} is accepted by the program");
        let told = python::run_script(
            &python,
            "validate_cases.py",
            &[folder.join("schema.json"), file],
        );
        assert!(
            told.contains("wrong.toml: "),
            "{wrong} is accepted by the schema: {told}"
        );
    }
}
