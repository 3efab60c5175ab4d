//! What the command line does with logs that exist, signals, times outside of a log, and outputs that cannot be written.

#![cfg(unix)]

mod program;

use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// A folder with the case, `factor` times as long.
fn folder(factor: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let case = WELD.replace("end = 1.5", &format!("end = {}", 1.5 * factor));
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    folder
}

/// Whether it succeeded, and what it said in case it did not.
fn told(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = command(folder, arguments).stderr(Stdio::piped()).output();
    let output = output.expect("it starts");
    (
        output.status.success(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

/// A run whose log exists, and which lasts for much longer.
fn long_run(folder: &Path) -> Child {
    let child = command(folder, &["run", "weld.toml", "--quiet"])
        .spawn()
        .expect("it starts");
    let started = Instant::now();
    while !folder.join("weld.mcap").exists() {
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "no log after a minute"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

fn signal(child: &mut Child, name: &str) -> ExitStatus {
    let pid = child.id().to_string();
    let sent = std::process::Command::new("kill")
        .args([name, &pid])
        .status();
    assert!(sent.expect("there is a `kill`").success());
    child.wait().expect("it ends")
}

#[test]
fn a_log_is_replaced_only_when_told_to() {
    let folder = folder(0.1);
    let folder = folder.path();
    let run = ["run", "weld.toml", "--quiet", "--until", "0.05"];
    assert_eq!(told(folder, &run), (true, String::new()));
    let before = std::fs::read(folder.join("weld.mcap")).expect("readable");
    let (done, message) = told(folder, &["run", "weld.toml"]);
    assert!(
        !done && message.contains("weld.mcap exists: `--force` replaces it"),
        "{message}"
    );
    assert_eq!(
        std::fs::read(folder.join("weld.mcap")).expect("readable"),
        before
    );
    let (done, message) = told(folder, &["run", "weld.toml", "--quiet", "--force"]);
    assert!(done, "{message}");
    let log = Log::open(folder.join("weld.mcap")).expect("a log");
    assert!(log.times("plate").last() > Some(&0.1));
}

#[test]
fn two_runs_do_not_write_one_log_and_signals_end_a_run_with_their_status() {
    for (name, status) in [("-TERM", 143), ("-INT", 130)] {
        let folder = folder(1000.0);
        let folder = folder.path();
        let mut first = long_run(folder);
        for second in [
            &["run", "weld.toml", "--force"][..],
            &["resume", "weld.mcap"],
        ] {
            let (done, message) = told(folder, second);
            assert!(
                !done && message.contains("is being written by another run"),
                "{message}"
            );
        }
        // readers are free
        let (done, message) = told(folder, &["info", "weld.mcap"]);
        assert!(done, "{message}");
        assert_eq!(signal(&mut first, name).code(), Some(status));
        let log = Log::open(folder.join("weld.mcap")).expect("a log");
        // the last state has a checkpoint
        let last = log.last_checkpoint().expect("a checkpoint");
        assert_eq!(
            log.times("plate").last(),
            Some(&log.checkpoints()[last].time)
        );
    }
}

#[test]
fn times_outside_of_a_log_are_refused_and_others_are_named() {
    let folder = folder(0.1);
    let folder = folder.path();
    assert_eq!(
        told(folder, &["run", "weld.toml", "--quiet"]),
        (true, String::new())
    );
    for command in ["plot", "export", "replay"] {
        let at = |time: &str| told(folder, &[command, "weld.mcap", "--at", time]);
        let (done, message) = at("3");
        assert!(
            !done && message.contains("lies outside of the logged times"),
            "{command}: {message}"
        );
        let (done, message) = at("-1");
        assert!(
            !done && message.contains("lies outside of the logged times"),
            "{command}: {message}"
        );
        let (done, message) = at("nan");
        assert!(
            !done && message.contains("expected a time"),
            "{command}: {message}"
        );
        let (done, message) = at("0.047");
        assert!(
            done && message.contains("nearest to 0.047 s is that at 0.04"),
            "{command}: {message}"
        );
    }
    let (done, message) = told(folder, &["run", "weld.toml", "--threads", "100000"]);
    assert!(!done && message.contains("from 1 to 1024"), "{message}");
}

#[test]
fn logs_of_some_fields_and_of_a_line_are_shown() {
    let folder = folder(0.1);
    let folder = folder.path();
    let case = folder.join("weld.toml");
    let text = std::fs::read_to_string(&case).expect("readable");
    let text = text.replace("[log]\n", "[log]\nfields = [\"temperature\"]\n");
    let line = "from = [0.001, 0.005, 0.003], to = [0.015, 0.005, 0.003], number = 7";
    let probe =
        format!("[[probes]]\nname = \"line\"\nfield = \"temperature\"\nkind.line = {{ {line} }}\n");
    std::fs::write(&case, format!("{text}\n{probe}")).expect("writable");
    assert!(told(folder, &["run", "weld.toml", "--quiet"]).0);
    let info = command(folder, &["info", "weld.mcap"])
        .stdout(Stdio::piped())
        .output();
    let info = String::from_utf8(info.expect("it starts").stdout).expect("text");
    assert!(
        info.contains("\n    temperature [K]\n    not logged: "),
        "{info}"
    );
    assert!(!info.contains("enthalpy ["), "{info}");
    assert!(
        info.contains("probe line: 0 [K], 0.00233333 [K], 0.00466667 [K]"),
        "{info}"
    );
    // one picture of a field and one of the line
    let (done, message) = told(folder, &["plot", "weld.mcap", "--at", "0.047"]);
    assert!(done && message.matches("note: ").count() == 1, "{message}");
}

#[test]
fn keys_of_no_section_are_told_with_their_paths() {
    let folder = folder(0.1);
    let (done, message) = told(folder.path(), &["run", "weld.toml", "--set", "power=3"]);
    assert!(
        !done && message.contains("`couplers.goldak.power`"),
        "{message}"
    );
}

/// A page that other viewers are told of is not shown by a program that cannot serve them.
#[test]
#[cfg(not(feature = "live"))]
fn no_address_is_printed_without_the_feature() {
    let folder = folder(0.1);
    let folder = folder.path();
    assert!(told(folder, &["run", "weld.toml", "--quiet"]).0);
    let view = command(folder, &["view", "weld.mcap", "--no-open", "--live"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    assert!(!view.status.success());
    assert_eq!(String::from_utf8_lossy(&view.stdout), "");
    assert!(String::from_utf8_lossy(&view.stderr).contains("--features live"));
}

/// `/dev/full` takes no byte.
#[test]
#[cfg(target_os = "linux")]
fn outputs_that_cannot_be_written_are_errors_and_no_panics() {
    let folder = folder(0.1);
    let folder = folder.path();
    assert_eq!(
        told(folder, &["run", "weld.toml", "--quiet"]),
        (true, String::new())
    );
    let full = || {
        Stdio::from(
            std::fs::File::options()
                .write(true)
                .open("/dev/full")
                .expect("there"),
        )
    };
    for arguments in [
        &["plot", "weld.mcap"][..],
        &["export", "weld.mcap"],
        &["summary", "weld.mcap"],
        &["run", "weld.toml", "--force"],
    ] {
        let output = command(folder, arguments)
            .stdout(full())
            .stderr(Stdio::piped())
            .output();
        let output = output.expect("it starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{arguments:?}: {message}");
        let status = command(folder, arguments)
            .stdout(full())
            .stderr(full())
            .status();
        assert_eq!(status.expect("it starts").code(), Some(1), "{arguments:?}");
    }
}

#[test]
fn a_misspelt_key_of_a_change_is_answered_with_the_right_one() {
    let folder = folder(0.1);
    for (change, right) in [("couplers.goldak.powr=1", "power"), ("time.sep=1", "step")] {
        let (done, message) = told(folder.path(), &["run", "weld.toml", "--set", change]);
        let hint = format!("did you mean `{right}`?");
        assert!(!done && message.contains(&hint), "{message}");
    }
}

#[test]
fn set_up_and_memory_of_a_case_are_measured_for_other_numbers_of_points() {
    let folder = tempfile::tempdir().expect("a folder");
    let case = perimelt_tests::root().join("cases/performance/heat-block.toml");
    let case = case.to_str().expect("a path");
    let arguments = ["bench", case, "--points", "1000,8e3"];
    let output = command(folder.path(), &arguments)
        .stdout(Stdio::piped())
        .output()
        .expect("it starts");
    let page = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{page}");
    for points in [1000, 8000] {
        let row = page
            .lines()
            .find(|line| line.contains(&format!("| {points} |")));
        let last = row.and_then(|row| row.trim_end_matches(" |").rsplit(' ').next());
        let bytes: f64 = last.and_then(|n| n.parse().ok()).expect("bytes a point");
        assert!(bytes > 40.0, "{page}");
    }
    let (done, message) = told(folder.path(), &["bench", case, "--points", "none"]);
    assert!(!done && message.contains("such as 1e6"), "{message}");
}
