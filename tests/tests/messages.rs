//! Mistakes that a user makes in calls of the program, and logs that cannot be used: the status and what the user is
//! told. The messages are in `snapshots/`.

#![cfg(unix)]

mod program;

use std::path::Path;
use std::process::Stdio;

use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// A folder with `weld.toml` and `weld.mcap`, a short weld and its log.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let case = WELD.replace("end = 1.5", "end = 0.1");
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    let run = command(folder.path(), &["run", "weld.toml", "--quiet"]).status();
    assert!(run.expect("it starts").success());
    folder
}

/// The calls, each with its status and message. A call that succeeds is a mistake of the test.
fn told(folder: &Path, calls: &[&str]) -> String {
    let mut told = String::new();
    for call in calls {
        let arguments: Vec<&str> = call.split_whitespace().collect();
        let output = command(folder, &arguments).stderr(Stdio::piped()).output();
        let output = output.expect("it starts");
        let status = output.status.code().expect("no signal");
        assert_ne!(status, 0, "`perimelt {call}` succeeds");
        // the program of the tests has another name
        let message = String::from_utf8_lossy(&output.stderr).replace("perimelt-tests", "perimelt");
        told += &format!("$ perimelt {call}\n{}\n[{status}]\n\n", message.trim_end());
    }
    told
}

/// Calls with arguments that do not exist, do not fit together, or name what is not there.
#[test]
fn mistakes_in_calls_are_explained() {
    let folder = folder();
    let calls = [
        "rnu weld.toml",
        "run",
        "run wled.toml",
        "run .",
        "run weld.mcap",
        "run weld.toml",
        "run weld.toml --treads 2",
        "run weld.toml --threads 0",
        "run weld.toml --threads 100000",
        "run weld.toml --until never",
        "run weld.toml --out no/such/folder/weld.mcap",
        "run weld.toml --force --set power=3000",
        "run weld.toml --force --set couplers.goldak.powr=3000",
        "run weld.toml --force --set couplers.goldak.power=fast",
        "run weld.toml --force --set couplers.goldak.power",
        "run weld.toml --force --set couplers.torch.power=3000",
        "run weld.toml --force --set time.end=-1",
        "check wled.toml",
        "resume wled.mcap",
        "resume weld.toml",
        "resume weld.mcap",
        "resume weld.mcap --until 0.02",
        "resume weld.mcap --case wled.toml",
        "info wled.mcap",
        "replay weld.mcap --at 75",
        "replay weld.mcap --at nan",
        "replay weld.mcap --at 0.05 --follow",
        "replay weld.mcap --field temprature",
        "replay weld.mcap --field temperature.x",
        "plot weld.mcap --field temprature",
        "plot weld.mcap --body plat",
        "plot weld.mcap --format gif",
        "plot weld.mcap --section w=0.01",
        "plot weld.mcap --section x",
        "plot weld.mcap --section x=9",
        "plot weld.mcap --range 5",
        "plot weld.mcap --range 900,300",
        "plot weld.mcap --deform much",
        "plot weld.mcap --width 3",
        "plot weld.mcap --at 0.05 --film film.gif",
        "plot weld.mcap --film film.avi",
        "plot weld.mcap --film film.gif --frames 0",
        "export weld.mcap --field temprature",
        "export weld.mcap --every 0",
        "export weld.mcap --format stl",
        "export weld.mcap --out weld.toml",
        "trim weld.mcap",
        "trim weld.mcap --from 0.08 --to 0.02 --out cut.mcap",
        "trim weld.mcap --from 5 --out cut.mcap",
        "trim weld.mcap --out weld.mcap",
        "diff weld.mcap",
        "diff weld.mcap wled.mcap",
        "diff weld.mcap weld.mcap --tolerance -1",
        "diff weld.mcap weld.mcap --field temprature",
        "summary weld.mcap --travel w",
        "summary weld.mcap --isotherm hot",
        "explain goldack",
        "explain goldak.powr",
        "explain t8/5",
        "new wled",
        "new weld --out weld.toml",
        "completions tcsh",
        "sweep weld.toml",
        "sweep weld.toml --set couplers.goldak.power=2000",
        "sweep weld.toml --set couplers.goldak.power=[]",
        "sweep weld.toml --set couplers.goldak.powr=[1,2]",
        "view wled.mcap",
        "view weld.mcap --port 99999",
        "verify no-such-case",
        "verify --level weekly",
        "verify --report wled.json",
    ];
    insta::assert_snapshot!(told(folder.path(), &calls));
}

/// Files that are no logs, or logs of which too little is left.
#[test]
fn logs_that_cannot_be_used_are_explained() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let log = std::fs::read(path("weld.mcap")).expect("readable");
    let write = |name: &str, bytes: &[u8]| std::fs::write(path(name), bytes).expect("writable");
    write("empty.mcap", b"");
    write("text.mcap", b"Dear diary, today I welded a plate.");
    // the mark of the format, and no record
    write("mark.mcap", &log[..8]);
    write("first.mcap", &log[..200]);
    let mut version = log.clone();
    version[5] = b'9';
    write("version.mcap", &version);
    // a length that reaches beyond the end, in the record behind the header: always at one place, unlike in compressed records
    let mut header = [0; 8];
    header.copy_from_slice(&log[9..17]);
    let second = 17 + u64::from_le_bytes(header) as usize;
    let damaged = [&log[..=second], &[0xff; 8], &[0x55; 200], &log[..8]].concat();
    write("damaged.mcap", &damaged);
    let calls: Vec<String> = ["empty", "text", "mark", "first", "version", "damaged"]
        .iter()
        .flat_map(|log| {
            ["info", "summary", "resume", "plot"].map(|command| format!("{command} {log}.mcap"))
        })
        .collect();
    let calls: Vec<&str> = calls.iter().map(String::as_str).collect();
    insta::assert_snapshot!(told(folder.path(), &calls));
}
