//! Whatever happened to a log, every command uses what is sound of it or gives a clear error: it does not panic, hang or take
//! much memory, and a run that it resumes ends in the right state.
//!
//! `PERIMELT_DAMAGES=500 cargo test --release -p perimelt-tests --test damaged_logs` makes 500 truncations and 500 bit flips.
#![cfg(unix)]

mod limited;
mod program;

use std::path::Path;

use limited::{Ended, run};
use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// The last checkpoint of a log that can be opened.
fn last_state(log: &Path) -> Option<Vec<u8>> {
    let log = Log::open(log).ok()?;
    log.checkpoint(log.last_checkpoint().ok()?).ok()
}

/// Every command copes with the log in `folder`. Returns whether the run could be resumed.
fn survive(folder: &Path, log: &[u8], expected: &[u8], what: &str) -> bool {
    let path = folder.join("damaged.mcap");
    let calls: [&[&str]; 7] = [
        &["info", "damaged.mcap"],
        &["summary", "damaged.mcap"],
        &["replay", "damaged.mcap"],
        &["plot", "damaged.mcap", "--at", "0.5"],
        &["export", "damaged.mcap", "--format", "csv"],
        &["diff", "damaged.mcap", "weld.mcap"],
        &["resume", "damaged.mcap", "--quiet"],
    ];
    std::fs::write(&path, log).expect("writable");
    for call in calls {
        let Ended { status, errors, .. } = run(folder, call);
        assert!(
            matches!(status, Some(0..=2)) && !errors.contains("panicked"),
            "{what}: {call:?} ended with {status:?}\n{errors}"
        );
        assert!(
            status == Some(0) || call[0] == "diff" || errors.contains("error:"),
            "{what}: {call:?} ended with {status:?} and no reason\n{errors}"
        );
        if call[0] == "resume" && status == Some(0) {
            let end = last_state(&path);
            assert!(end.as_deref() == Some(expected), "{what}: another end");
            return true;
        }
    }
    false
}

#[test]
fn damaged_logs_are_used_as_far_as_they_are_sound() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    let number = std::env::var("PERIMELT_DAMAGES").map_or(5, |n| n.parse().expect("a number"));
    std::fs::write(folder.join("weld.toml"), WELD).expect("writable");
    let whole = command(folder, &["run", "weld.toml", "--quiet"]).status();
    assert!(whole.expect("it starts").success());
    let log = std::fs::read(folder.join("weld.mcap")).expect("readable");
    let expected = last_state(&folder.join("weld.mcap")).expect("it has checkpoints");

    // a small generator: places need to differ, not to be random
    let mut seed: u64 = 0x2545_f491_4f6c_dd1d;
    let mut below = |most: usize| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed % most as u64) as usize
    };
    let mut resumed = 0;
    for _ in 0..number {
        let length = below(log.len());
        let what = format!("cut off at byte {length}");
        resumed += usize::from(survive(folder, &log[..length], &expected, &what));
    }
    // the first checkpoint is written at the start
    assert!(2 * resumed >= number, "{resumed} of {number} resumed");
    for _ in 0..number {
        let (at, bit) = (below(log.len()), below(8));
        let mut flipped = log.clone();
        flipped[at] ^= 1 << bit;
        survive(
            folder,
            &flipped,
            &expected,
            &format!("bit {bit} of byte {at} flipped"),
        );
    }
}
