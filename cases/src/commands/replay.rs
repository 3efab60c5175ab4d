//! `perimelt replay`: steps through the logged states.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use perimelt_core::log::{Log, Series};

use super::Done;
use crate::moment::state_at;
use crate::plot::unit;

#[derive(clap::Args, Debug)]
pub struct ReplayArgs {
    /// The log
    log: PathBuf,
    /// Show only the state nearest to this time, s
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    at: Option<f64>,
    /// Wait between states: simulated seconds in a second of real time
    #[arg(long, value_name = "R")]
    rate: Option<f64>,
}

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
enum ReplayError {
    #[error("{path} contains no state", path = .0.display())]
    Empty(PathBuf),
    #[error("`--rate` must be above 0, but is {0}")]
    Rate(f64),
}

pub fn run(args: &ReplayArgs) -> Done {
    if let Some(rate) = args.rate.filter(|r| !(r.is_finite() && *r > 0.0)) {
        return Err(ReplayError::Rate(rate).into());
    }
    let log = Log::open(&args.log)?;
    let first_body = log.bodies().next().unwrap_or_default().to_string();
    let times = log.times(&first_body).to_vec();
    if times.is_empty() {
        return Err(ReplayError::Empty(args.log.clone()).into());
    }
    let out = &mut std::io::stdout().lock();
    if let Some(at) = args.at {
        let index = state_at(&times, at)?.unwrap_or(0);
        return show(out, &log, index, times[index]);
    }
    let started = Instant::now();
    for (index, &time) in times.iter().enumerate() {
        if let Some(rate) = args.rate {
            let due =
                Duration::try_from_secs_f64((time - times[0]) / rate).unwrap_or(Duration::MAX);
            std::thread::sleep(due.saturating_sub(started.elapsed()));
        }
        show(out, &log, index, time)?;
        out.flush()?;
    }
    Ok(())
}

fn show(out: &mut impl Write, log: &Log, index: usize, time: f64) -> Done {
    writeln!(out, "t = {}", unit::time_text(time))?;
    for body in log.bodies() {
        if index >= log.times(body).len() {
            continue;
        }
        for field in &log.cloud(body, index)?.fields {
            // the magnitude of vectors and tensors
            let size = |v: &[f64]| {
                if v.len() == 1 {
                    v[0]
                } else {
                    v.iter().map(|x| x * x).sum::<f64>().sqrt()
                }
            };
            let values = field.values.chunks_exact(field.components).map(size);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            });
            line(
                out,
                &format!("{body} {}", field.name),
                &[low, high],
                &field.unit,
            )?;
        }
    }
    for (name, series) in log.probes() {
        row(out, &format!("probe {name}"), series, time)?;
    }
    row(out, "balance", log.balance(), time)
}

/// The values of a series at a time.
fn row(out: &mut impl Write, title: &str, series: &Series, time: f64) -> Done {
    let Some(at) = series.times.iter().position(|t| *t == time) else {
        return Ok(());
    };
    // lines of a hundred positions are not printed
    const MOST: usize = 16;
    for column in series.columns.iter().take(MOST) {
        let name = format!("{title}: {}", column.name);
        line(out, &name, &[column.values[at]], &column.unit)?;
    }
    let more = series.columns.len().saturating_sub(MOST);
    if more > 0 {
        writeln!(
            out,
            "  {title}: {more} more; `perimelt export --format csv` writes all"
        )?;
    }
    Ok(())
}

/// A name, and the values between which it lies, in a unit that suits the largest.
fn line(out: &mut impl Write, name: &str, values: &[f64], si: &str) -> Done {
    let largest = values.iter().fold(0.0, |size: f64, v| size.max(v.abs()));
    let (factor, unit) = unit::value(si, largest);
    let numbers = values.iter().map(|v| unit::number(v * factor, 6));
    let text = numbers.collect::<Vec<_>>().join(" to ");
    Ok(writeln!(out, "  {name:<44} {text} {unit}")?)
}
