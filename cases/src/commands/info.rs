//! `perimelt info`: contents of a log.

use std::io::Write;
use std::path::PathBuf;

use perimelt_core::log::{BodyInfo, Ending, FieldInfo, Log, Series};

use super::{Done, threads};
use crate::case::of_log::early_end;
use crate::unit::duration;
use crate::unit::{length_text, time_text};

#[derive(clap::Args, Debug)]
pub struct InfoArgs {
    /// The log
    log: PathBuf,
}

pub fn run(args: &InfoArgs) -> Done {
    let log = Log::open(&args.log)?;
    let logged = log.run();
    let out = &mut crate::terminal::output();
    writeln!(
        out,
        "case {}, perimelt {}, {}",
        log.case_name(),
        logged.version,
        threads(logged.threads)
    )?;
    print_ending(&log, out)?;
    if let Some(last) = log.progress().last() {
        let wall = duration(last.wall_seconds);
        writeln!(
            out,
            "t = {} after {} steps and {wall}",
            time_text(last.time),
            last.step
        )?;
    }
    for body in &logged.bodies {
        print_body(&log, body, out)?;
    }
    for (name, series) in log.probes() {
        print_probe(name, series, out)?;
    }
    let plugins = |kind: &str| -> Vec<String> {
        let list = logged.plugins[kind].as_array().into_iter().flatten();
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

/// State of the end of the log, and its damaged parts.
fn print_ending(log: &Log, out: &mut impl Write) -> std::io::Result<()> {
    match log.ending() {
        Ending::Finished => writeln!(out, "{}", closed(log))?,
        Ending::Unfinished { at } => writeln!(out, "the log is unfinished: it ends at byte {at}")?,
        Ending::Damaged { at, what } => writeln!(out, "the log is damaged at byte {at}: {what}")?,
    }
    for damage in log.damage() {
        let (part, what) = (&damage.part, &damage.what);
        let place = match damage.at {
            0 => String::new(),
            at => format!(" at byte {at}"),
        };
        writeln!(out, "{part}{place} is damaged and left out: {what}")?;
    }
    Ok(())
}

fn print_body(log: &Log, body: &BodyInfo, out: &mut impl Write) -> std::io::Result<()> {
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
    // a log without a state lists all fields that a state may have
    let cloud = log.first_cloud(&body.name).ok();
    let is_logged = |field: &&FieldInfo| {
        let names = cloud.as_ref().map(|cloud| &cloud.fields);
        names.is_none_or(|fields| fields.iter().any(|f| f.name == field.name))
    };
    let (logged, others): (Vec<_>, Vec<_>) = body.fields.iter().partition(is_logged);
    for field in logged {
        writeln!(out, "    {} [{}]", field.name, field.unit)?;
    }
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|field| field.name.as_str()).collect();
        writeln!(out, "    not logged: {}", names.join(", "))?;
    }
    Ok(())
}

fn print_probe(name: &str, series: &Series, out: &mut impl Write) -> std::io::Result<()> {
    let columns = series
        .columns
        .iter()
        .map(|c| format!("{} [{}]", c.name, c.unit));
    let shown: Vec<String> = columns.take(4).collect();
    let more = match series.columns.len().saturating_sub(shown.len()) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    writeln!(
        out,
        "\nprobe {name}: {}{more}, {} rows",
        shown.join(", "),
        series.times.len()
    )
}

/// The sentence for a log that its writer closed: whether the run reached the end of its case.
fn closed(log: &Log) -> String {
    match early_end(log) {
        None => "the log is complete".into(),
        Some((time, end)) => format!(
            "the run stopped before its end, at t = {} of {}: `perimelt resume` continues it",
            time_text(time),
            time_text(end)
        ),
    }
}
