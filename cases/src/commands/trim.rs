//! `perimelt trim`: cuts a time window out of a log.

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use perimelt_core::log::{
    CloudView, Coordinates, Destination, FieldView, Log, LogError, LoggedCloud, Precision, Writer,
};

use super::Done;
use crate::log_file::fit_f32;
use crate::log_file::open_log;
use crate::log_file::skip_damaged;
use crate::output::{Existing, LogPlace};
use crate::terminal::tell;

#[derive(clap::Args, Debug)]
pub struct TrimArgs {
    /// The log
    log: PathBuf,
    /// First time to keep, s [default: that of the first state]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Last time to keep, s [default: that of the last state]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    to: Option<f64>,
    /// The new log
    #[arg(long, short)]
    out: PathBuf,
    /// Replace the new log if it exists
    #[arg(long)]
    force: bool,
}

/// Why a log cannot be cut.
#[derive(Debug, thiserror::Error)]
enum TrimError {
    #[error("`--{key}` is {value}, expected a time in s")]
    NotATime { key: &'static str, value: f64 },
    #[error("`--from {from}` is after `--to {to}`")]
    Reversed { from: f64, to: f64 },
    #[error(
        "no logged state lies {}; the log has states from {first} to {last} s",
        if from > last {
            format!("at {from} s or later")
        } else if to < first {
            format!("at {to} s or earlier")
        } else {
            format!("between {from} and {to} s")
        }
    )]
    NothingInside {
        from: f64,
        to: f64,
        first: f64,
        last: f64,
    },
    #[error("{} contains no state", .0.display())]
    Empty(PathBuf),
    #[error("{} is the log to cut; give another `--out`", .0.display())]
    SameFile(PathBuf),
}

/// A logged item, in the order of the items of one time: a checkpoint comes last, as in a run.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Item {
    Cloud { body: String, index: usize },
    Probe { name: String, row: usize },
    Balance { row: usize },
    Progress { index: usize },
    Checkpoint { index: usize },
}

/// Contents of the new log.
#[derive(Debug, Default)]
struct Kept {
    states: usize,
    checkpoints: usize,
    span: Option<(f64, f64)>,
}

pub fn run(args: &TrimArgs) -> Done {
    let log = open_log(&args.log)?;
    let window = window(&log, args)?;
    if let (Ok(new), Ok(old)) = (args.out.canonicalize(), args.log.canonicalize())
        && new == old
    {
        return Err(TrimError::SameFile(args.out.clone()).into());
    }
    let place = LogPlace::claim(&args.out, Existing::Keep.unless(args.force))?;
    let mut part = place.begin()?;
    let kept = copy(&log, &window, part.destination())?;
    part.put_in_place()?;
    let (from, to) = kept.span.unwrap_or(window.into_inner());
    let checkpoints = match kept.checkpoints {
        0 => "no checkpoint, so that it cannot be resumed".to_string(),
        1 => "1 checkpoint".into(),
        count => format!("{count} checkpoints"),
    };
    writeln!(
        crate::terminal::output(),
        "{}: {} states from {from} to {to} s, {checkpoints}",
        args.out.display(),
        kept.states
    )?;
    Ok(())
}

/// First and last time to keep (s), with slack for times that were printed with fewer digits.
fn window(log: &Log, args: &TrimArgs) -> Result<RangeInclusive<f64>, TrimError> {
    let times = || log.bodies().flat_map(|body| log.times(body)).copied();
    let first = times().fold(f64::INFINITY, f64::min);
    let last = times().fold(f64::NEG_INFINITY, f64::max);
    if first > last {
        return Err(TrimError::Empty(args.log.clone()));
    }
    let from = args
        .from
        .unwrap_or_else(|| args.to.map_or(first, |to| to.min(first)));
    let to = args.to.unwrap_or_else(|| from.max(last));
    for (key, value) in [("from", from), ("to", to)] {
        if !value.is_finite() {
            return Err(TrimError::NotATime { key, value });
        }
    }
    if from > to {
        return Err(TrimError::Reversed { from, to });
    }
    let slack = 1e-6 * (last - first);
    let window = from - slack..=to + slack;
    if times().any(|time| window.contains(&time)) {
        return Ok(window);
    }
    Err(TrimError::NothingInside {
        from,
        to,
        first,
        last,
    })
}

/// Everything in the window, by time.
fn items(log: &Log, window: &RangeInclusive<f64>) -> Vec<(f64, Item)> {
    let mut items = Vec::new();
    let mut add = |time: f64, item: Item| {
        if window.contains(&time) {
            items.push((time, item));
        }
    };
    for name in log.bodies() {
        for (index, &time) in log.times(name).iter().enumerate() {
            let body = name.to_owned();
            add(time, Item::Cloud { body, index });
        }
    }
    for (name, series) in log.probes() {
        for (row, &time) in series.times.iter().enumerate() {
            let name = name.clone();
            add(time, Item::Probe { name, row });
        }
    }
    for (row, &time) in log.balance().times.iter().enumerate() {
        add(time, Item::Balance { row });
    }
    for (index, progress) in log.progress().iter().enumerate() {
        add(progress.time, Item::Progress { index });
    }
    for (index, checkpoint) in log.checkpoints().iter().enumerate() {
        add(checkpoint.time, Item::Checkpoint { index });
    }
    items.sort_by(|(a, x), (b, y)| a.total_cmp(b).then(x.cmp(y)));
    items
}

/// Writes the items of the window into a new log, one point cloud in memory at a time.
fn copy(log: &Log, window: &RangeInclusive<f64>, to: Destination) -> Result<Kept, LogError> {
    let mut writer = Writer::begin(to, log.run(), log.case_name(), log.case_text())?;
    let mut kept = Kept::default();
    let first_body = log.bodies().next().unwrap_or_default();
    for (time, item) in items(log, window) {
        match item {
            Item::Cloud { body, index } => {
                let Some(cloud) = skip_damaged(log.cloud(&body, index))? else {
                    continue;
                };
                write_cloud(&mut writer, &body, &cloud)?;
                if body == first_body {
                    kept.states += 1;
                    let from = kept.span.map_or(time, |(from, _)| from);
                    kept.span = Some((from, time));
                }
            }
            Item::Probe { name, row } => {
                writer.probe(&name, time, &log.probes()[&name].row(row))?;
            }
            Item::Balance { row } => writer.balance(time, &log.balance().row(row))?,
            Item::Progress { index } => writer.progress(&log.progress()[index])?,
            Item::Checkpoint { index } => match log.checkpoint(index) {
                Ok(state) => {
                    let step = log.checkpoints()[index].step;
                    let copy = |out: &mut dyn Write| {
                        // the writer tells of what it could not write
                        let _ = out.write_all(&state);
                        Ok::<(), LogError>(())
                    };
                    writer.checkpoint(time, step, copy)?;
                    kept.checkpoints += 1;
                }
                Err(damage @ LogError::Damaged { .. }) => {
                    tell(&format!("warning: a checkpoint is left out: {damage}"));
                }
                Err(error) => return Err(error),
            },
        }
    }
    writer.finish()?;
    Ok(kept)
}

/// Writes a cloud with as many bytes for a number as it was logged with.
fn write_cloud(writer: &mut Writer, body: &str, cloud: &LoggedCloud) -> Result<(), LogError> {
    let fields: Vec<FieldView> = cloud
        .fields
        .iter()
        .map(|field| FieldView {
            name: &field.name,
            components: field.components,
            values: &field.values,
        })
        .collect();
    let is_single =
        fit_f32(cloud.positions.as_flattened()) && fields.iter().all(|field| fit_f32(field.values));
    let precision = if is_single {
        Precision::F32
    } else {
        Precision::F64
    };
    let view = CloudView {
        time: cloud.time,
        positions: Coordinates::Listed(&cloud.positions),
        fields: &fields,
    };
    writer.points(body, precision, &view)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::fixture;

    fn trimmed(from: Option<f64>, to: Option<f64>) -> (tempfile::TempDir, TrimArgs) {
        let folder = tempfile::tempdir().expect("a folder");
        let log = folder.path().join("spot.mcap");
        fixture::write_log(&log, [6, 3, 2]);
        let out = folder.path().join("cut.mcap");
        let args = TrimArgs {
            log,
            from,
            to,
            out,
            force: false,
        };
        (folder, args)
    }

    #[test]
    fn a_window_keeps_its_states_series_and_the_case() {
        let (_folder, args) = trimmed(Some(0.3), Some(0.8));
        run(&args).expect("cut");
        let (old, new) = (
            Log::open(&args.log).expect("a log"),
            Log::open(&args.out).expect("a log"),
        );
        assert!(new.finished());
        assert_eq!(new.case_text(), old.case_text());
        assert_eq!(new.run(), old.run());
        assert_eq!(new.times("plate"), &old.times("plate")[2..5]);
        assert_eq!(
            new.cloud("sheet", 1).expect("there"),
            old.cloud("sheet", 3).expect("there")
        );
        let (new_probe, old_probe) = (
            &new.probes()["thermocouples"],
            &old.probes()["thermocouples"],
        );
        assert_eq!(
            new_probe.columns[1].values[..],
            old_probe.columns[1].values[2..5]
        );
        assert_eq!(new.balance().times.len(), 3);
        assert_eq!(new.progress(), &old.progress()[2..5]);
    }

    #[test]
    fn windows_that_make_no_sense_are_explained() {
        for (from, to, what) in [
            (Some(0.8), Some(0.3), "`--from 0.8` is after `--to 0.3`"),
            (
                Some(0.41),
                Some(0.45),
                "no logged state lies between 0.41 and 0.45 s",
            ),
            (Some(f64::NAN), None, "`--from` is NaN"),
        ] {
            let (_folder, args) = trimmed(from, to);
            let error = run(&args).expect_err("refused").to_string();
            assert!(error.contains(what), "{error}");
            assert!(!args.out.exists());
        }
        let (_folder, mut args) = trimmed(None, None);
        args.out = args.log.clone();
        args.force = true;
        let error = run(&args).expect_err("refused").to_string();
        assert!(error.contains("is the log to cut"), "{error}");
    }
}
