//! `[[verify]]`: a number of a run with its reference, as a case file writes it.
//!
//! ```toml
//! [[verify]]
//! quantity = "temperature on the axis at 300 s, °C"
//! measure.field = { field = "temperature", at = [[0, 0, 0]], time = 300, offset = -273.15 }
//! reference = -1.0056
//! limit.absolute = 0.02
//! source = "cases/references/stefan_neumann.py: enthalpy finite volumes"
//! ```

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limit::Limit;
use crate::case::sections::Components;
pub use measure::*;

mod measure;

/// A measurement, its reference and the limit of their difference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// Name of the quantity with its unit, one line.
    pub quantity: String,
    /// What is measured.
    pub measure: Measure,
    /// Another case, whose same measurement divides this one.
    #[serde(default)]
    pub of: Option<String>,
    /// Other cases, whose same measurements are subtracted from this one.
    #[serde(default)]
    pub minus: Vec<String>,
    /// Another case, whose error divides the error of this one: the limit applies to the ratio, which is 1 for equal
    /// errors. The error is the root mean square of the differences between the same measurements and the reference.
    #[serde(default)]
    pub error_of: Option<String>,
    /// The reference: one number for all measured values, or one for each.
    pub reference: Components,
    /// Limit of the difference between measured value and reference.
    pub limit: Limit,
    /// Source of the reference.
    pub source: String,
    /// When it is checked.
    #[serde(default)]
    pub level: Level,
}

impl Check {
    /// The other cases with which the check compares.
    pub fn others(&self) -> impl Iterator<Item = &String> {
        self.of.iter().chain(&self.minus).chain(&self.error_of)
    }

    /// Compares the values of this case with those of the other cases, in the order of [`Check::others`].
    ///
    /// # Errors
    /// More than one kind of comparison in one check.
    pub(super) fn compare(&self, own: &[f64], others: &[&[f64]]) -> Result<Vec<f64>, String> {
        let combine = |a: &[f64], b: &[f64], f: fn(f64, f64) -> f64| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
        };
        match (&self.of, self.minus.as_slice(), &self.error_of) {
            (None, [], None) => Ok(own.to_vec()),
            (Some(_), [], None) => Ok(combine(own, others[0], |a, b| a / b)),
            (None, [_, ..], None) => Ok(others.iter().fold(own.to_vec(), |all, other| {
                combine(&all, other, |a, b| a - b)
            })),
            (None, [], Some(_)) => Ok(vec![self.error(own) / self.error(others[0])]),
            _ => Err("give one of `of`, `minus` and `error_of`".into()),
        }
    }

    /// Root mean square of the differences between values and reference.
    fn error(&self, values: &[f64]) -> f64 {
        let references = self.reference.as_slice().iter().cycle();
        let squares = values.iter().zip(references).map(|(v, r)| (v - r).powi(2));
        (squares.sum::<f64>() / values.len() as f64).sqrt()
    }
}

/// When a check is made.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Always.
    #[default]
    Everyday,
    /// At the level "nightly" only: it takes longer than a few seconds.
    Nightly,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_key_is_refused() {
        let text = "quantity = 'q'\nmeasure.balance = { quantity = 'heat', tolerance = 1 }\n\
            reference = 0\nlimit.absolute = 1\nsource = ''";
        let error = toml::from_str::<Check>(text).expect_err("`tolerance` is no key");
        assert!(error.message().contains("tolerance"), "{error}");
    }
}
