//! Outcomes of checks, and the table that shows them.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::check::{Check, Level};
use super::limit::Limit;

/// A check with its result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outcome {
    /// Name of the case.
    pub case: String,
    /// The compared quantity.
    pub quantity: String,
    /// Measured value with the largest error.
    #[serde(with = "null_for_nan")]
    pub measured: f64,
    /// Reference of that value.
    pub reference: f64,
    /// Error, as defined by the limit; NaN without a measured value.
    #[serde(with = "null_for_nan")]
    pub error: f64,
    /// Largest permitted error.
    pub limit: Limit,
    /// Number of values compared.
    pub values: usize,
    /// Whether all of them are within the limit.
    pub passed: bool,
    /// Why there is nothing to compare.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Source of the reference.
    pub source: String,
    /// Level of the check.
    pub level: Level,
    /// Wall time of the run of the case, s.
    pub seconds: f64,
    /// Measured value and reference of each of several values; nothing where a number is not finite.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compared: Vec<[Option<f64>; 2]>,
}

impl Outcome {
    /// Judges the values measured for a check.
    pub fn new(case: &str, check: &Check, values: &[f64]) -> Outcome {
        let references = check.reference.as_slice();
        let count = (references.len(), values.len());
        if count.0 == 0 || count.1 == 0 || (count.0 != 1 && count.0 != count.1) {
            let reason = format!(
                "{} references for {} measured values; give one for all, or one for each",
                count.0, count.1
            );
            return Outcome::failed(case, check, reason);
        }
        let peak = references.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let mut outcome = Outcome {
            values: values.len(),
            passed: true,
            failure: None,
            ..Outcome::failed(case, check, String::new())
        };
        let mut worst = -1.0;
        for (i, &measured) in values.iter().enumerate() {
            let number = if references.len() == 1 { 0 } else { i };
            let reference = references.get(number).copied().unwrap_or(f64::NAN);
            if values.len() > 1 {
                let pair = [measured, reference];
                outcome
                    .compared
                    .push(pair.map(|v| v.is_finite().then_some(v)));
            }
            let (error, most) = check.limit.judge(measured, reference, peak);
            outcome.passed &= error <= most;
            // the first NaN is the worst value
            if worst != f64::INFINITY && (error > worst || error.is_nan()) {
                worst = if error.is_nan() { f64::INFINITY } else { error };
                (outcome.measured, outcome.reference, outcome.error) = (measured, reference, error);
            }
        }
        outcome.judge_together(references, values, peak);
        outcome
    }

    /// A check that has failed because there is nothing to compare.
    pub fn failed(case: &str, check: &Check, reason: String) -> Outcome {
        Outcome {
            case: case.into(),
            quantity: check.quantity.clone(),
            measured: f64::NAN,
            reference: check
                .reference
                .as_slice()
                .first()
                .copied()
                .unwrap_or(f64::NAN),
            error: f64::NAN,
            limit: check.limit,
            values: 0,
            passed: false,
            failure: Some(reason),
            source: check.source.clone(),
            level: check.level,
            seconds: 0.0,
            compared: Vec::new(),
        }
    }

    /// An error that is audited without a check in the case.
    pub fn audit(case: &str, quantity: String, error: f64, limit: f64) -> Outcome {
        Outcome {
            case: case.into(),
            quantity,
            measured: error,
            reference: 0.0,
            error,
            limit: Limit::Absolute(limit),
            values: 1,
            passed: error <= limit,
            failure: None,
            source: "conservation".into(),
            level: Level::Everyday,
            seconds: 0.0,
            compared: Vec::new(),
        }
    }

    /// Whether a run that has neither checks nor audits reached its end.
    pub fn end(case: &str, result: Result<(), String>) -> Outcome {
        let error = if result.is_ok() { 0.0 } else { f64::NAN };
        let audit = Outcome::audit(case, "audit of the end of the run".into(), error, 0.0);
        Outcome {
            failure: result.err(),
            source: "the case".into(),
            ..audit
        }
    }

    /// The error and verdict of limits on all values together.
    fn judge_together(&mut self, references: &[f64], values: &[f64], peak: f64) {
        let limit = self.limit;
        let errors = values.iter().enumerate().map(|(i, &measured)| {
            let number = if references.len() == 1 { 0 } else { i };
            let reference = references.get(number).copied().unwrap_or(f64::NAN);
            limit.judge(measured, reference, peak).0
        });
        let count = values.len() as f64;
        match limit {
            Limit::Rms(_) | Limit::RmsAbove(_) => {
                self.error = (errors.map(|e| e * e).sum::<f64>() / count).sqrt();
            }
            Limit::MeanRelative(_) | Limit::MeanRelativeAbove(_) => {
                self.error = errors.sum::<f64>() / count;
            }
            _ => {}
        }
        // comparisons with NaN are false, so that a NaN never passes
        match limit {
            Limit::Rms(most) | Limit::MeanRelative(most) => self.passed = self.error <= most,
            Limit::RmsAbove(least)
            | Limit::MeanRelativeAbove(least)
            | Limit::FractionOfPeakAbove(least) => self.passed &= self.error >= least,
            _ => {}
        }
    }

    /// Error over its limit, or the inverse where the error must be larger; `None` without a limit or an error.
    pub fn ratio_to_limit(&self) -> Option<f64> {
        let ratio = match self.limit {
            _ if self.error == 0.0 => 0.0,
            Limit::Absolute(limit)
            | Limit::Relative(limit)
            | Limit::FractionOfPeak(limit)
            | Limit::Rms(limit)
            | Limit::MeanRelative(limit) => self.error / limit,
            Limit::RmsAbove(least)
            | Limit::MeanRelativeAbove(least)
            | Limit::FractionOfPeakAbove(least) => least / self.error,
            Limit::Between([low, high]) => self.error / (0.5 * (high - low)),
            Limit::Recorded => return None,
        };
        ratio.is_finite().then_some(ratio)
    }

    /// Cells of a table.
    pub(super) fn cells(&self) -> [String; 7] {
        let percent = |value: f64| format!("{} %", number(100.0 * value));
        let of_peak = |value: f64| format!("{} % of peak", number(100.0 * value));
        let (reference, error, limit) = match self.limit {
            Limit::Absolute(limit) => (number(self.reference), number(self.error), number(limit)),
            Limit::Relative(limit) => (number(self.reference), percent(self.error), percent(limit)),
            Limit::FractionOfPeak(limit) | Limit::FractionOfPeakAbove(limit) => {
                (number(self.reference), of_peak(self.error), percent(limit))
            }
            Limit::Rms(limit) | Limit::RmsAbove(limit) => {
                let error = format!("{} % rms", number(100.0 * self.error));
                (number(self.reference), error, percent(limit))
            }
            Limit::MeanRelative(limit) | Limit::MeanRelativeAbove(limit) => {
                let error = format!("{} % mean", number(100.0 * self.error));
                (number(self.reference), error, percent(limit))
            }
            Limit::Between([low, high]) => (
                number(self.reference),
                String::new(),
                format!("{} to {}", number(low), number(high)),
            ),
            Limit::Recorded => (
                number(self.reference),
                // with its sign
                percent((self.measured - self.reference) / self.reference.abs()),
                "recorded".into(),
            ),
        };
        let limit = match self.limit {
            Limit::RmsAbove(_) | Limit::MeanRelativeAbove(_) | Limit::FractionOfPeakAbove(_) => {
                format!("> {limit}")
            }
            _ => limit,
        };
        let quantity = match self.values {
            0 | 1 => self.quantity.clone(),
            count => format!("{} (worst of {count})", self.quantity),
        };
        let verdict = if self.passed { "pass" } else { "FAIL" };
        [
            self.case.clone(),
            quantity,
            number(self.measured),
            reference,
            error,
            limit,
            verdict.into(),
        ]
    }
}

pub(super) const HEADINGS: [&str; 7] = [
    "case",
    "quantity",
    "measured",
    "reference",
    "error",
    "limit",
    "",
];

/// The outcomes as a table for a terminal.
pub struct OutcomeTable<'a>(pub &'a [Outcome]);

impl fmt::Display for OutcomeTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows: Vec<[String; 7]> = self.0.iter().map(Outcome::cells).collect();
        let width = |column: usize| {
            let cells = rows.iter().map(|row| row[column].chars().count());
            cells.max().unwrap_or(0).max(HEADINGS[column].len())
        };
        let widths: [usize; 7] = std::array::from_fn(width);
        let mut line = |cells: [&str; 7]| {
            let mut text = String::new();
            for (column, (cell, width)) in cells.into_iter().zip(widths).enumerate() {
                match column {
                    2..=5 => text += &format!("{cell:>width$}  "),
                    _ => text += &format!("{cell:<width$}  "),
                }
            }
            writeln!(f, "{}", text.trim_end())
        };
        line(HEADINGS)?;
        let mut last = "";
        for row in &rows {
            let mut cells: [&str; 7] = std::array::from_fn(|column| row[column].as_str());
            if cells[0] == last {
                cells[0] = "";
            } else {
                last = cells[0];
            }
            line(cells)?;
        }
        let mut last = "";
        for outcome in self.0 {
            let Some(reason) = outcome.failure.as_deref().filter(|r| *r != last) else {
                continue;
            };
            writeln!(f, "\n{}, {}: {reason}", outcome.case, outcome.quantity)?;
            last = reason;
        }
        Ok(())
    }
}

/// JSON has no NaN.
mod null_for_nan {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(value)?.unwrap_or(f64::NAN))
    }
}

/// Six significant digits in plain notation, four with an exponent.
pub(super) fn number(value: f64) -> String {
    let is_plain = (1e-3..1e6).contains(&value.abs());
    perimelt_core::text::number(value, if is_plain { 6 } else { 4 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(limit: &str) -> Check {
        let text = format!(
            "quantity = 'q'\nmeasure.balance = {{ quantity = 'heat' }}\nreference = [1.0, -10.0, 4.0]\n\
            limit.{limit}\nsource = ''"
        );
        toml::from_str(&text).expect("a valid check")
    }

    #[test]
    fn the_worst_value_is_shown() {
        let values = [1.1, -10.3, 4.0];
        let absolute = Outcome::new("case", &check("absolute = 0.2"), &values);
        assert_eq!((absolute.measured, absolute.passed), (-10.3, false));
        let relative = Outcome::new("case", &check("relative = 0.11"), &values);
        assert_eq!((relative.measured, relative.passed), (1.1, true));
        let peak = Outcome::new("case", &check("fraction_of_peak = 0.029"), &values);
        assert_eq!((peak.measured, peak.passed), (-10.3, false));
    }

    #[test]
    fn a_ratio_to_the_limit_exceeds_one_where_a_check_fails() {
        let values = [1.3, -10.4, 4.0];
        for limit in [
            "absolute = 0.5",
            "absolute = 0.3",
            "relative = 0.29",
            "fraction_of_peak = 0.05",
            "rms = 0.03",
            "rms = 0.028",
            "rms_above = 0.028",
            "rms_above = 0.03",
            "between = [-11, 2]",
        ] {
            let outcome = Outcome::new("case", &check(limit), &values);
            let ratio = outcome.ratio_to_limit().expect("a ratio");
            assert_eq!(ratio <= 1.0, outcome.passed, "{limit}: {ratio}");
        }
        let recorded = Outcome::new("case", &check("absolute = 0.5"), &values);
        let limit = Limit::Recorded;
        assert_eq!(Outcome { limit, ..recorded }.ratio_to_limit(), None);
    }

    #[test]
    fn a_root_mean_square_is_over_all_values() {
        let values = [1.3, -10.4, 4.0];
        // sqrt((0.3^2 + 0.4^2) / 3) / 10
        let error = 0.5 / 3f64.sqrt() / 10.0;
        let below = Outcome::new("case", &check("rms = 0.03"), &values);
        assert!((below.error - error).abs() < 1e-12 && below.passed);
        assert!(!Outcome::new("case", &check("rms = 0.028"), &values).passed);
        assert!(Outcome::new("case", &check("rms_above = 0.028"), &values).passed);
        assert!(!Outcome::new("case", &check("rms_above = 0.03"), &values).passed);
        assert!(!Outcome::new("case", &check("rms = 0.03"), &[f64::NAN; 3]).passed);
    }

    #[test]
    fn a_mean_relative_error_weighs_small_references_like_large_ones() {
        let values = [1.3, -10.0, 4.4];
        // (0.3 + 0 + 0.1) / 3
        let error = 0.4 / 3.0;
        let below = Outcome::new("case", &check("mean_relative = 0.14"), &values);
        assert!((below.error - error).abs() < 1e-12 && below.passed);
        let passed =
            |limit: &str, values: &[f64]| Outcome::new("case", &check(limit), values).passed;
        assert!(!passed("mean_relative = 0.13", &values));
        assert!(passed("mean_relative_above = 0.13", &values));
        assert!(!passed("mean_relative_above = 0.14", &values));
        assert!(!passed("mean_relative_above = 0.13", &[f64::NAN; 3]));
    }

    #[test]
    fn one_value_far_off_is_enough_for_what_must_show() {
        let passed =
            |limit: &str, values: &[f64]| Outcome::new("case", &check(limit), values).passed;
        let values = [1.0, -10.0, 4.5];
        assert!(passed("fraction_of_peak_above = 0.049", &values));
        assert!(!passed("fraction_of_peak_above = 0.051", &values));
        assert!(!passed(
            "fraction_of_peak_above = 0.049",
            &[f64::NAN, -10.0, 4.5]
        ));
    }

    #[test]
    fn what_is_no_number_or_has_no_reference_fails() {
        assert!(!Outcome::new("case", &check("absolute = 9"), &[1.0, f64::NAN, 4.0]).passed);
        for values in [&[][..], &[1.0], &[1.0; 4]] {
            let outcome = Outcome::new("case", &check("absolute = 99"), values);
            assert!(!outcome.passed && outcome.failure.is_some(), "{outcome:?}");
        }
    }

    #[test]
    fn numbers_have_six_digits() {
        let texts = [12345.678, 0.0123456789, -3.0, 1.5e-7, 1234567.0].map(number);
        assert_eq!(texts, ["12345.7", "0.0123457", "-3", "1.5e-7", "1.235e6"]);
    }
}
