//! Bodies that grow: points without material become active when it is deposited.
//!
//! A coupler that deposits material or cuts it off declares so at set-up and names the points that have no material at first
//! ([`Setup::change_material`](crate::Setup::change_material)). It writes the field [`keys::ACTIVE`], which says for each
//! point whether there is material: 1, or 0. The field is part of the configuration of the body and of every checkpoint.
//! Everybody else asks [`World::activity`].
//!
//! A point without material has no bonds, no mass and no heat, and no surface. Plugins that act on a body that grows must
//! know that: they declare it with their registration ([`Change::Births`], [`Change::Cuts`]), and those that do not are
//! refused.

use std::cell::Ref;

use super::changes::Change;
use super::{BodyIndex, World};
use crate::field::{FieldIndex, keys};

/// Whether there is material, from a value of [`keys::ACTIVE`].
pub fn is_active(value: f64) -> bool {
    value > 0.5
}

fn mask(values: &[f64]) -> Vec<bool> {
    values.iter().map(|v| is_active(*v)).collect()
}

impl World {
    pub(crate) fn activity_field(&self, body: BodyIndex) -> Option<FieldIndex> {
        let field = self.fields.find(body, &keys::ACTIVE.name)?;
        self.is_growing(body).then_some(field)
    }

    /// By point, whether there is material ([`is_active`]); `None` for a body that does not grow.
    pub fn activity(&self, body: BodyIndex) -> Option<Ref<'_, [f64]>> {
        let field = self.activity_field(body)?;
        Some(self.fields.field(field).read())
    }

    /// Whether material is deposited on a body or cut off during the run.
    pub fn is_growing(&self, body: BodyIndex) -> bool {
        let changes = self.changes[body];
        changes.contains(Change::Births) || changes.contains(Change::Cuts)
    }

    /// Whether each point of a body has material.
    pub(crate) fn present_points(&self, body: BodyIndex) -> Vec<bool> {
        match self.activity(body) {
            Some(activity) => mask(&activity),
            None => vec![true; self.bodies[body].points.len()],
        }
    }

    /// Whether a point has material.
    pub fn has_material(&self, body: BodyIndex, point: usize) -> bool {
        self.activity(body).is_none_or(|a| is_active(a[point]))
    }

    /// Counter that changes whenever points of a body may have become active.
    pub(crate) fn activity_version(&self, body: BodyIndex) -> Option<u64> {
        let field = self.activity_field(body)?;
        Some(self.fields.field(field).changes())
    }
}

/// Follows which points of a body are active.
#[derive(Debug, Default)]
pub struct ActivityChanges {
    seen: Option<u64>,
    active: Vec<bool>,
}

impl ActivityChanges {
    /// Points that became active or inactive since the last call, ascending; all at the first call. `None` where
    /// nothing changed, as for a body that does not grow.
    pub fn since_last(&mut self, world: &World, body: BodyIndex) -> Option<Vec<u32>> {
        let version = world.activity_version(body)?;
        if self.seen == Some(version) {
            return None;
        }
        let now = mask(&world.activity(body)?);
        let is_first = self.seen.replace(version).is_none();
        self.active.resize(now.len(), false);
        let pairs = self.active.iter().zip(&now).zip(0..);
        let changed = pairs.filter(|((before, now), _)| is_first || before != now);
        let changed: Vec<u32> = changed.map(|(_, point)| point).collect();
        self.active = now;
        (!changed.is_empty()).then_some(changed)
    }

    /// Whether a point was active at the last call.
    pub fn is_active(&self, point: usize) -> bool {
        self.active.get(point).is_none_or(|a| *a)
    }
}
