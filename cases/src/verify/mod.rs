//! `perimelt verify`: runs benchmark cases from their case files and compares numbers of the
//! running simulation (not of its log) with the references in their `[[verify]]` tables.
//!
//! [`check`] has the tables of case files, `measured_run` runs a case and takes the values by [`measurement`], `audit`
//! checks balances and convergence of every run, [`table`] compares and prints. [`results`] keeps the outcomes in a file, from
//! which [`report`] makes `docs/benchmarks.md` and a page of each [`topic`], and [`marks`] figures in the text of documents.
//!
//! Mistakes that can be found before the first run end the command. A later failure of one case makes
//! the checks of that case fail, with the reason, and no others.

pub(crate) mod audit;
pub mod benchmarks;
pub mod check;
pub mod html;
pub mod limit;
pub mod marks;
mod measured_run;
pub mod measurement;
pub mod report;
pub mod results;
pub mod table;
pub mod topic;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::error::nearest;

use crate::argument;
use crate::case::sections::Components;
use crate::case::{Case, CaseError};
use crate::unit::duration;
use check::{Check, Level};
use measured_run::{MeasuredRun, run_side_by_side};
use report::Report;
use results::{Results, Session};
use table::{Outcome, OutcomeTable};

/// Arguments of `perimelt verify`.
#[derive(clap::Args, Debug, Default)]
pub struct VerifyArgs {
    /// Only cases whose name contains this text; when there is none, those whose description does, such as another
    /// name of the problem
    pub filter: Option<String>,
    /// Which checks: those that take seconds, or all of them at full size
    #[arg(long, value_enum)]
    pub level: Option<Level>,
    /// Short for `--level nightly`
    #[arg(long, conflicts_with = "level")]
    pub full: bool,
    /// Case files of this folder instead of those of the program
    #[arg(long, value_name = "FOLDER")]
    pub cases: Option<PathBuf>,
    /// Threads; as many cases run side by side
    #[arg(long, value_parser = argument::threads)]
    pub threads: Option<usize>,
    /// Writes the results to this JSON file; results of other checks in it are kept
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Runs nothing: prints the results of such a file as tables in Markdown
    #[arg(long, value_name = "FILE", conflicts_with_all = ["full", "level", "output", "threads"])]
    pub report: Option<PathBuf>,
    /// With `--report`: renews the figures of this document between the comments that mark them, the overview where it has
    /// one, and the pages of the topics in the folder of its name; may be given several times
    #[arg(long, value_name = "DOCUMENT", requires = "report")]
    pub into: Vec<PathBuf>,
    /// Writes the results as a page with plots into this folder
    #[arg(long, value_name = "FOLDER", conflicts_with = "into")]
    pub html: Option<PathBuf>,
}

impl VerifyArgs {
    fn level(&self) -> Level {
        match self.full {
            true => Level::Nightly,
            false => self.level.unwrap_or_default(),
        }
    }
}

/// Why benchmarks could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// A mistake in a case file.
    #[error("{}", .0.render(false))]
    Case(#[from] CaseError),
    /// `of`, `minus` or `error_of` names no case.
    #[error("`{quantity}` of case `{case}` is compared with case `{of}`, which does not exist")]
    NoSuchCase {
        /// The case.
        case: String,
        /// The measured quantity.
        quantity: String,
        /// The case that is missing.
        of: String,
    },
    /// No case to run.
    #[error("no case has `{filter}` in its name or description{}", close.as_ref().map_or(String::new(), |c| format!("; did you mean `{c}`?")))]
    Nothing {
        /// The argument.
        filter: String,
        /// The nearest name.
        close: Option<String>,
    },
    /// The cases of a name have checks of another level only.
    #[error("the checks of {} belong to the nightly level; run them with `--full`", cases.join(", "))]
    OfAnotherLevel {
        /// Names of the cases.
        cases: Vec<String>,
    },
    /// A file of results, or a document, that cannot be read or written.
    #[error("the file {} {what}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The action that failed.
        what: &'static str,
        /// Error of the operating system or of the format.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A document without the comments that mark its tables, and without marks of figures.
    #[error("{} has no figures of results and no lines `{}` and `{}` between which the tables stand", path.display(), report::BEGIN, report::END)]
    NoMarks {
        /// The document.
        path: PathBuf,
    },
    /// A figure of a document that cannot be renewed.
    #[error("{}, {mark}", path.display())]
    Mark {
        /// The document.
        path: PathBuf,
        /// The mark and what is wrong with it.
        mark: marks::MarkError,
    },
    /// A folder that cannot be read.
    #[error("the folder {} cannot be read: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Threads that cannot be started.
    #[error("the threads for the runs cannot be started: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
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

impl Planned {
    /// Whether the check needs the run of a case: it is its own, or is compared with it.
    fn concerns(&self, case: &str) -> bool {
        self.case == case || self.check.others().any(|other| other == case)
    }
}

/// Runs `perimelt verify`.
///
/// # Errors
/// A mistake in a case, a file that cannot be read or written, or a check that fails.
pub fn run(args: &VerifyArgs) -> Result<(), Box<dyn std::error::Error>> {
    let benchmarks = benchmarks::load(args.cases.as_deref())?;
    let cases = benchmarks.cases.as_slice();
    if let Some(results) = &args.report {
        let results = Results::read(results)?;
        if let Some(folder) = &args.html {
            return Ok(html::write(folder, &results, cases)?);
        }
        if args.into.is_empty() {
            let report = Report::new(&results, cases, "benchmarks")?;
            return Ok(write!(std::io::stdout(), "{report}")?);
        }
        for document in &args.into {
            report::renew(document, &results, cases)?;
        }
        return Ok(());
    }
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()?;
    }
    // files that cannot be read or written are found before the runs, not after them
    if let Some(folder) = &args.html {
        html::create(folder)?;
    }
    let mut results = match &args.output {
        Some(path) if path.exists() => Results::read(path)?,
        _ => Results::default(),
    };
    let started = Instant::now();
    let outcomes = verify_cases(args, cases)?;
    let wall = duration(started.elapsed().as_secs_f64());
    let mut out = crate::terminal::output();
    write!(out, "{}", OutcomeTable(&outcomes))?;
    results.add(Session::now(args.level()), &outcomes);
    if let Some(path) = &args.output {
        results.write(path)?;
    }
    if let Some(folder) = &args.html {
        html::write(folder, &results, cases)?;
    }
    let failed = outcomes.iter().filter(|o| !o.passed).count();
    let all = outcomes.len();
    if failed > 0 {
        return Err(VerifyError::Failed { failed, all }.into());
    }
    Ok(writeln!(out, "all {all} checks passed in {wall}")?)
}

/// Runs the cases that the arguments select and judges their checks, in the order of the files, with the audits of
/// each run behind the checks of its case. Cases without checks run at the level "nightly", for their audits.
///
/// # Errors
/// A mistake that is found before the first run. A run that fails is no error: its checks have not passed.
pub fn verify(args: &VerifyArgs) -> Result<Vec<Outcome>, VerifyError> {
    verify_cases(args, &benchmarks::load(args.cases.as_deref())?.cases)
}

/// Names of the cases that have `filter` in their names, or without any of these, in their descriptions: these name the
/// same problem in other sources.
fn select<'a>(cases: &'a [(String, Case)], filter: &str) -> Vec<&'a str> {
    let named = |is_meant: &dyn Fn(&str, &Case) -> bool| -> Vec<&'a str> {
        let meant = cases.iter().filter(|(name, case)| is_meant(name, case));
        meant.map(|(name, _)| name.as_str()).collect()
    };
    let by_name = named(&|name, _| name.contains(filter));
    if !by_name.is_empty() {
        return by_name;
    }
    named(&|_, case| case.case.description.contains(filter))
}

fn verify_cases(args: &VerifyArgs, cases: &[(String, Case)]) -> Result<Vec<Outcome>, VerifyError> {
    let (filter, level) = (args.filter.as_deref().unwrap_or(""), args.level());
    let mut declared: BTreeMap<&str, Vec<Check>> = BTreeMap::new();
    for (name, case) in cases {
        declared.insert(name, case.verify_entries()?);
    }
    let mut planned = Vec::new();
    let mut without_checks = BTreeSet::new();
    let selected = select(cases, filter);
    for name in &selected {
        let checks = &declared[name];
        if checks.is_empty() && level == Level::Nightly {
            without_checks.insert(*name);
        }
        let wanted = checks.iter().filter(|c| c.level <= level);
        planned.extend(wanted.map(|check| Planned {
            case: name.to_string(),
            check: check.clone(),
        }));
    }
    if planned.is_empty() && without_checks.is_empty() {
        if !selected.is_empty() {
            let cases = selected.into_iter().map(String::from).collect();
            return Err(VerifyError::OfAnotherLevel { cases });
        }
        let names = cases.iter().map(|(name, _)| name.as_str());
        let close = nearest(filter, names).map(String::from);
        let filter = filter.into();
        return Err(VerifyError::Nothing { filter, close });
    }
    let unknown = planned.iter().find_map(|p| {
        let is_missing = |of: &&String| !cases.iter().any(|(name, _)| name == *of);
        p.check.others().find(is_missing).map(|of| (p, of))
    });
    if let Some((Planned { case, check }, of)) = unknown {
        let (case, quantity, of) = (case.clone(), check.quantity.clone(), of.clone());
        return Err(VerifyError::NoSuchCase { case, quantity, of });
    }

    let is_needed =
        |name: &str| planned.iter().any(|p| p.concerns(name)) || without_checks.contains(name);
    let needed: Vec<_> = cases.iter().filter(|(name, _)| is_needed(name)).collect();
    let runs = run_side_by_side(&needed, &planned)?;
    let ran = cases
        .iter()
        .filter_map(|(name, _)| Some((name, runs.get(name.as_str())?)));
    let judged = ran.flat_map(|(name, run)| {
        let checks = planned.iter().enumerate().filter(|(_, p)| p.case == *name);
        let outcomes = checks.map(|(index, p)| judge(index, p, &runs));
        let outcomes = outcomes.chain(run.audits(name, &declared[name.as_str()]));
        let timed = |outcome| Outcome {
            seconds: run.seconds,
            ..outcome
        };
        outcomes.map(timed).collect::<Vec<_>>()
    });
    Ok(judged.collect())
}

fn judge(index: usize, p: &Planned, runs: &BTreeMap<&str, MeasuredRun>) -> Outcome {
    let values = |case: &String| runs[case.as_str()].values(index);
    let compared = values(&p.case).and_then(|own| {
        let others: Vec<&[f64]> = p.check.others().map(values).collect::<Result<_, _>>()?;
        p.check.compare(own, &others)
    });
    match compared {
        Ok(values) if p.check.error_of.is_some() => {
            // the references are those of the two errors
            let ratio = Check {
                reference: Components::Scalar(1.0),
                ..p.check.clone()
            };
            Outcome::new(&p.case, &ratio, &values)
        }
        Ok(values) => Outcome::new(&p.case, &p.check, &values),
        Err(reason) => Outcome::failed(&p.case, &p.check, reason),
    }
}

#[cfg(test)]
mod tests;
