//! Influence functions: how much a member counts by its distance.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the influence of a member falls with its distance (Wang (2025), eqs. 3.14, 3.28; `docs/theory/differential_operator.md`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Influence {
    /// One value throughout the horizon.
    #[default]
    Constant,
    /// Falls linearly to zero at the horizon, `1 - |xi| / horizon`.
    Conical,
    /// `exp(-(2 |xi| / horizon)^2)`.
    Gaussian,
    /// `(1 - |xi| / horizon)^3`: `w xi` is then the gradient of the kernel of Wendland (1995), C2, for which pairs of
    /// moving points do not cluster.
    Wendland,
}

impl Influence {
    /// Influence at a distance given as a fraction of the horizon.
    pub fn at(self, fraction: f64) -> f64 {
        self.at_all([fraction])[0]
    }

    /// Influence at several distances, side by side.
    #[inline(always)]
    pub(super) fn at_all<const N: usize>(self, fractions: [f64; N]) -> [f64; N] {
        match self {
            Influence::Constant => [1.0; N],
            Influence::Conical => fractions.map(|s| (1.0 - s).max(0.0)),
            Influence::Gaussian => fractions.map(|s| exp_of_few(-4.0 * s * s)),
            Influence::Wendland => fractions.map(|s| {
                let rest = (1.0 - s).max(0.0);
                rest * rest * rest
            }),
        }
    }

    /// `integral of w(r) r^(power - 1) dr` from 0 to 1, r as a fraction of the horizon, by Simpson's rule with an error below
    /// 1e-12.
    pub fn radial_moment(self, power: i32) -> f64 {
        const INTERVALS: i32 = 2000;
        let value = |i: i32| {
            let r = f64::from(i) / f64::from(INTERVALS);
            self.at(r) * r.powi(power - 1)
        };
        let inner: f64 = (1..INTERVALS)
            .map(|i| if i % 2 == 1 { 4.0 } else { 2.0 } * value(i))
            .sum();
        (value(0) + inner + value(INTERVALS)) / (3.0 * f64::from(INTERVALS))
    }
}

/// `exp(x)` for x from -8 to 0, to a few units of rounding: the 16th power of the series for `x / 16`, which
/// vectorises.
#[inline(always)]
fn exp_of_few(x: f64) -> f64 {
    let x = x / 16.0;
    let mut sum = 1.0;
    for n in (1..=14).rev() {
        sum = 1.0 + x / f64::from(n) * sum;
    }
    let squared = sum * sum;
    let fourth = squared * squared;
    let eighth = fourth * fourth;
    eighth * eighth
}
