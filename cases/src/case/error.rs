//! Mistakes in a case file, shown at the line and key where they are.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// Text of a case file and the name that messages use for it.
#[derive(Debug)]
pub struct CaseFile {
    /// Path as the user gave it.
    pub name: String,
    /// The text.
    pub text: String,
}

/// A mistake in a case file: what is wrong, where, what was expected, what to do.
///
/// `Display` gives the plain text with the source line; [`CaseError::render`] adds colour.
#[derive(Debug, Clone)]
pub struct CaseError {
    /// The case file.
    pub file: Arc<CaseFile>,
    /// What is wrong.
    pub message: String,
    /// Bytes of the file at fault.
    pub span: Option<Range<usize>>,
    /// What was expected there.
    pub expected: String,
    /// The section that the place belongs to, with its name.
    pub section: Option<(Range<usize>, String)>,
    /// The nearest valid name, the known keys, what to do.
    pub help: Vec<String>,
}

impl CaseError {
    /// A mistake at `span`.
    pub fn new(file: &Arc<CaseFile>, message: impl Into<String>, span: Range<usize>) -> Box<Self> {
        Box::new(CaseError {
            file: file.clone(),
            message: message.into(),
            span: Some(span),
            expected: String::new(),
            section: None,
            help: Vec::new(),
        })
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

impl fmt::Display for CaseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for CaseError {}

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
                let shown = CaseError::new(&file, "wrong", start..end).render(false);
                assert!(shown.contains("wrong"), "{start}..{end}");
            }
        }
    }
}
