//! Round trips, cut and damaged files, resumed logs.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

mod cut;
mod damage;
mod follow;
mod resume;

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::*;

const BODY: &str = "plate";
const CASE: &str = "[case]\nname = \"test\"\n";

/// The log of the same run from a checkpoint on.
fn continued(old: &Log, path: impl AsRef<Path>, checkpoint: usize) -> Result<Writer, LogError> {
    let header = RunHeader {
        run: old.run(),
        case_name: old.case_name(),
        case_text: old.case_text(),
    };
    Writer::continue_from(old, Destination::create(path)?, checkpoint, header)
}

fn run_info() -> RunInfo {
    let field = |name: &str, unit: &str, components| FieldInfo {
        name: name.into(),
        unit: unit.into(),
        components,
    };
    RunInfo {
        inputs: Vec::new(),
        version: "0.1.0".into(),
        threads: 2,
        started: 1_700_000_000,
        case_folder: "cases".into(),
        bodies: vec![BodyInfo {
            name: BODY.into(),
            dimension: 3,
            spacing: 1e-4,
            thickness: 1e-4,
            points: 40,
            symmetry: vec![Face::YMin],
            lattice: None,
            plies: Vec::new(),
            fields: vec![
                field("temperature", "K", 1),
                field("velocity", "m/s", 3),
                field("stress", "Pa", 9),
            ],
        }],
        plugins: serde_json::json!({"physics": [{"type": "thermal", "horizon": 3.015}]}),
    }
}

/// Numbers without a short decimal or binary form, different for every seed.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    (0..count)
        .map(|i| ((seed * 977 + i as u64) as f64 * 0.7391).sin() * 1234.5678)
        .collect()
}

fn some_cloud(time: f64, points: usize, seed: u64) -> LoggedCloud {
    let coordinates = numbers(3 * points, seed);
    let field = |name: &str, unit: &str, components: usize| CloudField {
        name: name.into(),
        unit: unit.into(),
        components,
        values: numbers(components * points, seed + components as u64),
    };
    LoggedCloud {
        time,
        positions: coordinates
            .chunks_exact(3)
            .map(|p| [p[0], p[1], p[2]])
            .collect(),
        fields: vec![
            field("temperature", "K", 1),
            field("velocity", "m/s", 3),
            field("stress", "Pa", 9),
        ],
    }
}

fn log_cloud(
    writer: &mut Writer,
    precision: Precision,
    cloud: &LoggedCloud,
) -> Result<(), LogError> {
    let fields: Vec<_> = cloud
        .fields
        .iter()
        .map(|f| FieldView {
            name: &f.name,
            components: f.components,
            values: &f.values,
        })
        .collect();
    let view = CloudView {
        time: cloud.time,
        positions: Coordinates::Listed(&cloud.positions),
        fields: &fields,
    };
    writer.points(BODY, precision, &view)
}

fn create(path: &Path) -> Writer {
    Writer::create(path, &run_info(), "test.toml", CASE).expect("a fresh file")
}

fn time_of(step: u64) -> f64 {
    step as f64 * 1e-3 / 7.0
}

/// One step of a run with everything a log can hold; the checkpoint comes last.
fn log_step(writer: &mut Writer, step: u64, points: usize) {
    let time = time_of(step);
    log_cloud(writer, Precision::F64, &some_cloud(time, points, step)).expect("logs points");
    let value = numbers(1, step)[0];
    writer
        .probe("tip", time, &[Entry::new("temperature", "K", value)])
        .expect("logs a probe");
    writer
        .balance(
            time,
            &[
                Entry::new("stored", "J", value),
                Entry::new("error", "J", 1e-9),
            ],
        )
        .expect("logs balance");
    let progress = Progress {
        time,
        step,
        step_size: 1e-3 / 7.0,
        ..Default::default()
    };
    writer.progress(&progress).expect("logs progress");
    let state: Vec<u8> = numbers(points, step)
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    writer
        .checkpoint(time, step, |out| -> Result<(), LogError> {
            out.write_all(&state).expect("is gathered");
            Ok(())
        })
        .expect("logs a checkpoint");
    writer.flush().expect("flushes");
}

/// A folder with the finished log of some steps.
fn logged(steps: u64, points: usize) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    for step in 0..steps {
        log_step(&mut writer, step, points);
    }
    writer.finish().expect("finishes");
    (folder, path)
}

/// Everything a reader sees but the checkpoints.
fn assert_same_content(left: &Log, right: &Log) {
    assert_eq!(left.run(), right.run());
    assert_eq!(
        (left.case_name(), left.case_text()),
        (right.case_name(), right.case_text())
    );
    assert_eq!(left.probes(), right.probes());
    assert_eq!(left.balance(), right.balance());
    assert_eq!(left.progress(), right.progress());
    assert_eq!(left.times(BODY), right.times(BODY));
    for index in 0..left.times(BODY).len() {
        assert_eq!(
            left.cloud(BODY, index).unwrap(),
            right.cloud(BODY, index).unwrap()
        );
    }
}

#[test]
fn messages_of_a_channel_are_numbered_one_after_the_other() {
    let (_folder, path) = logged(4, 40);
    let bytes = std::fs::read(path).unwrap();
    let mut next: std::collections::BTreeMap<String, u32> = Default::default();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let due = next
            .entry(message.channel.topic.clone())
            .or_insert(message.sequence);
        assert_eq!(message.sequence, *due, "{}", message.channel.topic);
        *due += 1;
    }
    assert!(next.len() > 3, "{next:?}");
}

#[test]
fn what_was_written_is_read_back() {
    let (_folder, path) = logged(3, 40);
    let log = Log::open(path).unwrap();
    assert!(log.finished());
    assert_eq!(log.run(), &run_info());
    assert_eq!((log.case_name(), log.case_text()), ("test.toml", CASE));
    assert_eq!(log.bodies().collect::<Vec<_>>(), [BODY]);
    let times: Vec<f64> = (0..3).map(time_of).collect();
    assert_eq!(log.times(BODY), times);
    for step in 0..3 {
        let index = step as usize;
        assert_eq!(
            log.cloud(BODY, index).unwrap(),
            some_cloud(times[index], 40, step)
        );
        assert_eq!(
            log.checkpoints()[index],
            CheckpointInfo {
                time: times[index],
                step
            }
        );
        assert_eq!(log.checkpoint(index).unwrap().len(), 40 * 8);
        assert_eq!(log.progress()[index].step, step);
    }
    let tip = &log.probes()["tip"];
    assert_eq!(tip.times, times);
    let values = (0..3).map(|step| numbers(1, step)[0]).collect();
    let column = |name: &str, unit: &str, values| Column {
        name: name.into(),
        unit: unit.into(),
        values,
    };
    assert_eq!(tip.columns, [column("temperature", "K", values)]);
    assert_eq!(
        log.balance().columns[1],
        column("error", "J", vec![1e-9; 3])
    );
}

#[test]
fn large_messages_are_read_back_too() {
    // 20 000 points of 16 numbers: each cloud is in a separate chunk, which is not unpacked on opening
    let (_folder, path) = logged(2, 20_000);
    let log = Log::open(path).unwrap();
    assert_eq!(log.times(BODY), [time_of(0), time_of(1)]);
    assert_eq!(
        log.cloud(BODY, 1).unwrap(),
        some_cloud(time_of(1), 20_000, 1)
    );
    assert_eq!(
        log.checkpoints()[1],
        CheckpointInfo {
            time: time_of(1),
            step: 1
        }
    );
}

/// Topics of a log with the number of messages and of points on each, by the public reader.
fn counted_by_public_reader(path: &Path) -> Vec<(String, usize)> {
    let bytes = std::fs::read(path).expect("exists");
    let mut counts = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a whole message");
        *counts.entry(message.channel.topic.clone()).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

/// 128 bytes a point (16 numbers of f64) and 320 bytes of a checkpoint.
#[test]
fn a_state_beyond_the_limit_is_split_and_read_back_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    writer.part_bytes = 128 * 15 + 127;
    for step in 0..3 {
        log_step(&mut writer, step, 40);
    }
    writer.part_bytes = 100;
    log_step(&mut writer, 3, 40);
    writer.finish().unwrap();
    let (_folder, whole) = logged(4, 40);
    let (whole, log) = (Log::open(whole).unwrap(), Log::open(&path).unwrap());
    assert_same_content(&log, &whole);
    for index in 0..4 {
        assert_eq!(
            log.checkpoint(index).unwrap(),
            whole.checkpoint(index).unwrap()
        );
    }

    let counts = counted_by_public_reader(&path);
    let count = |topic: &str| {
        let found = counts.iter().find(|(name, _)| name == topic);
        found.map_or(0, |(_, count)| *count)
    };
    // 15 + 15 + 10 points three times, then one point a message
    assert_eq!(["/plate/points", "/plate/points/3"].map(count), [4, 4]);
    assert_eq!(["/plate/points/4", "/plate/points/40"].map(count), [1, 1]);
    assert_eq!(count("/plate/points/41"), 0);
    assert_eq!(
        ["/checkpoint", "/checkpoint/2", "/checkpoint/4"].map(count),
        [4, 1, 1]
    );
    assert_eq!(log.times(BODY).len(), 4);

    let resumed = folder.path().join("resumed.mcap");
    let mut writer = continued(&log, &resumed, 3).unwrap();
    log_step(&mut writer, 4, 40);
    writer.finish().unwrap();
    let resumed = Log::open(resumed).unwrap();
    assert_eq!(
        resumed.cloud(BODY, 3).unwrap(),
        whole.cloud(BODY, 3).unwrap()
    );
    assert_eq!(resumed.checkpoints().len(), 3);
    assert_eq!(resumed.checkpoint(1).unwrap(), whole.checkpoint(3).unwrap());
}

#[test]
fn a_log_cut_between_the_parts_of_a_state_lacks_that_state() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    writer.part_bytes = 128 * 4_000;
    let lengths: Vec<u64> = (0..2)
        .map(|step| {
            let cloud = some_cloud(time_of(step), 20_000, step);
            log_cloud(&mut writer, Precision::F64, &cloud).unwrap();
            writer.flush().unwrap();
            std::fs::metadata(&path).unwrap().len()
        })
        .collect();
    std::mem::forget(writer);
    let bytes = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    // all chunks are equally long but for rounding: in the second state, after one of five, ..., four
    for part in 1..5 {
        let end = lengths[0] + (lengths[1] - lengths[0]) * part / 5;
        std::fs::write(&cut, &bytes[..end as usize]).unwrap();
        let log = Log::open(&cut).unwrap();
        assert_eq!(log.times(BODY), [time_of(0)]);
        let expected = some_cloud(time_of(0), 20_000, 0);
        assert_eq!(log.cloud(BODY, 0).unwrap(), expected);
    }
    std::fs::write(&cut, &bytes[..lengths[1] as usize]).unwrap();
    assert_eq!(Log::open(&cut).unwrap().times(BODY).len(), 2);
}

#[test]
fn single_precision_rounds_and_nothing_more() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    let cloud = some_cloud(0.0, 40, 5);
    log_cloud(&mut writer, Precision::F32, &cloud).unwrap();
    writer.finish().unwrap();
    let read = Log::open(path).unwrap().cloud(BODY, 0).unwrap();
    let rounded = |value: f64| f64::from(value as f32);
    assert_eq!(read.positions[7], cloud.positions[7].map(rounded));
    for (read, written) in read.fields.iter().zip(&cloud.fields) {
        let expected: Vec<f64> = written.values.iter().copied().map(rounded).collect();
        assert_eq!(read.values, expected);
    }
}

#[test]
fn times_below_a_nanosecond_stay_apart_and_exact() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    let times: Vec<f64> = (0..20).map(|i| i as f64 * 1e-15 / 3.0).collect();
    for &time in &times {
        log_cloud(&mut writer, Precision::F64, &some_cloud(time, 4, 1)).unwrap();
        writer
            .probe("tip", time, &[Entry::new("temperature", "K", f64::NAN)])
            .unwrap();
    }
    writer.finish().unwrap();
    let log = Log::open(path).unwrap();
    assert_eq!(log.times(BODY), times);
    assert_eq!(log.probes()["tip"].times, times);
    assert!(
        log.probes()["tip"].columns[0]
            .values
            .iter()
            .all(|value| value.is_nan())
    );
}

#[test]
fn a_dropped_writer_leaves_a_readable_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    log_step(&mut writer, 0, 4);
    drop(writer);
    assert_eq!(Log::open(path).unwrap().progress().len(), 1);
}

#[test]
fn other_files_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    let refusal = || Log::open(&path).err().expect("refused").to_string();
    assert!(
        refusal().contains("could not read the log"),
        "{}",
        refusal()
    );
    for content in ["", "short", "a text file, longer than any magic number"] {
        std::fs::write(&path, content).unwrap();
        assert!(refusal().contains("is not an MCAP file"), "{}", refusal());
    }
    // a run that was killed before it wrote anything
    std::fs::write(&path, mcap::MAGIC).unwrap();
    assert!(
        refusal().contains("the file was cut off at byte 8"),
        "{}",
        refusal()
    );
    let mut other = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    other.finish().unwrap();
    assert!(
        refusal().contains("not the log of a Perimelt run"),
        "{}",
        refusal()
    );
}

#[test]
fn mistakes_in_logging_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    let good = some_cloud(0.0, 4, 1);
    let view = CloudView {
        time: 0.0,
        positions: Coordinates::Listed(&good.positions),
        fields: &[],
    };
    let unknown = writer.points("plat", Precision::F32, &view).unwrap_err();
    assert!(unknown.to_string().contains("`plate`"), "{unknown}");

    let mut short = good.clone();
    short.fields[1].values.pop();
    let error = log_cloud(&mut writer, Precision::F32, &short).unwrap_err();
    assert!(
        matches!(
            error,
            LogError::FieldLength {
                expected: 12,
                found: 11,
                ..
            }
        ),
        "{error}"
    );
    let mut coordinate = good.clone();
    coordinate.fields[0].name = "x".into();
    let error = log_cloud(&mut writer, Precision::F32, &coordinate).unwrap_err();
    assert!(matches!(error, LogError::Field { .. }), "{error}");
    let never = LoggedCloud {
        time: f64::NAN,
        ..good
    };
    let error = log_cloud(&mut writer, Precision::F32, &never).unwrap_err();
    assert!(matches!(error, LogError::Time { .. }), "{error}");

    writer
        .probe("tip", 0.0, &[Entry::new("a", "K", 1.0)])
        .unwrap();
    let error = writer
        .probe("tip", 1.0, &[Entry::new("b", "K", 1.0)])
        .unwrap_err();
    assert!(matches!(error, LogError::Columns { .. }), "{error}");

    let mut run = run_info();
    for name in ["", "probes", "a/b"] {
        run.bodies[0].name = name.into();
        let refused = Writer::create(&path, &run, "test.toml", CASE);
        assert!(matches!(refused, Err(LogError::BodyName { .. })));
    }
}
