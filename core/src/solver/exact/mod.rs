//! Exact sums: terms add up without rounding, and the total is rounded once.
//!
//! The result therefore depends on the terms alone, not on their order, on threads or on how they are divided. A buffer of terms
//! is split at multiples of a power of two into high parts, which add up exactly in any order, and remainders, which are split again
//! ([`split`]); each of these sums is an integer times a power of two and goes into a fixed-point number that spans all of `f64`.
//! Similar schemes sum the high parts only: \[Demmel2015\].

mod fixed;
#[allow(unsafe_code)]
mod split;

use crate::transport::Processes;
pub(super) use fixed::{FixedPoint, Halves};
use split::{LANES, LENGTH, Parts, split};

/// Bits of a digit.
const WIDTH: u32 = 40;
/// Exponent of the least number above zero.
const LEAST: i32 = -1074;
/// Digits of the largest number, and one for sums above it.
const DIGITS: usize = 2098_usize.div_ceil(WIDTH as usize) + 1;

/// Integers for sums of terms that are not finite.
const SPECIAL: usize = 3;

/// A sum for other processes: digits of 40 bits, and how many sums are not a number, infinite and minus infinite.
type Integers = [i64; DIGITS + SPECIAL];

/// A sum without rounding.
#[derive(Clone, Debug)]
pub struct ExactSum {
    /// Fixed point: the digit n counts in `2^(40 n - 1074)`. Digits have either sign and more than 40 bits: each term adds less than
    /// `2^93`, so that 2^34 terms fit.
    digits: [i128; DIGITS],
    /// The first digit that may differ from zero, and the one behind the last.
    used: [usize; 2],
    /// Sum of terms that are not finite.
    special: f64,
}

impl Default for ExactSum {
    fn default() -> Self {
        ExactSum {
            digits: [0; DIGITS],
            used: [DIGITS, 0],
            special: 0.0,
        }
    }
}

impl ExactSum {
    /// Adds a number.
    pub fn add(&mut self, term: f64) {
        if term == 0.0 {
            return;
        }
        let bits = term.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as u32;
        if exponent == 0x7ff {
            self.special += term;
            return;
        }
        let fraction = i128::from(bits & ((1 << 52) - 1));
        // subnormal numbers have the exponent of the least normal one and no leading bit
        let (size, place) = match exponent {
            0 => (fraction, 0),
            _ => (fraction | 1 << 52, exponent - 1),
        };
        let size = if term < 0.0 { -size } else { size };
        let digit = (place / WIDTH) as usize;
        self.digits[digit] += size << (place % WIDTH);
        self.use_digits(digit, digit + 1);
    }

    fn use_digits(&mut self, first: usize, end: usize) {
        self.used = [self.used[0].min(first), self.used[1].max(end)];
    }

    /// Adds terms, a multiple of 16 and 128 at most; it leaves zeros or remainders.
    fn add_all(&mut self, terms: &mut [f64]) {
        let Parts { sums, has_rest } = split(terms);
        sums.into_iter().for_each(|sum| self.add(sum));
        if has_rest {
            terms.iter().for_each(|term| self.add(*term));
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &ExactSum) {
        let [first, end] = other.used;
        for digit in first..end {
            self.digits[digit] += other.digits[digit];
        }
        self.use_digits(first, end);
        self.special += other.special;
    }

    /// The sum as integers: those of several sums add up to those of their sum.
    fn to_integers(&self) -> Integers {
        let mut digits = self.digits;
        let left = carry(&mut digits, 0);
        let mut integers = [0; DIGITS + SPECIAL];
        for (integer, digit) in integers.iter_mut().zip(digits) {
            *integer = digit as i64;
        }
        integers[DIGITS - 1] += (left << WIDTH) as i64;
        let special = [
            self.special.is_nan(),
            self.special == f64::INFINITY,
            self.special == f64::NEG_INFINITY,
        ];
        let counts = &mut integers[DIGITS..];
        counts
            .iter_mut()
            .zip(special)
            .for_each(|(count, is)| *count = i64::from(is));
        integers
    }

    fn from_integers(integers: &Integers) -> Self {
        let (digits, counts) = integers.split_at(DIGITS);
        let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY]
            .into_iter()
            .zip(counts);
        let special = special
            .filter(|(_, count)| **count > 0)
            .map(|(value, _)| value);
        ExactSum {
            digits: std::array::from_fn(|n| i128::from(digits[n])),
            used: [0, DIGITS],
            special: special.sum(),
        }
    }

    /// Replaces the sum by the total of those of all processes.
    pub fn add_up(&mut self, processes: &Processes) {
        if let Some(transport) = processes.transport() {
            let mut integers = self.to_integers();
            transport.sum(&mut integers);
            *self = ExactSum::from_integers(&integers);
        }
    }

    /// The sum, rounded to the nearest number, ties to even.
    pub fn value(&self) -> f64 {
        if self.special != 0.0 {
            return self.special;
        }
        let [first, _] = self.used;
        let mut digits = self.digits;
        let mut is_negative = false;
        // the carry out of the last digit tells the sign of the sum
        while carry(&mut digits, first) < 0 {
            is_negative = !is_negative;
            digits = self.digits.map(|digit| -digit);
        }
        let Some(last) = (first..DIGITS).rev().find(|digit| digits[*digit] != 0) else {
            return 0.0;
        };
        // 81 bits or more of the highest digits that are there; what lies below decides ties only
        let lowest = last.saturating_sub(2);
        let value = (lowest..=last).rev().fold(0_u128, |value, digit| {
            value << WIDTH | digits[digit] as u128
        });
        let is_below = (first..lowest).any(|digit| digits[digit] != 0);
        let value = (value | u128::from(is_below)) as f64;
        let scaled = value * power_of_two(WIDTH as i32 * lowest as i32 + LEAST);
        if is_negative { -scaled } else { scaled }
    }
}

/// Several sums.
pub(super) struct Sums<const N: usize> {
    sums: [ExactSum; N],
    terms: [[f64; LENGTH]; N],
}

impl<const N: usize> Sums<N> {
    pub(super) fn empty() -> Self {
        Sums {
            sums: std::array::from_fn(|_| ExactSum::default()),
            terms: [[0.0; LENGTH]; N],
        }
    }

    /// Adds the terms of numbers from 0 on.
    pub(super) fn add(mut self, count: usize, term: impl Fn(usize) -> [f64; N]) -> Self {
        for first in (0..count).step_by(LENGTH) {
            let part = LENGTH.min(count - first);
            let padded = part.next_multiple_of(LANES);
            for number in 0..part {
                let of_sums = term(first + number);
                (0..N).for_each(|n| self.terms[n][number] = of_sums[n]);
            }
            for (sum, terms) in self.sums.iter_mut().zip(&mut self.terms) {
                terms[part..padded].fill(0.0);
                sum.add_all(&mut terms[..padded]);
            }
        }
        self
    }

    pub(super) fn merge(mut self, other: Self) -> Self {
        let sums = self.sums.iter_mut().zip(&other.sums);
        sums.for_each(|(sum, other)| sum.merge(other));
        self
    }

    pub(super) fn into_sums(self) -> [ExactSum; N] {
        self.sums
    }
}

/// Gives digits from `first` their 40 bits, from 0 on; what is left above the last, which is below zero for sums below zero.
fn carry(digits: &mut [i128; DIGITS], first: usize) -> i128 {
    digits.iter_mut().skip(first).fold(0, |carry, digit| {
        let sum = *digit + carry;
        *digit = sum & ((1 << WIDTH) - 1);
        sum >> WIDTH
    })
}

/// `2^exponent` within the range of `f64`.
fn power_of_two(exponent: i32) -> f64 {
    match exponent {
        LEAST..-1022 => f64::from_bits(1 << (exponent - LEAST)),
        _ => f64::from_bits(((exponent + 1023) as u64) << 52),
    }
}

#[cfg(test)]
mod tests;
