//! Sums of many short vectors that do not depend on the order of their terms: cheaper than an [`ExactSum`](super::ExactSum) where the
//! largest term is known.

use crate::solver::Reducer;

/// Two quanta, powers of two: terms are rounded to a multiple of the first, and what is left to a multiple of the second. Both parts add up
/// without rounding. What is lost of a term is 2^-74 of the largest one over the number of terms.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct FixedPoint([f64; 2]);

/// The two parts of each entry of a vector.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::solver) struct Halves([Vec<f64>; 2]);

impl FixedPoint {
    /// For sums of at most `count` terms of which none is larger than `largest`.
    pub(in crate::solver) fn new(largest: f64, count: f64) -> Self {
        let bits = |value: f64| value.max(1.0).log2().ceil() as i32;
        // the sum of the first parts stays below 2^52 quanta
        let room = 51 - bits(count);
        let exponent = match largest > 0.0 && largest.is_finite() {
            true => largest.log2().ceil() as i32,
            false => 0,
        };
        let quantum = |parts: i32| 2_f64.powi((exponent - parts * room).max(-1000));
        FixedPoint([quantum(1), quantum(2)])
    }

    /// Adds terms to sums of as many entries, and sets the terms to zero.
    #[inline(always)]
    pub(in crate::solver) fn add(&self, terms: &mut [f64], [first, second]: [&mut [f64]; 2]) {
        /// Adding and subtracting so many quanta rounds to a multiple of one.
        const SHIFT: f64 = 6_755_399_441_055_744.0;
        let [of_first, of_second] = self.0.map(|quantum| SHIFT * quantum);
        for ((term, first), second) in terms.iter_mut().zip(first).zip(second) {
            let part = (*term + of_first) - of_first;
            let rest = *term - part;
            *first += part;
            *second += (rest + of_second) - of_second;
            *term = 0.0;
        }
    }

    /// The sums of all processes.
    pub(in crate::solver) fn total(&self, sums: Halves, points: &Reducer) -> Vec<f64> {
        let [mut first, second] = sums.0;
        if let Some(transport) = points.processes().transport() {
            let sums = [&first, &second].into_iter().zip(self.0);
            let quanta = sums.flat_map(|(sums, quantum)| sums.iter().map(move |s| s / quantum));
            let mut quanta: Vec<i64> = quanta.map(|count| count as i64).collect();
            transport.sum(&mut quanta);
            let (of_first, of_second) = quanta.split_at(first.len());
            let both = of_first.iter().zip(of_second);
            for (sum, (a, b)) in first.iter_mut().zip(both) {
                *sum = *a as f64 * self.0[0] + *b as f64 * self.0[1];
            }
        } else {
            let both = first.iter_mut().zip(&second);
            both.for_each(|(first, second)| *first += second);
        }
        first
    }
}

impl Halves {
    pub(in crate::solver) fn zeros(entries: usize) -> Self {
        Halves([vec![0.0; entries], vec![0.0; entries]])
    }

    /// Both parts of consecutive entries.
    #[inline(always)]
    pub(in crate::solver) fn entries(
        &mut self,
        entries: std::ops::Range<usize>,
    ) -> [&mut [f64]; 2] {
        let [first, second] = &mut self.0;
        [&mut first[entries.clone()], &mut second[entries]]
    }

    /// Both parts of an entry.
    pub(in crate::solver) fn at(&self, entry: usize) -> [f64; 2] {
        self.0.each_ref().map(|part| part[entry])
    }

    /// Adds both parts of another sum to an entry.
    pub(in crate::solver) fn add_to(&mut self, entry: usize, parts: [f64; 2]) {
        for (sum, part) in self.0.iter_mut().zip(parts) {
            sum[entry] += part;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terms of either sign over ten decades, each of which is added once.
    #[test]
    fn sums_do_not_depend_on_the_order_of_terms() {
        let terms: Vec<f64> = (0..5000)
            .map(|i| (f64::from(i) * 0.7).sin() * 10_f64.powi(i % 10 - 8))
            .collect();
        let fixed = FixedPoint::new(10.0, 5000.0);
        let sum = |terms: &mut dyn Iterator<Item = f64>| {
            let mut sums = Halves::zeros(1);
            terms.for_each(|term| fixed.add(&mut [term], sums.entries(0..1)));
            fixed.total(sums, &Reducer::default())[0]
        };
        let forward = sum(&mut terms.iter().copied());
        let backward = sum(&mut terms.iter().rev().copied());
        let plain: f64 = terms.iter().sum();
        assert_eq!(forward.to_bits(), backward.to_bits());
        // rounding of the plain sum
        assert!((forward - plain).abs() < 1e-12, "{forward} {plain}");
    }

    /// A term far below the largest one counts.
    #[test]
    fn small_terms_are_not_lost() {
        let fixed = FixedPoint::new(1.0, 1000.0);
        let mut sums = Halves::zeros(1);
        for term in [1.0, 3e-18, -1.0] {
            fixed.add(&mut [term], sums.entries(0..1));
        }
        let left = fixed.total(sums, &Reducer::default())[0];
        assert!((left / 3e-18 - 1.0).abs() < 1e-4, "{left}");
    }
}
