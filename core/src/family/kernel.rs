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

/// Bonds of a row that advance together on a cloud: one AVX2 register. Eight were slower, and small
/// families would fill them badly.
pub(super) const ROW_LANES: usize = 4;

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
    /// Evaluated rarely: compiled once, without vectors.
    const RARE: bool = false;

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
            let sum = if self.is_cloud() {
                self.sum_cloud_row(kernel, &inputs, &self.layer_rows, row)
            } else {
                self.sum_row(kernel, &inputs, &self.layer_rows, row)
            };
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
        let above = |slot: usize| self.place(slot, axis) > at;
        for span in &self.spans {
            for i in 0..span.len {
                let (point, slot) = (span.point + i, (span.slot + i) as usize);
                if above(slot) {
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
                        for at in self.rows.start[row]..self.rows.start[row + 1] {
                            add(&self.bond_of_row(slot, at), self.rows.column[at] as usize);
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

    /// Centre of a slot along an axis, m.
    fn place(&self, slot: usize, axis: usize) -> f64 {
        match &self.grid {
            Some(grid) => grid.position(slot, axis),
            None => self.places[axis][slot],
        }
    }

    fn bond_of_row(&self, slot: usize, at: usize) -> Bond {
        let (weight, dual) = (self.rows.weight[at], self.rows.dual[at]);
        if self.is_cloud() {
            let other = self.rows.column[at] as usize;
            let xi: [f64; 3] =
                std::array::from_fn(|a| self.places[a][other] - self.places[a][slot]);
            let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
            return Bond {
                xi,
                length,
                weight,
                dual,
            };
        }
        Bond {
            weight,
            dual,
            ..self.stencil[self.rows.step[at] as usize].bond
        }
    }

    fn sweep_plainly<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        output: &Output<O>,
        chunk: &Chunk,
    ) {
        for row in chunk.rows.clone() {
            let sum = if self.is_cloud() {
                self.sum_cloud_row(kernel, inputs, &self.rows, row)
            } else {
                self.sum_row(kernel, inputs, &self.rows, row)
            };
            output.set(self.rows.point[row] as usize, sum);
        }
        for run in &self.runs[chunk.runs.clone()] {
            for i in 0..run.len as usize {
                let slot = run.slot as usize + i;
                let [sum] = sum_block::<I, O, 1>(kernel, &self.stencil, inputs, slot);
                output.set(run.point as usize + i, sum);
            }
        }
    }

    fn sweep<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: &[&[f64]; I],
        output: &Output<O>,
        chunk: &Chunk,
    ) {
        if const { K::RARE } {
            return self.sweep_plainly(kernel, inputs, output, chunk);
        }
        if self.is_cloud() {
            // nothing is gained by wider registers: gathering limits
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the instruction set was detected.
                return unsafe { sweep_cloud_avx2(self, kernel, inputs, output, chunk) };
            }
            return sweep_cloud(self, kernel, inputs, output, chunk);
        }
        for row in chunk.rows.clone() {
            let sum = self.sum_row(kernel, inputs, &self.rows, row);
            output.set(self.rows.point[row] as usize, sum);
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

    /// The row of a point of a cloud: its bonds advance side by side, [`ROW_LANES`] at a time.
    #[inline(always)]
    fn sum_cloud_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        rows: &Rows,
        row: usize,
    ) -> [f64; O] {
        let at = rows.slot[row] as usize;
        let (mut first, end) = (rows.start[row], rows.start[row + 1]);
        let mut sums = [[0.0; ROW_LANES]; O];
        while first + ROW_LANES <= end {
            self.add_bonds::<I, O, true>(kernel, inputs, (rows, at, first, end), &mut sums);
            first += ROW_LANES;
        }
        if first < end {
            self.add_bonds::<I, O, false>(kernel, inputs, (rows, at, first, end), &mut sums);
        }
        sums.map(|lanes| lanes.into_iter().sum())
    }

    /// Adds the bonds from number `first` on of the point in slot `at`. Lanes from `end` on compute
    /// with what follows in memory and count nothing; where all are `WHOLE`, not to ask saves a third.
    #[inline(always)]
    fn add_bonds<const I: usize, const O: usize, const WHOLE: bool>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        (rows, at, first, end): (&Rows, usize, usize, usize),
        sums: &mut [[f64; ROW_LANES]; O],
    ) {
        let here: [f64; 3] = std::array::from_fn(|a| self.places[a][at]);
        let own: [f64; I] = std::array::from_fn(|i| inputs[i][at]);
        let columns = &rows.column[first..first + ROW_LANES];
        // element by element: on many processors faster than gather instructions
        let gather = |values: &[f64]| -> [f64; ROW_LANES] {
            std::array::from_fn(|lane| values[columns[lane] as usize])
        };
        let weight: [f64; ROW_LANES] = lanes(&rows.weight, first);
        let dual: [f64; ROW_LANES] = lanes(&rows.dual, first);
        let there: [[f64; ROW_LANES]; 3] = std::array::from_fn(|a| gather(&self.places[a]));
        let other: [[f64; ROW_LANES]; I] = std::array::from_fn(|i| gather(inputs[i]));
        for lane in 0..ROW_LANES {
            let xi: [f64; 3] = std::array::from_fn(|a| there[a][lane] - here[a]);
            let bond = Bond {
                xi,
                length: (xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]).sqrt(),
                weight: weight[lane],
                dual: dual[lane],
            };
            let part = kernel.bond(&bond, own, std::array::from_fn(|i| other[i][lane]));
            for o in 0..O {
                let counts = WHOLE || first + lane < end;
                sums[o][lane] += if counts { part[o] } else { 0.0 };
            }
        }
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

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_cloud_avx2<const I: usize, const O: usize>(
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    inputs: &[&[f64]; I],
    output: &Output<O>,
    chunk: &Chunk,
) {
    sweep_cloud(family, kernel, inputs, output, chunk);
}

#[inline(always)]
fn sweep_cloud<const I: usize, const O: usize>(
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    inputs: &[&[f64]; I],
    output: &Output<O>,
    chunk: &Chunk,
) {
    for row in chunk.rows.clone() {
        let sum = family.sum_cloud_row(kernel, inputs, &family.rows, row);
        output.set(family.rows.point[row] as usize, sum);
    }
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
