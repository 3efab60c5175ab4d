//! A run that `perimelt view` starts, to show it.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::thread;
use std::time::Duration;

use super::ViewError;
use crate::run::log_of;

/// Polling interval for the log.
const INTERVAL: Duration = Duration::from_millis(50);

/// Runs a case in a separate process, which continues after the page is closed, and blocks until its log exists.
///
/// # Errors
/// The program cannot be started, or the run ends before it has a log; it prints the reason itself.
pub(super) fn start(case: &Path) -> Result<PathBuf, ViewError> {
    let log = log_of(case);
    // a run refuses to replace a log: it ends before there is a new one
    let was_there = log.exists();
    let mut run = spawn(case).map_err(ViewError::Start)?;
    loop {
        if !was_there && log.exists() {
            return Ok(log);
        }
        if run.try_wait().map_err(ViewError::Start)?.is_some() && (was_there || !log.exists()) {
            return Err(ViewError::NoRun { case: case.into() });
        }
        thread::sleep(INTERVAL);
    }
}

fn spawn(case: &Path) -> io::Result<Child> {
    let program = std::env::current_exe()?;
    let mut run = Command::new(program);
    // the first line of the output is the address of the page
    run.arg("run").arg(case).stdout(io::stderr()).spawn()
}
