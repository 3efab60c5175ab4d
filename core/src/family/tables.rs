//! The bonds of a lattice as plain arrays, for devices.

use super::blocks::BLOCK;
use super::{Family, Store};

/// The bonds of a family on a lattice: those of a stencil, whose weights differ at some points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LatticeTables {
    /// From the slot of a point to those of its neighbours.
    pub offsets: Vec<i64>,
    /// The bonds of a complete family: vector (m), length (m), one over the length (1/m), weight, dual (1/m).
    pub bonds: Vec<[f64; 7]>,
    /// Slot of each point.
    pub slots: Vec<u32>,
    /// Where the first weight of a point stands in `weights`; -1 for those of the stencil.
    pub first_weight: Vec<i64>,
    /// Weights: that of the first bond of a point at its place, the dual [`LatticeTables::DUAL`] behind it, those of each
    /// following bond [`LatticeTables::NEXT`] behind. A bond that a point lacks has zeros.
    pub weights: Vec<f64>,
}

impl LatticeTables {
    /// From a weight to the dual of the same bond.
    pub const DUAL: usize = BLOCK;
    /// From a weight to that of the next bond.
    pub const NEXT: usize = 2 * BLOCK;
}

impl Family {
    /// The bonds as plain arrays; `None` for clouds, lists of bonds, and points that move or become present.
    pub fn lattice_tables(&self) -> Option<LatticeTables> {
        let Store::Lattice(bonds, _) = &self.store else {
            return None;
        };
        let stencil = &bonds.stencil.bonds;
        let mut tables = LatticeTables {
            offsets: stencil.iter().map(|bond| bond.offset as i64).collect(),
            bonds: (stencil.iter().map(|bond| bond.bond))
                .map(|bond| {
                    let [x, y, z] = bond.xi;
                    let [length, inverse] = [bond.length, bond.inverse_length];
                    [x, y, z, length, inverse, bond.weight, bond.dual]
                })
                .collect(),
            slots: (0..self.points)
                .map(|point| self.slot_of(point) as u32)
                .collect(),
            first_weight: vec![-1; self.points],
            weights: bonds.blocks.all_weights().to_vec(),
        };
        for head in &bonds.blocks.head {
            let pattern = head.pattern as usize * stencil.len() * LatticeTables::NEXT;
            for (lane, point) in head.points().enumerate() {
                tables.first_weight[point] = (pattern + lane) as i64;
            }
        }
        Some(tables)
    }
}
