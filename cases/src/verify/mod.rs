//! `perimelt verify`: runs benchmark cases from their case files and compares numbers of the
//! running simulation (not of its log) with the references in their `[[verify]]` tables.
//!
//! [`check`] has the tables of case files, `measured_run` runs a case and takes the values by [`measurement`],
//! [`table`] compares and prints them.
//!
//! Mistakes that can be found before the first run end the command. What goes wrong with one case after that makes
//! its checks fail, with the reason, and no others.

pub mod benchmarks;
pub mod check;
pub mod limit;
mod measured_run;
pub mod measurement;
pub mod table;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

use crate::case::CaseError;
use crate::run::on_workers;
use check::{Check, Level};
use measured_run::MeasuredRun;
use table::{Outcome, OutcomeTable};

/// Arguments of `perimelt verify`.
#[derive(clap::Args, Debug, Default)]
pub struct VerifyArgs {
    /// Only cases whose name contains this text
    pub filter: Option<String>,
    /// Also run the long cases
    #[arg(long)]
    pub full: bool,
    /// Case files of this folder instead of those of the program
    #[arg(long, value_name = "FOLDER")]
    pub cases: Option<PathBuf>,
    /// Threads
    #[arg(long)]
    pub threads: Option<usize>,
}

/// Why benchmarks could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// A mistake in a case file.
    #[error("{}", .0.render(false))]
    Case(#[from] Box<CaseError>),
    /// `of` names no case.
    #[error("`{quantity}` of case `{case}` is compared with case `{of}`, which does not exist")]
    NoSuchCase {
        /// The case.
        case: String,
        /// What is measured.
        quantity: String,
        /// The case that is missing.
        of: String,
    },
    /// No case to run.
    #[error("no case with a check has `{filter}` in its name; known: {}", known.join(", "))]
    Nothing {
        /// What was asked for.
        filter: String,
        /// Names of all cases.
        known: Vec<String>,
    },
    /// A folder that cannot be read.
    #[error("the folder {} cannot be read: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Checks that did not pass.
    #[error("{failed} of {all} checks failed")]
    Failed {
        /// Failed.
        failed: usize,
        /// All.
        all: usize,
    },
}

/// A check and where it belongs.
pub(crate) struct Planned {
    case: String,
    check: Check,
}

/// Runs `perimelt verify`.
///
/// # Errors
/// A mistake in a case, or a check that fails.
pub fn run(args: &VerifyArgs) -> Result<(), Box<dyn std::error::Error>> {
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()?;
    }
    let outcomes = on_workers(|| verify(args))?;
    let mut out = std::io::stdout().lock();
    write!(out, "{}", OutcomeTable(&outcomes))?;
    let failed = outcomes.iter().filter(|o| !o.passed).count();
    let all = outcomes.len();
    if failed > 0 {
        return Err(VerifyError::Failed { failed, all }.into());
    }
    Ok(writeln!(out, "all {all} checks passed")?)
}

/// Runs the cases that the arguments select and judges their checks, in the order of the files.
///
/// # Errors
/// A mistake that is found before the first run. A run that fails is no error: its checks have not passed.
pub fn verify(args: &VerifyArgs) -> Result<Vec<Outcome>, VerifyError> {
    let cases = benchmarks::load(args.cases.as_deref())?;
    let filter = args.filter.as_deref().unwrap_or("");
    let level = if args.full {
        Level::Full
    } else {
        Level::Everyday
    };
    let mut planned = Vec::new();
    for (name, case) in &cases {
        let checks: Vec<Check> = case.verify_entries()?;
        let wanted = checks
            .into_iter()
            .filter(|c| c.level <= level && name.contains(filter));
        planned.extend(wanted.map(|check| Planned {
            case: name.clone(),
            check,
        }));
    }
    if planned.is_empty() {
        let known = cases.into_iter().map(|(name, _)| name).collect();
        return Err(VerifyError::Nothing {
            filter: filter.into(),
            known,
        });
    }
    let unknown = planned.iter().find_map(|p| {
        let of = p.check.of.as_ref()?;
        (!cases.iter().any(|(name, _)| name == of)).then_some((p, of))
    });
    if let Some((Planned { case, check }, of)) = unknown {
        let (case, quantity, of) = (case.clone(), check.quantity.clone(), of.clone());
        return Err(VerifyError::NoSuchCase { case, quantity, of });
    }

    let mut runs: BTreeMap<&str, MeasuredRun> = BTreeMap::new();
    for (name, case) in &cases {
        let concerns = |p: &Planned| p.case == *name || p.check.of.as_deref() == Some(name);
        if planned.iter().any(concerns) {
            runs.insert(name, MeasuredRun::of(name, case, &planned, concerns));
        }
    }
    let judge = |(index, p): (usize, &Planned)| {
        let values = match &p.check.of {
            None => runs[p.case.as_str()].values(index).map(<[f64]>::to_vec),
            Some(other) => ratio(&runs[p.case.as_str()], &runs[other.as_str()], index),
        };
        match values {
            Ok(values) => Outcome::new(&p.case, &p.check, &values),
            Err(reason) => Outcome::failed(&p.case, &p.check, reason),
        }
    };
    Ok(planned.iter().enumerate().map(judge).collect())
}

/// The values of one run over those of another.
fn ratio(run: &MeasuredRun, other: &MeasuredRun, check: usize) -> Result<Vec<f64>, String> {
    let (own, other) = (run.values(check)?, other.values(check)?);
    Ok(own.iter().zip(other).map(|(a, b)| a / b).collect())
}

#[cfg(test)]
mod tests;
