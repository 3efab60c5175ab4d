//! What the command line makes of logs: a window of one, the difference of two, pictures, films.

#![cfg(unix)]

mod program;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// Status, output and messages of a command.
fn told(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = command(folder, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let status = output.status.code().expect("no signal");
    (status, text(&output.stdout), text(&output.stderr))
}

/// A folder with `weld.mcap`, the log of the weld up to `end`.
fn logged(end: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let case = WELD.replace("end = 1.5", &format!("end = {end}"));
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    let (status, _, message) = told(folder.path(), &["run", "weld.toml", "--quiet"]);
    assert_eq!(status, 0, "{message}");
    folder
}

#[test]
fn a_window_of_a_log_is_read_drawn_and_resumed_like_the_whole() {
    let folder = logged("0.6");
    let folder = folder.path();
    let cut = [
        "trim",
        "weld.mcap",
        "--from",
        "0.2",
        "--to",
        "0.4",
        "--out",
        "cut.mcap",
    ];
    let (status, output, message) = told(folder, &cut);
    assert_eq!(
        (status, &*output, &*message),
        (
            0,
            "cut.mcap: 11 states from 0.2 to 0.4 s, 3 checkpoints\n",
            ""
        )
    );
    // an existing log is not replaced without a word
    let (status, _, message) = told(folder, &cut);
    assert_eq!(status, 1);
    assert_eq!(
        message,
        "error: cut.mcap exists: `--force` replaces it, `--out` names another file\n"
    );
    for arguments in [
        &["info", "cut.mcap"][..],
        &["replay", "cut.mcap", "--at", "0.3"],
        &["summary", "cut.mcap"],
        &["plot", "cut.mcap", "--width", "500"],
        &["export", "cut.mcap", "--every", "5"],
        &["resume", "cut.mcap", "--out", "resumed.mcap", "--quiet"],
    ] {
        let (status, _, message) = told(folder, arguments);
        assert_eq!(status, 0, "{arguments:?}: {message}");
    }
    // the resumed window ends like the run without an interruption
    let rest = ["trim", "weld.mcap", "--from", "0.2", "--out", "rest.mcap"];
    assert_eq!(told(folder, &rest).0, 0);
    let (status, output, message) = told(folder, &["diff", "rest.mcap", "resumed.mcap"]);
    assert_eq!(status, 0, "{output}{message}");
    let log = Log::open(folder.join("resumed.mcap")).expect("a log");
    assert_eq!(log.times("plate").len(), 21);

    for (arguments, expected) in [
        (
            &["--from", "0.9"][..],
            "error: no logged state lies at 0.9 s or later; the log has states from 0 to 0.6 s\n",
        ),
        (
            &["--from", "0.4", "--to", "0.2"],
            "error: `--from 0.4` is after `--to 0.2`\n",
        ),
        (
            &["--to", "nan"],
            "error: `--to` is NaN, expected a time in s\n",
        ),
    ] {
        let all = [&["trim", "weld.mcap", "--out", "none.mcap"][..], arguments].concat();
        let (status, _, message) = told(folder, &all);
        assert_eq!((status, &*message), (1, expected));
        assert!(!folder.join("none.mcap").exists());
    }
}

#[test]
fn logs_that_differ_are_told_from_equal_ones_by_the_status() {
    let folder = logged("0.1");
    let folder = folder.path();
    let other = |arguments: &[&str]| {
        let run = [
            "run",
            "weld.toml",
            "--quiet",
            "--force",
            "--out",
            "other.mcap",
        ];
        let (status, _, message) = told(folder, &[&run[..], arguments].concat());
        assert_eq!(status, 0, "{message}");
    };
    other(&[]);
    let (status, output, message) = told(folder, &["diff", "weld.mcap", "other.mcap"]);
    assert_eq!(status, 0, "{output}{message}");
    assert!(output.contains("equal: "), "{output}");

    // a thousandth more power
    other(&["--set", "couplers.goldak.power=2002"]);
    let diff = |tolerance: &str| {
        told(
            folder,
            &["diff", "weld.mcap", "other.mcap", "--tolerance", tolerance],
        )
    };
    let (status, output, _) = diff("0");
    assert_eq!(status, 1, "{output}");
    assert!(
        output.contains("temperature (K)") && output.contains("different: "),
        "{output}"
    );
    assert_eq!(diff("0.01").0, 0);
    let (status, output, _) = diff("1e-5");
    assert_eq!(status, 1, "{output}");

    // other times: what is common is compared
    other(&["--set", "log.interval=0.04"]);
    let (status, output, _) = told(folder, &["diff", "weld.mcap", "other.mcap"]);
    assert_eq!(status, 1);
    assert!(output.contains("times are in both logs"), "{output}");

    for arguments in [
        &["diff", "weld.mcap", "none.mcap"][..],
        &["diff", "weld.mcap", "weld.toml"],
        &["diff", "weld.mcap", "other.mcap", "--tolerance", "-1"],
        &["diff", "weld.mcap", "other.mcap", "--field", "temprature"],
        &["diff", "weld.mcap"],
    ] {
        let (status, _, message) = told(folder, arguments);
        assert_eq!(status, 2, "{arguments:?}: {message}");
        assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    }
}

#[test]
fn sections_and_films_are_drawn_as_asked_and_mistakes_explained() {
    let folder = logged("0.2");
    let folder = folder.path();
    let plot = |arguments: &[&str]| told(folder, &[&["plot", "weld.mcap"][..], arguments].concat());
    let (status, output, message) = plot(&[
        "--section",
        "x=0.01",
        "--section",
        "y=0.005",
        "--celsius",
        "--isotherm",
        "100,500,1500",
        "--range",
        "20,1800",
        "--format",
        "svg",
        "--at",
        "0.2",
        "--field",
        "temperature",
    ]);
    assert_eq!(status, 0, "{message}");
    let picture = output.lines().next().expect("a picture");
    let text = std::fs::read_to_string(folder.join(picture)).expect("readable");
    for part in [
        "A short weld on a small steel block",
        "section A, x = ",
        "section B, y = ",
        "500 °C",
        "temperature (°C)",
    ] {
        assert!(text.contains(part), "no {part}");
    }
    // no body is hotter than the steel boils
    let (_, output, _) = plot(&["--isotherm", "9000", "--at", "0.2", "--format", "svg"]);
    let picture = output.lines().next().expect("a picture");
    let text = std::fs::read_to_string(folder.join(picture)).expect("readable");
    assert!(
        !text.contains("9000 K"),
        "an isotherm that is not there is named"
    );

    for film in ["weld.gif", "weld.apng"] {
        let (status, output, message) = plot(&["--film", film, "--width", "500", "--frames", "4"]);
        assert_eq!((status, &*output), (0, &*format!("{film}\n")), "{message}");
        let bytes = std::fs::read(folder.join(film)).expect("readable");
        // a control block for each picture of a GIF, a chunk for each of an APNG
        let mark: &[u8] = if film == "weld.gif" {
            b"\x21\xf9\x04"
        } else {
            b"fcTL"
        };
        let count = bytes.windows(mark.len()).filter(|w| *w == mark).count();
        assert_eq!(count, 4, "{film}");
    }

    for (arguments, expected) in [
        (
            &["--section", "x=2"][..],
            "error: `--section x=2` does not cut body `plate`, which extends from x = 0 to 0.02 m\n",
        ),
        (
            &["--film", "weld.mp4"],
            "error: `--film weld.mp4`: expected a file that ends in `.gif`, `.png` or `.apng`\n",
        ),
    ] {
        let (status, _, message) = plot(arguments);
        assert_eq!((status, &*message), (1, expected));
    }
    for (arguments, expected) in [
        (
            &["--section", "u=1"][..],
            "expected an axis and a coordinate in m, such as `x=0.05`",
        ),
        (
            &["--range", "9,1"],
            "expected two ascending numbers, such as `300,1500`",
        ),
    ] {
        let (status, _, message) = plot(arguments);
        assert_eq!(status, 2);
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_check_tells_the_size_of_the_log_and_the_version_its_commit_and_processor() {
    let folder = logged("0.1");
    let folder = folder.path();
    let (status, output, message) = told(folder, &["check", "weld.toml"]);
    assert_eq!(status, 0, "{message}");
    // 800 points: positions, temperature, liquid fraction, at six times
    assert!(output.contains("log: at most "), "{output}");
    assert!(
        output.contains("6 states of 16.2 kB, 2 checkpoints of "),
        "{output}"
    );
    assert!(output.contains("duration: "), "{output}");
    let (status, output, _) = told(folder, &["--version"]);
    assert_eq!(status, 0);
    assert!(
        output.starts_with("perimelt-tests of perimelt 0.1.0 ("),
        "{output}"
    );
    assert!(output.contains("threads"), "{output}");
}

#[test]
fn a_replay_follows_a_run_until_it_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let case = WELD.replace("end = 1.5", "end = 30");
    std::fs::write(folder.join("weld.toml"), case).expect("writable");
    let run = command(folder, &["run", "weld.toml", "--quiet"]).spawn();
    let mut run = run.expect("it starts");
    let log = || Log::open(folder.join("weld.mcap"));
    while log().map_or(0, |log| log.times("plate").len()) < 2 {
        std::thread::sleep(Duration::from_millis(10));
    }
    let follow = ["replay", "weld.mcap", "--follow", "--field", "temperature"];
    let mut replay = command(folder, &follow)
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut lines = BufReader::new(replay.stdout.take().expect("piped")).lines();
    let first = lines.next().expect("a line").expect("readable");
    assert_eq!(first, "t = 0 s");
    assert!(run.try_wait().expect("a status").is_none(), "too fast");
    let rest: Vec<String> = lines.map(|line| line.expect("readable")).collect();
    assert!(replay.wait().expect("it ends").success());
    assert!(run.wait().expect("it ends").success());
    let log = log().expect("a log");
    assert!(log.finished());
    let states = rest.iter().filter(|line| line.starts_with("t = ")).count();
    assert_eq!(1 + states, log.times("plate").len());
    let values = rest.iter().filter(|line| line.starts_with("  plate "));
    assert!(
        values
            .clone()
            .all(|line| line.starts_with("  plate temperature "))
    );
    assert_eq!(values.count(), 1 + states);
}

#[test]
fn a_replay_refuses_the_name_of_another_field() {
    let folder = logged("0.1");
    for at in [&[][..], &["--at", "0.1"]] {
        let asked = ["replay", "weld.mcap", "--field", "heat"];
        let (status, _, message) = told(folder.path(), &[&asked, at].concat());
        assert_eq!(status, 1);
        assert!(message.contains("no field `heat`; it has"), "{message}");
    }
}

#[test]
fn a_log_is_written_to_a_regular_file_only() {
    let folder = logged("0.04");
    let folder = folder.path();
    let at = |name: &str| folder.join(name);
    let made = std::process::Command::new("mkfifo")
        .arg(at("pipe"))
        .status();
    assert!(made.expect("it starts").success());
    std::fs::create_dir(at("data")).expect("a folder");
    let run = |out: &str| {
        told(
            folder,
            &["run", "weld.toml", "--quiet", "--force", "--out", out],
        )
    };
    for (out, what) in [("pipe", "a device or a pipe"), ("data", "a folder")] {
        let (status, _, message) = run(out);
        let expected =
            format!("error: {out} is {what}, and a log is a regular file; give another `--out`\n");
        assert_eq!((status, message), (1, expected));
        let (status, _, message) = told(folder, &["resume", "weld.mcap", "--out", out]);
        assert!(status == 1 && message.contains(what), "{message}");
        assert!(!at(&format!("{out}.part")).exists());
    }
    let (status, _, message) = told(folder, &["info", "pipe"]);
    assert_eq!(
        (status, &*message),
        (1, "error: pipe is not a regular file; a log must be one\n")
    );
    // a link stays, and its file is replaced
    std::os::unix::fs::symlink("data/real.mcap", at("link.mcap")).expect("a link");
    let until = [
        "run",
        "weld.toml",
        "--quiet",
        "--until",
        "0.02",
        "--out",
        "link.mcap",
    ];
    assert_eq!(told(folder, &until).0, 0);
    let (status, _, message) = told(folder, &["resume", "link.mcap", "--quiet"]);
    assert_eq!(status, 0, "{message}");
    assert!(at("link.mcap").is_symlink());
    let log = Log::open(at("data/real.mcap")).expect("a log");
    assert_eq!(log.times("plate").len(), 3);
}

#[test]
fn a_full_disk_is_told_with_the_log_and_how_to_go_on() {
    let folder = logged("0.04");
    let folder = folder.path();
    let limited = "trap '' XFSZ; ulimit -f 100; exec \"$0\" run long.toml --quiet";
    let case = WELD.replace("interval = 0.02", "interval = 0.002");
    std::fs::write(folder.join("long.toml"), case).expect("writable");
    let output = std::process::Command::new("sh")
        .current_dir(folder)
        .args(["-c", limited, env!("CARGO_BIN_EXE_perimelt-tests")])
        .output()
        .expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.starts_with("error: could not write the log long.mcap: ")
            && message.ends_with(
                "; the log is intact up to the last complete state: `perimelt resume long.mcap` continues it\n"
            ),
        "{message}"
    );
    let (status, _, message) = told(
        folder,
        &["resume", "long.mcap", "--until", "0.4", "--quiet"],
    );
    assert_eq!(status, 0, "{message}");
    let back = ["resume", "long.mcap", "--until", "0.1", "--quiet"];
    let (status, _, message) = told(folder, &back);
    assert!(
        status == 1 && message.contains("give a later time"),
        "{message}"
    );
}

#[test]
fn numbers_that_make_no_sense_are_refused() {
    let folder = logged("0.04");
    for arguments in [
        &["run", "weld.toml", "--until", "nan"][..],
        &["run", "weld.toml", "--until", "-1"],
        &["plot", "weld.mcap", "--deform", "nan"],
        &["plot", "weld.mcap", "--isotherm", "nan"],
        &["summary", "weld.mcap", "--isotherm", "-5"],
        &["summary", "weld.mcap", "--haz", "nan"],
    ] {
        let (status, _, message) = told(folder.path(), arguments);
        assert!(
            status == 2 && message.contains("expected a finite number"),
            "{arguments:?}: {message}"
        );
    }
    let rate = ["replay", "weld.mcap", "--rate", "-1"];
    let (status, _, message) = told(folder.path(), &rate);
    assert_eq!(
        (status, &*message),
        (1, "error: `--rate` must be above 0, but is -1\n")
    );
}

#[test]
fn damaged_states_are_told_by_every_command() {
    let folder = logged("0.2");
    let path = folder.path().join("weld.mcap");
    let mut bytes = std::fs::read(&path).expect("readable");
    let whole = Log::open(&path).expect("a log").times("plate").len();
    // a byte in the middle of every second chunk: opcode 6, its length, its content
    let (mut at, mut chunk) = (8, 0);
    while at + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight"));
        if bytes[at] == 6 {
            chunk += 1;
            if chunk % 3 == 0 {
                bytes[at + 9 + length as usize / 2] ^= 0x55;
            }
        }
        at += 9 + length as usize;
    }
    std::fs::write(&path, bytes).expect("writable");
    let sound = Log::open(&path).expect("a log").times("plate").len();
    let lost = whole - sound;
    assert!(lost > 0);
    let expected = format!(
        "warning: {lost} of {whole} states of weld.mcap are damaged and left out; `perimelt info weld.mcap` lists the \
         damage\n"
    );
    for arguments in [
        &["replay", "weld.mcap"][..],
        &["summary", "weld.mcap"],
        &["plot", "weld.mcap", "--width", "500"],
        &["export", "weld.mcap"],
        &["trim", "weld.mcap", "--out", "cut.mcap"],
    ] {
        let (_, _, message) = told(folder.path(), arguments);
        assert_eq!(
            message.matches(&expected).count(),
            1,
            "{arguments:?}: {message}"
        );
    }
    let (_, _, message) = told(folder.path(), &["diff", "weld.mcap", "cut.mcap"]);
    assert!(message.contains(&expected), "{message}");
}

#[test]
fn a_check_tells_of_the_initial_state_and_of_lost_power() {
    let folder = logged("0.04");
    let case = WELD.replace("initial.temperature = 300", "initial.temperature = 20");
    let case = case.replace("end = 1.5", "end = 0.04");
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    let (status, _, message) = told(folder.path(), &["check", "weld.toml"]);
    assert_eq!(status, 0, "{message}");
    assert!(message.contains("of body `plate` is 20 K;"), "{message}");
}
