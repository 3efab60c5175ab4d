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

use serde::{Deserialize, Serialize};

use super::changes::Change;
use super::{BodyIndex, World};
use crate::field::{FieldIndex, keys};

/// Whether there is material, from a value of [`keys::ACTIVE`].
pub fn is_active(value: f64) -> bool {
    value > 0.5
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

    /// Whether each point has material; `None` for a body that does not grow.
    pub fn present_points(&self, body: BodyIndex) -> Option<Vec<bool>> {
        let activity = self.activity(body)?;
        Some(activity.iter().map(|v| is_active(*v)).collect())
    }

    /// Whether a point has material.
    pub fn has_material(&self, body: BodyIndex, point: usize) -> bool {
        self.activity(body).is_none_or(|a| is_active(a[point]))
    }
}

/// The births and cuts of a body that somebody has taken up. Part of the state of those who account for them, as repeated
/// passes of a step must not count a birth twice.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ActivityChanges {
    active: Vec<bool>,
    #[serde(skip)]
    seen: Option<u64>,
}

impl ActivityChanges {
    /// Nothing taken up: so many points without material.
    pub fn none(points: usize) -> ActivityChanges {
        ActivityChanges {
            active: vec![false; points],
            seen: None,
        }
    }

    /// The points that have material now are taken up; no points for a body that does not grow.
    pub fn until_now(world: &World, body: BodyIndex) -> ActivityChanges {
        ActivityChanges {
            active: world.present_points(body).unwrap_or_default(),
            seen: None,
        }
    }

    /// Points that became active or inactive since the last call, ascending; all where no point is known. `None` where
    /// nothing changed, as for a body that does not grow. Collective: in several processes those of this one, if any changed in one of them.
    pub fn since_last(&mut self, world: &World, body: BodyIndex) -> Option<Vec<u32>> {
        let version = world.fields.field(world.activity_field(body)?).changes();
        if self.seen.replace(version) == Some(version) {
            return None;
        }
        let now = world.present_points(body)?;
        let differs = |(point, now): &(u32, &bool)| self.active.get(*point as usize) != Some(now);
        let changed = (0..).zip(&now).filter(differs);
        let changed: Vec<u32> = changed.map(|(point, _)| point).collect();
        self.active = now;
        (world.processes.any(!changed.is_empty())).then_some(changed)
    }

    /// What [`ActivityChanges::of_part`] reads, for checkpoints. Collective.
    #[must_use]
    pub fn of_whole(&self, world: &World, body: BodyIndex) -> ActivityChanges {
        ActivityChanges {
            active: world.whole_of(body, &self.active).into_owned(),
            seen: None,
        }
    }

    /// The changes that this process had taken up in its points, from those of the whole body. Collective.
    ///
    /// # Errors
    /// When they are those of another number of points.
    pub fn of_part(self, world: &World, body: BodyIndex) -> Result<Self, erased_serde::Error> {
        Ok(ActivityChanges {
            active: world.part_of(body, self.active)?,
            seen: None,
        })
    }

    /// Whether each point was active at the last call.
    pub fn active(&self) -> &[bool] {
        &self.active
    }

    /// Whether a point was active at the last call.
    pub fn is_active(&self, point: usize) -> bool {
        self.active.get(point).is_none_or(|a| *a)
    }
}
