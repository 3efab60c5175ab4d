//! The instruction sets for which sweeps and sums are compiled, and the one that a program uses.
//!
//! Programs with debug assertions, as tests use them, are not compiled for AVX-512, which would take them a third longer: its results are those of AVX2, as
//! the unit tests of this crate show.

use std::sync::OnceLock;

/// Instruction sets for which sweeps are compiled, each with those before it. Results with `Avx2` and `Avx512` are the same
/// bit by bit; those with `Baseline` differ in the rounding of sums that visit each bond once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every machine of the architecture has.
    Baseline,
    /// AVX2 and fused multiply-adds, on x86-64 machines that have them.
    Avx2,
    /// AVX-512 F and VL, on x86-64 machines that have them.
    Avx512,
}

impl InstructionSet {
    /// All sets, from the narrowest to the widest.
    pub const ALL: [InstructionSet; 3] = [
        InstructionSet::Baseline,
        InstructionSet::Avx2,
        InstructionSet::Avx512,
    ];

    /// Name in commands.
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }
}

static USED: OnceLock<InstructionSet> = OnceLock::new();

/// Limits the sweeps of this program to an instruction set; to be called before the first sweep, which takes the widest set
/// of the machine otherwise.
///
/// # Errors
/// The set that sweeps use already, if it is another one.
pub fn limit_instructions(limit: InstructionSet) -> Result<(), InstructionSet> {
    let set = widest().min(limit);
    match *USED.get_or_init(|| set) {
        used if used == set => Ok(()),
        used => Err(used),
    }
}

pub(crate) fn used() -> InstructionSet {
    #[cfg(test)]
    if let Some(limit) = limited::LIMIT.get() {
        return widest().min(limit);
    }
    *USED.get_or_init(widest)
}

/// Whether sweeps may use fused multiply-adds, which those that visit bonds once require.
pub(crate) fn can_fuse() -> bool {
    used() > InstructionSet::Baseline || cfg!(target_arch = "aarch64")
}

#[cfg(target_arch = "x86_64")]
fn widest() -> InstructionSet {
    if !(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")) {
        InstructionSet::Baseline
    } else if cfg!(any(test, not(debug_assertions)))
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
    {
        InstructionSet::Avx512
    } else {
        InstructionSet::Avx2
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn widest() -> InstructionSet {
    InstructionSet::Baseline
}

/// Sweeps limited to an instruction set, in unit tests.
#[cfg(test)]
pub(crate) mod limited {
    use std::cell::Cell;

    use super::InstructionSet;

    thread_local! {
        pub(super) static LIMIT: Cell<Option<InstructionSet>> = const { Cell::new(None) };
    }

    /// Calls `sweep` on a thread whose sweeps are limited to a set.
    pub(crate) fn to<R: Send>(set: InstructionSet, sweep: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
        let pool = pool.start_handler(move |_| LIMIT.set(Some(set))).build();
        pool.expect("a thread").install(sweep)
    }
}
