//! Sums over vectors and points that give the same bits for any number of threads, and however the points are divided.
//!
//! [`GROUP`] consecutive entries (64) add up in a fixed order, and the sums of the groups add up exactly ([`ExactSum`]): the result does not depend on
//! which groups are added where and when. Vectors with several components of each point have as many groups of entries for a group of points.
//! Within a group eight running sums (entry `i` goes to sum `i mod 8`) let the compiler use vector registers. Rounding is that of a group:
//! relative to the sum of magnitudes 11 eps at most.
//!
//! Limited by memory bandwidth from about 10^5 entries on.

use std::ops::Range;

use rayon::prelude::*;

use super::exact::{ExactSum, Sums};
use crate::transport::GROUP;

/// Entries that a task takes at least.
pub const CHUNK: usize = 4096;

/// Below this length, handing half of the work to another thread costs more than it saves.
const PARALLEL: usize = 8 * CHUNK;

const LANES: usize = 8;

/// `sum_i f(a_i, b_i, ...)` over the entries of `N` vectors of equal length.
///
/// Panics if the lengths differ.
pub fn sum_of<const N: usize>(inputs: [&[f64]; N], f: impl Fn([f64; N]) -> f64 + Sync) -> f64 {
    exact_sum_of(Groups::Even(inputs[0].len()), inputs, f).value()
}

/// How the entries of a sum form groups.
#[derive(Clone, Copy, Debug)]
pub(super) enum Groups<'a> {
    /// So many entries in groups of [`GROUP`].
    Even(usize),
    /// From each of these points or nodes to the next one, of so many entries each.
    From(&'a [u32], usize),
}

impl Groups<'_> {
    fn count(self) -> usize {
        match self {
            Groups::Even(entries) => entries.div_ceil(GROUP),
            Groups::From(starts, _) => starts.len().saturating_sub(1),
        }
    }

    /// The entries of a group.
    fn entries(self, number: usize) -> Range<usize> {
        match self {
            Groups::Even(entries) => number * GROUP..entries.min((number + 1) * GROUP),
            Groups::From(starts, each) => {
                let [first, end] = [starts[number], starts[number + 1]];
                first as usize * each..end as usize * each
            }
        }
    }
}

/// [`sum_of`] in some groups, before it is rounded.
pub(super) fn exact_sum_of<const N: usize>(
    groups: Groups<'_>,
    inputs: [&[f64]; N],
    f: impl Fn([f64; N]) -> f64 + Sync,
) -> ExactSum {
    assert!(
        inputs.iter().all(|input| input.len() == inputs[0].len()),
        "vectors of a sum must have equal lengths"
    );
    let [sum] = exact_sums(groups, |range| {
        [ordered_sum(inputs.map(|input| &input[range.clone()]), &f)]
    });
    sum
}

/// Sums over entries from those of groups.
fn exact_sums<const N: usize>(
    groups: Groups<'_>,
    of_group: impl Fn(Range<usize>) -> [f64; N] + Sync,
) -> [ExactSum; N] {
    /// Groups that a task takes at least.
    const OF_CHUNK: usize = CHUNK / GROUP;
    let count = groups.count();
    // the call is dynamic, so that the distribution is compiled once and not for every sum
    let add: &(dyn Fn(Sums<N>, usize) -> Sums<N> + Sync) = &|sums, chunk| {
        let first = chunk * OF_CHUNK;
        let here = count.min(first + OF_CHUNK) - first;
        sums.add(here, |number| of_group(groups.entries(first + number)))
    };
    let chunks = 0..count.div_ceil(OF_CHUNK);
    let sums = match count < PARALLEL / GROUP {
        true => chunks.fold(Sums::empty(), add),
        false => {
            let sums = chunks.into_par_iter().fold(Sums::empty, add);
            sums.reduce(Sums::empty, Sums::merge)
        }
    };
    sums.into_sums()
}

/// The sum of a few entries in one order, as of a group.
#[inline]
pub(super) fn ordered_sum<const N: usize>(
    inputs: [&[f64]; N],
    f: &impl Fn([f64; N]) -> f64,
) -> f64 {
    let len = inputs[0].len();
    let blocks = inputs.map(|input| input[..len].as_chunks::<LANES>());
    let mut lanes = [0.0; LANES];
    for block in 0..len / LANES {
        let values = blocks.map(|(full, _)| full[block]);
        for (lane, partial) in lanes.iter_mut().enumerate() {
            *partial += f(values.map(|value| value[lane]));
        }
    }
    for rest in 0..len % LANES {
        lanes[rest] += f(blocks.map(|(_, remainder)| remainder[rest]));
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// `sum_i a_i`.
pub fn sum(values: &[f64]) -> f64 {
    sum_of([values], |[value]| value)
}

/// `sum_i a_i b_i`. Panics if the lengths differ.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum_of([a, b], |[a, b]| a * b)
}

/// `sum_i w_i a_i`, for instance the integral of a density over point volumes.
/// Panics if the lengths differ.
pub fn weighted_sum(values: &[f64], weights: &[f64]) -> f64 {
    dot(values, weights)
}

/// `sum_i w_i v_i` of vectors, three entries each, for instance the total of a force density over point volumes.
/// Panics if the number of weights differs from that of vectors.
pub fn weighted_vectors(vectors: &[f64], weights: &[f64]) -> [f64; 3] {
    let (vectors, _) = vectors.as_chunks::<3>();
    assert_eq!(vectors.len(), weights.len(), "a weight for each vector");
    sum_points(weights.len(), |i| vectors[i].map(|v| weights[i] * v))
}

/// `sum_i f(i)` over the points `0..points`, for several sums at once.
pub fn sum_points<const N: usize>(points: usize, f: impl Fn(usize) -> [f64; N] + Sync) -> [f64; N] {
    exact_sums_of_points(Groups::Even(points), f).map(|sum| sum.value())
}

/// [`sum_points`] before they are rounded.
pub(super) fn exact_sums_of_points<const N: usize>(
    groups: Groups<'_>,
    f: impl Fn(usize) -> [f64; N] + Sync,
) -> [ExactSum; N] {
    exact_sums(groups, |range| {
        let mut sums = [0.0; N];
        for point in range {
            let parts = f(point);
            (0..N).for_each(|n| sums[n] += parts[n]);
        }
        sums
    })
}

/// Euclidean norm `sqrt(sum_i a_i^2)`.
///
/// Entries are squared as they are: it overflows above 1e154 and loses digits below 1e-154.
pub fn norm(values: &[f64]) -> f64 {
    sum_of([values], |[value]| value * value).sqrt()
}

/// Whether two vectors have the same length and entries.
pub fn are_equal(a: &[f64], b: &[f64]) -> bool {
    let [parts_of_a, parts_of_b] = [a, b].map(|vector| vector.par_chunks(CHUNK));
    let parts = parts_of_a.zip(parts_of_b).with_min_len(PARALLEL / CHUNK);
    a.len() == b.len() && parts.all(|(a, b)| a == b)
}

/// `max_i |a_i|`, 0 for an empty vector, NaN if an entry is NaN.
pub fn max_abs(values: &[f64]) -> f64 {
    let parts = values.par_chunks(CHUNK).with_min_len(PARALLEL / CHUNK);
    parts.map(max_abs_of_chunk).reduce(|| 0.0, larger)
}

/// Vectorised comparisons ignore NaN, which is therefore detected separately.
fn max_abs_of_chunk(values: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let mut numbers = true;
    let mut note = |lane: usize, value: f64| {
        let size = value.abs();
        lanes[lane] = if size > lanes[lane] {
            size
        } else {
            lanes[lane]
        };
        numbers &= !size.is_nan();
    };
    let (eights, rest) = values.as_chunks::<LANES>();
    for eight in eights {
        (0..LANES).for_each(|lane| note(lane, eight[lane]));
    }
    rest.iter()
        .enumerate()
        .for_each(|(lane, value)| note(lane, *value));
    match numbers {
        true => lanes.into_iter().fold(0.0, larger),
        false => f64::NAN,
    }
}

/// The larger of two non-negative numbers; unlike `f64::max` it propagates NaN.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(n: usize) -> Vec<f64> {
        // spread over six decades with both signs, so that any change of order shows in the last bits
        (0..n)
            .map(|i| (i as f64 * 0.7).sin() * 10f64.powi((i % 7) as i32 - 3))
            .collect()
    }

    fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("thread pool")
            .install(work)
    }

    #[test]
    fn sums_have_the_same_bits_for_any_number_of_threads() {
        for n in [0, 1, 7, CHUNK - 1, CHUNK + 1, 8 * CHUNK, 300_001] {
            let (a, b) = (values(n), values(n + 3)[3..].to_vec());
            let all = || [sum(&a), dot(&a, &b), norm(&a), max_abs(&b)].map(f64::to_bits);
            let one = with_threads(1, all);
            for threads in [2, 3, 8] {
                assert_eq!(
                    one,
                    with_threads(threads, all),
                    "n = {n}, {threads} threads"
                );
            }
        }
    }

    #[test]
    fn every_entry_is_counted_once() {
        // small integers add exactly in any order
        for n in [0, 1, 8, 9, CHUNK, CHUNK + 1, 100_003] {
            let a: Vec<f64> = (0..n).map(|i| (i % 13) as f64).collect();
            let exact: usize = (0..n).map(|i| i % 13).sum();
            let squares: usize = (0..n).map(|i| (i % 13) * (i % 13)).sum();
            assert_eq!(sum(&a), exact as f64);
            assert_eq!(weighted_sum(&a, &a), squares as f64);
        }
    }

    /// Parts that consist of whole groups, as on several processes.
    #[test]
    fn sums_do_not_depend_on_the_order_of_groups() {
        for n in [1000, 300_000] {
            let n = n / GROUP * GROUP;
            let (mut a, mut b) = (values(n), values(n + 3)[3..].to_vec());
            let before = [sum(&a), dot(&a, &b)].map(f64::to_bits);
            a.rotate_left(7 * GROUP);
            b.rotate_left(7 * GROUP);
            assert_eq!([sum(&a), dot(&a, &b)].map(f64::to_bits), before);
        }
    }

    #[test]
    fn rounding_is_that_of_a_group() {
        // 0.1 is rounded to f64 before the sum: 1e5 is exact to eps/2; a group adds at most 11 eps
        let a = vec![0.1; 1_000_000];
        assert!((sum(&a) / 1e5 - 1.0).abs() < 12.0 * f64::EPSILON);
    }

    #[test]
    fn largest_magnitude_reports_sign_free_value_and_passes_on_not_a_number() {
        let mut a = values(10_000);
        a[7777] = -1e9;
        assert_eq!(max_abs(&a), 1e9);
        a[5] = f64::NAN;
        assert!(max_abs(&a).is_nan());
    }
}
