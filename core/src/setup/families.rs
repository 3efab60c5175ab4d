//! Families of bodies, and who breaks their bonds.

use super::{FamilyRequest, Setup};
use crate::error::SetupError;
use crate::family::{self, Family, FamilyError, FamilySpec};
use crate::world::families::{FamilyHandle, FamilySize, WorldFamily};
use crate::world::{BodyIndex, BondBreaker, Breaker};

impl Setup<'_> {
    /// A family of a body, which follows what happens to its points; equal requests share one.
    /// [`World::family`](crate::World::family) gives it as it is at the time.
    ///
    /// # Errors
    /// When the horizon reaches no neighbour, or the family is one that points which move or get material do not support.
    pub fn family(
        &mut self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<FamilyHandle, SetupError> {
        self.check_support(body)?;
        self.warn_of_gaps(body, spec);
        let family = self.world.add_family(body, self.current, spec);
        family.map_err(|e| self.family_error(body, e))
    }

    /// Takes a family of a body whose points stay, which the calling plugin made for itself.
    ///
    /// # Errors
    /// When something happens to the points that the plugin does not support.
    pub fn take_family(
        &mut self,
        body: BodyIndex,
        family: Family,
    ) -> Result<FamilyHandle, SetupError> {
        self.check_support(body)?;
        Ok(self.world.take_family(body, self.current, family))
    }

    /// A family for the calling plugin alone, of the points that have material at set-up. The plugin takes up changes of
    /// the activity itself ([`Family::set_active`]), when it has compared the state before and after.
    ///
    /// # Errors
    /// See [`Setup::family`].
    pub fn own_family(&mut self, body: BodyIndex, spec: &FamilySpec) -> Result<Family, SetupError> {
        self.check_support(body)?;
        self.warn_of_gaps(body, spec);
        let family = self.world.build_growing(body, spec);
        let family = family.map_err(|e| self.family_error(body, e))?;
        self.count_family(FamilySize::of(body, &family));
        let remote = family.remote().iter();
        self.read_points(body, remote.map(|(_, point)| *point as usize));
        Ok(family)
    }

    /// Counts the bonds of a body that the calling plugin made and keeps for itself, for [`Simulation::family_sizes`](crate::simulation::Simulation::family_sizes).
    pub fn count_family(&mut self, size: FamilySize) {
        self.kept_families.push(size);
    }

    /// Warns of gaps and jumps of spacing that the family of a growing body bridges; those of other families are searched
    /// when somebody asks for the warnings of the simulation.
    fn warn_of_gaps(&mut self, body: BodyIndex, spec: &FamilySpec) {
        if self.world.is_growing(body) {
            for sentence in family::warnings(self.body(body), spec) {
                self.warn(sentence);
            }
        }
    }

    fn family_error(&self, body: BodyIndex, error: FamilyError) -> SetupError {
        let key = match self.world.is_growing(body) {
            true => "body",
            false => "horizon",
        };
        SetupError::new(key, error)
    }

    /// The families of points that stay; those of layers do not follow from their request.
    pub(super) fn requests(&self) -> Vec<FamilyRequest> {
        let families = self.world.families.iter();
        let families = families.filter(|f| self.body(f.body).layers().is_none());
        let at_rest = families
            .filter(|f| !(self.world.is_growing(f.body) || self.world.moves_freely(f.body)));
        let request = |family: &WorldFamily| FamilyRequest {
            plugin: self.label(family.plugin).to_string(),
            body: family.body,
            spec: family.spec.clone(),
        };
        at_rest.map(request).collect()
    }

    /// Declares that the calling plugin breaks bonds of a body: it adds them to the list that others see with the handle
    /// ([`World::break_pairs`](crate::World::break_pairs)). A plugin that `shares` the list with others only adds to it and
    /// keeps count of what it added; one that does not replaces the list when a state is restored.
    ///
    /// # Errors
    /// When another plugin breaks bonds of the body, unless both share the list.
    pub fn break_bonds(
        &mut self,
        body: BodyIndex,
        shares: bool,
    ) -> Result<BondBreaker, SetupError> {
        let breaker = Breaker {
            plugin: self.current,
            is_shared: shares,
        };
        self.world.set_breaker(body, breaker).map_err(|other| {
            let (other, name) = (self.label(other), &self.body(body).name);
            let message = format!("`{other}` already breaks bonds of body `{name}`");
            let expected =
                "cracks at given places (`growing_crack`) or `fracture` of one physics, not both";
            SetupError::value("body", message, expected)
        })
    }
}
