//! Families: all bonds of the points of a body, behind one interface.
//!
//! 1. A physics describes the family it needs ([`FamilySpec`]): horizon, partial-volume rule,
//!    correction, and the faces behind which the body continues as a mirrored layer.
//! 2. [`Family::build`] leaves out bonds across the body's [`Cut`](crate::Cut)s and lays out *slots*: one for each point and one for each layer point
//!    (*ghost*). Inputs of kernels are fields by slot ([`SlotField`]); a [`GhostRule`] says how the values of
//!    ghosts follow from those of points.
//! 3. [`Family::sum`] evaluates a [`BondKernel`] over all bonds of all points, and
//!    [`Family::sum_unbroken`] over those that are not among the [`BrokenBonds`].
//!
//! There are three stores. On a lattice, points whose family is complete share one stencil
//! and are swept in contiguous runs with SIMD; all others (at bare surfaces, next to them when bonds
//! are corrected) have weights of their own for that stencil, in blocks. With
//! [`Store::List`](crate::body::Store::List) every point has a row of its own. All add the bonds of a point
//! in the same order, so they agree to rounding. On a cloud every point has a row
//! over the union of its horizon and its dual horizon. Families of moving points ([`Family::moving`]) have
//! rows, too, which are rebuilt as points move; the [`World`](crate::World) owns them.

mod balance;
#[cfg(test)]
mod balance_tests;
mod blocks;
mod broken;
mod build;
mod calibration;
mod cloud;
#[cfg(test)]
mod cloud_tests;
mod foreign;
mod gaps;
mod ghost_rule;
mod growing;
mod images;
mod influence;
#[allow(unsafe_code)]
mod kernel;
mod lattice;
mod layer;
mod moving;
#[cfg(test)]
mod moving_tests;
mod of_bonds;
mod operator;
#[cfg(test)]
mod part_tests;
mod slot_field;
mod slots;
mod spec;
mod store;
mod tables;

pub use broken::BrokenBonds;
pub use foreign::{ForeignBond, ForeignBonds, ForeignGhost, Places};
pub use ghost_rule::{
    ByImage, ByRules, Curved, Direction, Folded, GhostRule, Mirrored, Rising, WithTractions,
};
pub use influence::Influence;
pub use kernel::{AxisPlane, Bond, BondKernel};
pub use layer::{Continuation, Image, LayerRule, Layout, Traction};
pub use of_bonds::PointBond;
pub use operator::Operator;
pub use slot_field::{PointValues, SlotField};
pub use spec::{Correction, FamilyError, FamilySpec, PartialVolume};
pub use tables::LatticeTables;

pub(crate) use build::Share;
pub(crate) use gaps::warnings;
pub(crate) use moving::skin;

use std::ops::Range;

use slots::{Ghost, PointSlots, SLOTS, Slots, Span};
use spec::TIE;
use store::{CloudRows, Rows, SlotPlaces, Stencil, StencilBond, StencilBonds, Store};

/// All bonds of the points of a body; no points by default.
#[derive(Debug, Default)]
pub struct Family {
    spec: FamilySpec,
    /// Number of points that it owns.
    points: usize,
    /// Number of points of the body, remote ones included.
    of_body: usize,
    bonds: usize,
    slots: Slots,
    store: Store,
    /// Bonds with points of audited layers.
    layer_rows: Rows,
    chunks: Vec<Chunk>,
}

/// A part of the work, sized to keep all cores busy.
#[derive(Debug, Default)]
struct Chunk {
    runs: Range<usize>,
    blocks: Range<usize>,
    rows: Range<usize>,
}

impl Family {
    /// The description from which the family was built.
    pub fn spec(&self) -> &FamilySpec {
        &self.spec
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of directed bonds.
    pub fn bonds(&self) -> usize {
        self.bonds
    }

    /// Number of bonds of a point.
    pub fn bonds_of(&self, point: usize) -> usize {
        let mut bonds = 0;
        self.for_each_bond(point, |_, _, _| bonds += 1);
        bonds
    }

    /// Length of a slot array.
    pub fn slots(&self) -> usize {
        self.slots.len
    }

    /// Slots of the points of other parts of the body that bonds reach, each with the number of its point in the part
    /// ([`Part::numbers`](crate::body::Part::numbers)). An exchange fills them before images are ([`Direction`]).
    pub fn remote(&self) -> &[(u32, u32)] {
        &self.slots.remote
    }

    /// Fraction of the points that are swept with the shared stencil.
    pub fn stencil_share(&self) -> f64 {
        let runs = self.store.stencil_bonds().map_or(&[][..], |b| &b.runs);
        runs.iter().map(|r| f64::from(r.len)).sum::<f64>() / self.points as f64
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        self.store.memory() + self.layer_rows.memory() + self.slots.memory()
    }
}
