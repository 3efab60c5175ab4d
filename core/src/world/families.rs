//! The families of bodies, whether their points rest, move or get material during the run.

use std::cell::RefCell;
use std::sync::Arc;

use nalgebra::Vector3;

use super::activity::ActivityChanges;
use super::configuration::Configuration;
use super::{BodyIndex, World};
use crate::body::{Body, Horizon};
use crate::family::{Family, FamilyError, FamilySpec, Share, skin};
use crate::neighbours::FoundAt;

/// A family of a body, owned by the [`World`]: [`World::family`] gives it as it is at the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FamilyHandle(pub(crate) usize);

/// Size of a family.
#[derive(Clone, Debug)]
pub struct FamilySize {
    /// The body.
    pub body: BodyIndex,
    /// The horizon.
    pub horizon: Horizon,
    /// Directed bonds.
    pub bonds: usize,
    /// Bytes held.
    pub memory: usize,
}

impl FamilySize {
    /// That of a family of the points of a body.
    pub fn of(body: BodyIndex, family: &Family) -> FamilySize {
        FamilySize {
            body,
            horizon: family.spec().horizon,
            bonds: family.bonds(),
            memory: family.memory(),
        }
    }
}

/// A family with its request.
#[derive(Debug)]
pub(crate) struct WorldFamily {
    pub(crate) body: BodyIndex,
    /// The plugin that asked first, by its position in the set-up.
    pub(crate) plugin: usize,
    pub(crate) spec: FamilySpec,
    store: Store,
}

/// What changes a family during the run.
#[derive(Debug)]
enum Store {
    /// Nothing: points rest and keep their material.
    AtRest(Arc<Family>),
    /// A physics moves the points.
    Moving {
        /// Distance over which points may move before rows are found again, m.
        skin: f64,
        state: RefCell<MovingState>,
    },
    /// Points get or lose their material.
    Growing(RefCell<GrowingState>),
}

#[derive(Debug)]
struct MovingState {
    family: Arc<Family>,
    /// Where the rows are to be found.
    found_at: FoundAt,
    /// Whether the family has other rows.
    has_old_rows: bool,
    /// Version of the configuration for which the family was last placed.
    placed_for: u64,
}

#[derive(Debug)]
struct GrowingState {
    family: Arc<Family>,
    /// Births and cuts that the family includes.
    taken: ActivityChanges,
}

impl MovingState {
    /// Brings the family up to date. Whoever still holds it keeps the family as it was.
    fn place(&mut self, body: &Body, spec: &FamilySpec, now: &Configuration) {
        if Arc::get_mut(&mut self.family).is_none() {
            let fresh = Family::moving(body, spec).expect("the same family was built at set-up");
            (self.family, self.has_old_rows) = (Arc::new(fresh), true);
        }
        let family = Arc::get_mut(&mut self.family).expect("nobody else has it");
        if self.has_old_rows {
            family.rebuild_rows(self.found_at.positions());
            self.has_old_rows = false;
        }
        family.update_weights(now.positions(), now.volumes());
        self.placed_for = now.version();
    }
}

impl World {
    /// Builds a family of a body as its points are at set-up; equal requests share one.
    pub(crate) fn add_family(
        &mut self,
        body: BodyIndex,
        plugin: usize,
        spec: &FamilySpec,
    ) -> Result<FamilyHandle, FamilyError> {
        let same = |f: &WorldFamily| f.body == body && f.spec == *spec;
        if let Some(present) = self.families.iter().position(same) {
            return Ok(FamilyHandle(present));
        }
        let this = &self.bodies[body];
        let store = if self.is_growing(body) {
            Store::Growing(RefCell::new(GrowingState {
                family: Arc::new(self.build_growing(body, spec)?),
                taken: ActivityChanges::until_now(self, body),
            }))
        } else if self.moves_freely(body) {
            Store::Moving {
                skin: skin(this.finest_spacing()),
                state: RefCell::new(MovingState {
                    family: Arc::new(Family::moving(this, spec)?),
                    found_at: FoundAt::new(&this.points.position),
                    has_old_rows: false,
                    placed_for: 0,
                }),
            }
        } else {
            let family = Family::of_share(self.share(body), spec)?;
            Store::AtRest(Arc::new(family))
        };
        self.families.push(WorldFamily {
            body,
            plugin,
            spec: spec.clone(),
            store,
        });
        Ok(FamilyHandle(self.families.len() - 1))
    }

    /// Takes a family of a body whose points stay.
    pub(crate) fn take_family(
        &mut self,
        body: BodyIndex,
        plugin: usize,
        family: Family,
    ) -> FamilyHandle {
        self.families.push(WorldFamily {
            body,
            plugin,
            spec: family.spec().clone(),
            store: Store::AtRest(Arc::new(family)),
        });
        FamilyHandle(self.families.len() - 1)
    }

    /// A family of the points of a growing body that have material now.
    pub(crate) fn build_growing(
        &self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<Family, FamilyError> {
        let present = self.present_points(body);
        let present = present.unwrap_or_else(|| vec![true; self.bodies[body].points.len()]);
        Family::growing(self.share(body), spec, &present, 0)
    }

    /// The points of a body of which this process has the families.
    fn share(&self, body: BodyIndex) -> Share<'_> {
        let this = &self.bodies[body];
        match &self.divisions[body] {
            None => Share::whole(this),
            Some(division) => Share {
                body: this,
                owned: division.owned,
                numbers: Some(&division.numbers),
            },
        }
    }

    /// A family as it is now: of the current positions where a physics moves the points, of the points that have material
    /// where it is deposited or cut off. Do not keep it beyond a step: while somebody holds a family that changes, it
    /// cannot be updated in place and is built again instead.
    pub fn family(&self, handle: FamilyHandle) -> Arc<Family> {
        let WorldFamily {
            body, spec, store, ..
        } = &self.families[handle.0];
        match store {
            Store::AtRest(family) => family.clone(),
            Store::Moving { state, .. } => {
                let now = self.configuration(*body);
                let state = &mut *state.borrow_mut();
                if state.placed_for != now.version() {
                    state.place(&self.bodies[*body], spec, &now);
                }
                state.family.clone()
            }
            Store::Growing(state) => {
                let state = &mut *state.borrow_mut();
                if state.taken.since_last(self, *body).is_some() {
                    let present = state.taken.active();
                    match Arc::get_mut(&mut state.family) {
                        Some(family) => family.set_active(present),
                        None => {
                            // of a version from which nobody takes the difference
                            let next = state.family.version() + 1;
                            let family = Family::growing(self.share(*body), spec, present, next);
                            let family = family.expect("the same family was built at set-up");
                            state.family = Arc::new(family);
                        }
                    }
                }
                state.family.clone()
            }
        }
    }

    /// All families as they were last asked for.
    pub(crate) fn families(&self) -> impl Iterator<Item = (&WorldFamily, Arc<Family>)> {
        self.families.iter().map(|f| match &f.store {
            Store::AtRest(family) => (f, family.clone()),
            Store::Moving { state, .. } => (f, state.borrow().family.clone()),
            Store::Growing(state) => (f, state.borrow().family.clone()),
        })
    }

    /// Finds the rows of the families of a body again where its points have moved beyond the skin.
    pub(super) fn follow_points(&self, body: BodyIndex, positions: &[Vector3<f64>]) {
        for family in self.families.iter().filter(|f| f.body == body) {
            let Store::Moving { skin, state } = &family.store else {
                continue;
            };
            let state = &mut *state.borrow_mut();
            if state.found_at.is_outdated(positions, |_| *skin) {
                state.found_at.set(positions);
                state.has_old_rows = true;
            }
        }
    }

    fn moving_states(&self) -> impl Iterator<Item = &RefCell<MovingState>> {
        self.families.iter().filter_map(|f| match &f.store {
            Store::Moving { state, .. } => Some(state),
            _ => None,
        })
    }

    /// Positions (m) at which the rows of each moving family were found: part of a checkpoint, because the order of sums
    /// depends on them.
    pub(crate) fn rows_found_at(&self) -> Vec<Vec<Vector3<f64>>> {
        let states = self.moving_states();
        states
            .map(|s| s.borrow().found_at.positions().to_vec())
            .collect()
    }

    /// Restores what [`World::rows_found_at`] gave; whether it fits the families.
    pub(crate) fn find_rows_at(&self, found_at: Vec<Vec<Vector3<f64>>>) -> bool {
        if self.moving_states().count() != found_at.len() {
            return false;
        }
        for (state, found_at) in self.moving_states().zip(found_at) {
            let mut state = state.borrow_mut();
            if state.found_at.positions().len() != found_at.len() {
                return false;
            }
            state.found_at.set(&found_at);
            (state.has_old_rows, state.placed_for) = (true, 0);
        }
        true
    }
}
