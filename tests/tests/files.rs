//! What the program does with files: nothing is replaced unasked, written through links, lost without a word or left half.
#![cfg(unix)]

mod program;

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// A folder with a case.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("weld.toml"), WELD).expect("writable");
    folder
}

/// Whether a command succeeded, and what it said where errors go.
fn told(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = command(folder, arguments).stderr(Stdio::piped()).output();
    let output = output.expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.success(), message)
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let sent = std::process::Command::new("kill")
        .args([name, &id])
        .status();
    assert!(sent.expect("there is a `kill`").success());
}

/// Waits for something.
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < Duration::from_secs(60), "no {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn ended(child: &mut Child) -> ExitStatus {
    let mut status = None;
    until("end", || {
        status = child.try_wait().expect("it can be waited for");
        status.is_some()
    });
    status.expect("it has ended")
}

/// Names of the files in a folder, hidden ones too.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let name = |e: std::io::Result<std::fs::DirEntry>| {
        e.expect("readable")
            .file_name()
            .to_string_lossy()
            .into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    names
}

/// A case that takes minutes to run, or with a fine spacing to compose.
fn long_case(folder: &Path, spacing: &str) {
    let text = WELD.replace("spacing = 0.001", &format!("spacing = {spacing}"));
    let text = text.replace("end = 1.5", "end = 1500");
    std::fs::write(folder.join("long.toml"), text).expect("writable");
}

#[test]
fn resume_and_trim_replace_a_file_only_when_told_to() {
    let folder = folder();
    let folder = folder.path();
    let run = ["run", "weld.toml", "--quiet", "--until", "0.05"];
    assert_eq!(told(folder, &run), (true, String::new()));
    std::fs::write(folder.join("notes.txt"), "precious").expect("writable");
    for call in [
        &["resume", "weld.mcap", "--quiet", "--out", "notes.txt"][..],
        &["trim", "weld.mcap", "--out", "notes.txt"],
        &["run", "weld.toml", "--quiet", "--out", "notes.txt"],
    ] {
        let (done, message) = told(folder, call);
        let expected = "error: notes.txt exists: `--force` replaces it, `--out` names another file";
        assert!(
            !done && message.starts_with(expected),
            "{call:?}: {message}"
        );
        let text = std::fs::read(folder.join("notes.txt")).expect("readable");
        assert_eq!(text, b"precious");
    }
    let forced = [
        "resume",
        "weld.mcap",
        "--quiet",
        "--until",
        "0.08",
        "--out",
        "notes.txt",
        "--force",
    ];
    assert_eq!(told(folder, &forced), (true, String::new()));
    assert!(Log::open(folder.join("notes.txt")).is_ok());
    assert_eq!(names(folder), ["notes.txt", "weld.mcap", "weld.toml"]);
}

#[test]
fn files_of_the_user_beside_a_log_stay() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("victim.txt"), "precious").expect("writable");
    symlink("victim.txt", folder.join("weld.mcap.part")).expect("a link");
    std::fs::write(folder.join(".weld.mcap.mine.part"), "mine").expect("writable");
    let run = ["run", "weld.toml", "--quiet", "--until", "0.05"];
    assert_eq!(told(folder, &run), (true, String::new()));
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).expect("readable");
    assert_eq!(text("victim.txt"), "precious");
    assert_eq!(text(".weld.mcap.mine.part"), "mine");
    assert!(!folder.join("weld.mcap").is_symlink());
    assert!(Log::open(folder.join("weld.mcap")).is_ok());
}

#[test]
fn the_place_of_a_log_is_claimed_until_the_run_has_ended() {
    let folder = folder();
    let folder = folder.path();
    let run = [
        "run",
        "weld.toml",
        "--quiet",
        "--until",
        "0.05",
        "--out",
        "other.mcap",
    ];
    assert_eq!(told(folder, &run), (true, String::new()));
    long_case(folder, "0.00025");
    let mut first = command(folder, &["run", "long.toml", "--quiet"])
        .spawn()
        .expect("it starts");
    until("claim", || folder.join(".long.mcap.lock").exists());
    // while it composes or a moment later
    for call in [
        &[
            "run",
            "weld.toml",
            "--quiet",
            "--out",
            "long.mcap",
            "--force",
        ][..],
        &["trim", "other.mcap", "--out", "long.mcap", "--force"],
        &[
            "resume",
            "other.mcap",
            "--quiet",
            "--out",
            "long.mcap",
            "--force",
        ],
    ] {
        let (done, message) = told(folder, call);
        let expected = "error: long.mcap is being written by another run";
        assert!(
            !done && message.starts_with(expected),
            "{call:?}: {message}"
        );
    }
    signal(&first, "-TERM");
    ended(&mut first);
    assert!(!folder.join(".long.mcap.lock").exists());
}

#[test]
fn a_run_whose_log_is_removed_fails() {
    let folder = folder();
    let folder = folder.path();
    long_case(folder, "0.001");
    let mut run = command(folder, &["run", "long.toml", "--quiet"]);
    let mut run = run.stderr(Stdio::piped()).spawn().expect("it starts");
    until("log", || folder.join("long.mcap").exists());
    std::fs::remove_file(folder.join("long.mcap")).expect("removable");
    std::fs::write(folder.join("long.mcap"), "another").expect("writable");
    signal(&run, "-TERM");
    let status = ended(&mut run);
    let output = run.wait_with_output().expect("it has ended");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(status.code(), Some(1), "{message}");
    assert!(
        message.contains("was removed or replaced during the run"),
        "{message}"
    );
    let text = std::fs::read(folder.join("long.mcap")).expect("readable");
    assert_eq!(text, b"another");
}

#[test]
fn signals_end_a_run_that_composes_at_once_and_leave_no_file() {
    use std::os::unix::process::ExitStatusExt;
    for (name, number) in [("-TERM", 15), ("-INT", 2)] {
        let folder = folder();
        let folder = folder.path();
        long_case(folder, "0.0001");
        let mut run = command(folder, &["run", "long.toml", "--quiet"])
            .spawn()
            .expect("it starts");
        until("claim", || folder.join(".long.mcap.lock").exists());
        std::thread::sleep(Duration::from_millis(200));
        let sent = Instant::now();
        signal(&run, name);
        let status = ended(&mut run);
        assert!(sent.elapsed() < Duration::from_secs(2));
        let is_so = status.signal() == Some(number) || status.code() == Some(128 + number);
        assert!(is_so, "{status:?}");
        assert_eq!(names(folder), ["long.toml", "weld.toml"]);
    }
}

/// The files of an export have their names when they are complete.
#[test]
fn a_killed_export_leaves_no_partial_file() {
    let folder = folder();
    let folder = folder.path();
    let text = WELD.replace("end = 1.5", "end = 0.3");
    std::fs::write(folder.join("weld.toml"), text).expect("writable");
    assert_eq!(
        told(folder, &["run", "weld.toml", "--quiet"]),
        (true, String::new())
    );
    let export = ["export", "weld.mcap", "--format", "csv", "--out"];
    assert!(told(folder, &[&export[..], &["whole"]].concat()).0);
    for delay in [20, 60, 120, 250] {
        let arguments = [&export[..], &["part"]].concat();
        let mut killed = command(folder, &arguments).spawn().expect("it starts");
        std::thread::sleep(Duration::from_millis(delay));
        killed.kill().expect("it can be killed");
        killed.wait().expect("it ends");
        let part = folder.join("part");
        if !part.exists() {
            continue;
        }
        for name in names(&part).iter().filter(|name| !name.starts_with('.')) {
            let read = |folder: &str| std::fs::read(folder_of(&part, folder).join(name));
            let same = read("part").expect("readable") == read("whole").expect("readable");
            assert!(same, "{name} after {delay} ms");
        }
    }
}

fn folder_of(sibling: &Path, name: &str) -> std::path::PathBuf {
    sibling.with_file_name(name)
}

#[test]
fn bodies_and_probes_with_similar_names_get_files_of_their_own() {
    let folder = folder();
    let folder = folder.path();
    let second = WELD
        [WELD.find("[bodies.plate]").expect("there")..WELD.find("[materials").expect("there")]
        .replace("[bodies.plate]", "[bodies.\"the-plate\"]");
    let text = WELD
        .replace("[bodies.plate]", "[bodies.\"the plate\"]")
        .replace("[materials.steel]", &format!("{second}\n[materials.steel]"))
        .replace("[[physics]]", "[[physics]]\nbody = \"the plate\"")
        .replace("[[couplers]]", "[[couplers]]\nbody = \"the plate\"")
        .replace("[[probes]]", "[[probes]]\nbody = \"the plate\"")
        + "\n[[physics]]\ntype = \"thermal\"\nname = \"other\"\nbody = \"the-plate\"\nhorizon = 2\n";
    std::fs::write(folder.join("two.toml"), text).expect("writable");
    let (done, message) = told(folder, &["run", "two.toml", "--quiet", "--until", "0.02"]);
    assert!(done, "{message}");
    for call in [
        &["export", "two.mcap", "--format", "csv", "--out", "e"][..],
        &["plot", "two.mcap", "--at", "0", "--out", "p"],
    ] {
        let output = command(folder, call)
            .stdout(Stdio::piped())
            .output()
            .expect("it starts");
        assert!(output.status.success(), "{call:?}");
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        let there = names(&folder.join(call.last().expect("a folder"))).len();
        let told = match printed.split_once(" files") {
            Some((count, _)) => count.parse().expect("a number"),
            None => printed.lines().count(),
        };
        assert_eq!(told, there, "{printed}");
    }
    let first = std::fs::read(folder.join("e/the-plate-00001.csv")).expect("there");
    let second = std::fs::read(folder.join("e/the-plate-00001-2.csv")).expect("there");
    assert_ne!(first, second);
}

#[test]
fn a_run_is_resumed_with_the_files_that_it_began_with() {
    let folder = folder();
    let folder = folder.path();
    let line = WELD
        .lines()
        .find(|l| l.starts_with("toolpath.line"))
        .expect("there");
    let text = WELD.replace(line, "toolpath.table = { file = \"path.csv\" }");
    std::fs::write(folder.join("table.toml"), text).expect("writable");
    let path = "time,x,y,z,power\n0,0.004,0.005,0.004,2000\n1.2,0.016,0.005,0.004,2000\n";
    std::fs::write(folder.join("path.csv"), path).expect("writable");
    let (done, message) = told(folder, &["run", "table.toml", "--quiet", "--until", "0.05"]);
    assert!(done, "{message}");
    let inputs = Log::open(folder.join("table.mcap"))
        .expect("a log")
        .run()
        .inputs
        .clone();
    assert_eq!(inputs.len(), 1);
    assert_eq!(
        (&*inputs[0].path, inputs[0].bytes),
        ("path.csv", path.len() as u64)
    );
    let resume = ["resume", "table.mcap", "--quiet", "--until", "0.1"];
    std::fs::write(folder.join("path.csv"), path.replace("0.016", "0.012")).expect("writable");
    let (done, message) = told(folder, &resume);
    assert!(
        !done && message.contains("path.csv, which the case names, has changed"),
        "{message}"
    );
    std::fs::write(folder.join("path.csv"), path).expect("writable");
    let (done, message) = told(folder, &resume);
    assert!(done, "{message}");
}

#[test]
fn a_sweep_goes_on_after_it_was_killed_while_it_wrote_or_ran() {
    let folder = folder();
    let folder = folder.path();
    let text = WELD.replace("end = 1.5", "end = 0.2");
    std::fs::write(folder.join("short.toml"), text).expect("writable");
    let sweep = [
        "sweep",
        "short.toml",
        "--set",
        "couplers.goldak.power=[1500, 2000]",
        "--out",
        "s",
    ];
    // a case that was cut off by a full disk
    std::fs::create_dir(folder.join("s")).expect("a folder");
    std::fs::write(folder.join("s/1.toml"), "").expect("writable");
    let mut killed = command(folder, &sweep).spawn().expect("it starts");
    until("log of a run", || folder.join("s/1.mcap").exists());
    killed.kill().expect("it can be killed");
    killed.wait().expect("it ends");
    // its runs end with it, and the same command takes them up
    let (done, message) = told(folder, &sweep);
    assert!(done, "{message}");
    assert!(!message.contains("failed"), "{message}");
    let other = [
        "sweep",
        "short.toml",
        "--set",
        "couplers.goldak.power=[1000, 2000]",
        "--out",
        "s",
    ];
    let (done, message) = told(folder, &other);
    assert!(
        !done && message.contains("belongs to a sweep of other cases"),
        "{message}"
    );
}

#[test]
fn a_run_of_a_sweep_ends_with_the_sweep() {
    let folder = folder();
    let folder = folder.path();
    long_case(folder, "0.001");
    let sweep = [
        "sweep",
        "long.toml",
        "--set",
        "couplers.goldak.power=[1500]",
        "--out",
        "s",
    ];
    let mut killed = command(folder, &sweep).spawn().expect("it starts");
    let log = folder.join("s/1.mcap");
    until("log of the run", || log.exists());
    killed.kill().expect("it can be killed");
    killed.wait().expect("it ends");
    until("end of the run", || {
        Log::open(&log).is_ok_and(|log| log.finished())
    });
    assert!(
        !folder.join("s/.1.mcap.lock").exists() || {
            std::thread::sleep(Duration::from_secs(1));
            !folder.join("s/.1.mcap.lock").exists()
        }
    );
}

/// Two tasks of a job array share a sweep, each run of which a launcher starts; the task that ends last has the whole table.
#[test]
fn tasks_of_a_job_array_share_a_sweep() {
    let folder = folder();
    let folder = folder.path();
    let text = WELD.replace("end = 1.5", "end = 0.2");
    std::fs::write(folder.join("short.toml"), text).expect("writable");
    let sweep = |others: &[&str]| {
        let values = "couplers.goldak.power=[1000, 1500, 2000]";
        let sweep = ["sweep", "short.toml", "--set", values, "--out", "s"];
        told(folder, &[&sweep[..], others].concat())
    };
    let rows = || {
        let table = std::fs::read_to_string(folder.join("s/sweep.csv")).expect("a table");
        let is_at_end = |row: &&str| row.split(',').nth(2) == Some("yes");
        table.lines().filter(is_at_end).count()
    };
    let by_launcher = ["--launcher", "env PERIMELT_TASK=1"];
    let (done, message) = sweep(&[&by_launcher[..], &["--part", "1/2"]].concat());
    assert!(done && message.contains("3 of 3"), "{message}");
    assert!(!folder.join("s/2.mcap").exists());
    assert_eq!(rows(), 2);
    let (done, message) = sweep(&["--part", "2/2"]);
    assert!(done && !message.contains("3 of 3"), "{message}");
    assert_eq!(rows(), 3);
    for (wrong, expected) in [
        (["--part", "3/2"], "expected a number from 1"),
        (["--part", "0/2"], "expected a number from 1"),
        (["--launcher", " "], "expected a command"),
    ] {
        let (done, message) = sweep(&wrong);
        assert!(!done && message.contains(expected), "{message}");
    }
    std::fs::remove_file(folder.join("s/1.mcap")).expect("it is there");
    let (done, message) = sweep(&["--launcher", "no-such-launcher -n 2"]);
    assert!(
        !done && message.contains("cannot start no-such-launcher"),
        "{message}"
    );
}
