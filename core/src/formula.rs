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
mod tests {
    use super::*;

    #[test]
    fn functions_of_two_arguments_stand_in_both_arguments_of_others() {
        for (text, value) in [
            ("min(1, max(0, t))", 0.5),
            ("min(max(0, t), 1)", 0.5),
            ("min(1, 2 + max(0, t))", 1.0),
            (
                "max( atan2 (t, 1) , min(-1,-max(2, t)) )",
                0.5_f64.atan2(1.0),
            ),
            ("2 * min(3, max(1, min(t, 7)))^2 + sin(max(0, 0 * t))", 2.0),
            ("-max(1, max(t, 2))^2", -4.0),
            ("min(sqrt(max(4, t)), 3)", 2.0),
        ] {
            let formula = Formula::new(text).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(formula.at([0.0; 3], 0.5), value, "{text}");
        }
        for text in ["min(1)", "min(1, 2, 3)", "max(1, min(2)", "min 1, 2"] {
            assert!(Formula::new(text).is_err(), "{text}");
        }
    }

    #[test]
    fn formulas_are_evaluated_at_a_place_and_time() {
        let formula = Formula::new("y^2 * exp(-t) + sin(PI * x) - 10e-1").expect("valid");
        let value = formula.at([0.5, 3.0, 7.0], 2.0);
        assert!((value - 9.0 * (-2.0f64).exp()).abs() < 1e-14);
        assert_eq!(Formula::new("4").expect("valid").at([0.0; 3], 0.0), 4.0);
    }

    #[test]
    fn powers_bind_more_tightly_than_signs() {
        for (text, expected) in [
            ("-x^2", -9.0),
            ("(-x)^2", 9.0),
            ("exp(-(x - 1)^2)", (-4.0f64).exp()),
            ("1 + -x^2", -8.0),
            ("1 - -x^2", 10.0),
            ("2 * -x^2", -18.0),
            ("18 / -x^2", -2.0),
            ("x^-2", 1.0 / 9.0),
            ("-x^2 + x", -6.0),
            ("1e-2 * x^2", 0.09),
            ("atan2(0, -x^2)", std::f64::consts::PI),
        ] {
            let value = Formula::new(text).expect(text).at([3.0, 0.0, 0.0], 0.0);
            assert!((value - expected).abs() < 1e-14, "{text}: {value}");
        }
    }

    /// Values at x = 3, y = 2, z = 5, t = 4.
    #[test]
    fn operators_constants_and_functions_have_their_usual_meaning() {
        use std::f64::consts::{E, PI};
        for (text, expected) in [
            ("pi", PI),
            ("PI", PI),
            ("2*pi*x", 6.0 * PI),
            ("e", E),
            ("E", E),
            ("e^2", E * E),
            ("2*e-3", 2.0 * E - 3.0),
            ("1e-3", 1e-3),
            ("1E+3", 1e3),
            ("1.5e3*x", 4500.0),
            (".5*x", 1.5),
            ("2.*x", 6.0),
            ("x^-1e0", 1.0 / 3.0),
            ("400 + -(1000*x)^2", 400.0 - 9e6),
            ("-min(x, y)", -2.0),
            ("2*max(x, y)^2", 18.0),
            ("min(-x^2, -3)", -9.0),
            ("1 - max(x, y) - 1", -3.0),
            ("-sin(x)^2", -(3.0_f64.sin().powi(2))),
            ("x/y/z", 0.3),
            ("x/y*z", 7.5),
            ("x*y/z", 1.2),
            ("x - y - z", -4.0),
            ("x - y + z", 6.0),
            ("x + y - z", 0.0),
            ("+x^2", 9.0),
            ("(x^2)^3", 729.0),
            ("2^(x^2)", 512.0),
            ("x^2*y^3 - z^2", 47.0),
            ("atan2(y, x)", 2.0_f64.atan2(3.0)),
            ("log(x)", 3.0_f64.ln()),
            ("ln(x)", 3.0_f64.ln()),
            ("log10(x)", 3.0_f64.log10()),
            ("t * exp(-2 * t)", 4.0 * (-8.0_f64).exp()),
        ] {
            let formula = Formula::new(text).expect(text);
            let value = formula.at([3.0, 2.0, 5.0], 4.0);
            assert!(
                (value - expected).abs() < 1e-14 * expected.abs().max(1.0),
                "{text}: {value} {expected}"
            );
        }
        for function in FUNCTIONS {
            let two = ["atan2", "min", "max"].contains(&function);
            let text = format!("{function}({}x)", if two { "y, " } else { "" });
            assert!(Formula::new(&text).is_ok(), "{text}");
        }
    }

    #[test]
    fn a_power_of_a_power_needs_parentheses() {
        for text in ["2^3^2", "2^-x^2", "exp(x^y^z)", "2^(x)^2"] {
            let error = Formula::new(text).expect_err(text).to_string();
            assert!(error.contains("two meanings"), "{error}");
        }
        for text in [
            "x^2 + y^2",
            "x^(y^2)",
            "x^2*y^2",
            "x^-2 - y^2",
            "max(x^2, y^2)",
            "(x^2)^2",
        ] {
            assert!(Formula::new(text).is_ok(), "{text}");
        }
    }

    #[test]
    fn a_number_is_a_constant_formula() {
        #[derive(Deserialize)]
        struct Keys {
            all: [Formula; 4],
        }
        let keys: Keys = toml::from_str("all = [-2, 3.5, '2 * t', -1e-7]").expect("valid");
        let values = keys.all.map(|f| f.at([0.0; 3], 4.0));
        assert_eq!(values, [-2.0, 3.5, 8.0, -1e-7]);
        assert!(toml::from_str::<Keys>("all = [true, 0, 0, 0]").is_err());
    }

    #[test]
    fn mistakes_are_named() {
        let unknown = Formula::new("2 * r").expect_err("r is unknown").to_string();
        assert!(unknown.contains("`r`"), "{unknown}");
        let misspelt = Formula::new("293 + fire_iso834(t)")
            .expect_err("iso_834")
            .to_string();
        assert!(
            misspelt.contains("did you mean `fire_iso_834`?"),
            "{misspelt}"
        );
        let broken = Formula::new("2 * (x")
            .expect_err("it does not end")
            .to_string();
        assert!(broken.contains("cannot be read"), "{broken}");
    }
}
