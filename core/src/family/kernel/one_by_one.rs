//! Sums bond by bond, compiled once for each kernel: of points beside cracks, of rare kernels, of rows near layers, and on
//! machines without vectors.

use super::cloud::{ROW_LANES, total_of_lanes};
use super::{Bits, BondKernel, add, inputs_at};
use crate::family::store::BondReceiver;
use crate::family::{Family, Rows, Stencil, StencilBond, StencilBonds, Store};

impl Family {
    /// The sum of one point, bond by bond: for incomplete families beside cracks and of rare kernels.
    pub(super) fn sum_bonds<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        point: usize,
        broken: Bits<'_>,
    ) -> [f64; O] {
        let pass = |receive: BondReceiver<'_>| self.pass_bonds(point, receive);
        sum_passed(kernel, inputs, self.slot_of(point), broken, 1, &pass)
    }

    /// The sum of one row, bond by bond.
    pub(super) fn sum_row<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        rows: &Rows,
        row: usize,
        broken: Bits<'_>,
    ) -> [f64; O] {
        let slot = rows.slot[row] as usize;
        match &self.store {
            Store::Cloud(cloud) | Store::Moving(cloud, _) => {
                let pass = |receive: BondReceiver<'_>| {
                    cloud.places.for_each_bond(rows, row, receive);
                };
                sum_passed(kernel, inputs, slot, broken, ROW_LANES, &pass)
            }
            Store::Lattice(StencilBonds { stencil, .. }, _)
            | Store::Growing(StencilBonds { stencil, .. }, _)
            | Store::List(stencil, _) => {
                let pass = |receive: BondReceiver<'_>| stencil.for_each_bond(rows, row, receive);
                sum_passed(kernel, inputs, slot, broken, 1, &pass)
            }
        }
    }
}

impl Stencil {
    /// The sum of a point with a complete family, bond by bond. Compiled once.
    #[inline(never)]
    pub(super) fn sum_complete<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
        slot: usize,
        broken: Bits<'_>,
    ) -> [f64; O] {
        let own = inputs_at(inputs, slot);
        let mut sums = [0.0; O];
        for (number, StencilBond { offset, bond }) in self.bonds.iter().enumerate() {
            if !broken.is_broken(number) {
                let other = inputs_at(inputs, slot.wrapping_add_signed(*offset));
                add(&mut sums, kernel.bond(bond, own, other));
            }
        }
        sums
    }
}

/// The sum over the bonds that `pass` passes on, of the point in a slot. It has the bits of a sweep that sums bonds in so
/// many lanes, a power of two. Compiled once.
#[inline(never)]
fn sum_passed<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    inputs: &[&[f64]; I],
    slot: usize,
    broken: Bits<'_>,
    lanes: usize,
    pass: &dyn Fn(BondReceiver<'_>),
) -> [f64; O] {
    let own = inputs_at(inputs, slot);
    let mut sums = [[0.0; ROW_LANES]; O];
    pass(&mut |number, bond, other| {
        if !broken.is_broken(number) {
            let part = kernel.bond(bond, own, inputs_at(inputs, other));
            for (sums, part) in sums.iter_mut().zip(part) {
                sums[number & (lanes - 1)] += part;
            }
        }
    });
    total_of_lanes(&sums)
}
