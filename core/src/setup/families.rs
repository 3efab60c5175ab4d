//! Families of a body, and who decides where its points are.

use std::sync::Arc;

use crate::error::SetupError;
use crate::family::{Family, FamilySpec};
use crate::world::configuration::{Description, MovingFamily, PointMover};
use crate::world::{BodyIndex, BondBreaker, Breaker, World};

use super::{Access, Declaration, Setup};

/// A family of points that stay, and the plugin that asked for it first.
pub(super) struct ObtainedFamily {
    body: BodyIndex,
    plugin: usize,
    spec: FamilySpec,
    family: Arc<Family>,
}

impl Setup<'_> {
    /// A family of the reference positions of a body; equal requests share one.
    ///
    /// # Errors
    /// When the horizon reaches no neighbour, or a physics moves the points ([`Setup::moving_family`]).
    pub fn family(
        &mut self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<Arc<Family>, SetupError> {
        if let Some(mover) = self.world.configurations.mover(body) {
            let message = format!(
                "`{}` moves the points of body `{}`, which change neighbours",
                self.plugins[mover],
                self.body(body).name
            );
            let expected = "a physics whose families follow their points";
            return Err(SetupError::value("body", message, expected));
        }
        if self.is_growing(body) {
            return Err(self.refused_growth(body));
        }
        let same = |f: &&ObtainedFamily| f.body == body && f.spec == *spec;
        if let Some(present) = self.families.iter().find(same) {
            return Ok(present.family.clone());
        }
        let family =
            Family::build(self.body(body), spec).map_err(|e| SetupError::new("horizon", e))?;
        let family = Arc::new(family);
        self.families.push(ObtainedFamily {
            body,
            plugin: self.plugins.len() - 1,
            spec: spec.clone(),
            family: family.clone(),
        });
        Ok(family)
    }

    /// Declares that the calling physics moves the points of a body, which change neighbours. It sets the
    /// configuration with the handle ([`World::set_configuration`]).
    ///
    /// # Errors
    /// When another physics moves them, or a plugin prepared before takes them for matter at rest.
    pub fn move_points(&mut self, body: BodyIndex) -> Result<PointMover, SetupError> {
        self.check_points_are_free(body)?;
        let plugin = self.plugins.len() - 1;
        Ok(self.world.configurations.set_mover(body, plugin))
    }

    /// Refuses the calling plugin with `error`, should a physics that is prepared later move the points of a body, as an
    /// updated Lagrangian fluid does.
    pub fn refuse_moving_points(&mut self, body: BodyIndex, error: SetupError) {
        let plugin = self.plugins.len() - 1;
        self.need_points_at_rest.push((plugin, body, error));
    }

    /// Finds a plugin that needs points at rest on a body whose points move.
    pub(crate) fn check_points_at_rest(&mut self) -> Result<(), (usize, SetupError)> {
        let configurations = &self.world.configurations;
        let moves =
            |(_, body, _): &(usize, BodyIndex, SetupError)| configurations.moves_points(*body);
        match self.need_points_at_rest.iter().position(moves) {
            Some(found) => {
                let (plugin, _, error) = self.need_points_at_rest.swap_remove(found);
                Err((plugin, error))
            }
            None => Ok(()),
        }
    }

    /// Declares that matter flows through the points of a body, whose `velocity` the calling physics owns, and whether the points
    /// rest.
    ///
    /// # Errors
    /// As [`Setup::move_points`].
    pub fn flow_through(
        &mut self,
        body: BodyIndex,
        description: Description,
    ) -> Result<(), SetupError> {
        self.check_points_are_free(body)?;
        let plugin = self.plugins.len() - 1;
        let flow = (plugin, description);
        self.world.configurations.set_flow(body, flow);
        Ok(())
    }

    /// The family over which the flow through the points of a body is summed: what a flow carries is kept to rounding by sums over
    /// the same bonds. `None` where nothing flows through them.
    pub fn flow_family(&self, body: BodyIndex) -> Option<Arc<Family>> {
        let plugin = self.world.configurations.flow_owner(body)?;
        let of_flow = |f: &&ObtainedFamily| f.body == body && f.plugin == plugin;
        let family = self.families.iter().find(of_flow);
        family.map(|f| f.family.clone())
    }

    fn check_points_are_free(&self, body: BodyIndex) -> Result<(), SetupError> {
        if self.is_growing(body) {
            return Err(self.refused_growth(body));
        }
        let name = &self.body(body).name;
        let configurations = &self.world.configurations;
        if let Some(first) = configurations.owner(body) {
            let first = &self.plugins[first];
            let message =
                format!("`{first}` already decides where the points of body `{name}` are");
            let expected = "one physics that moves the points or flows through them";
            return Err(SetupError::value("body", message, expected));
        }
        let plugin = self.plugins.len() - 1;
        let at_rest = self.families.iter().find(|f| f.body == body);
        let at_rest = at_rest
            .map(|f| f.plugin)
            .or(configurations.told_at_rest(body));
        if let Some(label) = at_rest.filter(|p| *p != plugin).map(|p| &self.plugins[p]) {
            let message = format!(
                "`{label}` comes before the physics that decides where the points of body `{name}` are, and would take \
                 them for matter at rest"
            );
            let expected = format!("`{label}` after it in the case file");
            return Err(SetupError::value("body", message, expected));
        }
        Ok(())
    }

    /// Declares that the calling plugin breaks bonds of a body; it adds them to the list that others see with the
    /// handle ([`World::break_pairs`]), and replaces the list when a state is restored.
    ///
    /// # Errors
    /// When another plugin breaks them.
    pub fn break_bonds(&mut self, body: BodyIndex) -> Result<BondBreaker, SetupError> {
        self.set_breaker(body, false)
    }

    /// As [`Setup::break_bonds`], for plugins that only add to the list and keep count of what they added: several of
    /// them may act on one body.
    ///
    /// # Errors
    /// When a plugin that replaces the list breaks bonds of the body.
    pub fn break_bonds_with_others(&mut self, body: BodyIndex) -> Result<BondBreaker, SetupError> {
        self.set_breaker(body, true)
    }

    fn set_breaker(&mut self, body: BodyIndex, is_shared: bool) -> Result<BondBreaker, SetupError> {
        let plugin = self.plugins.len() - 1;
        let breaker = Breaker { plugin, is_shared };
        self.world.set_breaker(body, breaker).map_err(|other| {
            let (other, name) = (&self.plugins[other], &self.body(body).name);
            let message = format!("`{other}` already breaks bonds of body `{name}`");
            let expected =
                "cracks at given places (`growing_crack`) or `fracture` of one physics, not both";
            SetupError::value("body", message, expected)
        })
    }

    /// What the points of a body are, as declared by a physics prepared before: updated Lagrangian where one moves
    /// them, as it says where matter flows through them, else total Lagrangian.
    pub fn description(&mut self, body: BodyIndex) -> Description {
        let plugin = self.plugins.len() - 1;
        self.world.configurations.description(body, plugin)
    }

    /// A family that follows the points of a body; equal requests share one. [`Setup::current_family`] and
    /// [`World::moving_family`] give it as it is.
    ///
    /// # Errors
    /// When the horizon reaches no neighbour, or the family is one that [`Family::moving`] does not support.
    pub fn moving_family(
        &mut self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<MovingFamily, SetupError> {
        let World {
            bodies,
            configurations,
            ..
        } = &mut *self.world;
        let family = configurations.follow((body, &bodies[body]), spec);
        family.map_err(|e| SetupError::new("horizon", e))
    }

    /// A moving family as it is at set-up, where all points have their reference positions.
    pub fn current_family(&self, family: MovingFamily) -> Arc<Family> {
        self.world.moving_family(family)
    }

    /// The families of points that stay, by the plugin that asked first: its name, body and request.
    pub(crate) fn requests(&self) -> Vec<(String, BodyIndex, FamilySpec)> {
        let families = self.families.iter();
        families
            .map(|f| (self.plugins[f.plugin].clone(), f.body, f.spec.clone()))
            .collect()
    }

    /// Plugins with a family of a body at rest.
    pub(crate) fn plugins_with_families(&self, body: BodyIndex) -> impl Iterator<Item = usize> {
        let families = self.families.iter().filter(move |f| f.body == body);
        families.map(|f| f.plugin)
    }

    /// The first plugin that acts on a body, by a declared access or a family, and is not among its `followers`.
    pub(crate) fn unaware_plugin(
        &self,
        body: BodyIndex,
        acts: impl Fn(Access) -> bool,
        followers: &[(usize, BodyIndex)],
    ) -> Option<usize> {
        let is_here = |d: &&Declaration| self.world.fields.field(d.field).body == body;
        let declarations = self.declarations.iter().filter(is_here);
        let declared = declarations.filter(|d| acts(d.access)).map(|d| d.plugin);
        let mut all = declared.chain(self.plugins_with_families(body));
        all.find(|plugin| !followers.contains(&(*plugin, body)))
    }

    /// All families obtained so far.
    pub fn families(&self) -> impl Iterator<Item = (BodyIndex, Arc<Family>)> {
        let at_rest = self.families.iter();
        let at_rest = at_rest.map(|f| (f.body, f.family.clone()));
        at_rest.chain(self.world.configurations.families())
    }
}
