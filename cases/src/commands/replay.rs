//! `perimelt replay`: steps through the logged states.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use perimelt_core::log::{Log, Series, check_unused};

use super::Done;
use crate::growing_log::{GrowingLog, LogChange};
use crate::log_file::skip_damaged;
use crate::log_file::tell_damage;
use crate::moment::{note_other_times, state_at};
use crate::quantity::scalar::{check_scalars, scalar};
use crate::terminal::tell;
use crate::unit;

/// Polling interval for a log that is being written.
const INTERVAL: Duration = Duration::from_millis(200);

#[derive(clap::Args, Debug)]
pub struct ReplayArgs {
    /// The log
    log: PathBuf,
    /// Show only the state nearest to this time, s
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    at: Option<f64>,
    /// Show only these fields, or numbers computed from them, such as `displacement.x`, `stress.von_mises`,
    /// `stress.principal_1`
    #[arg(long, value_delimiter = ',')]
    field: Vec<String>,
    /// Wait between states: simulated seconds in a second of real time
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// After the last state, wait for those that a run still writes, until it ends
    #[arg(long, conflicts_with = "at")]
    follow: bool,
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
    // before the log, so that what is written before the run ends is not missed
    let mut is_written = args.follow && check_unused(&args.log).is_err();
    let mut growing = GrowingLog::open(&args.log)?;
    tell_damage(growing.log());
    if let Some(at) = args.at {
        let log = growing.log();
        args.check_fields(log)?;
        let times = times(log);
        note_other_times(times, &[at]);
        return match state_at(times, at)? {
            Some(index) => args.show(log, index, times[index]),
            None => Err(ReplayError::Empty(args.log.clone()).into()),
        };
    }
    let started = Instant::now();
    let mut shown = 0;
    loop {
        let log = growing.log();
        if shown == 0 {
            args.check_fields(log)?;
        }
        let times = times(log);
        for (index, &time) in times.iter().enumerate().skip(shown) {
            if let Some(rate) = args.rate {
                let due =
                    Duration::try_from_secs_f64((time - times[0]) / rate).unwrap_or(Duration::MAX);
                std::thread::sleep(due.saturating_sub(started.elapsed()));
            }
            args.show(log, index, time)?;
        }
        shown = times.len();
        if !is_written {
            break;
        }
        std::thread::sleep(INTERVAL);
        is_written = check_unused(&args.log).is_err();
        if growing.refresh() == LogChange::Replaced {
            tell("note: another run has replaced the log");
            shown = 0;
        }
    }
    if shown == 0 {
        return Err(ReplayError::Empty(args.log.clone()).into());
    }
    Ok(())
}

/// Times of the states of the first body, s.
fn times(log: &Log) -> &[f64] {
    log.bodies().next().map_or(&[], |body| log.times(body))
}

impl ReplayArgs {
    /// Reads the first state only with `--field`: `--at` should read one state.
    fn check_fields(&self, log: &Log) -> Done {
        if !self.field.is_empty() {
            check_scalars(log, log.bodies(), &self.field)?;
        }
        Ok(())
    }

    fn show(&self, log: &Log, index: usize, time: f64) -> Done {
        let out = &mut crate::terminal::output();
        writeln!(out, "t = {}", unit::time_text(time))?;
        for body in log.bodies() {
            if index >= log.times(body).len() {
                continue;
            }
            let Some(cloud) = skip_damaged(log.cloud(body, index))? else {
                continue;
            };
            let names = if self.field.is_empty() {
                cloud.fields.iter().map(|field| &field.name).collect()
            } else {
                self.field.iter().collect::<Vec<_>>()
            };
            for name in names {
                let Some(scalar) = scalar(&cloud, name) else {
                    continue;
                };
                let all = (f64::INFINITY, f64::NEG_INFINITY);
                let (low, high) = scalar
                    .values
                    .iter()
                    .fold(all, |(low, high), v| (low.min(*v), high.max(*v)));
                line(
                    out,
                    &format!("{body} {}", scalar.label),
                    &[low, high],
                    &scalar.unit,
                )?;
            }
        }
        for (name, series) in log.probes() {
            row(out, &format!("probe {name}"), series, time)?;
        }
        row(out, "balance", log.balance(), time)?;
        Ok(out.flush()?)
    }
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
