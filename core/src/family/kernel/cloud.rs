//! Rows of a cloud: the bonds of a point advance side by side, and so do their weights.
//!
//! Columns are gathered one by one: gather instructions are slower than loads.

use super::{Bits, Bond, BondKernel, Inputs, Output, bits, lanes};
use crate::family::{Chunk, Family, FamilySpec, Rows};

/// Bonds of a row that advance together on a cloud: two AVX2 registers.
pub(in crate::family) const ROW_LANES: usize = 8;

impl Family {
    /// The row of a point of a cloud: its bonds advance side by side, [`ROW_LANES`] at a time. Code that does not ask
    /// whether bonds count where all do is compiled only where speed matters (`FAST`).
    #[inline(always)]
    pub(super) fn sum_cloud_row<const I: usize, const O: usize, const FAST: bool>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        (rows, row): (&Rows, usize),
        broken: Bits<'_>,
    ) -> [f64; O] {
        let at = rows.slot[row] as usize;
        let (start, end) = (rows.start[row], rows.start[row + 1]);
        let mut first = start;
        let mut sums = [[0.0; ROW_LANES]; O];
        let all = |_| true;
        if const { FAST } {
            while first + ROW_LANES <= end && !broken.any() {
                self.add_bonds::<I, O, true>(kernel, inputs, (rows, at, first), all, &mut sums);
                first += ROW_LANES;
            }
        }
        let counts = |bond| bond < end && !broken.is_broken(bond - start);
        while first < end {
            self.add_bonds::<I, O, false>(kernel, inputs, (rows, at, first), counts, &mut sums);
            first += ROW_LANES;
        }
        sums.map(|lanes| lanes.into_iter().sum())
    }

    /// Adds the bonds from number `first` on of the point in slot `at`. Those that do not count compute
    /// with what is there in memory; where all do (`WHOLE`), not to ask saves a third.
    #[inline(always)]
    fn add_bonds<const I: usize, const O: usize, const WHOLE: bool>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        (rows, at, first): (&Rows, usize, usize),
        counts: impl Fn(usize) -> bool,
        sums: &mut [[f64; ROW_LANES]; O],
    ) {
        let here: [f64; 3] = std::array::from_fn(|a| self.places[a][at]);
        let own: [f64; I] = std::array::from_fn(|i| inputs[i][at]);
        let columns: [u32; ROW_LANES] = rows.column[first..first + ROW_LANES]
            .try_into()
            .expect("the slice has as many elements");
        let weight: [f64; ROW_LANES] = lanes(&rows.weight, first);
        let dual: [f64; ROW_LANES] = match rows.dual.is_empty() {
            true => weight,
            false => lanes(&rows.dual, first),
        };
        let there = gather_places(&self.places, (here, self.flat), columns);
        let other: [[f64; ROW_LANES]; I] = std::array::from_fn(|i| gather(inputs[i], columns));
        for lane in 0..ROW_LANES {
            let xi: [f64; 3] = std::array::from_fn(|a| there[a][lane] - here[a]);
            let length = (xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]).sqrt();
            let bond = Bond {
                xi,
                length,
                inverse_length: 1.0 / length,
                weight: weight[lane],
                dual: dual[lane],
            };
            let part = kernel.bond(&bond, own, std::array::from_fn(|i| other[i][lane]));
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
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    inputs: Inputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_cloud(family, kernel, inputs, output, chunk);
}

#[inline(always)]
pub(super) fn sweep_cloud<const I: usize, const O: usize>(
    family: &Family,
    kernel: &impl BondKernel<I, O>,
    (inputs, broken): Inputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    for row in chunk.rows.clone() {
        let point = family.rows.point[row] as usize;
        let sum = family.sum_cloud_row::<I, O, true>(
            kernel,
            inputs,
            (&family.rows, row),
            bits(broken, point),
        );
        output.set(point, sum);
    }
}

/// What the weights of rows are made of.
pub(in crate::family) struct Weighing<'a> {
    places: &'a [Vec<f64>; 3],
    volume: &'a [f64],
    spacing: &'a [f64],
    spec: &'a FamilySpec,
    flat: bool,
}

impl<'a> Weighing<'a> {
    /// Of places (m; whether all in one plane), volumes (m³) and spacings (m) of each of the slots.
    ///
    /// # Panics
    /// When there is not one of each.
    pub fn new(
        spec: &'a FamilySpec,
        slots: usize,
        (places, flat): (&'a [Vec<f64>; 3], bool),
        [volume, spacing]: [&'a [f64]; 2],
    ) -> Self {
        let lengths = places.iter().map(Vec::len);
        let mut lengths = lengths.chain([volume.len(), spacing.len()]);
        assert!(lengths.all(|n| n == slots), "one for each slot");
        Weighing {
            places,
            volume,
            spacing,
            spec,
            flat,
        }
    }

    /// Weights of the bonds of the point in slot `at` to the slots in `columns`, which go on for [`ROW_LANES`]
    /// beyond the row, with its horizon (m) and the moment of its family.
    pub fn weigh(
        &self,
        (at, horizon, moment): (usize, f64, f64),
        columns: &[u32],
        weights: &mut [f64],
    ) {
        assert!(columns.len() >= weights.len().next_multiple_of(ROW_LANES));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the instruction set was detected.
            return unsafe { weigh_avx2(self, (at, horizon, moment), columns, weights) };
        }
        self.weigh_lanes((at, horizon, moment), columns, weights);
    }

    #[inline(always)]
    fn weigh_lanes(
        &self,
        (at, horizon, moment): (usize, f64, f64),
        columns: &[u32],
        weights: &mut [f64],
    ) {
        let here: [f64; 3] = std::array::from_fn(|a| self.places[a][at]);
        let (rows, _) = columns.as_chunks::<ROW_LANES>();
        for (weights, &columns) in weights.chunks_mut(ROW_LANES).zip(rows) {
            let there = gather_places(self.places, (here, self.flat), columns);
            let volume = gather(self.volume, columns);
            let spacing = gather(self.spacing, columns);
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
fn weigh_avx2(
    weighing: &Weighing<'_>,
    row: (usize, f64, f64),
    columns: &[u32],
    weights: &mut [f64],
) {
    weighing.weigh_lanes(row, columns, weights);
}

#[inline(always)]
fn gather<const N: usize>(values: &[f64], columns: [u32; N]) -> [f64; N] {
    let mut gathered = [0.0; N];
    for lane in 0..N {
        debug_assert!((columns[lane] as usize) < values.len());
        // SAFETY: columns are slots (asserted by `Family::take_images`), and places, volumes, spacings and inputs
        // are as long as there are slots (so made there, asserted by those who sweep or weigh).
        gathered[lane] = unsafe { *values.get_unchecked(columns[lane] as usize) };
    }
    gathered
}

/// Places of the slots of a row; those of a flat body lie in the plane of `here`.
#[inline(always)]
fn gather_places(
    places: &[Vec<f64>; 3],
    (here, flat): ([f64; 3], bool),
    columns: [u32; ROW_LANES],
) -> [[f64; ROW_LANES]; 3] {
    let across = match flat {
        true => [here[2]; ROW_LANES],
        false => gather(&places[2], columns),
    };
    [
        gather(&places[0], columns),
        gather(&places[1], columns),
        across,
    ]
}
