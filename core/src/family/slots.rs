//! Slots: where the values of points and ghosts stand in the arrays that kernels read.

use std::ops::Range;

use rayon::prelude::*;

use crate::body::Face;
use crate::parallel::ParallelLoop;

use super::images::Layers;

/// Slots that a thread fills at a time.
pub(super) const SLOTS: usize = 1 << 14;

/// The slots of a family: those of its points, and those of ghosts in the order in which they are filled.
#[derive(Debug, Default)]
pub(super) struct Slots {
    /// Length of an array by slot.
    pub(super) len: usize,
    pub(super) points: PointSlots,
    /// Slots and numbers of points of other parts of the body.
    pub(super) remote: Vec<(u32, u32)>,
    /// Images of points.
    pub(super) ghosts: Vec<Ghost>,
    /// Faces and their ghosts, in the order in which they are filled.
    pub(super) layers: Vec<(Face, Range<usize>)>,
    /// Layer points that faces of several axes mirrored; their source is the slot of the point.
    pub(super) corners: Vec<Ghost>,
    /// Axes along which layers are copies.
    pub(super) periodic: [bool; 3],
}

/// Which slots belong to points.
#[derive(Debug)]
pub(super) enum PointSlots {
    /// Slots ascend with points.
    Ascending(Vec<Span>),
    /// The first slots, in an order that changes.
    Sorted {
        point_in: Vec<u32>,
        slot_of: Vec<u32>,
    },
}

/// Consecutive points in consecutive slots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) slot: u32,
    pub(super) point: u32,
    pub(super) len: u32,
}

/// A layer point: its slot, the slot that it mirrors, the layer point in that slot if it holds one,
/// the point that it finally mirrors, and how often each face mirrored that point on the way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ghost {
    pub(super) slot: u32,
    pub(super) source: u32,
    pub(super) parent: Option<u32>,
    pub(super) point: u32,
    pub(super) passes: [u8; 6],
}

impl Span {
    #[inline(always)]
    pub(super) fn points(&self) -> Range<usize> {
        self.point as usize..(self.point + self.len) as usize
    }
}

impl Ghost {
    /// Whether faces of several axes mirrored the point, each once.
    pub(super) fn is_corner(&self) -> bool {
        let along = self.passes.as_chunks::<2>().0.iter();
        let along = along.map(|[lower, upper]| lower + upper);
        along.clone().filter(|n| *n > 0).count() > 1 && along.max() == Some(1)
    }
}

impl Default for PointSlots {
    fn default() -> Self {
        PointSlots::Ascending(Vec::new())
    }
}

impl PointSlots {
    /// The first slots, by the point in each of them.
    pub(super) fn sorted(point_in: Vec<u32>) -> Self {
        let mut slot_of = vec![0; point_in.len()];
        for (slot, &point) in (0..).zip(&point_in) {
            slot_of[point as usize] = slot;
        }
        PointSlots::Sorted { point_in, slot_of }
    }

    /// The slot of a point.
    pub(super) fn of(&self, point: usize) -> usize {
        match self {
            PointSlots::Sorted { slot_of, .. } => slot_of[point] as usize,
            PointSlots::Ascending(spans) => {
                let after = spans.partition_point(|s| s.point as usize <= point);
                let span = spans[after - 1];
                span.slot as usize + point - span.point as usize
            }
        }
    }

    /// The point in a slot.
    pub(super) fn point_in(&self, slot: usize) -> Option<usize> {
        match self {
            PointSlots::Sorted { point_in, .. } => point_in.get(slot).map(|&p| p as usize),
            PointSlots::Ascending(spans) => {
                let after = spans.partition_point(|s| s.slot as usize <= slot);
                let span = spans.get(after.checked_sub(1)?)?;
                let along = slot - span.slot as usize;
                (along < span.len as usize).then_some(span.point as usize + along)
            }
        }
    }

    /// Copies values by point to their slots, where these are the first ones.
    pub(super) fn arrange<T: Copy + Send + Sync>(&self, by_point: &[T], by_slot: &mut [T]) {
        if let PointSlots::Sorted { point_in, .. } = self {
            let slots = by_slot.par_iter_mut().zip(point_in);
            let slots = slots.with_min_len(SLOTS);
            slots.for_all(|(value, &point)| *value = by_point[point as usize]);
        }
    }

    /// Consecutive points in consecutive slots, ascending; none where the order changes.
    pub(super) fn spans(&self) -> &[Span] {
        match self {
            PointSlots::Ascending(spans) => spans,
            PointSlots::Sorted { .. } => &[],
        }
    }

    fn memory(&self) -> usize {
        match self {
            PointSlots::Ascending(spans) => size_of_val(&**spans),
            PointSlots::Sorted { point_in, slot_of } => {
                size_of_val(&**point_in) + size_of_val(&**slot_of)
            }
        }
    }
}

impl Slots {
    /// The layers in the order in which they are filled: ghosts may mirror ghosts of earlier layers.
    pub(super) fn layers(&self) -> impl DoubleEndedIterator<Item = (Face, &[Ghost])> {
        let layers = self.layers.iter();
        layers.map(|(face, range)| (*face, &self.ghosts[range.clone()]))
    }

    /// Lays out the ghosts.
    pub(super) fn set_ghosts(&mut self, layers: Layers) {
        let Layers { ghosts, faces } = layers;
        let from_point = |ghost: &Ghost| {
            let mut first = ghost;
            while let Some(parent) = first.parent {
                first = &ghosts[parent as usize];
            }
            let source = first.source;
            Ghost { source, ..*ghost }
        };
        let corners = ghosts.iter().filter(|g| g.is_corner());
        self.corners = corners.map(from_point).collect();
        (self.ghosts, self.layers) = (ghosts, faces);
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.ghosts) + self.points.memory()
    }
}
