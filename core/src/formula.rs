//! Formulas in case files, such as `"0.04 * sin(2 * PI * x)"`.

use std::borrow::Cow;
use std::fmt;

use exmex::{Express, FlatEx, FloatOpsFactory, MatchLiteral, literal_matcher_from_pattern};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Variables of a formula in position and time.
const VARIABLES: [&str; 4] = ["x", "y", "z", "t"];

literal_matcher_from_pattern!(
    ScientificNumber,
    r"^([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
);

type Expression = FlatEx<f64, FloatOpsFactory<f64>, ScientificNumber>;

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
        "`{name}` in the formula `{text}` is unknown; known are {known}, PI, E and functions such as sin, exp and sqrt"
    )]
    Variable {
        /// The formula.
        text: String,
        /// The name.
        name: String,
        /// Names of the variables.
        known: String,
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
        let parsed = Expression::parse(&with_usual_signs(text)).map_err(syntax)?;
        let place = |name: &String| {
            let known = variables.iter().position(|v| v == name);
            known.ok_or_else(|| FormulaError::Variable {
                text: text.into(),
                name: name.clone(),
                known: variables.join(", "),
            })
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

    /// Whether it is a formula in the time alone.
    pub fn is_of_time(&self) -> bool {
        self.used.iter().all(|v| self.variables[*v] == "t")
    }

    /// The value at a position (m) and time (s).
    pub fn at(&self, [x, y, z]: [f64; 3], time: f64) -> f64 {
        self.of(&[x, y, z, time])
    }

    /// The value for values of all its variables.
    pub fn of(&self, all: &[f64]) -> f64 {
        let mut values = [0.0; 8];
        let used = values.iter_mut().zip(&self.used);
        used.for_each(|(value, v)| *value = all[*v]);
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
            "description": "formula in x, y, z (m) and t (s), such as \"0.04 * sin(2 * PI * x)\""
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let broken = Formula::new("2 * (x")
            .expect_err("it does not end")
            .to_string();
        assert!(broken.contains("cannot be read"), "{broken}");
    }
}
