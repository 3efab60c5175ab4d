//! Arguments of commands: numbers, and names of bodies and fields of a log.

use perimelt_core::error::nearest;
use perimelt_core::log::{BodyInfo, Log};

/// No such body.
#[derive(Debug, thiserror::Error)]
#[error("the run has no body `{body}`; its bodies are: {}{}", known.join(", "), suggestion(body, known))]
pub struct UnknownBody {
    /// the requested name
    pub body: String,
    /// the known names
    pub known: Vec<String>,
}

/// The requested bodies, or all.
///
/// # Errors
/// A name that no body has.
pub(crate) fn bodies<'a>(log: &'a Log, asked: &[String]) -> Result<Vec<&'a BodyInfo>, UnknownBody> {
    let all = || log.run().bodies.iter();
    if asked.is_empty() {
        return Ok(all().collect());
    }
    let find = |name: &String| {
        let found = all().find(|body| body.name == *name);
        found.ok_or_else(|| UnknownBody {
            body: name.clone(),
            known: log.bodies().map(String::from).collect(),
        })
    };
    asked.iter().map(find).collect()
}

/// The end of a message about an unknown name, also one with a component such as `displacment.x`: the known name that is
/// nearest to it, if one is near.
pub(crate) fn suggestion(name: &str, known: &[String]) -> String {
    let (field, component) = name.split_at(name.find('.').unwrap_or(name.len()));
    match nearest(field, known.iter().map(String::as_str)) {
        Some(close) if close != field => format!("; did you mean `{close}{component}`?"),
        _ => String::new(),
    }
}

/// A finite number that is given as an argument.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| "expected a finite number".into())
}

/// A positive number that is given as an argument.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    let number = finite(text).ok().filter(|x| *x > 0.0);
    number.ok_or_else(|| "expected a finite number above 0".into())
}

/// More threads than any machine has cores take a minute to start.
const MOST_THREADS: usize = 1024;

/// A number of threads that is given as an argument.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    let number = text.trim().parse().ok();
    let number = number.filter(|count| (1..=MOST_THREADS).contains(count));
    number.ok_or_else(|| format!("expected a number from 1 to {MOST_THREADS}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_with_its_component() {
        let known = ["displacement", "temperature"].map(String::from);
        let suggested = |name| suggestion(name, &known);
        assert_eq!(
            suggested("displacment.x"),
            "; did you mean `displacement.x`?"
        );
        assert_eq!(suggested("temprature"), "; did you mean `temperature`?");
        assert_eq!(suggested("temperature.x"), "");
        assert_eq!(suggested("hardness"), "");
    }
}
