//! Entry-wise updates of vectors, in parallel where it pays.

use super::reduce::CHUNK;
use rayon::prelude::*;

/// Below this length another thread costs more than it saves.
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
            .for_each(|(chunk, out)| piece(chunk * CHUNK, out));
    }
}
