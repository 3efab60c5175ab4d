//! However a run is killed, its log replays up to the last interval, and `resume` ends in the
//! state of the uninterrupted run, bit for bit.
//!
//! `PERIMELT_KILLS=300 cargo test --release -p perimelt-tests --test kill_and_resume killed` kills as many runs.

mod program;

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");
const WALL: &str = include_str!("cases/wall.toml");
#[cfg(feature = "umat")]
const LAWS: &str = include_str!("cases/laws.toml");

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
fn killed_runs_replay_and_resume_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let at = |name: &str| folder.path().join(name);
    // finer than the case of the mistakes, so that a run is long enough to be killed
    let case = WELD.replace("spacing = 0.001", "spacing = 0.0005");
    std::fs::write(at("weld.toml"), case).expect("writable");
    let started = Instant::now();
    let run = command(folder.path(), &["run", "weld.toml", "--quiet"]).status();
    assert!(run.expect("it starts").success());
    let whole = started.elapsed();
    let kills = std::env::var("PERIMELT_KILLS").map_or(20, |n| n.parse().expect("a number"));
    let (end, expected) = final_state(&at("weld.mcap"));
    let states = Log::open(at("weld.mcap"))
        .expect("the log opens")
        .times("plate")
        .len();

    // a small generator: kill times need to differ, not to be random
    let mut seed: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut killed_midway = 0;
    for kill in 0..kills {
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
        killed_midway >= kills / 4,
        "only {killed_midway} runs were killed while running"
    );
}

/// A body with a law of flow and one with a law of points, both with state variables.
#[cfg(feature = "umat")]
#[test]
fn states_of_laws_are_resumed_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    if perimelt_tests::compile_subroutines(folder).is_none() {
        return;
    }
    std::fs::write(folder.join("laws.toml"), LAWS).expect("writable");
    let (done, message) = told(folder, &["run", "laws.toml", "--quiet"]);
    assert!(done, "{message}");
    let expected = final_state(&folder.join("laws.mcap"));
    let log = Log::open(folder.join("laws.mcap")).expect("the log opens");
    let last = log.times("block").len() - 1;
    let cloud = log.cloud("block", last).expect("a state");
    let mut fields = cloud.fields.iter();
    let strain = fields.find(|f| f.name == "umat.state_1").expect("logged");
    assert!(strain.values.iter().any(|p| *p > 1e-4), "the block yields");

    for checkpoints in [2, 5] {
        let name = format!("part-{checkpoints}.mcap");
        let part = folder.join(&name);
        let arguments = ["run", "laws.toml", "--quiet", "--out", &name];
        let mut run = command(folder, &arguments).spawn().expect("it starts");
        let has_saved = || Log::open(&part).is_ok_and(|log| log.checkpoints().len() >= checkpoints);
        while !has_saved() && run.try_wait().expect("it runs").is_none() {
            std::thread::sleep(Duration::from_millis(5));
        }
        run.kill().expect("it can be killed");
        run.wait().expect("it ends");
        let at = final_state(&part).0;
        assert!(at < expected.0, "killed at {at} s, after its end");
        let (done, message) = told(folder, &["resume", &name, "--quiet"]);
        assert!(done, "{message}");
        assert!(final_state(&part) == expected, "resumed from {at} s");
    }
}

/// Whether a command succeeded, and what it said where errors go.
fn told(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = command(folder, arguments)
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.success(), message)
}

#[test]
fn a_finished_run_goes_on_to_a_later_end_as_if_it_had_been_its_end() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    let at = |name: &str| folder.join(name);
    let write = |name: &str, text: &str| std::fs::write(at(name), text).expect("writable");
    write("whole.toml", &WELD.replace("end = 1.5", "end = 0.5"));
    write("part.toml", &WELD.replace("end = 1.5", "end = 0.31"));
    for case in ["whole.toml", "part.toml"] {
        let (done, message) = told(folder, &["run", case, "--quiet"]);
        assert!(done, "{message}");
    }
    let (done, message) = told(folder, &["resume", "part.mcap"]);
    assert!(!done && message.contains("`--case`"), "{message}");
    let stronger = WELD.replace("power = 2000", "power = 3000");
    write("other.toml", &stronger);
    let resume = ["resume", "part.mcap", "--quiet", "--case"];
    let (done, message) = told(folder, &[&resume[..], &["other.toml"]].concat());
    assert!(!done && message.contains("`couplers` of"), "{message}");

    let (done, message) = told(folder, &[&resume[..], &["whole.toml"]].concat());
    assert!(done, "{message}");
    let (part, whole) = (
        final_state(&at("part.mcap")),
        final_state(&at("whole.mcap")),
    );
    assert_eq!(part.0, whole.0);
    let log = Log::open(at("part.mcap")).expect("the log opens");
    assert!(log.case_text().contains("end = 0.5"));
    // besides the log interval in which the first run ended, all are there
    let expected: Vec<f64> = Log::open(at("whole.mcap"))
        .expect("the log opens")
        .times("plate")
        .into();
    let times: Vec<f64> = log
        .times("plate")
        .iter()
        .copied()
        .filter(|t| *t != 0.31)
        .collect();
    assert_eq!(times, expected);

    // with another interval, and told that the file has changed
    write(
        "part.toml",
        &WELD
            .replace("end = 1.5", "end = 0.6")
            .replace("interval = 0.02", "interval = 0.05"),
    );
    let (done, message) = told(
        folder,
        &["resume", "part.mcap", "--quiet", "--case", "part.toml"],
    );
    assert!(done, "{message}");
    let log = Log::open(at("part.mcap")).expect("the log opens");
    let later: Vec<f64> = log
        .times("plate")
        .iter()
        .copied()
        .filter(|t| *t > 0.5)
        .collect();
    assert_eq!(later.len(), 2, "{later:?}");
    assert!(
        (later[0] - 0.55).abs() < 1e-12 && later[1] == 0.6,
        "{later:?}"
    );
}

#[test]
fn a_deposit_with_mechanics_goes_on_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    let at = |name: &str| folder.join(name);
    let write = |name: &str, text: &str| std::fs::write(at(name), text).expect("writable");
    write("wall.toml", WALL);
    let (done, message) = told(folder, &["run", "wall.toml", "--quiet"]);
    assert!(done, "{message}");
    let expected = final_state(&at("wall.mcap"));
    // in the middle of the second bead, between release and cut, and after the cut
    for end in ["3", "7.5", "8"] {
        write(
            "part.toml",
            &WALL.replace("end = 9", &format!("end = {end}")),
        );
        let (done, message) = told(folder, &["run", "part.toml", "--quiet", "--force"]);
        assert!(done, "{message}");
        let resume = ["resume", "part.mcap", "--quiet", "--case", "wall.toml"];
        let (done, message) = told(folder, &resume);
        assert!(done, "{message}");
        assert!(final_state(&at("part.mcap")) == expected, "from {end} s");
    }
}

#[test]
fn a_case_file_that_changed_since_is_named() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    let case = WELD.replace("end = 1.5", "end = 0.2");
    std::fs::write(folder.join("weld.toml"), &case).expect("writable");
    let (done, message) = told(folder, &["run", "weld.toml", "--quiet", "--until", "0.1"]);
    assert!(done, "{message}");
    std::fs::write(folder.join("weld.toml"), format!("{case}\n# a remark\n")).expect("writable");
    let (done, message) = told(folder, &["resume", "weld.mcap", "--quiet"]);
    assert!(
        done && message.contains("differs from the case of the log"),
        "{message}"
    );
}

/// A run that is stopped within a pass, while its path waits, and within the pass after the wait.
#[test]
fn a_path_that_waits_is_resumed_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    let case = include_str!("cases/passes.toml");
    std::fs::write(folder.join("passes.toml"), case).expect("writable");
    let run = |extra: &[&str]| {
        let (done, message) = told(
            folder,
            &[&["run", "passes.toml", "--quiet"], extra].concat(),
        );
        assert!(done, "{message}");
    };
    run(&["--out", "whole.mcap"]);
    let whole = Log::open(folder.join("whole.mcap")).expect("the log opens");
    let reports = &whole.probes()["reports"];
    let column = |name: &str| {
        let column = reports.columns.iter().find(|c| c.name == name);
        column.expect("reported").values.clone()
    };
    let starts = column("torch.pass.2.start");
    let start = starts.last().copied().unwrap_or(f64::NAN);
    assert!(start > 0.7 && start < 3.5, "the second pass waits: {start}");
    let temperature = column("torch.pass.2.temperature");
    let temperature = temperature.last().copied().unwrap_or(f64::NAN);
    assert!(temperature <= 600.0 && temperature > 590.0, "{temperature}");
    let energy = column("torch.energy.asked").last().copied();
    assert!(
        energy.is_some_and(|e| (e - 2.0 * 900.0).abs() < 1e-9),
        "{energy:?}"
    );

    let expected = final_state(&folder.join("whole.mcap"));
    for until in [0.3, 0.65, start + 0.2] {
        run(&[
            "--force",
            "--out",
            "part.mcap",
            "--until",
            &until.to_string(),
        ]);
        let (done, message) = told(folder, &["resume", "part.mcap", "--quiet"]);
        assert!(done, "{message}");
        let resumed = final_state(&folder.join("part.mcap"));
        assert!(resumed == expected, "resumed after {until} s");
    }
}

#[test]
fn a_wait_that_does_not_end_is_told() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let case = include_str!("cases/passes.toml").replace("end = 4", "end = 1");
    std::fs::write(folder.path().join("passes.toml"), case).expect("writable");
    let (done, message) = told(folder.path(), &["run", "passes.toml"]);
    assert!(done, "{message}");
    assert!(
        message.contains("torch: the run ends while pass 2 of 2 waits"),
        "{message}"
    );
}
