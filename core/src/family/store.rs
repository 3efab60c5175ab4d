//! Where the bonds of a family are: what a sweep goes through.

use std::sync::OnceLock;

use super::Bond;
use super::blocks::Blocks;
use super::growing::GrowingBonds;
use super::kernel::Pairs;
use super::layer::SlotGrid;
use super::moving::Following;
use super::slots::Span;

/// The bonds of a family.
#[derive(Debug)]
pub(super) enum Store {
    /// Points of a lattice, in runs and blocks. The pairs are built by the first kernel with paired sums.
    Lattice(StencilBonds, OnceLock<Option<Box<Pairs>>>),
    /// Points of a lattice that become present and absent.
    Growing(StencilBonds, Box<GrowingBonds>),
    /// A row for each point of a lattice.
    List(Stencil, Rows),
    /// A row for each of points anywhere.
    Cloud(CloudRows),
    /// A row for each of points that move.
    Moving(CloudRows, Box<Following>),
}

/// Takes a bond: its number in the family, the bond, the slot of the other end.
pub(super) type BondReceiver<'a> = &'a mut dyn FnMut(usize, &Bond, usize);

/// Bonds that all complete families of a lattice have.
#[derive(Debug)]
pub(super) struct Stencil {
    pub(super) grid: SlotGrid,
    pub(super) bonds: Vec<StencilBond>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct StencilBond {
    pub(super) offset: isize,
    pub(super) bond: Bond,
}

/// Bonds that equal those of a stencil, or differ from them in their weights only.
#[derive(Debug)]
pub(super) struct StencilBonds {
    pub(super) stencil: Stencil,
    /// Points whose families are complete and equal.
    pub(super) runs: Vec<Span>,
    pub(super) blocks: Blocks,
    /// Remote points whose bonds differ from those of the stencil.
    pub(super) remote: Blocks,
}

/// Compressed rows of bonds.
#[derive(Debug, Default)]
pub(super) struct Rows {
    pub(super) point: Vec<u32>,
    pub(super) slot: Vec<u32>,
    pub(super) start: Vec<usize>,
    pub(super) column: Vec<u32>,
    /// Number in the stencil; on a lattice only.
    pub(super) step: Vec<u16>,
    pub(super) weight: Vec<f64>,
    /// Empty where equal to `weight`, as in moving families.
    pub(super) dual: Vec<f64>,
}

/// Rows whose bonds follow from the places of slots.
#[derive(Debug, Default)]
pub(super) struct CloudRows {
    pub(super) places: SlotPlaces,
    pub(super) rows: Rows,
}

/// Reference position of each slot along each axis, m.
#[derive(Debug, Default)]
pub(super) struct SlotPlaces {
    pub(super) at: [Vec<f64>; 3],
    /// Whether all points lie in a plane of constant z.
    pub(super) flat: bool,
}

impl Default for Store {
    fn default() -> Self {
        Store::Cloud(CloudRows::default())
    }
}

impl Store {
    pub(super) fn stencil(&self) -> Option<&Stencil> {
        match self {
            Store::Lattice(bonds, _) | Store::Growing(bonds, _) => Some(&bonds.stencil),
            Store::List(stencil, _) => Some(stencil),
            Store::Cloud(_) | Store::Moving(..) => None,
        }
    }

    pub(super) fn stencil_bonds(&self) -> Option<&StencilBonds> {
        match self {
            Store::Lattice(bonds, _) | Store::Growing(bonds, _) => Some(bonds),
            _ => None,
        }
    }

    /// Rows of points; `None` where bonds are those of a stencil.
    pub(super) fn rows(&self) -> Option<&Rows> {
        match self {
            Store::Lattice(..) | Store::Growing(..) => None,
            Store::List(_, rows) => Some(rows),
            Store::Cloud(cloud) | Store::Moving(cloud, _) => Some(&cloud.rows),
        }
    }

    pub(super) fn growth(&self) -> Option<&GrowingBonds> {
        match self {
            Store::Growing(_, growth) => Some(growth),
            _ => None,
        }
    }

    pub(super) fn memory(&self) -> usize {
        match self {
            Store::Lattice(bonds, pairs) => {
                let pairs = pairs.get().and_then(Option::as_ref);
                bonds.blocks.memory() + pairs.map_or(0, |p| p.memory())
            }
            Store::Growing(bonds, growth) => bonds.blocks.memory() + growth.memory(),
            Store::List(_, rows) => rows.memory(),
            Store::Cloud(cloud) | Store::Moving(cloud, _) => {
                let places = cloud.places.at.iter();
                cloud.rows.memory() + places.map(|x| size_of_val(&**x)).sum::<usize>()
            }
        }
    }
}

impl Stencil {
    /// All bonds of a row: number in the row, bond, slot of the other end.
    pub(super) fn for_each_bond(&self, rows: &Rows, row: usize, receive: BondReceiver<'_>) {
        for (number, at) in (rows.start[row]..rows.start[row + 1]).enumerate() {
            let [weight, dual] = rows.weights(at);
            let bond = Bond {
                weight,
                dual,
                ..self.bonds[rows.step[at] as usize].bond
            };
            receive(number, &bond, rows.column[at] as usize);
        }
    }
}

impl StencilBonds {
    /// All bonds of a point in a slot: number in the stencil, bond, slot of the other end.
    pub(super) fn for_each_bond(&self, point: usize, slot: usize, receive: BondReceiver<'_>) {
        let own = self.blocks.find(point as u32);
        let own = own.map(|(block, lane)| (self.blocks.weights(block), lane));
        for (number, StencilBond { offset, bond }) in self.stencil.bonds.iter().enumerate() {
            let other = slot.wrapping_add_signed(*offset);
            let Some((weights, lane)) = own else {
                receive(number, bond, other);
                continue;
            };
            let [weight, dual] = weights[number].map(|lanes| lanes[lane]);
            if weight != 0.0 || dual != 0.0 {
                let bond = Bond {
                    weight,
                    dual,
                    ..*bond
                };
                receive(number, &bond, other);
            }
        }
    }

    /// The weights of a bond of a remote point, by its number in the stencil.
    pub(super) fn weights_of_remote(&self, point: u32, number: usize) -> [f64; 2] {
        let Bond { weight, dual, .. } = self.stencil.bonds[number].bond;
        match self.remote.find(point) {
            Some((block, lane)) => self.remote.weights(block)[number].map(|lanes| lanes[lane]),
            None => [weight, dual],
        }
    }
}

/// A bond of a row.
pub(super) struct RowBond {
    /// Number of its step between cells of the lattice.
    pub(super) step: u16,
    /// Slot of the other point.
    pub(super) column: u32,
    /// Weights at both ends: `weight` and `dual` of a [`Bond`].
    pub(super) weights: [f64; 2],
}

impl Rows {
    /// Weights of a bond by its place among all bonds.
    fn weights(&self, at: usize) -> [f64; 2] {
        let weight = self.weight[at];
        [weight, self.dual.get(at).copied().unwrap_or(weight)]
    }

    pub(super) fn new() -> Rows {
        Rows {
            start: vec![0],
            ..Rows::default()
        }
    }

    pub(super) fn push(&mut self, point: usize, slot: u32, bonds: impl Iterator<Item = RowBond>) {
        self.point.push(point as u32);
        self.slot.push(slot);
        for bond in bonds {
            let [weight, dual] = bond.weights;
            self.step.push(bond.step);
            self.column.push(bond.column);
            self.weight.push(weight);
            self.dual.push(dual);
        }
        self.start.push(self.column.len());
    }

    /// Adds the rows of others, behind its own.
    pub(super) fn append(&mut self, other: Rows) {
        let before = self.column.len();
        self.point.extend(other.point);
        self.slot.extend(other.slot);
        let ends = other.start.into_iter().skip(1);
        self.start.extend(ends.map(|end| before + end));
        self.column.extend(other.column);
        self.step.extend(other.step);
        self.weight.extend(other.weight);
        self.dual.extend(other.dual);
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.column)
            + size_of_val(&*self.step)
            + size_of_val(&*self.weight)
            + size_of_val(&*self.dual)
            + self.point.len() * 16
    }
}

impl SlotPlaces {
    /// All bonds of a row: number in the row, bond, slot of the other end.
    pub(super) fn for_each_bond(&self, rows: &Rows, row: usize, receive: BondReceiver<'_>) {
        let slot = rows.slot[row] as usize;
        for (number, at) in (rows.start[row]..rows.start[row + 1]).enumerate() {
            let other = rows.column[at] as usize;
            receive(number, &self.bond(slot, other, rows.weights(at)), other);
        }
    }

    /// The bond between two slots with these weights.
    fn bond(&self, slot: usize, other: usize, weights: [f64; 2]) -> Bond {
        let apart = |axis: usize| self.at[axis][other] - self.at[axis][slot];
        // positions of a plane body may differ along z by rounding, which sweeps leave out, too
        let xi = [apart(0), apart(1), if self.flat { 0.0 } else { apart(2) }];
        let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
        Bond::new(xi, length, weights)
    }
}
