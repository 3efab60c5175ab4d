//! The command line, built in the profile of the tests.

use std::path::Path;
use std::process::{Command, Stdio};

/// The program in a folder, silent.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_perimelt-tests"));
    command
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}
