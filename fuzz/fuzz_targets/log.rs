//! Any bytes as a log: what is sound of it is read, down to the state that a run would resume from.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use perimelt::core::log::Log;
use perimelt::summary::{self, SummaryOptions};

/// The file that every input is written to, in memory where the system has such a folder.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() {
        memory
    } else {
        std::env::temp_dir()
    };
    folder.join(format!("perimelt-fuzz-{}.mcap", std::process::id()))
});

/// States of a body that are read.
const MOST_STATES: usize = 4;

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("the folder is writable");
    let log = match Log::open(&*FILE) {
        Ok(log) => log,
        Err(refused) => {
            let _ = refused.to_string();
            return;
        }
    };
    let bodies: Vec<&str> = log.bodies().collect();
    for body in bodies {
        for state in 0..log.times(body).len().min(MOST_STATES) {
            let _ = log.cloud(body, state);
        }
        let _ = log.first_cloud(body);
    }
    let _ = summary::read_off(&log, &SummaryOptions::default());
    if let Ok((_, state)) = log.last_sound_checkpoint()
        && let Some(mut simulation) = perimelt_fuzz::compose(log.case_name(), log.case_text())
    {
        let _ = simulation.load(&state);
    }
});
