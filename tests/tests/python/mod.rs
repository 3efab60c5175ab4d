//! Scripts that read what the program writes, without our code.
//!
//! `PERIMELT_PYTHON` names a Python with the packages that they need; else `python3`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python that can import these modules, if there is one.
pub fn with(modules: &str) -> Option<String> {
    let python = std::env::var("PERIMELT_PYTHON").unwrap_or_else(|_| "python3".into());
    let probe = Command::new(&python)
        .args(["-c", &format!("import {modules}")])
        .output();
    if probe.as_ref().is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    let why = match probe {
        Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
        Err(error) => error.to_string(),
    };
    assert!(
        std::env::var_os("CI").is_none(),
        "`{python}` cannot import {modules}: {why}"
    );
    eprintln!("skipped: `{python}` cannot import {modules}: {why}");
    None
}

/// What a script in `python` prints.
pub fn run_script(python: &str, script: &str, arguments: &[PathBuf]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("python")
        .join(script);
    let output = Command::new(python)
        .arg(script)
        .args(arguments)
        .output()
        .expect("it started before");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}{errors}");
    told
}
