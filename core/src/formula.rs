//! Formulas in case files, such as `"0.04 * sin(2 * pi * x)"`.
//!
//! Operators are `+ - * / ^` and parentheses, with the usual order: `-x^2` is `-(x^2)`. `a^b^c` is refused, because programs
//! differ in what they take it for. Numbers may have exponents (`1e-3`). Constants are `pi` or `PI`, and `e` or `E` (Euler's
//! number). Functions are [`FUNCTIONS`]; `log` is the natural logarithm, as `ln`, and [`fire`](crate::fire) has those of fires.

use std::borrow::Cow;
use std::fmt;

use exmex::{
    Express, FlatEx, FloatOpsFactory, MakeOperators, MatchLiteral, Operator,
    literal_matcher_from_pattern,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::explanation::nearest;
use crate::fire::FIRE_CURVES;

/// Variables of a formula in position and time.
const VARIABLES: [&str; 4] = ["x", "y", "z", "t"];

/// Functions of a formula.
pub const FUNCTIONS: [&str; 32] = [
    "abs",
    "signum",
    "sqrt",
    "cbrt",
    "exp",
    "ln",
    "log",
    "log2",
    "log10",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "floor",
    "round",
    "ceil",
    "trunc",
    "fract",
    "min",
    "max",
    "fire_iso_834",
    "fire_hydrocarbon",
    "fire_external",
];

/// Functions of two arguments.
const OF_TWO: [&str; 3] = ["atan2", "min", "max"];

literal_matcher_from_pattern!(
    ScientificNumber,
    r"^([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
);

/// The operators and functions of formulas.
#[derive(Clone, Debug)]
struct Functions;

impl MakeOperators<f64> for Functions {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        let fires = FIRE_CURVES.map(|curve| Operator::make_unary(curve.name, curve.rise));
        let mut functions = FloatOpsFactory::<f64>::make();
        functions.extend(fires);
        functions
    }
}

type Expression = FlatEx<f64, Functions, ScientificNumber>;

/// A formula in the position x, y, z (m) and the time t (s).
#[derive(Clone, Debug)]
pub struct Formula {
    text: String,
    parsed: Box<Expression>,
    /// Names of its variables.
    variables: &'static [&'static str],
    /// Which of them it uses, in the order of the parser.
    used: Vec<usize>,
}

/// A mistake in a formula.
#[derive(Debug, thiserror::Error)]
pub enum FormulaError {
    /// It cannot be read.
    #[error("the formula `{text}` cannot be read: {cause}")]
    Syntax {
        /// The formula.
        text: String,
        /// Error of the parser.
        cause: String,
    },
    /// An unknown name.
    #[error(
        "`{name}` in the formula `{text}` is unknown{}; known are {known}, pi, e and the functions {}",
        nearest.map_or(String::new(), |nearest| format!(", did you mean `{nearest}`?")),
        FUNCTIONS.join(", ")
    )]
    Variable {
        /// The formula.
        text: String,
        /// The name.
        name: String,
        /// The variable or function that it may be a slip of.
        nearest: Option<&'static str>,
        /// Names of the variables.
        known: String,
    },
    /// A power of a power without parentheses.
    #[error("`a^b^c` in the formula `{text}` has two meanings; write `(a^b)^c` or `a^(b^c)`")]
    Powers {
        /// The formula.
        text: String,
    },
}

impl Formula {
    /// Reads a formula.
    ///
    /// # Errors
    /// [`FormulaError`].
    pub fn new(text: &str) -> Result<Formula, FormulaError> {
        Self::in_variables(text, &VARIABLES)
    }

    /// Reads a formula in other variables, at most eight, whose value is [`Formula::of`] them.
    ///
    /// # Errors
    /// [`FormulaError`].
    pub fn in_variables(
        text: &str,
        variables: &'static [&'static str],
    ) -> Result<Formula, FormulaError> {
        let syntax = |e: exmex::ExError| FormulaError::Syntax {
            text: text.into(),
            cause: e.msg().into(),
        };
        if has_chained_powers(text) {
            return Err(FormulaError::Powers { text: text.into() });
        }
        let unknown = |name: &str| FormulaError::Variable {
            text: text.into(),
            name: name.into(),
            nearest: nearest(name, variables.iter().copied().chain(FUNCTIONS)),
            known: variables.join(", "),
        };
        if let Some(name) = unknown_function(text, variables) {
            return Err(unknown(name));
        }
        let rewritten = with_operators(&with_usual_signs(text));
        let parsed = Expression::parse(&rewritten).map_err(syntax)?;
        let place = |name: &String| {
            let known = variables.iter().chain(&["pi"]).position(|v| v == name);
            known.ok_or_else(|| unknown(name))
        };
        let used = parsed
            .var_names()
            .iter()
            .map(place)
            .collect::<Result<_, _>>()?;
        Ok(Formula {
            text: text.into(),
            parsed: Box::new(parsed),
            variables,
            used,
        })
    }

    /// The text of the formula.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether it is a formula in the time alone.
    pub fn is_of_time(&self) -> bool {
        !self
            .used
            .iter()
            .any(|v| ["x", "y", "z"].contains(&self.name(*v)))
    }

    /// Whether it depends on the time.
    pub fn depends_on_time(&self) -> bool {
        self.used.iter().any(|v| self.name(*v) == "t")
    }

    /// Name of a variable; the parser takes `pi` for one.
    fn name(&self, variable: usize) -> &str {
        self.variables.get(variable).unwrap_or(&"pi")
    }

    /// The value at a position (m) and time (s).
    pub fn at(&self, [x, y, z]: [f64; 3], time: f64) -> f64 {
        self.of(&[x, y, z, time])
    }

    /// The value for values of all its variables.
    pub fn of(&self, all: &[f64]) -> f64 {
        let mut values = [0.0; 9];
        let used = values.iter_mut().zip(&self.used);
        used.for_each(|(value, v)| *value = all.get(*v).copied().unwrap_or(std::f64::consts::PI));
        self.parsed
            .eval(&values[..self.used.len()])
            .expect("there is a value for every variable")
    }
}

/// The formula for a parser that takes `-x^2` for `(-x)^2`: signs become differences and factors, so that powers bind more
/// tightly, as is usual. A sign of an exponent stays.
fn with_usual_signs(text: &str) -> Cow<'_, str> {
    if !text.contains('^') {
        return text.into();
    }
    let mut rewritten = String::with_capacity(text.len() + 8);
    let mut before = None;
    for c in text.chars() {
        match (c, before) {
            ('-', None | Some('(' | ',')) => rewritten.push_str("0-"),
            ('-', Some('+' | '-' | '*')) => rewritten.push_str("(-1)*"),
            ('-', Some('/')) => rewritten.push_str("(-1)/"),
            _ => rewritten.push(c),
        }
        if !c.is_whitespace() {
            before = Some(c);
        }
    }
    rewritten.into()
}

/// The formula for a parser that does not read a function of two arguments in the second argument of another one: `min(a, b)`
/// becomes `((a) min (b))`.
fn with_operators(text: &str) -> String {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut names = text.match_indices(is_of_name).map(|(at, _)| at);
    let found = names.find_map(|at| {
        if text[..at].ends_with(is_of_name) {
            return None;
        }
        let name = OF_TWO.iter().find(|name| text[at..].starts_with(**name))?;
        let (first, second, rest) = two_arguments(&text[at + name.len()..])?;
        let [first, second, rest] = [first, second, rest].map(with_operators);
        Some(format!(
            "{}(({first}) {name} ({second})){rest}",
            &text[..at]
        ))
    });
    found.unwrap_or_else(|| text.into())
}

/// Two arguments in parentheses at the start of a text, and what follows.
fn two_arguments(text: &str) -> Option<(&str, &str, &str)> {
    let inside = text.trim_start().strip_prefix('(')?;
    let (mut depth, mut comma) = (0, None);
    for (at, c) in inside.char_indices() {
        match c {
            '(' => depth += 1,
            ')' if depth == 0 => {
                let (first, second) = inside[..at].split_at(comma?);
                return Some((first, &second[1..], &inside[at + 1..]));
            }
            ')' => depth -= 1,
            ',' if depth == 0 && comma.is_some() => return None,
            ',' if depth == 0 => comma = Some(at),
            _ => {}
        }
    }
    None
}

/// The first name in front of a parenthesis that is no function: the parser calls it an operand without an operator.
fn unknown_function<'a>(text: &'a str, variables: &[&str]) -> Option<&'a str> {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let parts = text.split('(');
    let before = parts.map(|part| {
        let part = part.trim_end();
        let name = part.trim_end_matches(is_of_name);
        &part[name.len()..]
    });
    // no parenthesis follows the last part
    let count = text.matches('(').count();
    let named = |name: &&str| name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let known = |name: &str| {
        FUNCTIONS.contains(&name)
            || variables.contains(&name)
            || ["pi", "PI", "e", "E"].contains(&name)
    };
    before.take(count).filter(named).find(|name| !known(name))
}

/// Whether an exponent is followed by another one, as in `a^b^c`.
fn has_chained_powers(text: &str) -> bool {
    // whether the operand follows `^`, by level of parentheses
    let mut is_exponent = vec![false];
    let mut before = [' ', ' '];
    for c in text.chars().filter(|c| !c.is_whitespace()) {
        let depth = is_exponent.len();
        let level = is_exponent.last_mut();
        match (c, level) {
            ('(', _) => is_exponent.push(false),
            (')', _) if depth > 1 => {
                is_exponent.pop();
            }
            ('^', Some(true)) => return true,
            ('^', Some(level)) => *level = true,
            ('+' | '-' | '*' | '/' | ',', Some(level)) => {
                let is_of_number =
                    matches!(before[1], 'e' | 'E') && matches!(before[0], '0'..='9' | '.');
                let is_sign = matches!(c, '+' | '-') && (before[1] == '^' || is_of_number);
                *level = *level && is_sign;
            }
            _ => {}
        }
        before = [before[1], c];
    }
    false
}

impl PartialEq for Formula {
    fn eq(&self, other: &Formula) -> bool {
        self.text == other.text
    }
}

impl Serialize for Formula {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

/// A text, or a number for a formula that is constant.
impl<'de> Deserialize<'de> for Formula {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FormulaVisitor;
        impl de::Visitor<'_> for FormulaVisitor {
            type Value = Formula;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, or a formula in x, y, z (m) and t (s)")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Formula, E> {
                Formula::new(text).map_err(E::custom)
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Formula, E> {
                self.visit_str(&value.to_string())
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Formula, E> {
                self.visit_str(&value.to_string())
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Formula, E> {
                self.visit_str(&value.to_string())
            }
        }
        deserializer.deserialize_any(FormulaVisitor)
    }
}

impl JsonSchema for Formula {
    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({
            "type": ["string", "number"],
            "description": "formula in x, y, z (m) and t (s), such as \"0.04 * sin(2 * pi * x)\"; operators + - * / ^, constants pi and e, functions abs, sqrt, exp, ln, log10, sin, cos, tan, atan2(y, x), min(a, b), max(a, b), fire_iso_834(t) and others"
        })
    }
}

#[cfg(test)]
mod tests;
