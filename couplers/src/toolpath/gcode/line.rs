//! A line of a program: its words, without comments and checksum.
//!
//! A word is a letter and a number. Comments end with their line: `( ... )`, in which balanced brackets may stand, and `;`.
//! A checksum `*nn` at the end of a line is not verified. Arguments of codes of printers may be a letter alone (`G28 X`) or
//! a text in quotation marks (`M862.3 P "name"`); what follows `M117` and its like is a text up to the end of the line.

use std::fmt;

/// `M` codes whose text reaches up to the end of the line: files, messages, checks of the machine's name.
const WITH_TEXT: [u32; 7] = [16, 23, 28, 32, 117, 118, 928];

/// Value after the letter of a word.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Number(f64),
    /// A text in quotation marks.
    Text,
    /// No value: the letter is a switch.
    Missing,
}

/// A letter, in upper case, and its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word {
    pub letter: char,
    pub value: Value,
}

/// The number of a `G` or `M` code, such as 92.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Code {
    pub major: u32,
    /// Digit after the point.
    pub minor: u32,
}

impl Code {
    /// The code with a number, if it can be one.
    pub fn new(number: f64) -> Option<Code> {
        let tenths = 10.0 * number;
        let is_code = (0.0..1e6).contains(&tenths) && (tenths - tenths.round()).abs() < 1e-6;
        let tenths = tenths.round() as u32;
        is_code.then_some(Code {
            major: tenths / 10,
            minor: tenths % 10,
        })
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.minor {
            0 => write!(f, "{}", self.major),
            minor => write!(f, "{}.{minor}", self.major),
        }
    }
}

/// Content of a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Line {
    /// `%`: begin or end of the program.
    Tape,
    /// Words; `deletable`: it begins with `/`.
    Block { words: Vec<Word>, deletable: bool },
}

impl Line {
    /// Reads a line; an error says what is wrong with it.
    pub fn read(text: &str) -> Result<Line, String> {
        let text = text.trim();
        if let Some(rest) = text.strip_prefix('%') {
            return match after_comments(rest)? {
                "" => Ok(Line::Tape),
                _ => Err("a `%`, begin or end of a program, needs a line of its own".into()),
            };
        }
        let deletable = text.starts_with('/');
        let mut rest = text;
        if deletable {
            // the number of the switch, `/2`
            rest = rest[1..].trim_start_matches(|c: char| c.is_ascii_digit());
        }
        let mut words: Vec<Word> = Vec::new();
        loop {
            rest = after_comments(rest)?;
            if let Some(checksum) = rest.strip_prefix('*') {
                rest = checksum.trim_start_matches(|c: char| c.is_ascii_digit());
                if rest.len() == checksum.len() || !after_comments(rest)?.is_empty() {
                    return Err("a `*` is followed by a checksum and the end of the line".into());
                }
                break;
            }
            if rest.is_empty() {
                break;
            }
            let (word, after) = read_word(rest)?;
            let has_text = matches!(word, Word { letter: 'M', value: Value::Number(number) }
                if Code::new(number).is_some_and(|c| c.minor == 0 && WITH_TEXT.contains(&c.major)));
            words.push(word);
            if has_text {
                break;
            }
            rest = after;
        }
        Ok(Line::Block { words, deletable })
    }
}

/// The text after blanks and comments.
fn after_comments(text: &str) -> Result<&str, String> {
    let mut rest = text.trim_start();
    loop {
        rest = match rest.chars().next() {
            Some(';') => return Ok(""),
            Some(')') => return Err("a `)` has no `(` before it".into()),
            Some('(') => after_brackets(rest)?.trim_start(),
            _ => return Ok(rest),
        };
    }
}

/// The text after the bracket that closes the first one.
fn after_brackets(text: &str) -> Result<&str, String> {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Ok(&text[at + c.len_utf8()..]);
        }
    }
    Err("a comment `(` is not closed in its line; close each bracket, or write `;`".into())
}

/// The first word of a text, and the text after it.
fn read_word(text: &str) -> Result<(Word, &str), String> {
    let chunk = text.split_whitespace().next().unwrap_or(text);
    let strange =
        |more: &str| format!("`{chunk}` is not understood: a word is a letter and a number{more}");
    let letter = match text.chars().next() {
        Some(c) if c.is_ascii_alphabetic() => c.to_ascii_uppercase(),
        Some('#' | '[' | '=') => return Err(strange(EXPRESSION)),
        Some('/') => return Err(strange("; a `/` is the first character of its line")),
        Some('%') => return Err(strange("; a `%` needs a line of its own")),
        _ => return Err(strange("")),
    };
    let after = text[1..].trim_start();
    let word = |value| Word { letter, value };
    if let Some(quoted) = after.strip_prefix('"') {
        let end = quoted
            .find('"')
            .ok_or("a text `\"` is not closed in its line")?;
        return Ok((word(Value::Text), &quoted[end + 1..]));
    }
    let length = number_length(after);
    if length == 0 {
        return match after.chars().next() {
            Some('#' | '[' | '=') => Err(strange(EXPRESSION)),
            Some(c) if "(;*".contains(c) => Ok((word(Value::Missing), after)),
            // a letter alone is followed by a blank
            Some(c) if c.is_ascii_alphabetic() && after.len() < text.len() - 1 => {
                Ok((word(Value::Missing), after))
            }
            Some(_) => Err(strange("")),
            None => Ok((word(Value::Missing), after)),
        };
    }
    let (number, rest) = after.split_at(length);
    if has_exponent(rest) {
        return Err(strange(
            " without an exponent; before the `E` of an extruder write a blank",
        ));
    }
    if rest.starts_with(|c: char| {
        !c.is_ascii_alphabetic() && !c.is_whitespace() && !"(;*)".contains(c)
    }) {
        return Err(strange(""));
    }
    match number.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok((word(Value::Number(number)), rest)),
        _ => Err(strange("")),
    }
}

const EXPRESSION: &str = "; variables and expressions are not evaluated";

/// Length of the number at the start of a text: a sign, digits, a point, digits.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| {
        let count = text[from..].bytes().take_while(u8::is_ascii_digit).count();
        from + count
    };
    let sign = usize::from(text.starts_with(['+', '-']));
    let whole = digits(sign);
    let end = match text[whole..].starts_with('.') {
        true => digits(whole + 1),
        false => whole,
    };
    let has_digits = text[sign..end].bytes().any(|c| c.is_ascii_digit());
    if has_digits { end } else { 0 }
}

/// Whether `E` and a whole number follow a number without a blank: an exponent, or the word of an extruder.
fn has_exponent(rest: &str) -> bool {
    let Some(after) = rest.strip_prefix(['E', 'e']) else {
        return false;
    };
    let length = number_length(after);
    length > 0 && !after[..length].contains('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a line as `X1.5`, `X` (no value) and `P"`.
    fn words(text: &str) -> Result<Vec<String>, String> {
        let Line::Block { words, .. } = Line::read(text)? else {
            return Ok(vec!["%".into()]);
        };
        let as_text = |word: &Word| match word.value {
            Value::Number(number) => format!("{}{number}", word.letter),
            Value::Text => format!("{}\"", word.letter),
            Value::Missing => word.letter.to_string(),
        };
        Ok(words.iter().map(as_text).collect())
    }

    #[test]
    fn a_line_is_a_row_of_words() {
        for (text, expected) in [
            ("G01X+.5Y-2.", "G1 X0.5 Y-2"),
            ("  g1 x 10\ty20  ", "G1 X10 Y20"),
            ("N10 G1 X1*99", "N10 G1 X1"),
            ("G1 X1 *7 ; checked", "G1 X1"),
            ("%", "%"),
            (" % (begin)", "%"),
            ("G28 X Y", "G28 X Y"),
            ("G28 X Y0", "G28 X Y0"),
            ("G28 W; mesh", "G28 W"),
            ("M862.3 P \"MK3S\"", "M862.3 P\""),
            ("M117 Layer 1 (of 2", "M117"),
            ("N3 M117 E", "N3 M117"),
            ("G1 X10E0.4", "G1 X10 E0.4"),
            ("G1 X10 E-3", "G1 X10 E-3"),
            ("", ""),
        ] {
            assert_eq!(words(text).expect(text).join(" "), expected, "{text}");
        }
        let deletable = |text: &str| {
            matches!(
                Line::read(text),
                Ok(Line::Block {
                    deletable: true,
                    ..
                })
            )
        };
        assert!(deletable("/G1 X1") && deletable(" /2 G1 X1") && !deletable("G1 X1"));
        assert_eq!(words("/2 G1 X1").expect("a block").join(" "), "G1 X1");
    }

    #[test]
    fn comments_end_with_their_line() {
        for text in [
            "X1 (a) Y2",
            "X1 (length (X): 20 mm) Y2",
            "(a)X1(b)Y2(c)",
            "X1 Y2 ; (open",
            "X1 (a ; b) Y2 ;)",
        ] {
            assert_eq!(words(text).expect(text).join(" "), "X1 Y2", "{text}");
        }
        for (text, message) in [
            ("X1 (open", "`(` is not closed"),
            ("X1 (root pass (1)", "`(` is not closed"),
            ("(open", "`(` is not closed"),
            ("X1 ) Y2", "`)` has no `(`"),
            ("X1) Y2", "`)` has no `(`"),
            ("X1 (a)) Y2", "`)` has no `(`"),
        ] {
            let found = words(text).expect_err(text);
            assert!(found.contains(message), "{text}: {found}");
        }
    }

    #[test]
    fn what_is_no_word_is_told() {
        for (text, message) in [
            (
                "X1e3",
                "`X1e3` is not understood: a word is a letter and a number without an exponent",
            ),
            ("X1E-3 Y2", "without an exponent"),
            ("X1.2.3", "`X1.2.3` is not understood"),
            ("X1 5", "`5` is not understood"),
            ("X--1", "`X--1`"),
            ("X.", "`X.`"),
            ("X#1", "variables and expressions are not evaluated"),
            ("#1=5", "variables"),
            ("X[1+2]", "variables"),
            ("START_PRINT BED=60", "`START_PRINT` is not understood"),
            ("end of tape", "`end` is not understood"),
            ("$H", "`$H`"),
            ("X1,C2", "`X1,C2`"),
            ("X1/2", "`X1/2`"),
            ("G1 /X1", "first character of its line"),
            ("% O1", "a line of its own"),
            ("M862.3 P \"MK3S", "not closed"),
            ("X1*", "checksum"),
            ("X1*7 Y2", "checksum"),
            ("X1é", "`X1é`"),
            ("é", "`é`"),
        ] {
            let found = words(text).expect_err(text);
            assert!(found.contains(message), "{text}: {found}");
        }
    }
}
