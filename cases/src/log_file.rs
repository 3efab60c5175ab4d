//! Logs that may be damaged: readable parts are used, and a warning is printed for the rest.

use std::path::Path;

use perimelt_core::log::{Ending, Log, LogError, LoggedCloud};

use crate::terminal::tell;

/// Opens a log, with a warning about damaged states.
///
/// # Errors
/// See [`Log::open`].
pub(crate) fn open_log(path: &Path) -> Result<Log, LogError> {
    let log = Log::open(path)?;
    tell_damage(&log);
    Ok(log)
}

/// Prints warnings about the damage in a log.
pub(crate) fn tell_damage(log: &Log) {
    let path = log.path().display();
    let lost: usize = log.damage().iter().map(|d| d.states).sum();
    let sound = log.bodies().map(|body| log.times(body).len()).max();
    let all = sound.unwrap_or_default() + lost;
    let list = format!("`perimelt info {path}` lists the damage");
    match log.damage().len() {
        0 => {}
        _ if lost > 0 => tell(&format!(
            "warning: {lost} of {all} states of {path} are damaged and left out; {list}"
        )),
        count if log.damage().iter().all(|d| d.part == "a chunk") => tell(&format!(
            "warning: {count} chunks of {path} are damaged, and their rows of probes, balances or progress left out; {list}"
        )),
        1 => tell(&format!(
            "warning: a part of {path} is damaged and left out; {list}"
        )),
        count => tell(&format!(
            "warning: {count} parts of {path} are damaged and left out; {list}"
        )),
    }
    if let Ending::Damaged { at, .. } = log.ending() {
        tell(&format!(
            "warning: {path} is damaged at byte {at}, and what comes after is left out; {list}"
        ));
    }
}

/// A logged state; `None` with a warning for a damaged one.
///
/// # Errors
/// Any other error.
pub(crate) fn skip_damaged(
    cloud: Result<LoggedCloud, LogError>,
) -> Result<Option<LoggedCloud>, LogError> {
    match cloud {
        Err(damage @ LogError::Damaged { .. }) => {
            tell(&format!("warning: a state is left out: {damage}"));
            Ok(None)
        }
        cloud => cloud.map(Some),
    }
}

/// The plugins of a type that acted on a body in the run.
pub(crate) fn plugins_of<'a>(
    log: &'a Log,
    section: &str,
    kind: &'a str,
    body: &'a str,
) -> impl Iterator<Item = &'a serde_json::Value> {
    let plugins = log.run().plugins[section].as_array().into_iter().flatten();
    plugins.filter(move |plugin| {
        // without a name, it acts on the only body
        let is_of_body = plugin["body"].as_str().is_none_or(|name| name == body);
        plugin["type"] == kind && is_of_body
    })
}

/// Whether single precision represents these numbers exactly, as after logging in single precision.
pub(crate) fn fit_f32(values: &[f64]) -> bool {
    values
        .iter()
        .all(|&value| value.is_nan() || f64::from(value as f32) == value)
}
