//! Splits terms into sums that are exact.

/// Most terms that are split together.
pub(super) const LENGTH: usize = 128;

/// Terms that advance together; those of a buffer are a multiple of them.
pub(super) const LANES: usize = 16;

/// Bits of a high part: 128 of them add up within the 53 bits of a number.
const BITS: i32 = 45;

/// Below and above these sizes roundings leave the range of normal numbers.
const RANGE: [f64; 2] = [1e-250, 1e300];

/// Sums of the high parts of terms, and of the high parts of what they leave.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) sums: [f64; 2],
    /// Whether something is left of terms.
    pub(super) has_rest: bool,
}

/// Takes high parts off the terms twice and sums them; terms become what is left.
pub(super) fn split(terms: &mut [f64]) -> Parts {
    #[cfg(target_arch = "x86_64")]
    {
        use crate::instructions::{InstructionSet, used};
        match used() {
            InstructionSet::Baseline => {}
            // SAFETY: the instruction set was detected, or one that includes it.
            InstructionSet::Avx2 => return unsafe { split_avx2(terms) },
            // SAFETY: the instruction set was detected.
            InstructionSet::Avx512 => return unsafe { split_avx512(terms) },
        }
    }
    split_plainly(terms)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn split_avx512(terms: &mut [f64]) -> Parts {
    split_plainly(terms)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn split_avx2(terms: &mut [f64]) -> Parts {
    split_plainly(terms)
}

#[inline(always)]
fn split_plainly(terms: &mut [f64]) -> Parts {
    let largest = largest(terms.as_chunks::<LANES>().0);
    if !(largest > RANGE[0] && largest < RANGE[1]) {
        return Parts {
            has_rest: terms.iter().any(|term| *term != 0.0),
            ..Parts::default()
        };
    }
    // 1.5 times a power of two rounds what is added to it, here to 45 bits below the largest term, and to 45 bits below these
    let exponent = (largest.to_bits() >> 52) as i32 - 1023;
    let large = [0, 1].map(|n| {
        let step = exponent + 1 - (n + 1) * BITS;
        1.5 * f64::from_bits(((step + 52 + 1023) as u64) << 52)
    });
    let (rows, _) = terms.as_chunks_mut::<LANES>();
    let mut sums = [[0.0; LANES]; 2];
    let mut left = [0.0; LANES];
    for row in rows {
        for lane in 0..LANES {
            let first = (row[lane] + large[0]) - large[0];
            let rest = row[lane] - first;
            let second = (rest + large[1]) - large[1];
            let rest = rest - second;
            sums[0][lane] += first;
            sums[1][lane] += second;
            row[lane] = rest;
            left[lane] = larger(left[lane], rest.abs());
        }
    }
    Parts {
        sums: sums.map(|lanes| lanes.into_iter().sum()),
        has_rest: left.into_iter().any(|size| size != 0.0),
    }
}

/// The largest magnitude; zero if all numbers are zero or not a number.
#[inline(always)]
fn largest(rows: &[[f64; LANES]]) -> f64 {
    let mut lanes = [0.0; LANES];
    for row in rows {
        for lane in 0..LANES {
            lanes[lane] = larger(lanes[lane], row[lane].abs());
        }
    }
    lanes.into_iter().fold(0.0, larger)
}

/// The second of two numbers if it is larger: one instruction.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}
