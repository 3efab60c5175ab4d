//! Declarations of plugins that add or remove material, and of those that follow it.

use std::sync::Arc;

use crate::error::SetupError;
use crate::family::{Family, FamilySpec};
use crate::field::{Write, keys};
use crate::setup::{Access, Declaration, Setup};
use crate::world::BodyIndex;
use crate::world::activity::{Grower, GrowingFamily, mask};

impl Setup<'_> {
    /// Declares that the calling coupler deposits material on a body, at `points` that have none at first, and hands
    /// over the activity of the points, which the coupler sets to 1.
    ///
    /// # Errors
    /// When another coupler deposits material there, or the body has no lattice.
    pub fn deposit(&mut self, body: BodyIndex, points: &[u32]) -> Result<Write<f64>, SetupError> {
        if self.body(body).lattice().is_none() {
            let name = &self.body(body).name;
            let message =
                format!("body `{name}` has no lattice, on whose cells material is deposited");
            let expected = "a body with `spacing`, without `zones`, `jitter` or `points`";
            return Err(SetupError::value("body", message, expected));
        }
        let active = self.change_activity(body)?;
        let field = self.world.fields.values_mut(active.field);
        points.iter().for_each(|&p| field[p as usize] = 0.0);
        Ok(active)
    }

    /// Declares that the calling coupler cuts material off a body during the run, and hands over the activity of the
    /// points, which the coupler sets to 0.
    ///
    /// # Errors
    /// When the body has no lattice.
    pub fn cut_off(&mut self, body: BodyIndex) -> Result<Write<f64>, SetupError> {
        if self.body(body).lattice().is_none() {
            let name = &self.body(body).name;
            let message = format!("body `{name}` has no lattice, whose cells are cut off");
            let expected = "a body with `spacing`, without `zones`, `jitter` or `points`";
            return Err(SetupError::value("body", message, expected));
        }
        self.change_activity(body)
    }

    /// The activity of a body whose points become active or inactive. Couplers that deposit and that cut share it: each
    /// changes its own points only.
    fn change_activity(&mut self, body: BodyIndex) -> Result<Write<f64>, SetupError> {
        let shared = self.world.activity_field(body);
        let active = match shared {
            None => self.write(body, &keys::ACTIVE)?,
            Some(field) => {
                self.declarations.push(Declaration {
                    plugin: self.plugins.len() - 1,
                    access: Access::Write,
                    field,
                });
                Write::new(field)
            }
        };
        if shared.is_none() {
            self.set_first(active, |_| 1.0);
        }
        self.world.growing[body] = true;
        self.follow_activity(body);
        Ok(active)
    }

    /// Declares that the calling plugin regards points of a body without material as absent, should the body grow: it
    /// asks [`World::activity`] when it runs, after the coupler that deposits.
    pub fn follow_activity(&mut self, body: BodyIndex) {
        let plugin = self.plugins.len() - 1;
        self.followers.push((plugin, body));
    }

    /// Whether material is deposited on a body; for physics, which are prepared after couplers.
    pub fn is_growing(&self, body: BodyIndex) -> bool {
        self.world.growing[body]
    }

    /// A family of a body that grows; equal requests share one. [`World::growing_family`] gives it as it is.
    ///
    /// # Errors
    /// When the horizon reaches no neighbour, or the family is one that [`Family`]s that grow do not support.
    pub fn growing_family(
        &mut self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<GrowingFamily, SetupError> {
        self.follow_activity(body);
        let same = |g: &Grower| g.body == body && g.spec == *spec;
        if let Some(present) = self.world.configurations.growers.iter().position(same) {
            return Ok(GrowingFamily(present));
        }
        for sentence in crate::family::warnings(self.body(body), spec) {
            self.warn(sentence);
        }
        let active = self.world.activity(body).map(|a| mask(&a));
        let active = active.unwrap_or_else(|| vec![true; self.body(body).points.len()]);
        let family = Family::growing(self.body(body), spec, &active, 0)
            .map_err(|e| SetupError::new("body", e))?;
        let seen = self.world.activity_version(body).unwrap_or(0);
        let growers = &mut self.world.configurations.growers;
        growers.push(Grower::new(body, spec, family, seen));
        Ok(GrowingFamily(growers.len() - 1))
    }

    /// A family of a body that grows for the calling plugin alone, of the points that are active at set-up. The plugin
    /// takes up changes of the activity itself ([`Family::set_active`]), when it has compared the state before and after.
    ///
    /// # Errors
    /// As [`Setup::growing_family`].
    pub fn own_growing_family(
        &mut self,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<Family, SetupError> {
        self.follow_activity(body);
        for sentence in crate::family::warnings(self.body(body), spec) {
            self.warn(sentence);
        }
        let active = self.world.activity(body).map(|a| mask(&a));
        let active = active.unwrap_or_else(|| vec![true; self.body(body).points.len()]);
        Family::growing(self.body(body), spec, &active, 0).map_err(|e| SetupError::new("body", e))
    }

    /// A growing family as it is at set-up.
    pub fn current_growing_family(&self, family: GrowingFamily) -> Arc<Family> {
        self.world.growing_family(family)
    }

    /// Refuses plugins that do not know that a body grows, and lets the others read the activity.
    pub(crate) fn check_growth(&mut self) -> Result<(), (usize, SetupError)> {
        for body in (0..self.world.bodies.len()).filter(|&b| self.world.growing[b]) {
            let acts =
                |access: Access| matches!(access, Access::Own | Access::Add) || access.gives();
            if let Some(plugin) = self.unaware_plugin(body, acts, &self.followers) {
                return Err((plugin, self.refused_growth(body)));
            }
            let Some(field) = self.world.activity_field(body) else {
                continue;
            };
            let followers = self.followers.iter().filter(|(_, b)| *b == body);
            let writer = |plugin: usize| {
                let mut all = self.declarations.iter();
                all.any(|d| d.plugin == plugin && d.field == field && d.access == Access::Write)
            };
            let reads = followers.filter(|(plugin, _)| !writer(*plugin));
            let reads: Vec<Declaration> = reads
                .map(|&(plugin, _)| Declaration {
                    plugin,
                    access: Access::Read,
                    field,
                })
                .collect();
            self.declarations.extend(reads);
        }
        Ok(())
    }

    /// The mistake of a plugin that takes all points of a body for material.
    pub(crate) fn refused_growth(&self, body: BodyIndex) -> SetupError {
        let message = format!(
            "`deposit` adds material to body `{}`, or `cut` takes it off, which this plugin does not support",
            self.body(body).name
        );
        let expected = "`thermal`, `thermal_history`, `metallurgy`, `phase_change`, heat sources on a toolpath, heat through surfaces or at a \
                        prescribed temperature, `mechanical`, `thermal_expansion`, `inherent_strain`, `clamp`, \
                        `prescribed_displacement`, `traction`, `gravity`, or a body without `deposit` and `cut`";
        SetupError::value("", message, expected)
    }
}
