//! Entry-wise updates of vectors, in parallel where it pays.

use super::reduce::CHUNK;
use crate::parallel::ParallelLoop;
use rayon::prelude::*;

/// Below this length, another thread costs more than it saves.
const PARALLEL: usize = 8 * CHUNK;

/// `out_i = f(out_i, [a_i, b_i, ...])` for all entries.
///
/// Entries are independent, so the result does not depend on the number of threads.
/// Panics if an input is shorter than `out`.
pub(crate) fn update<const N: usize>(
    out: &mut [f64],
    inputs: [&[f64]; N],
    f: impl Fn(f64, [f64; N]) -> f64 + Sync,
) {
    let piece = |start: usize, out: &mut [f64]| {
        let inputs = inputs.map(|input| &input[start..start + out.len()]);
        for i in 0..out.len() {
            out[i] = f(out[i], std::array::from_fn(|k| inputs[k][i]));
        }
    };
    if out.len() < PARALLEL {
        piece(0, out);
    } else {
        out.par_chunks_mut(CHUNK)
            .enumerate()
            .for_all(|(chunk, out)| piece(chunk * CHUNK, out));
    }
}

/// `a / d`; zero where `d` is, at points of other processes that no bond of this one reaches.
pub(crate) fn quotient([a, d]: [f64; 2]) -> f64 {
    if d == 0.0 { 0.0 } else { a / d }
}

/// [`update`] of two vectors of one length at once.
pub(crate) fn update_both<const N: usize>(
    [first, second]: [&mut [f64]; 2],
    inputs: [&[f64]; N],
    f: impl Fn([f64; 2], [f64; N]) -> [f64; 2] + Sync,
) {
    let piece = |start: usize, first: &mut [f64], second: &mut [f64]| {
        let inputs = inputs.map(|input| &input[start..start + first.len()]);
        for i in 0..first.len() {
            let inputs = std::array::from_fn(|k| inputs[k][i]);
            [first[i], second[i]] = f([first[i], second[i]], inputs);
        }
    };
    if first.len() < PARALLEL {
        piece(0, first, second);
    } else {
        let parts = first
            .par_chunks_mut(CHUNK)
            .zip(second.par_chunks_mut(CHUNK));
        parts
            .enumerate()
            .for_all(|(chunk, (first, second))| piece(chunk * CHUNK, first, second));
    }
}
