//! Limits of the error of a check.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limit of the difference between measured value and reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// `|measured - reference|`, in the unit of the quantity.
    Absolute(f64),
    /// `|measured - reference| / |reference|`, number by number.
    Relative(f64),
    /// `|measured - reference|` over the largest absolute reference.
    FractionOfPeak(f64),
    /// Root mean square of `measured - reference` over all values, over the largest absolute reference.
    Rms(f64),
    /// Mean of `|measured - reference| / |reference|` over all values (Khoshrou, eq. 99).
    MeanRelative(f64),
    /// Like `rms`, but the error must be at least this large: a known error must be detected.
    RmsAbove(f64),
    /// Like `mean_relative`, but the error must be at least this large.
    MeanRelativeAbove(f64),
    /// Like `fraction_of_peak`, but the error of at least one value must be this large.
    FractionOfPeakAbove(f64),
    /// The measured value lies between these numbers; the reference is only printed.
    Between([f64; 2]),
    /// None: the relative deviation from a measurement is the result. Only a value that is not finite fails.
    Recorded,
}

impl Limit {
    /// Error of one value and its limit. `peak`: the largest absolute reference.
    pub fn judge(self, measured: f64, reference: f64, peak: f64) -> (f64, f64) {
        let difference = (measured - reference).abs();
        match self {
            Limit::Absolute(limit) => (difference, limit),
            Limit::Relative(limit) => (difference / reference.abs(), limit),
            Limit::Recorded => (difference / reference.abs(), f64::MAX),
            Limit::FractionOfPeak(limit) => (difference / peak, limit),
            // these limits apply to all values together
            Limit::MeanRelative(_) | Limit::MeanRelativeAbove(_) => {
                (difference / reference.abs(), f64::INFINITY)
            }
            Limit::Rms(_) | Limit::RmsAbove(_) | Limit::FractionOfPeakAbove(_) => {
                (difference / peak, f64::INFINITY)
            }
            // the distance from the middle, so that errors compare
            Limit::Between([low, high]) => {
                ((measured - 0.5 * (low + high)).abs(), 0.5 * (high - low))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_measure_what_they_say() {
        let cases = [
            (Limit::Absolute(0.5), (3.0, 0.5)),
            (Limit::Relative(0.1), (0.3, 0.1)),
            (Limit::FractionOfPeak(0.1), (0.03, 0.1)),
            (Limit::Between([10.0, 20.0]), (2.0, 5.0)),
            (Limit::Recorded, (0.3, f64::MAX)),
        ];
        for (limit, (error, most)) in cases {
            let judged = limit.judge(13.0, 10.0, 100.0);
            // rounding of one division
            assert!(
                (judged.0 - error).abs() < 1e-15 && judged.1 == most,
                "{limit:?}: {judged:?}"
            );
        }
    }
}
