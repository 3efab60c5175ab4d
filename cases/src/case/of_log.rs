//! The case of a logged run.

use std::path::Path;

use perimelt_core::log::Log;

use super::{Case, CaseError, plugin_names};

/// The case of a log, as it was run.
///
/// # Errors
/// A mistake in it, for example because a plugin is missing in this program.
pub fn case_of(log: &Log) -> Result<Case, CaseError> {
    let folder = Path::new(&log.run().case_folder);
    let case = Case::parse(log.case_name(), log.case_text().to_string(), folder);
    // it has run on a machine
    let case = case.map(|mut case| {
        case.memory = None;
        case
    });
    case.map_err(|mistake| match missing_plugins(log) {
        missing if missing.is_empty() => mistake,
        missing => mistake.help(format!(
            "the log was written by a program with other plugins; missing here: {}",
            missing.join(", ")
        )),
    })
}

/// Types of plugins of a run that this program does not have.
fn missing_plugins(log: &Log) -> Vec<String> {
    let mut missing = Vec::new();
    for section in ["physics", "couplers"] {
        let known = plugin_names(section);
        let plugins = log.run().plugins[section].as_array().into_iter().flatten();
        let types = plugins.filter_map(|p| p["type"].as_str());
        missing.extend(types.filter(|t| !known.contains(t)).map(String::from));
    }
    missing
}

/// Last time of the run of a log and end of its case (s) where the run did not get there: it was interrupted, stopped or
/// failed, or is still running. `None` of a case that this program cannot read.
pub fn early_end(log: &Log) -> Option<(f64, f64)> {
    let end = case_of(log).ok()?.time.end;
    let last = log.progress().last().map(|p| p.time);
    let saved = log.checkpoints().last().map(|c| c.time);
    let time = last.into_iter().chain(saved).reduce(f64::max);
    let time = time.unwrap_or_default();
    (time < end).then_some((time, end))
}
