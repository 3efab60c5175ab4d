//! Mistakes in a case file, shown at the line and key where they are.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use perimelt_core::Explanation;

/// Text of a case file and the name that messages use for it.
#[derive(Debug, PartialEq, Eq)]
pub struct CaseFile {
    /// Path as the user gave it.
    pub name: String,
    /// The text.
    pub text: String,
}

/// A mistake in a case file: what is wrong, where, what was expected, what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The case file.
    pub file: Arc<CaseFile>,
    /// The mistake.
    pub message: String,
    /// Bytes of the file at fault.
    pub span: Option<Range<usize>>,
    /// The expected input.
    pub expected: String,
    /// The section that the place belongs to, with its name.
    pub section: Option<(Range<usize>, String)>,
    /// The nearest valid name, the known keys, what to do.
    pub help: Vec<String>,
}

impl Mistake {
    /// A mistake at `span`.
    pub fn new(file: &Arc<CaseFile>, message: impl Into<String>, span: Range<usize>) -> Box<Self> {
        Box::new(Mistake {
            file: file.clone(),
            message: message.into(),
            span: Some(span),
            expected: String::new(),
            section: None,
            help: Vec::new(),
        })
    }

    /// A mistake at `span` with the words of a plugin, a body or a material.
    pub fn explained(file: &Arc<CaseFile>, words: Explanation, span: Range<usize>) -> Box<Self> {
        let mistake = Self::new(file, words.message, span).expected(words.expected);
        match words.help.is_empty() {
            true => mistake,
            false => mistake.help(words.help),
        }
    }

    /// A mistake of the file as a whole.
    pub fn of_file(file: &Arc<CaseFile>, message: impl Into<String>) -> Box<Self> {
        let mut error = Self::new(file, message, 0..0);
        error.span = None;
        error
    }

    /// Adds what was expected at the place.
    pub fn expected(mut self: Box<Self>, expected: impl Into<String>) -> Box<Self> {
        self.expected = expected.into();
        self
    }

    /// Adds a line of help.
    pub fn help(mut self: Box<Self>, help: impl Into<String>) -> Box<Self> {
        self.help.push(help.into());
        self
    }

    /// Names the section that the place belongs to, unless the place is its header.
    pub fn within(mut self: Box<Self>, header: Range<usize>, name: impl Into<String>) -> Box<Self> {
        let inside = self.span.as_ref().is_some_and(|span| {
            let line = |at: usize| self.file.text[..at].matches('\n').count();
            line(span.start) != line(header.start)
        });
        if inside {
            self.section = Some((header, name.into()));
        }
        self
    }

    /// The message with its source line, a mark under the place, and help.
    pub fn render(&self, colour: bool) -> String {
        let mut group = Group::with_title(Level::ERROR.primary_title(self.message.as_str()));
        match &self.span {
            Some(span) => {
                let mark = AnnotationKind::Primary.span(self.visible(span));
                let mark = if self.expected.is_empty() {
                    mark
                } else {
                    mark.label(self.expected.as_str())
                };
                let snippet = Snippet::source(self.file.text.as_str())
                    .path(self.file.name.as_str())
                    .annotation(mark);
                let section = self.section.as_ref().map(|(header, name)| {
                    AnnotationKind::Context
                        .span(self.visible(header))
                        .label(name.as_str())
                });
                group = group.element(snippet.annotations(section));
            }
            None => {
                let place = annotate_snippets::Origin::path(self.file.name.as_str());
                group = group.element(place);
            }
        }
        for help in &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        let renderer = if colour {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        renderer.render(&[group]).to_string()
    }

    /// The first line of a span, and at least one character of the text. A span that ends within a
    /// character, as that of a TOML error may, is extended to the whole character.
    fn visible(&self, span: &Range<usize>) -> Range<usize> {
        let text = &self.file.text;
        let start = text.floor_char_boundary(span.start);
        let end = text.ceil_char_boundary(span.end.max(start));
        let line = text[start..end].lines().next().unwrap_or("").len();
        let character = text[start..].chars().next().map_or(0, char::len_utf8);
        start..start + line.max(character)
    }
}

/// Mistakes shown at once; more of them have mostly one cause.
const MOST_SHOWN: usize = 20;

/// All mistakes that were found in a case file, in the order of their lines.
///
/// `Display` gives the plain text with the source lines; [`CaseError::render`] adds colour.
#[derive(Debug, Clone)]
pub struct CaseError {
    /// At least one.
    mistakes: Vec<Mistake>,
}

impl CaseError {
    /// The mistakes, at least one.
    pub fn mistakes(&self) -> &[Mistake] {
        &self.mistakes
    }

    /// Adds a line of help to the last mistake.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        if let Some(last) = self.mistakes.last_mut() {
            last.help.push(help.into());
        }
        self
    }

    /// The first mistakes as [`Mistake::render`] shows them, and the number of all of them where there are several.
    pub fn render(&self, colour: bool) -> String {
        let shown = self.mistakes.iter().take(MOST_SHOWN);
        let mut parts: Vec<String> = shown.map(|mistake| mistake.render(colour)).collect();
        let count = self.mistakes.len();
        if let [first, _, ..] = self.mistakes.as_slice() {
            let file = &first.file.name;
            parts.push(match count > MOST_SHOWN {
                true => format!("{file}: {count} mistakes, the first {MOST_SHOWN} are shown"),
                false => format!("{file}: {count} mistakes"),
            });
        }
        parts.join("\n\n")
    }
}

impl fmt::Display for CaseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for CaseError {}

impl From<Box<Mistake>> for CaseError {
    fn from(mistake: Box<Mistake>) -> Self {
        CaseError {
            mistakes: vec![*mistake],
        }
    }
}

/// Collects the mistakes of parts of a case file that do not depend on each other.
#[derive(Debug, Default)]
pub(super) struct Mistakes(Vec<Mistake>);

impl Mistakes {
    /// Adds the mistakes of a part.
    pub fn add(&mut self, error: impl Into<CaseError>) {
        for mistake in error.into().mistakes {
            // two bodies may be made of one wrong material, and two plugins need what it lacks
            let is_same = |m: &Mistake| m.message == mistake.message && m.span == mistake.span;
            if !self.0.iter().any(is_same) {
                self.0.push(mistake);
            }
        }
    }

    /// The value of a part, or `None` after its mistakes were added.
    pub fn collect<T>(&mut self, part: Result<T, impl Into<CaseError>>) -> Option<T> {
        part.map_err(|e| self.add(e)).ok()
    }

    /// Whether there is no mistake.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The value of all parts, if none has a mistake.
    pub fn finish<T>(self, value: T) -> Result<T, CaseError> {
        match self.0.is_empty() {
            true => Ok(value),
            false => Err(self.into()),
        }
    }
}

impl From<Mistakes> for CaseError {
    fn from(Mistakes(mut mistakes): Mistakes) -> Self {
        // mistakes of the file as a whole come last
        let place = |m: &Mistake| m.span.as_ref().map_or(usize::MAX, |span| span.start);
        mistakes.sort_by_key(place);
        CaseError { mistakes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_within_a_character_or_beyond_the_text_is_shown() {
        let file = Arc::new(CaseFile {
            name: "case.toml".into(),
            text: "a = \"°é\"\n".into(),
        });
        for start in 0..15 {
            for end in start..15 {
                let shown = Mistake::new(&file, "wrong", start..end).render(false);
                assert!(shown.contains("wrong"), "{start}..{end}");
            }
        }
    }

    #[test]
    fn mistakes_are_shown_by_line_once_and_up_to_a_limit() {
        let file = Arc::new(CaseFile {
            name: "case.toml".into(),
            text: "x\n".repeat(30),
        });
        let found = |lines: &[usize]| {
            let mut mistakes = Mistakes::default();
            for line in lines {
                let at = 2 * line - 2;
                let wrong = Mistake::new(&file, format!("wrong in line {line}"), at..at + 1);
                mistakes.add(wrong);
            }
            mistakes.finish(()).expect_err("mistakes").to_string()
        };
        assert!(!found(&[4]).contains("mistakes"));
        let shown = found(&[7, 3, 7, 5]);
        assert!(shown.ends_with("\n\ncase.toml: 3 mistakes"), "{shown}");
        let place = |line| shown.find(&format!("wrong in line {line}"));
        assert!(place(3) < place(5) && place(5) < place(7), "{shown}");
        let shown = found(&(1..=25).collect::<Vec<_>>());
        assert!(
            shown.contains("line 20\n") && !shown.contains("line 21\n"),
            "{shown}"
        );
        assert!(
            shown.ends_with("25 mistakes, the first 20 are shown"),
            "{shown}"
        );
    }
}
