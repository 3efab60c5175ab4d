//! What is wrong, in words that are kept apart until they are shown.

use std::fmt;

/// A mistake in words: what is wrong, what is expected, what to do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Explanation {
    /// What is wrong.
    pub message: String,
    /// What is expected in its place, or the nearest known name; may be empty.
    pub expected: String,
    /// What to do, or the known names; may be empty.
    pub help: String,
}

impl Explanation {
    /// An explanation by its message alone.
    pub fn new(message: impl Into<String>) -> Self {
        Explanation {
            message: message.into(),
            ..Explanation::default()
        }
    }

    /// The explanation with the value that is expected.
    #[must_use]
    pub fn expected(mut self, expected: impl fmt::Display) -> Self {
        self.expected = format!("expected {expected}");
        self
    }

    /// The explanation with what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }

    /// The explanation with the known name nearest to `name`, else all of them.
    #[must_use]
    pub fn suggest(mut self, name: &str, known: &[String]) -> Self {
        match nearest(name, known.iter().map(String::as_str)) {
            Some(close) => self.expected = format!("did you mean `{close}`?"),
            None if known.is_empty() => self.help = "there is none".into(),
            None => self.help = format!("known: {}", known.join(", ")),
        }
        self
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        let rest = [&self.expected, &self.help].into_iter();
        rest.filter(|part| !part.is_empty())
            .try_for_each(|part| write!(f, "; {part}"))
    }
}

/// The known name closest to `name`, when it is close enough to be a slip of the finger.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let limit = |length: usize| (length / 3).max(1).min(length - 1);
    known
        .into_iter()
        .map(|k| (strsim::damerau_levenshtein(name, k), k))
        .filter(|(distance, k)| *distance <= limit(k.len().max(name.len()).max(1)))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}
