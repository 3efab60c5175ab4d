//! The sweep over all bonds: the only place with `unsafe`, and the only one that must be fast.
//!
//! Complete families: [`LANES`] neighbouring points advance together through the shared
//! stencil, their sums in registers; per bond and point one load of each input. The
//! compiler vectorises the lane loop for AVX2 and AVX-512, one of which is chosen at run time; machines of the x86
//! kind that have neither evaluate bond by bond. Fused multiply-adds are used only
//! where bonds are visited once ([`BondKernel::add_ends`]), as they give other bits than machines without them.

use std::marker::PhantomData;
use std::ops::Range;

use rayon::prelude::*;

use super::blocks::Weights;
use super::broken::Bits;
use super::{BrokenBonds, Chunk, Family, Rows, StencilBond};

mod cloud;
mod pairs;

#[cfg(not(target_arch = "x86_64"))]
use cloud::sweep_cloud;
#[cfg(target_arch = "x86_64")]
use cloud::sweep_cloud_avx2;
pub(super) use cloud::{ROW_LANES, Weighing};
pub(super) use pairs::Pairs;

/// Points that advance together: two AVX-512 or four AVX2 registers.
const LANES: usize = 16;

/// A bond of the reference configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// Reference vector to the neighbour, m.
    pub xi: [f64; 3],
    /// Length of `xi`, m.
    pub length: f64,
    /// One over it, 1/m.
    pub inverse_length: f64,
    /// Weight of the neighbour in the family of the point, 1/m: its volume times influence,
    /// partial volume and correction, over the moment of the family ([`moment`](super::FamilySpec::moment)).
    /// Calibrated families have `sum_j weight |xi| = dimension`.
    pub weight: f64,
    /// Weight with which the neighbour's family holds the point, for the force that the
    /// neighbour's state exerts along the bond: the same but for the horizon and the moment,
    /// which are the neighbour's. Equal to `weight` where horizons are uniform; zero when the point
    /// lies beyond the neighbour's horizon (dual horizon, Wang (2025), eq. 5.13).
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

    /// How many of the sums, from the first, the bond adds to at both of its ends ([`BondKernel::ends`]). On a
    /// lattice, where the machine has fused multiply-adds, it is then visited from one end only, to which it adds the
    /// others.
    const PAIRED: usize = 0;

    /// The contributions of one bond.
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O];

    /// The contributions of one bond to its own and its other end, which are opposite unless said otherwise.
    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; O]; 2] {
        let part = self.bond(bond, own, other);
        [part, std::array::from_fn(|o| -part[o])]
    }

    /// Adds what [`BondKernel::ends`] gives to the sums of both ends. Called only where the machine has fused
    /// multiply-adds: a kernel that uses them has fewer instructions, and other last bits than without.
    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; I],
        other: [f64; I],
        [here, there]: [&mut [f64; O]; 2],
    ) {
        add_parts([here, there], self.ends(bond, own, other));
    }
}

/// Adds what a bond gives to the sums of its ends.
#[inline(always)]
fn add_parts<const O: usize>([here, there]: [&mut [f64; O]; 2], parts: [[f64; O]; 2]) {
    for o in 0..O {
        here[o] += parts[0][o];
        there[o] += parts[1][o];
    }
}

/// Calls `sweep` with each of the parts of a sweep, on all threads. What distributes them is compiled once, not for
/// every kernel, as one dynamic call for each part costs nothing beside it.
fn for_each<T: Sync>(parts: &[T], sweep: &(dyn Fn(&T) + Sync)) {
    parts.par_iter().for_each(sweep);
}

/// Whether this machine has fused multiply-adds, without which bonds are not visited once.
fn can_fuse() -> bool {
    #[cfg(target_arch = "x86_64")]
    return !matches!(instructions(), Instructions::Baseline);
    #[cfg(not(target_arch = "x86_64"))]
    return cfg!(target_arch = "aarch64");
}

/// The instruction sets for which sweeps are compiled.
#[cfg(target_arch = "x86_64")]
enum Instructions {
    /// What every machine has: kernels are evaluated bond by bond, not side by side.
    Baseline,
    /// With fused multiply-adds.
    Avx2,
    /// With fused multiply-adds.
    Avx512,
}

#[cfg(target_arch = "x86_64")]
fn instructions() -> Instructions {
    if !(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")) {
        Instructions::Baseline
    } else if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
        Instructions::Avx512
    } else {
        Instructions::Avx2
    }
}

/// Output shared by the threads of a sweep; each point is written by exactly one of them.
struct Output<'a, const O: usize> {
    /// Where each sum of the first point goes, and how far behind those of the next one follow.
    sums: [(*mut f64, usize); O],
    len: usize,
    borrowed: PhantomData<&'a mut f64>,
}

// SAFETY: `chunks` partition the points (checked by `Family::build`), so no two threads
// write the same element, and nobody reads before the sweep has joined.
unsafe impl<const O: usize> Sync for Output<'_, O> {}

impl<'a, const O: usize> Output<'a, O> {
    fn new(sums: &'a mut [[f64; O]]) -> Self {
        let first = sums.as_mut_ptr().cast::<f64>();
        Output {
            sums: std::array::from_fn(|o| (first.wrapping_add(o), O)),
            len: sums.len(),
            borrowed: PhantomData,
        }
    }

    #[inline(always)]
    fn set(&self, point: usize, value: [f64; O]) {
        debug_assert!(point < self.len);
        for ((first, stride), value) in self.sums.into_iter().zip(value) {
            // SAFETY: `point` indexes a point of the family and `Family::sum_to` asserts that the
            // output has one element per point; exclusive by the partition named above.
            unsafe { *first.add(point * stride) = value }
        }
    }
}

impl<'a> Output<'a, 4> {
    /// Three sums to `vectors`, the fourth to `last`.
    fn apart(vectors: &'a mut [[f64; 3]], last: &'a mut [f64]) -> Self {
        let Output {
            sums: [x, y, z],
            len,
            borrowed,
        } = Output::new(vectors);
        assert_eq!(last.len(), len, "as many as vectors");
        Output {
            sums: [x, y, z, (last.as_mut_ptr(), 1)],
            len,
            borrowed,
        }
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
        self.sum_unbroken(kernel, inputs, None, sums);
    }

    /// As [`Family::sum`], over the bonds that are not broken.
    ///
    /// # Panics
    /// As [`Family::sum`], and when `broken` belongs to another family.
    pub fn sum_unbroken<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        self.sum_to(kernel, inputs, broken, Output::new(sums));
    }

    /// As [`Family::sum_unbroken`], with the first three sums in `vectors` and the fourth in `last`.
    ///
    /// # Panics
    /// As [`Family::sum_unbroken`].
    pub fn sum_apart<const I: usize>(
        &self,
        kernel: &impl BondKernel<I, 4>,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        (vectors, last): (&mut [[f64; 3]], &mut [f64]),
    ) {
        self.sum_to(kernel, inputs, broken, Output::apart(vectors, last));
    }

    fn sum_to<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        output: Output<'_, O>,
    ) {
        self.check_inputs(&inputs);
        assert_eq!(output.len, self.points, "one sum per point");
        if const { K::PAIRED > 0 }
            && can_fuse()
            && self.growth.is_none()
            && let Some(pairs) = self.pairs.get_or_init(|| Pairs::new(self))
        {
            return self.sum_pairs((kernel, pairs), (&inputs, broken), &output);
        }
        for_each(&self.chunks, &|chunk| {
            self.sweep(kernel, (&inputs, broken), &output, chunk);
        });
        for span in &self.unborn {
            let points = span.point as usize..(span.point + span.len) as usize;
            points.for_each(|point| output.set(point, [0.0; O]));
        }
    }

    fn check_inputs<const I: usize>(&self, inputs: &[&[f64]; I]) {
        let slots = |input: &&[f64]| input.len() == self.slots;
        assert!(inputs.iter().all(slots), "inputs are slot arrays");
    }

    /// For every point near an audited layer, passes the point and the sum of `kernel` over
    /// its bonds with layer points to `receive`, in order.
    pub fn sum_from_layers<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        self.check_inputs(&inputs);
        let mut sums = [[0.0; O]; 1024];
        for (block, points) in self.layer_rows.point.chunks(sums.len()).enumerate() {
            let first = block * sums.len();
            let rows = sums.par_iter_mut().zip(first..first + points.len());
            rows.with_min_len(128).for_each(|(sums, row)| {
                *sums = self.sum_any_row(kernel, &inputs, (&self.layer_rows, row), Bits::NONE);
            });
            let points = points.iter().zip(&sums);
            points.for_each(|(&point, sums)| receive(point as usize, *sums));
        }
    }

    /// For every point below the plane `x_axis = at` (m), passes the point and the sum of `kernel`
    /// over its unbroken bonds with points and layer points above to `receive`, in order.
    pub fn sum_across<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        (inputs, broken): ([&[f64]; I], Option<&BrokenBonds>),
        (axis, at): (usize, f64),
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        let above = |slot: usize| self.place(slot, axis) > at;
        for point in 0..self.points {
            let slot = self.slot_of(point);
            if above(slot) {
                continue;
            }
            let mut sums = [0.0; O];
            let bits = broken.map_or(Bits::NONE, |b| b.bits(point));
            self.for_each_bond(point, |number, bond, other| {
                if above(other) && !bits.is_broken(number) {
                    let ends = [slot, other].map(|s| inputs.each_ref().map(|i| i[s]));
                    let part = kernel.bond(bond, ends[0], ends[1]);
                    (0..O).for_each(|o| sums[o] += part[o]);
                }
            });
            receive(point, sums);
        }
    }

    /// Centre of a slot along an axis, m.
    pub(super) fn place(&self, slot: usize, axis: usize) -> f64 {
        match &self.grid {
            Some(grid) => grid.position(slot, axis),
            None => self.places[axis][slot],
        }
    }

    pub(super) fn bond_of_row(&self, slot: usize, at: usize) -> Bond {
        let weight = self.rows.weight[at];
        let dual = self.rows.dual.get(at).copied().unwrap_or(weight);
        if self.is_cloud() {
            let other = self.rows.column[at] as usize;
            let xi: [f64; 3] =
                std::array::from_fn(|a| self.places[a][other] - self.places[a][slot]);
            let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
            return Bond {
                xi,
                length,
                inverse_length: 1.0 / length,
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
        (inputs, broken): Inputs<'_, I>,
        output: &Output<'_, O>,
        chunk: &Chunk,
    ) {
        for row in chunk.rows.clone() {
            let point = self.rows.point[row] as usize;
            let sum = self.sum_any_row(kernel, inputs, (&self.rows, row), bits(broken, point));
            output.set(point, sum);
        }
        let blocks = self.blocks.head[chunk.blocks.clone()].iter();
        let blocks = blocks.map(|b| b.point..b.point + b.len);
        let runs = self.runs[chunk.runs.clone()].iter();
        let runs = runs.map(|r| r.point..r.point + r.len);
        for point in blocks.chain(runs).flatten() {
            let point = point as usize;
            let sum = self.sum_bonds(kernel, inputs, point, bits(broken, point));
            output.set(point, sum);
        }
    }

    /// The sum of one point, bond by bond: compiled once, for points beside cracks and rare kernels.
    #[inline(never)]
    fn sum_bonds<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        point: usize,
        broken: Bits<'_>,
    ) -> [f64; O] {
        let at = self.slot_of(point);
        let own = std::array::from_fn(|i| inputs[i][at]);
        let mut sums = [0.0; O];
        self.for_each_bond(point, |number, bond, other| {
            if !broken.is_broken(number) {
                let part = kernel.bond(bond, own, inputs.map(|i| i[other]));
                (0..O).for_each(|o| sums[o] += part[o]);
            }
        });
        sums
    }

    fn sweep<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: Inputs<'_, I>,
        output: &Output<'_, O>,
        chunk: &Chunk,
    ) {
        if const { K::RARE } {
            return self.sweep_plainly(kernel, inputs, output, chunk);
        }
        // rows whose bonds are those of a lattice
        if !(self.is_cloud() || chunk.rows.is_empty()) {
            return self.sweep_plainly(kernel, inputs, output, chunk);
        }
        #[cfg(target_arch = "x86_64")]
        match instructions() {
            Instructions::Baseline => self.sweep_plainly(kernel, inputs, output, chunk),
            // not AVX-512: its gather instructions are slower than loads one by one
            _ if self.is_cloud() => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_cloud_avx2(self, kernel, inputs, output, chunk) }
            }
            // of paired kernels only bodies come here that are too narrow for pairs
            Instructions::Avx512 if const { K::PAIRED == 0 } => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_avx512(self, kernel, inputs, output, chunk) }
            }
            Instructions::Avx512 | Instructions::Avx2 => {
                // SAFETY: the instruction set was detected, or one that includes it.
                unsafe { sweep_avx2(self, kernel, inputs, output, chunk) }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        match self.is_cloud() {
            true => sweep_cloud(self, kernel, inputs, output, chunk),
            false => sweep_lattice(self, kernel, inputs, output, chunk),
        }
    }

    /// The sum of one row, compiled once.
    #[inline(never)]
    fn sum_any_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        row: (&Rows, usize),
        broken: Bits<'_>,
    ) -> [f64; O] {
        if self.is_cloud() {
            self.sum_cloud_row::<I, O, false>(kernel, inputs, row, broken)
        } else {
            self.sum_row(kernel, inputs, row, broken)
        }
    }

    #[inline(always)]
    fn sum_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        (rows, row): (&Rows, usize),
        broken: Bits<'_>,
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
        for (number, (((&column, &step), &weight), &dual)) in members.enumerate() {
            if broken.is_broken(number) {
                continue;
            }
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
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    inputs: Inputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_lattice(family, kernel, inputs, output, chunk);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_avx2<const I: usize, const O: usize>(
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    inputs: Inputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_lattice(family, kernel, inputs, output, chunk);
}

#[inline(always)]
fn sweep_lattice<const I: usize, const O: usize>(
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    (values, broken): Inputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    // of one length, for all the compiler knows: one check of bounds for all
    let inputs = &values.map(|input| &input[..family.slots]);
    let is_whole = |points: Range<usize>| broken.is_none_or(|b| b.is_whole(points));
    let sum_one = |point: usize| family.sum_bonds(kernel, inputs, point, bits(broken, point));
    let stencil = &family.stencil[..];
    for run in &family.runs[chunk.runs.clone()] {
        let (slot, point, len) = (run.slot as usize, run.point as usize, run.len as usize);
        let mut done = 0;
        while done < len {
            // the last block overlaps the one before it: the same sums are written twice
            let first = done.min(len.saturating_sub(LANES));
            let points = point + first..point + (first + LANES).min(len);
            if points.len() == LANES && is_whole(points.clone()) {
                let sums = sum_lanes::<I, O, LANES>(kernel, (stencil, None), inputs, slot + first);
                points.zip(sums).for_each(|(p, sum)| output.set(p, sum));
            } else {
                points.for_each(|p| output.set(p, sum_one(p)));
            }
            done = first + LANES;
        }
    }
    for block in chunk.blocks.clone() {
        let head = family.blocks.head[block];
        let points = head.points();
        if is_whole(points.clone()) {
            let bonds = (stencil, Some(family.blocks.weights(block)));
            let sums = sum_lanes(kernel, bonds, inputs, head.slot as usize);
            points.zip(sums).for_each(|(p, sum)| output.set(p, sum));
        } else {
            points.for_each(|p| output.set(p, sum_one(p)));
        }
    }
}

/// Inputs of a kernel, and the bonds that do not count.
type Inputs<'a, const I: usize> = (&'a [&'a [f64]; I], Option<&'a BrokenBonds>);

#[inline(always)]
fn bits(broken: Option<&BrokenBonds>, point: usize) -> Bits<'_> {
    broken.map_or(Bits::NONE, |b| b.bits(point))
}

/// Sums of `N` points in consecutive slots over the bonds of the stencil, with its weights or those of a
/// block; lanes of a block that are no points sum up nothing.
#[inline(always)]
fn sum_lanes<const I: usize, const O: usize, const N: usize>(
    kernel: &impl BondKernel<I, O>,
    (stencil, weights): (&[StencilBond], Option<&[Weights<N>]>),
    inputs: &[&[f64]; I],
    slot: usize,
) -> [[f64; O]; N] {
    let own: [[f64; N]; I] = std::array::from_fn(|i| lanes(inputs[i], slot));
    let mut sums = [[0.0; N]; O];
    // a copy of each bond: from behind a reference its parts would be gathered lane by lane
    for (number, &StencilBond { offset, bond }) in stencil.iter().enumerate() {
        if weights.is_some_and(|weights| weights[number] == [[0.0; N]; 2]) {
            continue;
        }
        let at = slot.wrapping_add_signed(offset);
        let other: [[f64; N]; I] = std::array::from_fn(|i| lanes(inputs[i], at));
        for lane in 0..N {
            let bond = weights.map_or(bond, |weights| Bond {
                weight: weights[number][0][lane],
                dual: weights[number][1][lane],
                ..bond
            });
            let part = kernel.bond(
                &bond,
                std::array::from_fn(|i| own[i][lane]),
                std::array::from_fn(|i| other[i][lane]),
            );
            // where there is no point its inputs mean nothing
            let counts = weights.is_none() || bond.weight + bond.dual != 0.0;
            for o in 0..O {
                sums[o][lane] += if counts { part[o] } else { 0.0 };
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
