//! `perimelt summary`: the numbers that a process engineer reads off a log.

use std::io::Write;
use std::path::PathBuf;

use super::Done;
use crate::argument::positive;
use crate::case::of_log::early_end;
use crate::log_file::open_log;
use crate::melt_pool::Travel;
use crate::summary::{SummaryOptions, print, read_off};
use crate::terminal::tell;
use crate::unit::time_text;

#[derive(clap::Args, Debug)]
pub struct SummaryArgs {
    /// The log
    log: PathBuf,
    /// Temperature that bounds the melt pool and the fusion zone, K [default: the solidus]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = positive)]
    isotherm: Option<f64>,
    /// Temperature that bounds the heat-affected zone, K [default: Ac1 of the steel]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = positive)]
    haz: Option<f64>,
    /// Axis along which the heat source travels, for the length of the melt pool
    #[arg(long, value_enum, default_value_t)]
    travel: Travel,
    /// Print JSON, in SI units
    #[arg(long)]
    json: bool,
}

pub fn run(args: &SummaryArgs) -> Done {
    let log = open_log(&args.log)?;
    let options = SummaryOptions {
        isotherm: args.isotherm,
        haz: args.haz,
        travel: args.travel,
    };
    if let Some((time, end)) = early_end(&log) {
        tell(&format!(
            "warning: the run is not complete: the log ends at t = {} of {}",
            time_text(time),
            time_text(end)
        ));
    }
    let found = read_off(&log, &options)?;
    let out = &mut crate::terminal::output();
    if args.json {
        serde_json::to_writer_pretty(&mut *out, &found)?;
        writeln!(out)?;
    } else {
        print(&found, out)?;
    }
    Ok(())
}
