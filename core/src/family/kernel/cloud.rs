//! Rows of a cloud: the bonds of a point and their weights are computed side by side.
//!
//! Columns are loaded one by one, as gather instructions are slower.

use super::lattice::{lane_of, lanes};
use super::{Bits, Bond, BondKernel, Output, SweepInputs, inputs_at};
use crate::family::{Chunk, CloudRows, FamilySpec, Rows, SlotPlaces};
#[cfg(target_arch = "x86_64")]
use crate::instructions::{self, InstructionSet};

/// Bonds of a row that are computed together on a cloud: two AVX2 registers.
pub(in crate::family) const ROW_LANES: usize = 8;

/// [`ROW_LANES`] bonds of a row.
#[derive(Clone, Copy)]
struct BondGroup<'a> {
    rows: &'a Rows,
    /// Slot of the point.
    slot: usize,
    /// Number of the first bond in `rows`.
    first: usize,
}

impl SlotPlaces {
    /// The sum of a row of a cloud, [`ROW_LANES`] bonds at a time.
    #[inline(always)]
    pub(super) fn sum_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        rows: &Rows,
        row: usize,
        broken: Bits<'_>,
    ) -> [f64; O] {
        let slot = rows.slot[row] as usize;
        let (start, end) = (rows.start[row], rows.start[row + 1]);
        let mut first = start;
        let mut sums = [[0.0; ROW_LANES]; O];
        let all = |_| true;
        while first + ROW_LANES <= end && !broken.any() {
            let group = BondGroup { rows, slot, first };
            self.add_bonds::<I, O, true>(kernel, inputs, group, all, &mut sums);
            first += ROW_LANES;
        }
        let counts = |bond| bond < end && !broken.is_broken(bond - start);
        while first < end {
            let group = BondGroup { rows, slot, first };
            self.add_bonds::<I, O, false>(kernel, inputs, group, counts, &mut sums);
            first += ROW_LANES;
        }
        total_of_lanes(&sums)
    }

    /// Adds a group of bonds. Lanes that do not count compute with any numbers; if all count (`WHOLE`), skipping the test
    /// saves a third of the time.
    #[inline(always)]
    fn add_bonds<const I: usize, const O: usize, const WHOLE: bool>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        BondGroup { rows, slot, first }: BondGroup<'_>,
        counts: impl Fn(usize) -> bool,
        sums: &mut [[f64; ROW_LANES]; O],
    ) {
        let here = [self.at[0][slot], self.at[1][slot], self.at[2][slot]];
        let own = inputs_at(inputs, slot);
        let columns: [u32; ROW_LANES] = rows.column[first..first + ROW_LANES]
            .try_into()
            .expect("the slice has as many elements");
        let [weight] = lanes::<1, ROW_LANES>(&[&rows.weight], first);
        let [dual] = match rows.dual.is_empty() {
            true => [weight],
            false => lanes(&[&rows.dual], first),
        };
        let plane = self.flat.then_some(here[2]);
        // SAFETY: columns are slots (asserted by `Family::take_images`), for each of which there are positions (made
        // there).
        let there = unsafe { gather_places(&self.at, plane, columns) };
        let mut other = [[0.0; ROW_LANES]; I];
        for (other, input) in other.iter_mut().zip(inputs) {
            // SAFETY: as above, and there are as many inputs as slots (asserted by `Family::check_inputs`).
            *other = unsafe { gather(input, columns) };
        }
        for lane in 0..ROW_LANES {
            let [x, y, z] = lane_of(&there, lane);
            let xi = [x - here[0], y - here[1], z - here[2]];
            let length = (xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]).sqrt();
            let bond = Bond::new(xi, length, [weight[lane], dual[lane]]);
            let part = kernel.bond(&bond, own, lane_of(&other, lane));
            for o in 0..O {
                let counts = WHOLE || counts(first + lane);
                sums[o][lane] += if counts { part[o] } else { 0.0 };
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
pub(super) fn sweep_cloud_avx2<const I: usize, const O: usize>(
    cloud: &CloudRows,
    kernel: &impl BondKernel<I, O>,
    inputs: SweepInputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_cloud(cloud, kernel, inputs, output, chunk);
}

#[inline(always)]
pub(super) fn sweep_cloud<const I: usize, const O: usize>(
    cloud: &CloudRows,
    kernel: &impl BondKernel<I, O>,
    inputs: SweepInputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    let CloudRows { places, rows } = cloud;
    for row in chunk.rows.clone() {
        let point = rows.point[row] as usize;
        let (values, bits) = (inputs.values, inputs.bits(point));
        let sum = places.sum_row(kernel, values, rows, row, bits);
        // SAFETY: rows are those of points of the family, for each of which `output` has sums, and no other chunk
        // contains them.
        unsafe { output.set(point, sum) }
    }
}

/// Each sum over all lanes.
#[inline(always)]
pub(super) fn total_of_lanes<const O: usize>(sums: &[[f64; ROW_LANES]; O]) -> [f64; O] {
    let mut totals = [0.0; O];
    for (total, lanes) in totals.iter_mut().zip(sums) {
        *total = lanes.iter().sum();
    }
    totals
}

/// Fields by slot from which the weights of rows follow.
pub(in crate::family) struct Weighing<'a> {
    spec: &'a FamilySpec,
    places: &'a SlotPlaces,
    volume: &'a [f64],
    spacing: &'a [f64],
}

/// The point whose family a row is.
#[derive(Clone, Copy)]
pub(in crate::family) struct RowOwner {
    pub slot: usize,
    /// m.
    pub horizon: f64,
    /// Moment of a family of this horizon.
    pub moment: f64,
}

impl<'a> Weighing<'a> {
    /// Places, volumes (m³) and spacings (m) of all slots.
    ///
    /// # Panics
    /// When there is not one of each for each slot.
    pub fn new(
        spec: &'a FamilySpec,
        places: &'a SlotPlaces,
        volume: &'a [f64],
        spacing: &'a [f64],
    ) -> Self {
        let lengths = places.at.iter().map(Vec::len);
        let mut lengths = lengths.chain([volume.len(), spacing.len()]);
        assert!(lengths.all(|n| n == volume.len()), "one for each slot");
        Weighing {
            spec,
            places,
            volume,
            spacing,
        }
    }

    /// Weights of the bonds of a point to the slots in `columns`, which continue for [`ROW_LANES`] beyond the row.
    pub fn weigh(&self, owner: RowOwner, columns: &[u32], weights: &mut [f64]) {
        assert!(columns.len() >= weights.len().next_multiple_of(ROW_LANES));
        #[cfg(target_arch = "x86_64")]
        if instructions::used() > InstructionSet::Baseline {
            // SAFETY: the instruction set was detected.
            return unsafe { weigh_avx2(self, owner, columns, weights) };
        }
        self.weigh_lanes(owner, columns, weights);
    }

    #[inline(always)]
    fn weigh_lanes(&self, owner: RowOwner, columns: &[u32], weights: &mut [f64]) {
        let RowOwner {
            slot,
            horizon,
            moment,
        } = owner;
        let here: [f64; 3] = std::array::from_fn(|a| self.places.at[a][slot]);
        let (rows, _) = columns.as_chunks::<ROW_LANES>();
        for (weights, &columns) in weights.chunks_mut(ROW_LANES).zip(rows) {
            let plane = self.places.flat.then_some(here[2]);
            // SAFETY: columns are slots (asserted by `Family::take_images`), for each of which there are positions (made
            // there), volumes and spacings (asserted by `Weighing::new`).
            let (there, volume, spacing) = unsafe {
                let there = gather_places(&self.places.at, plane, columns);
                (
                    there,
                    gather(self.volume, columns),
                    gather(self.spacing, columns),
                )
            };
            let length: [f64; ROW_LANES] = std::array::from_fn(|lane| {
                let xi: [f64; 3] = std::array::from_fn(|a| there[a][lane] - here[a]);
                (xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]).sqrt()
            });
            let shares = self.spec.shares(horizon, spacing, length);
            let all: [f64; ROW_LANES] =
                std::array::from_fn(|lane| shares[lane] * volume[lane] / moment);
            weights.copy_from_slice(&all[..weights.len()]);
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn weigh_avx2(weighing: &Weighing<'_>, owner: RowOwner, columns: &[u32], weights: &mut [f64]) {
    weighing.weigh_lanes(owner, columns, weights);
}

/// Values of some slots.
///
/// # Safety
/// `columns` are indices of `values`.
#[inline(always)]
unsafe fn gather<const N: usize>(values: &[f64], columns: [u32; N]) -> [f64; N] {
    let mut gathered = [0.0; N];
    for lane in 0..N {
        debug_assert!((columns[lane] as usize) < values.len());
        // SAFETY: the contract of the caller.
        gathered[lane] = unsafe { *values.get_unchecked(columns[lane] as usize) };
    }
    gathered
}

/// Positions of some slots; `plane` is the common z of a flat body.
///
/// # Safety
/// `columns` are indices of all `places`.
#[inline(always)]
unsafe fn gather_places(
    places: &[Vec<f64>; 3],
    plane: Option<f64>,
    columns: [u32; ROW_LANES],
) -> [[f64; ROW_LANES]; 3] {
    // SAFETY: the contract of the caller. No closures: they would be compiled without the instruction set of the caller.
    unsafe {
        let z = match plane {
            Some(z) => [z; ROW_LANES],
            None => gather(&places[2], columns),
        };
        [gather(&places[0], columns), gather(&places[1], columns), z]
    }
}
