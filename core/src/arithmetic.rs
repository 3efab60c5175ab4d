//! Numbers that kernels compute with: `f64`, or operations that are recorded ([`device`](crate::device)).

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number of a kernel. Code for any number has no branches that depend on its value: [`Number::select_above`] chooses.
pub trait Number:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;

    /// `self factor + term`, rounded once.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// `then` if this number is above the limit, otherwise `otherwise`, as for NaN.
    #[must_use]
    fn select_above(self, limit: Self, then: Self, otherwise: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn sqrt(self) -> f64 {
        self.sqrt()
    }

    #[inline(always)]
    fn mul_add(self, factor: f64, term: f64) -> f64 {
        self.mul_add(factor, term)
    }

    #[inline(always)]
    fn select_above(self, limit: f64, then: f64, otherwise: f64) -> f64 {
        if self > limit { then } else { otherwise }
    }
}
