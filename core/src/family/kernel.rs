//! The sweep over all bonds: the only place with `unsafe`, and the only one that must be fast.
//!
//! Complete families: [`LANES`] neighbouring points advance together through the shared
//! stencil, their sums in registers; per bond and point one load of each input. The
//! compiler vectorises the lane loop for the instruction set chosen at run time. No fused
//! multiply-add: all instruction sets then give the same bits.

use rayon::prelude::*;

#[cfg(doc)]
use super::FamilySpec;
use super::{Chunk, Family, Rows, Span, StencilBond};

/// Points that advance together: two AVX-512 or four AVX2 registers.
const LANES: usize = 16;

/// A bond of the reference configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// Reference vector to the neighbour, m.
    pub xi: [f64; 3],
    /// Length of `xi`, m.
    pub length: f64,
    /// Weight of the neighbour in the family of the point, 1/m: its volume times influence,
    /// partial volume and correction, over the moment of the family ([`FamilySpec::moment`]).
    /// Corrected families have `sum_j weight |xi| = dimension`.
    pub weight: f64,
    /// Weight with which the neighbour's family holds the point, for the force that the
    /// neighbour's state exerts along the bond: the same but for the horizon and the moment,
    /// which are the neighbour's. Equal to `weight` where horizons are uniform; zero when the point
    /// lies beyond the neighbour's horizon (dual horizon, spec 01, 1.10).
    pub dual: f64,
}

impl Bond {
    /// Mean of both weights: that of pair forces and flows, which both ends share.
    #[inline(always)]
    pub fn mean(&self) -> f64 {
        0.5 * (self.weight + self.dual)
    }
}

/// What a bond adds to `O` sums of its point, from `I` inputs at its two ends.
///
/// Write plain scalar code and mark `bond` `#[inline(always)]`: the sweep vectorises it.
pub trait BondKernel<const I: usize, const O: usize>: Sync {
    /// The contributions of one bond.
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O];
}

/// Output shared by the threads of a sweep; each point is written by exactly one of them.
struct Output<const O: usize> {
    first: *mut [f64; O],
    len: usize,
}

// SAFETY: `chunks` partition the points (checked by `Family::build`), so no two threads
// write the same element, and nobody reads before the sweep has joined.
unsafe impl<const O: usize> Sync for Output<O> {}

impl<const O: usize> Output<O> {
    #[inline(always)]
    fn set(&self, point: usize, value: [f64; O]) {
        debug_assert!(point < self.len);
        // SAFETY: `point` indexes a point of the family and `Family::sum` asserts that the
        // output has one element per point; exclusive by the partition named above.
        unsafe { *self.first.add(point) = value }
    }
}

impl Family {
    /// For every point, the sum of `kernel` over its bonds; `inputs` in slot space, `sums`
    /// by point. Bit-identical for any number of threads.
    ///
    /// # Panics
    /// When an input is not [`Family::slots`] long or `sums` not one element per point.
    pub fn sum<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        sums: &mut [[f64; O]],
    ) {
        assert!(
            inputs.iter().all(|i| i.len() == self.slots),
            "inputs are slot arrays"
        );
        assert_eq!(sums.len(), self.points, "one sum per point");
        let output = Output {
            first: sums.as_mut_ptr(),
            len: sums.len(),
        };
        self.chunks
            .par_iter()
            .for_each(|chunk| self.sweep(kernel, &inputs, &output, chunk));
    }

    /// For every point near an audited layer, passes the point and the sum of `kernel` over
    /// its bonds with layer points to `receive`, in order.
    pub fn sum_from_layers<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        for row in 0..self.layer_rows.point.len() {
            let sum = self.sum_row(kernel, &inputs, &self.layer_rows, row);
            receive(self.layer_rows.point[row] as usize, sum);
        }
    }

    /// For every point below the plane `x_axis = at` (m), passes the point and the sum of `kernel`
    /// over its bonds with points and layer points above to `receive`, in order.
    pub fn sum_across<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        (axis, at): (usize, f64),
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        let above = |slot: usize| self.grid.position(slot, axis) > at;
        for span in &self.spans {
            for i in 0..span.len {
                let (point, slot) = (span.point + i, (span.slot + i) as usize);
                let reach = self.grid.position(slot, axis) + 2.0 * self.spec.horizon;
                if above(slot) || reach < at {
                    continue;
                }
                let mut sums = [0.0; O];
                let mut add = |bond: &Bond, other: usize| {
                    if above(other) {
                        let ends = [slot, other].map(|s| inputs.each_ref().map(|i| i[s]));
                        let part = kernel.bond(bond, ends[0], ends[1]);
                        (0..O).for_each(|o| sums[o] += part[o]);
                    }
                };
                match self.rows.point.binary_search(&point) {
                    Ok(row) => {
                        for bond in self.rows.start[row]..self.rows.start[row + 1] {
                            let weights = (self.rows.weight[bond], self.rows.dual[bond]);
                            let step = self.rows.step[bond] as usize;
                            let bond_of_row = Bond {
                                weight: weights.0,
                                dual: weights.1,
                                ..self.stencil[step].bond
                            };
                            add(&bond_of_row, self.rows.column[bond] as usize);
                        }
                    }
                    Err(_) => {
                        for StencilBond { offset, bond } in &self.stencil {
                            add(bond, slot.wrapping_add_signed(*offset));
                        }
                    }
                }
                receive(point as usize, sums);
            }
        }
    }

    fn sweep<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        output: &Output<O>,
        chunk: &Chunk,
    ) {
        for row in chunk.rows.clone() {
            output.set(
                self.rows.point[row] as usize,
                self.sum_row(kernel, inputs, &self.rows, row),
            );
        }
        let runs = &self.runs[chunk.runs.clone()];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                // SAFETY: the instruction set was detected.
                return unsafe { sweep_avx512(kernel, &self.stencil, inputs, output, runs) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the instruction set was detected.
                return unsafe { sweep_avx2(kernel, &self.stencil, inputs, output, runs) };
            }
        }
        sweep_runs(kernel, &self.stencil, inputs, output, runs);
    }

    #[inline(always)]
    fn sum_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        rows: &Rows,
        row: usize,
    ) -> [f64; O] {
        let at = rows.slot[row] as usize;
        let own = std::array::from_fn(|i| inputs[i][at]);
        let mut sums = [0.0; O];
        let range = rows.start[row]..rows.start[row + 1];
        let columns = &rows.column[range.clone()];
        let (weights, duals) = (&rows.weight[range.clone()], &rows.dual[range.clone()]);
        let members = columns
            .iter()
            .zip(&rows.step[range])
            .zip(weights)
            .zip(duals);
        for (((&column, &step), &weight), &dual) in members {
            let bond = Bond {
                weight,
                dual,
                ..self.stencil[step as usize].bond
            };
            let other = std::array::from_fn(|i| inputs[i][column as usize]);
            let part = kernel.bond(&bond, own, other);
            for o in 0..O {
                sums[o] += part[o];
            }
        }
        sums
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn sweep_avx512<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    stencil: &[StencilBond],
    inputs: &[&[f64]; I],
    output: &Output<O>,
    runs: &[Span],
) {
    sweep_runs(kernel, stencil, inputs, output, runs);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_avx2<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    stencil: &[StencilBond],
    inputs: &[&[f64]; I],
    output: &Output<O>,
    runs: &[Span],
) {
    sweep_runs(kernel, stencil, inputs, output, runs);
}

#[inline(always)]
fn sweep_runs<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    stencil: &[StencilBond],
    inputs: &[&[f64]; I],
    output: &Output<O>,
    runs: &[Span],
) {
    for run in runs {
        let (slot, point, len) = (run.slot as usize, run.point as usize, run.len as usize);
        let mut done = 0;
        while done < len {
            if len < LANES {
                output.set(
                    point + done,
                    sum_block::<I, O, 1>(kernel, stencil, inputs, slot + done)[0],
                );
                done += 1;
                continue;
            }
            // the last block overlaps the one before it: the same sums are written twice
            let first = done.min(len - LANES);
            let sums = sum_block::<I, O, LANES>(kernel, stencil, inputs, slot + first);
            for (lane, sum) in sums.into_iter().enumerate() {
                output.set(point + first + lane, sum);
            }
            done = first + LANES;
        }
    }
}

/// Sums of `N` consecutive points with complete families.
#[inline(always)]
fn sum_block<const I: usize, const O: usize, const N: usize>(
    kernel: &impl BondKernel<I, O>,
    stencil: &[StencilBond],
    inputs: &[&[f64]; I],
    slot: usize,
) -> [[f64; O]; N] {
    let own: [[f64; N]; I] = std::array::from_fn(|i| lanes(inputs[i], slot));
    let mut sums = [[0.0; N]; O];
    for StencilBond { offset, bond } in stencil {
        let at = slot.wrapping_add_signed(*offset);
        let other: [[f64; N]; I] = std::array::from_fn(|i| lanes(inputs[i], at));
        for lane in 0..N {
            let part = kernel.bond(
                bond,
                std::array::from_fn(|i| own[i][lane]),
                std::array::from_fn(|i| other[i][lane]),
            );
            for o in 0..O {
                sums[o][lane] += part[o];
            }
        }
    }
    std::array::from_fn(|lane| std::array::from_fn(|o| sums[o][lane]))
}

#[inline(always)]
fn lanes<const N: usize>(input: &[f64], at: usize) -> [f64; N] {
    input[at..at + N]
        .try_into()
        .expect("the slice has N elements")
}
