//! What happens to the points of bodies, and whether plugins support it.

use super::{Access, Declaration, Happening, Plugin, RefusedChange, Setup};
use crate::body::Horizon;
use crate::error::SetupError;
use crate::field::{Write, keys};
use crate::world::changes::{Change, Changes};
use crate::world::configuration::{Description, PointMover};
use crate::world::refinement::{Refinement, Transfer, WindowMover};
use crate::world::{BodyIndex, FamilyReach};

impl Setup<'_> {
    /// Notes that the calling plugin changes the points of a body.
    pub(super) fn happens(&mut self, body: BodyIndex, change: Change) {
        let plugin = self.current;
        let changes = &mut self.world.changes[body];
        *changes = changes.and(Changes::of(&[change]));
        self.happenings.push(Happening {
            body,
            change,
            plugin: Some(plugin),
        });
    }

    /// Refuses the calling plugin with `error`, should `change` happen to the points of a body although plugins of its type
    /// support that.
    ///
    /// # Errors
    /// `error`, where it is known already that the change happens.
    pub fn refuse(
        &mut self,
        body: BodyIndex,
        change: Change,
        error: SetupError,
    ) -> Result<(), SetupError> {
        if self.world.changes[body].contains(change) {
            return Err(error);
        }
        self.refused.push(RefusedChange {
            plugin: self.current,
            body,
            change,
            error,
        });
        Ok(())
    }

    /// Declares that the calling coupler deposits material on a body ([`Change::Births`]) or cuts it off ([`Change::Cuts`])
    /// during the run, and hands over the activity of the points, which are active at first but for those `without` material.
    /// Such couplers share it: each changes its own points only.
    ///
    /// # Errors
    /// When the body has no lattice.
    pub fn change_material(
        &mut self,
        body: BodyIndex,
        change: Change,
        without: &[u32],
    ) -> Result<Write<f64>, SetupError> {
        if self.body(body).lattice().is_none() {
            let message = format!(
                "body `{}` has no lattice: material is deposited or cut off on the cells of a lattice",
                self.body(body).name
            );
            let expected = "a body with `spacing`, without `zones`, `jitter` or `points`";
            return Err(SetupError::value("body", message, expected));
        }
        if self.world.processes().size() > 1 && self.world.bodies.len() > 1 {
            let name = &self.body(body).name;
            let message = format!(
                "several processes do not share body `{name}`, which grows or is cut, beside other bodies"
            );
            return Err(SetupError::value("body", message, "one process"));
        }
        let shared = self.world.activity_field(body);
        let active = match shared {
            None => {
                let active = self.write(body, &keys::ACTIVE)?;
                self.set_first(active, |_| 1.0);
                active
            }
            Some(field) => {
                self.declarations.push(Declaration {
                    plugin: self.current,
                    access: Access::Write,
                    field,
                });
                Write::new(field)
            }
        };
        let values = self.world.fields.values_mut(active.field);
        without.iter().for_each(|&p| values[p as usize] = 0.0);
        self.happens(body, change);
        Ok(active)
    }

    /// The permission of the calling physics, which published the [`Description`] of a body, to move its points
    /// ([`World::set_configuration`](crate::World::set_configuration)).
    ///
    /// # Panics
    /// When the physics has not published that it moves the points.
    pub fn move_points(&mut self, body: BodyIndex) -> PointMover {
        let published = self.world.facts.of::<Description>(body).next();
        let is_own = published == Some((self.current, &Description::UpdatedLagrangian));
        assert!(is_own, "the physics has published that it moves the points");
        PointMover { body }
    }

    /// Lets `window` be a part of `plate` with finer points that moves over it; called by a coupler, which gets the
    /// permission to move it, and names the fields that move with it.
    ///
    /// # Errors
    /// When the two bodies do not fit, or one of them belongs to a refinement already.
    pub fn refine(
        &mut self,
        plate: BodyIndex,
        window: BodyIndex,
        Transfer { conserved, derived }: Transfer<'_>,
    ) -> Result<WindowMover, SetupError> {
        for (key, body) in [("body", plate), ("fine", window)] {
            if self.world.refinement(body).is_some() {
                let message = format!("body `{}` has a window already", self.body(body).name);
                return Err(SetupError::value(key, message, "one window for each body"));
            }
        }
        let derived = [self.read(plate, derived)?, self.read(window, derived)?];
        let conserved = [self.read(plate, conserved)?, self.read(window, conserved)?];
        let refinement = Refinement::new(self.world, plate, window, conserved, derived)?;
        self.world.refinements.push(refinement);
        self.happens(window, Change::Window);
        Ok(WindowMover {
            refinement: self.world.refinements.len() - 1,
        })
    }

    /// Divides all bodies among the processes that share the run, if there are several.
    ///
    /// # Errors
    /// Plugins that do not support it, and bodies that cannot be divided.
    pub(crate) fn divide_bodies(&mut self) -> Result<(), (usize, SetupError)> {
        if self.world.processes().size() == 1 {
            return Ok(());
        }
        self.world.keep_whole_bodies();
        for body in 0..self.world.bodies.len() {
            let happening = Happening {
                body,
                change: Change::Division,
                plugin: None,
            };
            let supports = |plugin: &Plugin| plugin.supports.contains(Change::Division);
            if let Some(plugin) = self.plugins.iter().position(|plugin| !supports(plugin)) {
                return Err((plugin, self.unsupported(&happening, plugin)));
            }
            let changes = &mut self.world.changes[body];
            *changes = changes.and(Changes::of(&[Change::Division]));
            let reaches = self.world.facts.of::<FamilyReach>(body);
            let spacing = self.world.bodies[body].coarsest_spacing();
            let reach = reaches.map(|(_, reach)| reach.0.of(spacing));
            let reach = reach.fold(spacing, f64::max);
            (self.world.divide(body, Horizon::Length(reach))).map_err(|e| (0, e))?;
        }
        Ok(())
    }

    /// Tells that the calling plugin reads values at these points, whichever process owns them, besides those in reach of its families.
    pub fn read_points(&mut self, body: BodyIndex, points: impl Iterator<Item = usize>) {
        self.world
            .read_points(body, points.map(|point| point as u32));
    }

    /// Whether a plugin decides where points of a body are, or what flows through them.
    pub(crate) fn decides_points(&self, plugin: usize) -> bool {
        let mut descriptions = self.world.facts.all::<Description>();
        descriptions.any(|(by, _)| by == plugin)
    }

    /// Refuses plugins that act on points to which something happens that they do not support, and lets the others read
    /// which points have material.
    pub(super) fn check_changes(&mut self) -> Result<(), (usize, SetupError)> {
        let happens = |r: &RefusedChange| self.world.changes[r.body].contains(r.change);
        if let Some(found) = self.refused.iter().position(happens) {
            let RefusedChange { plugin, error, .. } = self.refused.swap_remove(found);
            return Err((plugin, error));
        }
        for happening in &self.happenings {
            let lacks = |plugin: &usize| !self.plugins[*plugin].supports.contains(happening.change);
            if let Some(plugin) = self.acting_plugins(happening.body).find(lacks) {
                return Err((plugin, self.unsupported(happening, plugin)));
            }
        }
        self.read_activity();
        Ok(())
    }

    /// Plugins that act on the points of a body: they do more than read its fields, or have a family.
    fn acting_plugins(&self, body: BodyIndex) -> impl Iterator<Item = usize> {
        let is_here = move |d: &&Declaration| self.world.fields.field(d.field).body == body;
        let declarations = self.declarations.iter().filter(is_here);
        let declared = declarations
            .filter(move |d| d.access.acts())
            .map(|d| d.plugin);
        let families = self.world.families.iter().filter(move |f| f.body == body);
        declared.chain(families.map(|f| f.plugin))
    }

    /// The mistake of a plugin that does not support what happens to points.
    fn unsupported(&self, happening: &Happening, plugin: usize) -> SetupError {
        let by = happening.plugin.map_or("", |plugin| self.label(plugin));
        let body = &self.body(happening.body).name;
        let what = match happening.change {
            Change::Motion => format!("`{by}` moves the points of body `{body}`"),
            Change::Flow => format!("`{by}` lets a fluid flow through the points of body `{body}`"),
            Change::Births => format!("`{by}` adds material to body `{body}`"),
            Change::Cuts => format!("`{by}` removes material from body `{body}`"),
            Change::Window => format!("`{by}` moves body `{body}` as a window of finer points"),
            Change::Layers => format!("body `{body}` has its points in the layers of a `layup`"),
            Change::Division => format!("several processes share the points of body `{body}`"),
        };
        let message = format!("{what}, which `{}` does not support", self.label(plugin));
        let expected = format!(
            "plugins that support `{}` (`perimelt list --support`), or a body without it",
            happening.change.name()
        );
        SetupError::value("", message, expected)
    }

    /// Refuses the calling plugin where it does not support what happens to the points of a body.
    pub(super) fn check_support(&self, body: BodyIndex) -> Result<(), SetupError> {
        self.check_support_of(body, |_| true)
    }

    /// Refuses the calling plugin where it does not support what the case says of the points of a body, before it acts on them.
    pub(super) fn check_support_of_case(&self, body: BodyIndex) -> Result<(), SetupError> {
        self.check_support_of(body, |happening| happening.plugin.is_none())
    }

    fn check_support_of(
        &self,
        body: BodyIndex,
        counts: impl Fn(&Happening) -> bool,
    ) -> Result<(), SetupError> {
        let supports = self.plugins[self.current].supports;
        let mut happenings = self.happenings.iter().filter(|h| counts(h));
        match happenings.find(|h| h.body == body && !supports.contains(h.change)) {
            Some(happening) => Err(self.unsupported(happening, self.current)),
            None => Ok(()),
        }
    }

    /// Lets the plugins that act on a growing body read which of its points have material, but for those that set it.
    fn read_activity(&mut self) {
        for body in 0..self.world.bodies.len() {
            let Some(field) = self.world.activity_field(body) else {
                continue;
            };
            let sets = |plugin: usize| {
                let mut all = self.declarations.iter();
                all.any(|d| d.plugin == plugin && d.field == field && d.access == Access::Write)
            };
            let mut readers: Vec<usize> = self.acting_plugins(body).collect();
            readers.sort_unstable();
            readers.dedup();
            readers.retain(|plugin| !sets(*plugin));
            let access = Access::Read;
            let reads = readers.into_iter().map(|plugin| Declaration {
                plugin,
                access,
                field,
            });
            let reads: Vec<Declaration> = reads.collect();
            self.declarations.extend(reads);
        }
    }
}
