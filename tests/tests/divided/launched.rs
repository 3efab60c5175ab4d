//! The program started as several processes by a launcher of MPI.
//!
//! `PERIMELT_MPIEXEC` names the launcher; else it is `mpiexec`.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use perimelt_tests::last_checkpoint;

use super::build::BUILD;
use super::cases::{QUENCH, WELD, torn};
use super::collision::COLLISION;

const PROGRAM: &str = env!("CARGO_BIN_EXE_perimelt-tests");

/// Time that no run of these cases takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// The program as some processes of a folder, more than there are cores if need be.
fn launch(count: usize, folder: &Path, arguments: &[&str]) -> Command {
    let launcher = std::env::var("PERIMELT_MPIEXEC").unwrap_or_else(|_| "mpiexec".into());
    let version = Command::new(&launcher).arg("--version").output();
    let version = version.unwrap_or_else(|e| panic!("{launcher}: {e}")).stdout;
    let version = String::from_utf8_lossy(&version).to_lowercase();
    let mut command = Command::new(launcher);
    if version.contains("openrte") || version.contains("open mpi") {
        command.args(["--oversubscribe", "--bind-to", "none"]);
        command.arg("--allow-run-as-root");
    }
    command.args(["-n", &count.to_string(), PROGRAM]);
    command.args(arguments).current_dir(folder);
    command
}

/// Runs the command, which must succeed.
fn succeed(command: &mut Command) {
    let output = command.output().expect("it starts");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {told}");
}

fn write(folder: &Path, text: &str) {
    std::fs::write(folder.join("case.toml"), text).expect("writable");
}

/// The last checkpoint of a run of one process.
fn end_alone(folder: &Path) -> Vec<u8> {
    let arguments = ["run", "case.toml", "--quiet", "--out", "alone.mcap"];
    succeed(Command::new(PROGRAM).args(arguments).current_dir(folder));
    last_checkpoint(&folder.join("alone.mcap"))
}

/// A weld whose plate a process computes for seconds.
fn weld() -> String {
    WELD.replace("HORIZON", "1").replace("0.2", "0.05")
}

#[test]
fn processes_of_mpi_have_the_bits_of_one() {
    let heat = WELD.replace("HORIZON", "1");
    let quench = QUENCH.replace("FORMULATION", "staggered");
    let quench = quench.replace("KINEMATICS", "finite");
    let cases = [
        ("heat", heat, &[(2, 1), (2, 2), (4, 1)][..]),
        ("fracture", torn("finite", "energy"), &[(2, 1), (4, 2)]),
        ("metallurgy", quench, &[(2, 1)]),
        ("growth", BUILD.replace("HORIZON", "1"), &[(4, 1)]),
        ("contact", COLLISION.into(), &[(2, 1)]),
    ];
    for (name, text, runs) in cases {
        let folder = tempfile::tempdir().expect("a folder for logs");
        let folder = folder.path();
        write(folder, &text);
        let alone = end_alone(folder);
        for (count, threads) in runs {
            let (threads, log) = (threads.to_string(), format!("{count}-{threads}.mcap"));
            let arguments = ["run", "case.toml", "--quiet", "--threads", &threads];
            let mut run = launch(*count, folder, &arguments);
            succeed(run.args(["--out", &log]));
            let same = last_checkpoint(&folder.join(&log)) == alone;
            assert!(same, "{name}: {count} processes, {threads} threads");
        }
    }
}

/// Processes of the program that run in a folder, but for the launcher.
#[cfg(target_os = "linux")]
fn processes_in(folder: &Path) -> Vec<String> {
    let [folder, program] = [folder, PROGRAM.as_ref()].map(|p| p.canonicalize().expect("there"));
    let leads_to = |link: &Path, end: &Path| std::fs::read_link(link).is_ok_and(|to| to == end);
    let all = std::fs::read_dir("/proc").expect("processes").flatten();
    let own = all.filter(|process| {
        let path = process.path();
        leads_to(&path.join("exe"), &program) && leads_to(&path.join("cwd"), &folder)
    });
    own.map(|process| process.file_name().to_string_lossy().into_owned())
        .collect()
}

/// A run of several processes, one of which is killed, ends with a message, and its log goes on with another number of processes.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_process_ends_the_run_and_another_number_resumes_it() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let folder = folder.path();
    write(folder, &weld());
    let alone = end_alone(folder);
    let arguments = ["run", "case.toml", "--quiet", "--threads", "1"];
    let mut run = launch(2, folder, &arguments);
    let run = run.args(["--out", "killed.mcap"]).stderr(Stdio::piped());
    let run = run.stdout(Stdio::piped()).spawn().expect("it starts");
    let log = folder.join("killed.mcap");
    let started = Instant::now();
    let has_begun = || {
        // the first checkpoint is that of the start
        Log::open(&log).is_ok_and(|log| log.checkpoints().len() > 1)
    };
    while !has_begun() {
        assert!(started.elapsed() < PATIENCE, "no state is logged");
        std::thread::sleep(Duration::from_millis(20));
    }
    let processes = processes_in(folder);
    assert_eq!(processes.len(), 2, "{processes:?}");
    let kill = Command::new("kill").args(["-KILL", &processes[1]]).status();
    assert!(kill.expect("it starts").success());
    let ended = run.wait_with_output().expect("it ends");
    assert!(!ended.status.success());
    assert!(!ended.stderr.is_empty(), "the launcher tells what happened");
    assert!(last_checkpoint(&log) != alone);

    let arguments = ["resume", "killed.mcap", "--quiet", "--threads", "1"];
    succeed(&mut launch(3, folder, &arguments));
    assert!(last_checkpoint(&log) == alone);
}

/// The mistake of a case is told once, and ends all processes.
#[test]
fn a_mistake_is_told_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &weld().replace("efficiency", "eficiency"));
    let output = launch(3, folder, &["run", "case.toml"]).output();
    let output = output.expect("it starts");
    assert!(!output.status.success());
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(told.matches("case.toml").count(), 1, "{told}");
    assert!(told.contains("eficiency"), "{told}");
}
