//! Commands with limited memory and time.
#![allow(dead_code)] // not every test uses all of it

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SLOWEST: Duration = Duration::from_secs(60);
/// Address space of a command, KiB.
const MEMORY: u32 = 1 << 20;

/// How a command ended, and what it printed.
pub struct Ended {
    pub status: Option<i32>,
    pub output: String,
    pub errors: String,
}

/// Runs a command with limited memory, until it ends or takes too long.
pub fn run(folder: &Path, arguments: &[&str]) -> Ended {
    let program = env!("CARGO_BIN_EXE_perimelt-tests");
    let limited = format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\"");
    let mut child = Command::new("sh")
        .current_dir(folder)
        .args(["-c", &limited, program])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    // what is not read keeps a command from going on
    let mut output = child.stdout.take().expect("it is piped");
    let output = std::thread::spawn(move || {
        let mut text = Vec::new();
        output.read_to_end(&mut text).map(|_| text)
    });
    let started = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("it can be waited for") {
            break status;
        }
        if started.elapsed() > SLOWEST {
            child.kill().expect("it can be killed");
            panic!("{arguments:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let mut errors = String::new();
    let pipe = child.stderr.as_mut().expect("it is piped");
    pipe.read_to_string(&mut errors).expect("it is text");
    let output = output.join().expect("it is read").expect("readable");
    Ended {
        status: status.code(),
        output: String::from_utf8_lossy(&output).into_owned(),
        errors,
    }
}
