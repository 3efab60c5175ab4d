//! Bodies that grow: points without material become active when it is deposited.
//!
//! A coupler that deposits material declares so at set-up and names the points that have no material at first
//! ([`Setup::deposit`](crate::Setup::deposit)); one that cuts material off declares that ([`Setup::cut_off`](crate::Setup::cut_off)). They write the field
//! [`keys::ACTIVE`], which says for each point whether there is material: 1, or 0. The field is part of the configuration
//! of the body and of every checkpoint. Everybody else asks [`World::activity`].
//!
//! A point without material has no bonds, no mass and no heat, and no surface. Plugins that act on a body that grows must
//! know that: they declare it ([`Setup::follow_activity`](crate::Setup::follow_activity), [`Setup::growing_family`](crate::Setup::growing_family)), and those that do not are refused.

use std::cell::{Ref, RefCell};
use std::sync::Arc;

use super::{BodyIndex, World};
use crate::family::{Family, FamilySpec};
use crate::field::{FieldIndex, keys};

/// A family of a body that grows, owned by the [`World`].
#[derive(Clone, Copy, Debug)]
pub struct GrowingFamily(pub(crate) usize);

/// A family whose points become active.
#[derive(Debug)]
pub(crate) struct Grower {
    pub(crate) body: BodyIndex,
    pub(crate) spec: FamilySpec,
    state: RefCell<GrowerState>,
}

#[derive(Debug)]
struct GrowerState {
    family: Arc<Family>,
    /// Changes of the activity that the family includes.
    seen: u64,
}

impl Grower {
    /// A family that includes `seen` changes of the activity.
    pub(crate) fn new(body: BodyIndex, spec: &FamilySpec, family: Family, seen: u64) -> Self {
        let family = Arc::new(family);
        Grower {
            body,
            spec: spec.clone(),
            state: RefCell::new(GrowerState { family, seen }),
        }
    }

    pub(crate) fn family(&self) -> (BodyIndex, Arc<Family>) {
        (self.body, self.state.borrow().family.clone())
    }
}

/// Whether there is material, from a value of [`keys::ACTIVE`].
pub fn is_active(value: f64) -> bool {
    value > 0.5
}

pub(crate) fn mask(values: &[f64]) -> Vec<bool> {
    values.iter().map(|v| is_active(*v)).collect()
}

impl World {
    pub(crate) fn activity_field(&self, body: BodyIndex) -> Option<FieldIndex> {
        let field = self.fields.find(body, &keys::ACTIVE.name)?;
        self.growing[body].then_some(field)
    }

    /// By point, whether there is material ([`is_active`]); `None` for a body that does not grow.
    pub fn activity(&self, body: BodyIndex) -> Option<Ref<'_, [f64]>> {
        let field = self.activity_field(body)?;
        Some(self.fields.field(field).read())
    }

    /// Whether material is deposited on a body during the run.
    pub fn is_growing(&self, body: BodyIndex) -> bool {
        self.growing[body]
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

    /// A family of a body that grows, of the points that are active now. Do not keep it beyond a step: while somebody
    /// holds it, it cannot be updated in place and is built again instead.
    pub fn growing_family(&self, handle: GrowingFamily) -> Arc<Family> {
        let grower = &self.configurations.growers[handle.0];
        let state = &mut *grower.state.borrow_mut();
        let version = self.activity_version(grower.body);
        if let Some(version) = version.filter(|v| *v != state.seen) {
            let active = self.activity(grower.body).map(|a| mask(&a));
            let active = active.unwrap_or_default();
            match Arc::get_mut(&mut state.family) {
                Some(family) => family.set_active(&active),
                None => {
                    // of a version from which nobody takes the difference
                    let next = state.family.version() + 1;
                    let body = &self.bodies[grower.body];
                    let family = Family::growing(body, &grower.spec, &active, next);
                    state.family = Arc::new(family.expect("the same family was built at set-up"));
                }
            }
            state.seen = version;
        }
        state.family.clone()
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
