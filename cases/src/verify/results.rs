//! Results of `perimelt verify` in a file: one line of JSON for each check, with the session that made it.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::VerifyError;
use super::check::Level;
use super::table::Outcome;

/// Outcomes of several sessions: of each check the last one.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Results {
    /// Sessions in which the outcomes were computed.
    pub sessions: Vec<Session>,
    /// Outcomes, in the order of the cases.
    pub checks: Vec<Recorded>,
}

/// Program, machine and time of one `perimelt verify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// Version of the program.
    pub version: String,
    /// Commit from which the program was built, with "+" behind it where the sources had changes.
    pub commit: String,
    /// Day, UTC, such as `2026-01-31`.
    pub date: String,
    /// Processor.
    pub machine: String,
    /// Threads.
    pub threads: usize,
    /// Level of the checks.
    pub level: Level,
}

/// An outcome and its session.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Recorded {
    /// Number of the session.
    pub session: usize,
    /// The outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
}

impl Session {
    /// Headings of [`Session::cells`].
    pub(super) const HEADINGS: [&str; 6] =
        ["version", "commit", "date", "machine", "threads", "level"];

    /// Cells of a table.
    pub(super) fn cells(&self) -> [String; 6] {
        let level = match self.level {
            Level::Everyday => "everyday",
            Level::Nightly => "nightly",
        };
        let threads = self.threads.to_string();
        [
            &*self.version,
            &*self.commit,
            &*self.date,
            &*self.machine,
            &*threads,
            level,
        ]
        .map(Into::into)
    }

    /// A session of this program on this machine.
    pub fn now(level: Level) -> Session {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        Session {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: env!("PERIMELT_COMMIT").into(),
            date: date(since.map_or(0, |d| d.as_secs() / 86_400)),
            machine: machine(),
            threads: rayon::current_num_threads(),
            level,
        }
    }
}

impl Results {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or contains something else.
    pub fn read(path: &Path) -> Result<Results, VerifyError> {
        let failed = |what, cause| file_error(path, what, cause);
        let text = std::fs::read_to_string(path).map_err(|e| failed("cannot be read", e.into()))?;
        let results: Results = serde_json::from_str(&text)
            .map_err(|e| failed("has no results of `perimelt verify`", e.into()))?;
        match results
            .checks
            .iter()
            .find(|c| c.session >= results.sessions.len())
        {
            Some(c) => {
                let cause = format!("there is no session {}", c.session);
                Err(failed("is damaged", cause.into()))
            }
            None => Ok(results),
        }
    }

    /// Adds the outcomes of a session; those of the same checks in earlier sessions are dropped.
    pub fn add(&mut self, session: Session, outcomes: &[Outcome]) {
        let key = |o: &Outcome| (o.case.clone(), o.quantity.clone());
        let new: BTreeSet<_> = outcomes.iter().map(key).collect();
        self.checks.retain(|c| !new.contains(&key(&c.outcome)));
        let known = self.sessions.iter().position(|s| *s == session);
        let number = known.unwrap_or_else(|| {
            self.sessions.push(session);
            self.sessions.len() - 1
        });
        self.checks.extend(outcomes.iter().map(|outcome| Recorded {
            session: number,
            outcome: outcome.clone(),
        }));
        // sessions without outcomes
        let used: BTreeSet<usize> = self.checks.iter().map(|c| c.session).collect();
        let used: Vec<usize> = used.into_iter().collect();
        self.sessions = used.iter().map(|&n| self.sessions[n].clone()).collect();
        for check in &mut self.checks {
            check.session = used.binary_search(&check.session).unwrap_or_default();
        }
        self.checks
            .sort_by(|a, b| a.outcome.case.cmp(&b.outcome.case));
    }

    /// Writes a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), VerifyError> {
        let failed = |cause| file_error(path, "cannot be written", cause);
        let text = self.to_json().map_err(|e| failed(e.into()))?;
        std::fs::write(path, text).map_err(|e| failed(e.into()))
    }

    /// One line for each session and check.
    fn to_json(&self) -> Result<String, serde_json::Error> {
        let lines = |values: Vec<String>| values.join(",\n");
        let sessions = self.sessions.iter().map(serde_json::to_string);
        let checks = self.checks.iter().map(serde_json::to_string);
        Ok(format!(
            "{{\"sessions\": [\n{}\n], \"checks\": [\n{}\n]}}\n",
            lines(sessions.collect::<Result<_, _>>()?),
            lines(checks.collect::<Result<_, _>>()?),
        ))
    }
}

pub(super) fn file_error(
    path: &Path,
    what: &'static str,
    cause: Box<dyn std::error::Error + Send + Sync>,
) -> VerifyError {
    VerifyError::File {
        path: path.into(),
        what,
        cause,
    }
}

/// Name of the processor and number of its threads.
pub(crate) fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let names = info
        .lines()
        .filter_map(|line| line.strip_prefix("model name"));
    let name = names.map(|n| n.trim_start_matches([' ', '\t', ':'])).next();
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    let name = name.unwrap_or(std::env::consts::ARCH);
    format!("{name}, {count} threads, {}", std::env::consts::OS)
}

/// Date of a day counted from 1970-01-01, in the Gregorian calendar.
fn date(days: u64) -> String {
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut day) = (1970, days);
    while day >= 365 + u64::from(is_leap(year)) {
        day -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if day < length {
            break;
        }
        day -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", day + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(commit: &str) -> Session {
        Session {
            commit: commit.into(),
            ..Session::now(Level::Everyday)
        }
    }

    #[test]
    fn the_last_outcome_of_a_check_counts() {
        let outcome = |case: &str, error| Outcome::audit(case, "q".into(), error, 1e-10);
        let mut results = Results::default();
        results.add(session("first"), &[outcome("a", 1.0), outcome("b", 0.0)]);
        results.add(session("second"), &[outcome("a", f64::NAN)]);
        results.add(
            session("third"),
            &[outcome("a", 0.0), outcome("c", f64::NAN)],
        );
        let text = results.to_json().expect("JSON");
        let read: Results = serde_json::from_str(&text).expect("what was written");
        let commits: Vec<_> = read.sessions.iter().map(|s| s.commit.as_str()).collect();
        assert_eq!(commits, ["first", "third"]);
        let checks: Vec<_> = read
            .checks
            .iter()
            .map(|c| (&*c.outcome.case, c.session))
            .collect();
        assert_eq!(checks, [("a", 1), ("b", 0), ("c", 1)]);
        let [a, _, c] = &read.checks[..] else {
            panic!("{read:?}")
        };
        assert!(a.outcome.passed && !c.outcome.passed && c.outcome.error.is_nan());
    }

    #[test]
    fn days_have_dates() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (20_454, "2026-01-01"),
            (20_818, "2026-12-31"),
        ] {
            assert_eq!(date(days), expected);
        }
    }
}
