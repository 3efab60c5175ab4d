//! However a run is killed, its log replays up to the last interval, and `resume` ends in the
//! state of the uninterrupted run, bit for bit.

mod program;

use std::path::Path;
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");
const KILLS: u32 = 20;

/// Time and bytes of the last checkpoint.
fn final_state(log: &Path) -> (f64, Vec<u8>) {
    let log = Log::open(log).expect("the log opens");
    let last = log.last_checkpoint().expect("it has a checkpoint");
    (
        log.checkpoints()[last].time,
        log.checkpoint(last).expect("it reads"),
    )
}

#[test]
fn twenty_killed_runs_replay_and_resume_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let at = |name: &str| folder.path().join(name);
    // finer than the case of the mistakes, so that a run is long enough to be killed
    let case = WELD.replace("spacing = 0.001", "spacing = 0.0005");
    std::fs::write(at("weld.toml"), case).expect("writable");
    let started = Instant::now();
    let run = command(folder.path(), &["run", "weld.toml", "--quiet"]).status();
    assert!(run.expect("it starts").success());
    let whole = started.elapsed();
    let (end, expected) = final_state(&at("weld.mcap"));
    let states = Log::open(at("weld.mcap"))
        .expect("the log opens")
        .times("plate")
        .len();

    // a small generator: kill times need to differ, not to be random
    let mut seed: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut killed_midway = 0;
    for kill in 0..KILLS {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let share = (seed >> 40) as f64 / (1u64 << 24) as f64;
        let log = at("killed.mcap");
        let mut run = command(
            folder.path(),
            &["run", "weld.toml", "--quiet", "--out", "killed.mcap"],
        )
        .spawn()
        .expect("it starts");
        std::thread::sleep(Duration::from_secs_f64(share * whole.as_secs_f64()));
        run.kill().expect("it can be killed");
        run.wait().expect("it ends");
        if !log.exists() {
            continue; // killed before the log had anything in it: nothing is lost
        }
        let opened = Log::open(&log).unwrap_or_else(|e| panic!("kill {kill}: {e}"));
        let times = opened.times("plate").to_vec();
        for index in 0..times.len() {
            opened
                .cloud("plate", index)
                .unwrap_or_else(|e| panic!("kill {kill}: {e}"));
        }
        // every interval up to the last is there
        for (index, time) in times.iter().enumerate() {
            assert!(
                (time - 0.02 * index as f64).abs() < 1e-9,
                "kill {kill}: state {index} at {time} s"
            );
        }
        let finished = opened.finished();
        drop(opened);
        let replay = command(folder.path(), &["replay", "killed.mcap"]).status();
        assert!(replay.expect("it starts").success(), "kill {kill}: replay");
        if !finished {
            killed_midway += 1;
            let resume = command(folder.path(), &["resume", "killed.mcap", "--quiet"]).status();
            let already = final_state(&log).0 >= end;
            assert!(
                already || resume.expect("it starts").success(),
                "kill {kill}: resume"
            );
        }
        let (time, state) = final_state(&log);
        assert_eq!(time, end, "kill {kill}");
        assert!(
            state == expected,
            "kill {kill}: the resumed run ends in another state"
        );
        let resumed = Log::open(&log).expect("the log opens");
        assert_eq!(resumed.times("plate").len(), states, "kill {kill}: states");
        std::fs::remove_file(&log).expect("removable");
    }
    assert!(
        killed_midway >= KILLS / 4,
        "only {killed_midway} runs were killed while running"
    );
}
