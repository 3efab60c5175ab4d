//! A shape of a heat source of another crate is a coupler with a toolpath, pulses and exact power.

use std::path::Path;
use std::process::Command;

use perimelt_core::log::Log;

const CASE: &str = r#"
[case]
title = "A ring on a plate"

[bodies.plate]
shape.box = { min = [0, 0, -0.002], max = [0.02, 0.01, 0] }
spacing = 5e-4
material = "steel"
initial.temperature = 300

[materials.steel]
density = 7800
specific_heat = 600
conductivity = 30

[[physics]]
type = "thermal"
horizon = 2

[[couplers]]
type = "ring_source"
name = "laser"
voltage = 20
current = 10
radius = 1e-3
half_width = 5e-4
depth = 1e-3
pulse = { frequency = 20, duty = 0.5 }
toolpath.line = { start = [0.005, 0.005, 0], end = [0.015, 0.005, 0], speed = 0.01 }

[time]
end = 1

[log]
interval = 1
"#;

fn run(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_moisture"));
    let output = command.current_dir(folder).args(arguments).output();
    let output = output.expect("the binary starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.success(),
        text(&output.stdout) + &text(&output.stderr),
    )
}

#[test]
fn a_ring_heats_with_its_power_in_pulses() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("ring.toml"), CASE).expect("written");
    let (is_done, told) = run(folder.path(), &["run", "ring.toml", "--threads", "1"]);
    assert!(is_done, "{told}");
    let log = Log::open(folder.path().join("ring.mcap")).expect("the log opens");
    let reports = &log.probes()["reports"].columns;
    let named = |name: &str| reports.iter().find(|c| c.name.ends_with(name));
    let energy = named("energy.deposited").expect("reported").values.last();
    // 200 W for half of 1 s; sums of a thousand steps
    let energy = *energy.expect("a value");
    assert!((energy - 100.0).abs() < 1e-9, "{energy} J");
}

#[test]
fn its_keys_are_explained_and_mistakes_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, help) = run(folder.path(), &["explain", "ring_source"]);
    for told in ["Half width of the ring", "voltage", "pulse"] {
        assert!(help.contains(told), "{help}");
    }
    let wrong = CASE.replace("half_width", "half_widht");
    std::fs::write(folder.path().join("ring.toml"), wrong).expect("written");
    let (is_done, told) = run(folder.path(), &["check", "ring.toml"]);
    assert!(!is_done && told.contains("half_widht"), "{told}");
}
