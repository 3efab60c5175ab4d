//! The log of a run is read by the public MCAP packages, without our code.
//!
//! `PERIMELT_PYTHON` names a Python with `mcap`, `mcap-protobuf-support` and
//! `foxglove-schemas-protobuf`; else `python3`. Without them the test is skipped, but fails
//! where `CI` is set.

use std::path::Path;
use std::process::Command;

use perimelt::case::Case;
use perimelt::run::{Options, run};

#[test]
fn an_independent_reader_finds_what_the_log_promises() {
    let python = std::env::var("PERIMELT_PYTHON").unwrap_or_else(|_| "python3".into());
    let modules = "import mcap.reader, mcap_protobuf.decoder, foxglove_schemas_protobuf";
    let probe = Command::new(&python).args(["-c", modules]).output();
    if !probe.as_ref().is_ok_and(|o| o.status.success()) {
        let why = match probe {
            Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
            Err(error) => error.to_string(),
        };
        assert!(
            std::env::var_os("CI").is_none(),
            "`{python}` cannot read MCAP: {why}"
        );
        eprintln!("skipped: `{python}` cannot read MCAP: {why}");
        return;
    }
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

    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/python/read_log.py");
    let output = Command::new(&python)
        .arg(script)
        .arg(&out)
        .output()
        .expect("it started before");
    let (told, errors) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(output.status.success(), "{told}{errors}");
    // the start and five intervals
    assert!(told.contains("6 point clouds"), "{told}");
}
