//! `perimelt info`: contents of a log.

use std::io::Write;
use std::path::PathBuf;

use perimelt_core::log::{Ending, Log};

use super::Done;
use crate::plot::unit::{length_text, time_text};
use crate::run::case_of;
use crate::run::display::duration;

#[derive(clap::Args, Debug)]
pub struct InfoArgs {
    /// The log
    log: PathBuf,
}

pub fn run(args: &InfoArgs) -> Done {
    let log = Log::open(&args.log)?;
    let run = log.run();
    let out = &mut std::io::stdout().lock();
    writeln!(
        out,
        "case {}, perimelt {}, {} threads",
        log.case_name(),
        run.version,
        run.threads
    )?;
    match log.ending() {
        Ending::Finished => writeln!(out, "the log is complete{}", early_end(&log))?,
        Ending::Unfinished { at } => writeln!(out, "the log is unfinished: it ends at byte {at}")?,
        Ending::Damaged { at, what } => writeln!(out, "the log is damaged at byte {at}: {what}")?,
    }
    for damage in log.damage() {
        let (at, what) = (damage.at, &damage.what);
        writeln!(out, "a chunk at byte {at} is damaged and left out: {what}")?;
    }
    if let Some(last) = log.progress().last() {
        let wall = duration(last.wall_seconds);
        writeln!(
            out,
            "t = {} after {} steps and {wall}",
            time_text(last.time),
            last.step
        )?;
    }
    for body in &run.bodies {
        let times = log.times(&body.name);
        let span = match (times.first(), times.last()) {
            (Some(first), Some(last)) => {
                let (first, last) = (time_text(*first), time_text(*last));
                format!("{} states from {first} to {last}", times.len())
            }
            _ => "no state".into(),
        };
        writeln!(
            out,
            "\nbody {}: {} points, {}D, spacing {}, {span}",
            body.name,
            body.points,
            body.dimension,
            length_text(body.spacing)
        )?;
        for field in &body.fields {
            writeln!(out, "    {} [{}]", field.name, field.unit)?;
        }
    }
    for (name, series) in log.probes() {
        let columns = series
            .columns
            .iter()
            .map(|c| format!("{} [{}]", c.name, c.unit));
        let shown: Vec<String> = columns.clone().take(4).collect();
        let more = series.columns.len().saturating_sub(shown.len());
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        writeln!(
            out,
            "\nprobe {name}: {}{more}, {} rows",
            shown.join(", "),
            series.times.len()
        )?;
    }
    let plugins = |kind: &str| -> Vec<String> {
        let list = run.plugins[kind].as_array().into_iter().flatten();
        list.filter_map(|p| p["type"].as_str().map(String::from))
            .collect()
    };
    writeln!(
        out,
        "\nphysics: {}\ncouplers: {}",
        plugins("physics").join(", "),
        plugins("couplers").join(", ")
    )?;
    let times: Vec<String> = log
        .checkpoints()
        .iter()
        .map(|c| time_text(c.time))
        .collect();
    writeln!(out, "checkpoints at t = {}", times.join(", "))?;
    Ok(())
}

/// What to say of a run that stopped before the end of its case; empty for one that reached its end.
fn early_end(log: &Log) -> String {
    // a case that this program cannot read tells no end
    let (Ok(case), Some(last)) = (case_of(log), log.progress().last()) else {
        return String::new();
    };
    let end = case.time.end;
    match last.time >= end {
        true => String::new(),
        false => format!(
            "; the run stopped before its end, at t = {} of {}: `perimelt resume` continues it",
            time_text(last.time),
            time_text(end)
        ),
    }
}
