//! SIGINT and SIGTERM: a run that steps ends after its step, everything else ends at once and leaves no unfinished files.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};

/// Polling interval for signals.
const INTERVAL: Duration = Duration::from_millis(20);

/// Number of the last signal, or zero.
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// Whether a run checks for signals between its steps.
static IS_STEPPING: AtomicBool = AtomicBool::new(false);

/// Files to remove when the program ends early.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that is removed when a signal ends the program before this is dropped.
#[derive(Debug)]
pub(crate) struct Unfinished(PathBuf);

impl Unfinished {
    pub(crate) fn new(path: &Path) -> Self {
        change(|files| files.push(path.into()));
        Self(path.into())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        change(|files| files.retain(|file| *file != self.0));
    }
}

fn change(change: impl FnOnce(&mut Vec<PathBuf>)) {
    change(&mut UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner));
}

/// From now on a run checks for signals between its steps, and ends the program itself.
pub(crate) fn leave_to_run() {
    IS_STEPPING.store(true, Ordering::SeqCst);
}

/// Number of the signal that requests an early end; zero without one.
pub(crate) fn signal() -> Arc<AtomicUsize> {
    SIGNAL.clone()
}

/// Requests an early end as a signal does.
pub(crate) fn request_end() {
    SIGNAL.store(SIGTERM as usize, Ordering::SeqCst);
}

/// Handles signals from now on. Without handlers they end the program at once, and a log is still good.
///
/// # Errors
/// An error of the operating system.
pub(crate) fn watch() -> io::Result<()> {
    // in this order: the first SIGINT finds the flag unset, a second one ends the program within a step
    let impatient = Arc::new(AtomicBool::new(false));
    flag::register_conditional_shutdown(SIGINT, 128 + SIGINT, impatient.clone())?;
    flag::register(SIGINT, impatient)?;
    for signal in [SIGINT, SIGTERM] {
        flag::register_usize(signal, SIGNAL.clone(), signal as usize)?;
    }
    std::thread::Builder::new()
        .name("signals".into())
        .spawn(|| {
            loop {
                std::thread::sleep(INTERVAL);
                let signal = SIGNAL.load(Ordering::SeqCst);
                if signal != 0 && !IS_STEPPING.load(Ordering::SeqCst) {
                    end(signal);
                }
            }
        })?;
    Ok(())
}

/// Ends the program as the signal would have done.
fn end(signal: usize) -> ! {
    change(|files| {
        for file in files.drain(..) {
            let _ = std::fs::remove_file(file);
        }
    });
    let _ = low_level::emulate_default_handler(signal as i32);
    std::process::exit(128 + signal as i32)
}
