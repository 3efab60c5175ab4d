//! A field by slot: what kernels read.
//!
//! Points have slots of their own, and so have ghosts. A [`SlotField`] takes the values of points
//! ([`SlotField::load`]); those of ghosts follow from them by a [`GhostRule`].

use std::ops::{Deref, DerefMut};
use std::slice;

use rayon::prelude::*;

use super::{Family, GhostRule, PointSlots, SLOTS};
use crate::parallel::ParallelLoop;

/// Values of a field by point: a slice, or a function of the point that costs little.
pub trait PointValues: Sync {
    /// The value of a point.
    fn at(&self, point: usize) -> f64;

    /// Copies the values of consecutive points from `first` on.
    fn copy(&self, first: usize, values: &mut [f64]) {
        let points = values.iter_mut().zip(first..);
        points.for_each(|(value, point)| *value = self.at(point));
    }
}

impl PointValues for &[f64] {
    fn at(&self, point: usize) -> f64 {
        self[point]
    }

    fn copy(&self, first: usize, values: &mut [f64]) {
        values.copy_from_slice(&self[first..][..values.len()]);
    }
}

impl<F: Fn(usize) -> f64 + Sync> PointValues for F {
    fn at(&self, point: usize) -> f64 {
        self(point)
    }
}

/// A scalar field, or a component of a field, by slot of a [`Family`]; empty until it is loaded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SlotField(Vec<f64>);

impl SlotField {
    /// Zero everywhere.
    pub fn zeros(family: &Family) -> SlotField {
        SlotField(vec![0.0; family.slots.len])
    }

    /// Takes the values of points, and fills the ghosts by their rule.
    pub fn load(&mut self, family: &Family, values: impl PointValues, ghosts: impl GhostRule) {
        self.take(family, &values);
        self.fill_ghosts(family, ghosts);
    }

    /// Takes the values of points for several fields, and fills their ghosts by a common rule; `values(n)` are those of
    /// the field `n`.
    pub fn load_all<V: PointValues>(
        fields: &mut [SlotField],
        family: &Family,
        values: impl Fn(usize) -> V + Sync,
        ghosts: impl GhostRule,
    ) {
        let each = fields.par_iter_mut().enumerate();
        each.for_all(|(n, field)| field.take(family, &values(n)));
        family.fill_ghosts(fields, ghosts);
    }

    /// Sets the values of all slots, ghosts included.
    pub fn set(&mut self, values: impl IndexedParallelIterator<Item = f64>) {
        let values = values.with_min_len(SLOTS / 4);
        values.fill(&mut self.0);
    }

    /// Fills the ghosts of a field whose points have their values.
    pub fn fill_ghosts(&mut self, family: &Family, ghosts: impl GhostRule) {
        family.fill_ghosts(slice::from_mut(self), ghosts);
    }

    /// Copies the values of points to their slots.
    fn take(&mut self, family: &Family, values: &impl PointValues) {
        self.0.resize(family.slots.len, 0.0);
        for (slot, point) in &family.slots.remote {
            self.0[*slot as usize] = values.at(*point as usize);
        }
        let spans = match &family.slots.points {
            PointSlots::Ascending(spans) => spans,
            PointSlots::Sorted { point_in, .. } => {
                let slots = self.0.par_iter_mut().zip(point_in);
                return slots
                    .with_min_len(SLOTS)
                    .for_all(|(value, &point)| *value = values.at(point as usize));
            }
        };
        let parts = self.0.par_chunks_mut(SLOTS).enumerate();
        parts.for_all(|(number, part)| {
            let (start, end) = (number * SLOTS, number * SLOTS + part.len());
            let from = spans.partition_point(|s| (s.slot + s.len) as usize <= start);
            let spans = spans[from..].iter();
            for span in spans.take_while(|s| (s.slot as usize) < end) {
                let (slot, point) = (span.slot as usize, span.point as usize);
                let here = slot.max(start)..(slot + span.len as usize).min(end);
                let first = point + here.start - slot;
                values.copy(first, &mut part[here.start - start..here.end - start]);
            }
        });
    }
}

impl Deref for SlotField {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl DerefMut for SlotField {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }
}
