//! `perimelt view --live` serves the messages of a run, received by a client that is not ours.
//!
//! `cargo test -p perimelt-tests --features live --test live`. `PERIMELT_PYTHON` names a Python with `websockets` and
//! `foxglove-schemas-protobuf`; else `python3`.
#![cfg(feature = "live")]

mod program;
mod python;
mod running;

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use program::command;
use running::Running;

const BLOCK: &str = r#"
[bodies.block]
shape.box = { min = [0, 0, 0], max = [0.02, 0.01, 0.005] }
spacing = 0.0005
material = "steel"
initial.temperature = "600 + 1e4 * x"

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 40

[[physics]]
type = "thermal"

[[probes]]
name = "middle"
field = "temperature"
kind.point = [0.01, 0.005, 0.0025]

[time]
end = 0.5
step = 2e-5 # the run takes longer than a viewer to connect

[log]
interval = 0.005
"#;

/// Starts `perimelt view` with these arguments; the process and the address for viewers.
fn serve(folder: &std::path::Path, arguments: &[&str]) -> (Running, String) {
    let arguments = [&["view", "--no-open", "--live=0"], arguments].concat();
    let mut viewed = command(folder, &arguments);
    let mut viewed = Running(viewed.stdout(Stdio::piped()).spawn().expect("it starts"));
    let output = viewed.0.stdout.take().expect("piped");
    let line = BufReader::new(output).lines().map_while(Result::ok);
    let mut addresses = line.filter_map(|line| {
        let address = line.split(' ').next()?;
        address.starts_with("ws://").then(|| address.to_owned())
    });
    let address = addresses.next().expect("the program prints the address");
    (viewed, address)
}

#[test]
fn a_run_under_way_and_a_finished_log_reach_other_viewers() {
    let Some(python) = python::with("websockets.sync.client, foxglove_schemas_protobuf") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("block.toml"), BLOCK).expect("writable");
    let told = |address: &str| {
        python::run_script(&python, "read_live.py", &[address.into(), "0.5".into()])
    };
    let expected = |several: &str| {
        format!(
            "/balance: json, {several}, until 0.5 s, time 0.5 s\n\
             /block/points: protobuf, {several}, until 0.5 s, 8000 points up to x = 0.0198\n\
             /probes/middle: json, {several}, until 0.5 s, time 0.5 s\n\
             /progress: json, {several}, until 0.5 s, time 0.5 s\n\
             clock 0.5 s\n"
        )
    };

    // starts the run itself
    let (viewed, address) = serve(folder, &["block.toml"]);
    assert_eq!(told(&address), expected("several"));
    drop(viewed);
    // a viewer of a finished log gets its newest state
    let (_viewed, address) = serve(folder, &["block.mcap"]);
    assert_eq!(told(&address), expected("one"));
}
