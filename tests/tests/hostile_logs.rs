//! Logs that somebody made to do harm get an error or are shown as far as they are sound: no command panics, hangs, takes
//! much memory, obeys the log, or goes on from a state that no run can have.
#![cfg(unix)]

mod hostile;
mod limited;
mod program;

use std::path::Path;
use std::sync::LazyLock;

use hostile::{Checkpoint, Forgery};
use limited::{Ended, run};
use perimelt_core::log::Log;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");

/// The log of a run that stopped on its way.
static LOG: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let case = WELD.replace("end = 1.5", "end = 0.2");
    std::fs::write(folder.join("weld.toml"), case).expect("writable");
    let until = ["run", "weld.toml", "--quiet", "--until", "0.1"];
    assert!(
        command(folder, &until)
            .status()
            .expect("it starts")
            .success()
    );
    std::fs::read(folder.join("weld.mcap")).expect("readable")
});

fn forged(change: impl FnOnce(&mut Forgery)) -> Vec<u8> {
    let mut forgery = Forgery::of(&LOG);
    change(&mut forgery);
    forgery.bytes()
}

/// The commands that read a log.
const READERS: [&[&str]; 6] = [
    &["info", "x.mcap"],
    &["summary", "x.mcap"],
    &["replay", "x.mcap"],
    &["export", "x.mcap", "--format", "csv"],
    &["plot", "x.mcap", "--at", "0.1"],
    &["resume", "x.mcap", "--quiet", "--out", "y.mcap", "--force"],
];

/// Every command ends by itself, in the limits of memory and time, with an error or without one.
fn read_all(log: &[u8], what: &str) -> Vec<Ended> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("x.mcap"), log).expect("writable");
    let read = |call: &&[&str]| {
        let ended = run(folder.path(), call);
        let Ended { status, errors, .. } = &ended;
        assert!(
            matches!(status, Some(0 | 1)) && !errors.contains("panicked"),
            "{what}: {call:?} ended with {status:?}\n{errors}"
        );
        ended
    };
    READERS.iter().map(read).collect()
}

#[test]
fn a_chunk_that_unpacks_to_hundreds_of_megabytes_takes_no_memory() {
    for topic in ["/progress", "/index", "/plate/points"] {
        let log = forged(|f| {
            f.compressed = true;
            f.change(topic, |message| message.data = Vec::new());
            let mut messages = f.messages.iter_mut();
            let bomb = messages.find(|m| m.topic == topic).expect("there");
            bomb.data = vec![0; 400 << 20];
        });
        assert!(log.len() < 1 << 20, "{}", log.len());
        let ended = read_all(&log, topic);
        let told = &ended[0].output;
        // a state is unpacked when it is asked for only
        assert!(
            told.contains("is damaged") || topic == "/plate/points",
            "{told}"
        );
    }
}

#[test]
fn a_path_that_a_log_names_is_not_read_unless_it_is_a_small_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("it starts").success());
    for path in [Path::new("/dev/zero"), &pipe] {
        let name = serde_json::to_string(&path).expect("text");
        let log = forged(|f| {
            f.run.insert("case_file".into(), name);
        });
        let ended = read_all(&log, "a path");
        assert_eq!(ended[5].status, Some(0), "{}", ended[5].errors);
    }
}

#[test]
fn control_characters_of_a_log_do_not_reach_the_terminal() {
    let escape = "\u{1b}]0;owned\u{7}\u{9b}2J";
    let log = forged(|f| {
        f.case = f
            .case
            .replace("A short weld", "A \\u001b]0;owned\\u0007 weld");
        f.run
            .insert("version".into(), serde_json::json!(escape).to_string());
        f.run
            .insert("case_file".into(), serde_json::json!(escape).to_string());
        let json = serde_json::json!(escape).to_string();
        let inside = json.trim_matches('"');
        let bodies = f.run["bodies"].replace("\"K\"", &format!("\"{inside}\""));
        f.run
            .insert("bodies".into(), bodies.replace("enthalpy", inside));
        for message in &mut f.messages {
            if message.topic.starts_with("/probes/") {
                message.topic += escape;
                let schema = String::from_utf8_lossy(&message.schema.2);
                message.schema.2 = schema.replace("\"K\"", &json).into_bytes();
            }
        }
    });
    for Ended { output, errors, .. } in read_all(&log, "escapes") {
        let has_control = |text: &str| text.chars().any(|c| c.is_control() && c != '\n');
        assert!(!has_control(&output), "{output:?}");
        assert!(!has_control(&errors), "{errors:?}");
    }
    // files are text, too
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("x.mcap"), &log).expect("writable");
    for call in [
        &["export", "x.mcap", "--format", "csv", "--out", "out"][..],
        &["plot", "x.mcap", "--at", "0.1", "--out", "out"],
    ] {
        run(folder.path(), call);
    }
    for entry in std::fs::read_dir(folder.path().join("out")).expect("written") {
        let path = entry.expect("readable").path();
        let name = path.to_string_lossy().into_owned();
        assert!(!name.chars().any(char::is_control), "{name:?}");
        if name.ends_with(".csv") || name.ends_with(".svg") {
            let text = std::fs::read_to_string(&path).expect("text");
            assert!(
                !text.contains('\u{1b}') && !text.contains('\u{9b}'),
                "{name}"
            );
        }
    }
}

#[test]
fn checkpoints_that_no_run_can_have_are_refused() {
    type Change = fn(&mut Checkpoint);
    let changes: [(&str, Change); 17] = [
        ("no time of a physics", |c| c.clock.advanced_to.clear()),
        ("no sub-steps", |c| c.clock.progress.sub_steps.clear()),
        ("no iterations", |c| c.clock.progress.iterations.clear()),
        ("no evaluations", |c| c.clock.progress.evaluations.clear()),
        ("too many", |c| c.clock.progress.evaluations.push(1)),
        ("counts that overflow", |c| {
            c.clock.progress.sub_steps[0] = u64::MAX;
        }),
        ("a step that overflows", |c| {
            c.clock.progress.macro_steps = u64::MAX
        }),
        ("a physics far behind", |c| c.clock.advanced_to[0] = -1e6),
        ("a physics ahead", |c| c.clock.advanced_to[0] = 1e6),
        ("a time that is not a number", |c| c.clock.time = f64::NAN),
        ("a time before the start", |c| {
            c.clock.time = -1.0;
            c.clock.advanced_to[0] = -1.0;
        }),
        ("no fields", |c| c.fields.clear()),
        ("a field less", |c| c.fields.truncate(1)),
        ("a field twice", |c| {
            let first = c.fields[0].clone();
            c.fields.push(first);
        }),
        ("a field of a body that is not there", |c| {
            c.fields[0].body = 7
        }),
        ("values that are not finite", |c| {
            let temperature = c.fields.iter_mut().find(|f| f.name == "temperature");
            temperature.expect("there").values[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        }),
        ("no state of a physics", |c| c.physics.clear()),
    ];
    for (what, change) in changes {
        let log = forged(|f| f.change_checkpoint(change));
        let ended = read_all(&log, what);
        let Ended { status, errors, .. } = &ended[5];
        assert_eq!(*status, Some(1), "{what}: {errors}");
        assert!(errors.starts_with("error: "), "{what}: {errors}");
    }
    // one that is not changed is taken
    let ended = read_all(&forged(|f| f.change_checkpoint(|_| {})), "unchanged");
    assert_eq!(ended[5].status, Some(0), "{}", ended[5].errors);
}

#[test]
fn numbers_and_messages_that_cannot_be_parsed_are_left_out_alone() {
    let whole = Forgery::of(&LOG);
    let rows = |topic: &str| whole.messages.iter().filter(|m| m.topic == topic).count();
    for topic in ["/progress", "/balance", "/probes/base"] {
        for text in [&b"{\"time\": 1e999}"[..], b"[[[[", b"\xff", b""] {
            let log = forged(|f| {
                let mut messages = f.messages.iter_mut();
                let first = messages.find(|m| m.topic == topic).expect("there");
                first.data = text.into();
            });
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("x.mcap");
            std::fs::write(&path, &log).expect("writable");
            let log = Log::open(&path).expect("the log opens");
            assert_eq!(log.damage().len(), 1, "{:?}", log.damage());
            let count = match topic {
                "/progress" => log.progress().len(),
                "/balance" => log.balance().times.len(),
                _ => log.probes()["base"].times.len(),
            };
            assert_eq!(count, rows(topic) - 1, "{topic}");
            log.cloud("plate", 2).expect("the states are sound");
        }
    }
}

/// Any bit of the case file and of the description of the run.
#[test]
fn a_flipped_bit_before_the_states_leaves_them_readable() {
    let log = forged(|_| {});
    let expected = states(&log).expect("sound");
    assert!(expected > 3);
    let first_chunk = first_chunk(&log);
    let folder = tempfile::tempdir().expect("a folder");
    // the magic and the header say that the file is a log
    let header = 8 + 9 + u64::from_le_bytes(log[9..17].try_into().expect("eight")) as usize;
    let mut resumable = 0;
    for (number, at) in (header..first_chunk).step_by(7).enumerate() {
        let mut flipped = log.clone();
        flipped[at] ^= 1 << (number % 8);
        let found = states(&flipped);
        assert_eq!(found, Some(expected), "byte {at} of {first_chunk}");
        // a case that may be another one is not resumed
        if number % 40 == 0 {
            std::fs::write(folder.path().join("x.mcap"), &flipped).expect("writable");
            let call = ["resume", "x.mcap", "--quiet", "--out", "y.mcap", "--force"];
            let Ended { status, errors, .. } = run(folder.path(), &call);
            assert!(!errors.contains("panicked"), "{errors}");
            resumable += usize::from(status == Some(0));
        }
    }
    assert!(resumable < 20);
}

/// Number of states of all bodies that can be read.
fn states(log: &[u8]) -> Option<usize> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.mcap");
    std::fs::write(&path, log).expect("writable");
    let log = Log::open(&path).ok()?;
    let sound = |body: &str| {
        let indexes = 0..log.times(body).len();
        indexes.filter(|i| log.cloud(body, *i).is_ok()).count()
    };
    Some(log.bodies().map(sound).sum())
}

/// Start of the first chunk of a log.
fn first_chunk(log: &[u8]) -> usize {
    let mut at = 8;
    loop {
        let length = u64::from_le_bytes(log[at + 1..at + 9].try_into().expect("eight"));
        if log[at] == 6 {
            return at;
        }
        at += 9 + length as usize;
    }
}

#[test]
fn numbers_of_a_point_cloud_without_an_end_are_damage() {
    let log = forged(|f| {
        f.change("/plate/points", |message| {
            message.data = vec![0xff; 1 << 20]
        });
    });
    for Ended { status, errors, .. } in &read_all(&log, "varints")[1..5] {
        assert!(*status == Some(0) || errors.contains("error: "), "{errors}");
    }
}
