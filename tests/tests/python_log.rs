//! The log of a run is read by the public MCAP packages, without our code.
//!
//! `PERIMELT_PYTHON` names a Python with `mcap`, `mcap-protobuf-support` and `foxglove-schemas-protobuf`; else `python3`.
//! Without them the test is skipped, but fails where `CI` is set.

mod python;

use std::path::Path;

use perimelt::case::Case;
use perimelt::run::{Options, run};

#[test]
fn an_independent_reader_finds_what_the_log_promises() {
    let modules = "mcap.reader, mcap_protobuf.decoder, foxglove_schemas_protobuf";
    let Some(python) = python::with(modules) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder for logs");
    let out = folder.path().join("weld.mcap");
    let text = include_str!("cases/weld.toml").replace("end = 1.5", "end = 0.1");
    let case = Case::parse("weld.toml", text, Path::new("")).expect("a valid case");
    let options = Options {
        out: out.clone(),
        quiet: true,
        ..Options::default()
    };
    run(&case, &options).expect("it runs");

    let told = python::run_script(&python, "read_log.py", &[out]);
    // the start and five intervals
    assert!(told.contains("6 point clouds"), "{told}");
}
