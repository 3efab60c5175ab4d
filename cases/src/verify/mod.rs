//! `perimelt verify`: runs benchmark cases from their case files and compares numbers of the
//! running simulation (not of its log) with the references in their `[[verify]]` tables.
//!
//! [`check`] has the tables of case files, [`measurement`] takes the values, [`table`] compares and prints them.

pub mod benchmarks;
pub mod check;
pub mod measurement;
pub mod table;

use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::{RunError, SetupError};

use crate::case::{Case, CaseError};
use crate::run::display::{Display, duration};
use crate::run::{Failure, on_workers};
use check::{Check, Level};
use measurement::Measurement;
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
    /// A check that does not fit its case.
    #[error("cannot measure `{quantity}` in case `{case}`: {cause}")]
    Check {
        /// The case.
        case: String,
        /// What should be measured.
        quantity: String,
        /// Why not.
        cause: Box<SetupError>,
    },
    /// A list of references that does not fit what is measured.
    #[error(
        "`{quantity}` of case `{case}` has {references} references for {measured} measured values; give one for all, or one for each"
    )]
    References {
        /// The case.
        case: String,
        /// What is measured.
        quantity: String,
        /// References given.
        references: usize,
        /// Values measured.
        measured: usize,
    },
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
struct Planned {
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
/// A mistake in a case or check. A run that fails is no error: its checks have not passed.
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

    // results of each run, by name of the case: one entry per planned check
    let mut measured: BTreeMap<&str, Vec<Option<Vec<f64>>>> = BTreeMap::new();
    for (name, case) in &cases {
        let concerns = |p: &Planned| p.case == *name || p.check.of.as_deref() == Some(name);
        if planned.iter().any(concerns) {
            measured.insert(name, measure(name, case, &planned, concerns)?);
        }
    }
    let judge = |(index, p): (usize, &Planned)| {
        let of_run = |name: &str| measured[name][index].as_deref();
        let own = of_run(&p.case);
        let values = match p.check.of.as_deref() {
            None => own.map(<[f64]>::to_vec),
            Some(other) => own
                .zip(of_run(other))
                .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a / b).collect()),
        };
        let references = p.check.reference.as_slice().len();
        let measured = values.as_ref().map_or(references, Vec::len);
        if references == 0 || measured == 0 || (references != 1 && references != measured) {
            let (case, quantity) = (p.case.clone(), p.check.quantity.clone());
            return Err(VerifyError::References {
                case,
                quantity,
                references,
                measured,
            });
        }
        Ok(Outcome::new(&p.case, &p.check, values.as_deref()))
    };
    planned.iter().enumerate().map(judge).collect()
}

/// Runs one case and takes the measurements that concern it.
fn measure(
    name: &str,
    case: &Case,
    planned: &[Planned],
    concerns: impl Fn(&Planned) -> bool,
) -> Result<Vec<Option<Vec<f64>>>, VerifyError> {
    let started = Instant::now();
    let mut simulation = case.compose()?;
    let mut measurements = Vec::new();
    for p in planned {
        let measurement = concerns(p)
            .then(|| Measurement::new(&p.check.measure, &simulation))
            .transpose();
        measurements.push(measurement.map_err(|cause| {
            let (case, quantity) = (name.to_string(), p.check.quantity.clone());
            VerifyError::Check {
                case,
                quantity,
                cause: Box::new(cause),
            }
        })?);
    }
    let result = advance(
        case,
        &mut simulation,
        measurements.iter_mut().flatten().collect(),
    );
    let steps = simulation.progress().macro_steps;
    let iterations: u64 = simulation.progress().iterations.iter().sum();
    let evaluations: u64 = simulation.progress().evaluations.iter().sum();
    let wall = duration(started.elapsed().as_secs_f64());
    match result {
        Ok(()) => eprintln!(
            "{name}: {steps} steps, {iterations} iterations, {evaluations} evaluations in {wall}"
        ),
        Err(Failure::Case(mistake)) => return Err(VerifyError::Case(mistake)),
        Err(failure) => eprintln!("{name}: stopped after {steps} steps and {wall}: {failure}"),
    }
    Ok(measurements
        .into_iter()
        .map(|r| Some(r?.values()?.to_vec()))
        .collect())
}

/// Steps to the end of the case.
fn advance(
    case: &Case,
    simulation: &mut perimelt_core::Simulation,
    mut measurements: Vec<&mut Measurement>,
) -> Result<(), Failure> {
    case.start(simulation)?;
    let mut display = Display::new(simulation, f64::INFINITY, !std::io::stderr().is_terminal());
    let result = loop {
        if simulation.is_finished() {
            break Ok(());
        }
        match simulation.step() {
            Ok(logging) => measurements
                .iter_mut()
                .for_each(|m| m.observe(simulation, logging)),
            Err(failure) => break Err::<(), RunError>(failure),
        }
        display.update(simulation);
    };
    display.finish();
    Ok(result?)
}
