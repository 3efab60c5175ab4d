//! Printing text that may come from others: names, units, titles and case texts of logs.
//!
//! A terminal executes control characters in what is printed: they can change its title, write to the clipboard or hide lines.
//! [`Clean`] writes them as `\\u001b`, their form in JSON, and so the characters that change the direction of a line. All
//! output of the program goes through it.

use std::fmt::Write as _;
use std::io::{self, Stdout, Write};

/// Whether a character is written in another form.
fn is_hidden(c: char) -> bool {
    // the ends of lines and tabs are those of the program
    let is_control = c.is_control() && !matches!(c, '\n' | '\t');
    is_control
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A text without control characters.
#[must_use]
pub(crate) fn clean(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match is_hidden(c) {
            true => {
                let _ = write!(shown, "\\u{:04x}", u32::from(c));
            }
            false => shown.push(c),
        }
    }
    shown
}

/// Passes on text without control characters.
#[derive(Debug)]
pub(crate) struct Clean<W: Write> {
    to: W,
    /// Beginning of a character that is not complete.
    rest: Vec<u8>,
}

impl<W: Write> Clean<W> {
    pub(crate) fn new(to: W) -> Self {
        Self {
            to,
            rest: Vec::new(),
        }
    }
}

impl<W: Write> Write for Clean<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.rest.extend_from_slice(bytes);
        let complete = match std::str::from_utf8(&self.rest) {
            Ok(_) => self.rest.len(),
            // bytes that are no text are passed on as they are
            Err(error) if error.error_len().is_some() => self.rest.len(),
            Err(error) => error.valid_up_to(),
        };
        let text: Vec<u8> = self.rest.drain(..complete).collect();
        match String::from_utf8(text) {
            Ok(text) => self.to.write_all(clean(&text).as_bytes())?,
            Err(error) => {
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                self.to.write_all(clean(&text).as_bytes())?;
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Standard output for commands. It is not locked, because the thread that ends a long estimate also prints.
pub(crate) fn output() -> Clean<Stdout> {
    Clean::new(io::stdout())
}

/// Prints a line where errors go, if anything can be written there.
pub(crate) fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", clean(line));
}

/// Prints warnings where errors go.
pub fn warn(warnings: &[String]) {
    for sentence in warnings {
        tell(&format!("warning: {sentence}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_not_obeyed() {
        for (text, shown) in [
            ("\u{1b}]0;title\u{7}", "\\u001b]0;title\\u0007"),
            ("\u{9b}31m\u{7f}\r", "\\u009b31m\\u007f\\u000d"),
            ("a\u{202e}b", "a\\u202eb"),
            ("Grün µm 温度\n\t", "Grün µm 温度\n\t"),
        ] {
            assert_eq!(clean(text), shown);
            // whatever the parts in which it is written
            for size in 1..4 {
                let mut out = Clean::new(Vec::new());
                for part in text.as_bytes().chunks(size) {
                    out.write_all(part).expect("memory");
                }
                assert_eq!(String::from_utf8(out.to).expect("text"), shown);
            }
        }
    }
}
