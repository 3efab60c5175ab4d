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
mod operator;
mod slot_field;
mod spec;

pub use broken::BrokenBonds;
pub use foreign::{ForeignBonds, ForeignGhost, Places};
pub use ghost_rule::{ByImage, ByRules, Curved, GhostRule, Mirrored, Rising, WithTractions};
pub use influence::Influence;
pub use kernel::{AxisPlane, Bond, BondKernel, InstructionSet, limit_instructions};
pub use layer::{Continuation, Image, LayerRule, Layout, Traction};
pub use operator::Operator;
pub use slot_field::{PointValues, SlotField};
pub use spec::{Correction, FamilyError, FamilySpec, PartialVolume};

pub(crate) use gaps::warnings;
pub(crate) use moving::{needs_rebuild, skin};

use std::ops::Range;
use std::sync::OnceLock;

use rayon::prelude::*;

use crate::body::Face;
use blocks::Blocks;
use kernel::Pairs;
use layer::SlotGrid;
use spec::TIE;

/// Slots that a thread fills at a time.
const SLOTS: usize = 1 << 14;

/// All bonds of the points of a body; no points by default.
#[derive(Debug, Default)]
pub struct Family {
    spec: FamilySpec,
    points: usize,
    bonds: usize,
    slots: usize,
    spans: Vec<Span>,
    ghosts: Vec<Ghost>,
    layers: Vec<(Face, Range<usize>)>,
    /// Layer points that faces of several axes mirrored.
    corners: Vec<Ghost>,
    /// Axes along which layers are copies.
    periodic: [bool; 3],
    /// Reference position of each slot along each axis, m; empty on lattices.
    places: [Vec<f64>; 3],
    /// Whether all points lie in a plane of constant z.
    flat: bool,
    /// Cells of the slots; on lattices only.
    grid: Option<SlotGrid>,
    stencil: Vec<StencilBond>,
    runs: Vec<Span>,
    blocks: Blocks,
    rows: Rows,
    layer_rows: Rows,
    chunks: Vec<Chunk>,
    /// Order of slots in space, for moving families; empty otherwise (see `spans`).
    order: Order,
    /// For moving families only.
    following: Option<Box<moving::Following>>,
    /// For growing families only.
    growth: Option<Box<growing::GrowingBonds>>,
    /// Points without material, in growing families.
    unborn: Vec<Span>,
    /// Built by the first kernel with paired sums.
    pairs: OnceLock<Option<Pairs>>,
}

/// Consecutive points in consecutive slots.
#[derive(Clone, Copy, Debug)]
struct Span {
    slot: u32,
    point: u32,
    len: u32,
}

impl Span {
    #[inline(always)]
    fn points(&self) -> Range<usize> {
        self.point as usize..(self.point + self.len) as usize
    }
}

/// Points by slot and slots by point.
#[derive(Debug, Default)]
struct Order {
    point_in: Vec<u32>,
    slot_of: Vec<u32>,
}

impl Order {
    fn new(point_in: Vec<u32>) -> Self {
        let mut slot_of = vec![0; point_in.len()];
        for (slot, &point) in (0..).zip(&point_in) {
            slot_of[point as usize] = slot;
        }
        Order { point_in, slot_of }
    }

    /// Copies values by point to their slots.
    fn arrange<T: Copy + Send + Sync>(&self, by_point: &[T], by_slot: &mut [T]) {
        let slots = by_slot.par_iter_mut().zip(&self.point_in);
        let slots = slots.with_min_len(SLOTS);
        slots.for_each(|(value, &point)| *value = by_point[point as usize]);
    }
}

/// A layer point: its slot, the slot that it mirrors, the layer point in that slot if it holds one,
/// the point that it finally mirrors, and how often each face mirrored that point on the way.
#[derive(Clone, Copy, Debug)]
struct Ghost {
    slot: u32,
    source: u32,
    parent: Option<u32>,
    point: u32,
    passes: [u8; 6],
}

impl Ghost {
    /// Whether faces of several axes mirrored the point, each once.
    fn is_corner(&self) -> bool {
        let along = self.passes.as_chunks::<2>().0.iter();
        let along = along.map(|[lower, upper]| lower + upper);
        along.clone().filter(|n| *n > 0).count() > 1 && along.max() == Some(1)
    }
}

#[derive(Clone, Copy, Debug)]
struct StencilBond {
    offset: isize,
    bond: Bond,
}

/// Compressed rows of bonds.
#[derive(Debug, Default)]
struct Rows {
    point: Vec<u32>,
    slot: Vec<u32>,
    start: Vec<usize>,
    column: Vec<u32>,
    /// Number in the stencil; on a lattice only.
    step: Vec<u16>,
    weight: Vec<f64>,
    /// Empty where equal to `weight`, as in moving families.
    dual: Vec<f64>,
}

/// A part of the work, sized to keep all cores busy.
#[derive(Clone, Debug)]
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
        self.slots
    }

    /// Fraction of the points that are swept with the shared stencil.
    pub fn stencil_share(&self) -> f64 {
        self.runs.iter().map(|r| f64::from(r.len)).sum::<f64>() / self.points as f64
    }

    fn is_cloud(&self) -> bool {
        !self.places[0].is_empty()
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        self.rows.memory()
            + self.blocks.memory()
            + self.layer_rows.memory()
            + size_of_val(&*self.ghosts)
            + size_of_val(&*self.spans)
            + size_of_val(&*self.order.point_in)
            + size_of_val(&*self.order.slot_of)
            + self.places.iter().map(|x| size_of_val(&**x)).sum::<usize>()
            + self.growth.as_ref().map_or(0, |g| g.memory())
            + self
                .pairs
                .get()
                .and_then(Option::as_ref)
                .map_or(0, Pairs::memory)
    }
}

impl Rows {
    fn memory(&self) -> usize {
        size_of_val(&*self.column)
            + size_of_val(&*self.step)
            + size_of_val(&*self.weight)
            + size_of_val(&*self.dual)
            + self.point.len() * 16
    }
}
