//! Declarations of windows of finer points, and of plugins that follow them.

use crate::error::SetupError;
use crate::field::keys;
use crate::setup::{Access, Setup};
use crate::world::BodyIndex;
use crate::world::refinement::{Level, Refinement, WindowMover};

impl Setup<'_> {
    /// Lets `window` be a part of `plate` with finer points that moves over it; called by a coupler, which gets the
    /// permission to move it.
    ///
    /// # Errors
    /// When the two bodies do not fit, or one of them belongs to a refinement already.
    pub fn refine(
        &mut self,
        plate: BodyIndex,
        window: BodyIndex,
    ) -> Result<WindowMover, SetupError> {
        for (key, body) in [("body", plate), ("fine", window)] {
            if self.world.refinement(body).is_some() {
                let message = format!("body `{}` has a window already", self.body(body).name);
                return Err(SetupError::value(key, message, "one window for each body"));
            }
        }
        let temperature = [
            self.read(plate, &keys::TEMPERATURE)?,
            self.read(window, &keys::TEMPERATURE)?,
        ];
        let enthalpy = [
            self.read(plate, &keys::ENTHALPY)?,
            self.read(window, &keys::ENTHALPY)?,
        ];
        let refinement = Refinement::new(self.world, (plate, window), temperature, enthalpy)?;
        self.world.refinements.push(refinement);
        self.follow_window(window);
        Ok(WindowMover {
            refinement: self.world.refinements.len() - 1,
        })
    }

    /// The refinement of which a body is a part; for physics, which are prepared after couplers.
    pub fn refinement(&self, body: BodyIndex) -> Option<(&Refinement, Level)> {
        self.world.refinement(body)
    }

    /// Declares that the calling plugin knows that the points of a body may be a window that moves: it acts at the places
    /// where they are ([`World::window_shift`]), or its action does not depend on their places.
    pub fn follow_window(&mut self, body: BodyIndex) {
        let plugin = self.plugins.len() - 1;
        self.window_followers.push((plugin, body));
    }

    /// Refuses plugins that do not know that a body is a window which moves, and bodies that melt differently.
    pub(crate) fn check_refinements(&self) -> Result<(), (usize, SetupError)> {
        for refinement in &self.world.refinements {
            let (plate, window) = (refinement.plate(), refinement.window());
            let acts = |access: Access| {
                let is_reading = matches!(access, Access::Read | Access::ReadIfProvided);
                let is_layer = matches!(access, Access::Layer | Access::LayerIfProvided);
                !(is_reading || is_layer)
            };
            if let Some(plugin) = self.unaware_plugin(window, acts, &self.window_followers) {
                let message = format!(
                    "the points of body `{}` are a window that moves, which this plugin does not support",
                    self.body(window).name
                );
                let expected = format!(
                    "`thermal`, `phase_change`, heat sources on a toolpath, or heat through surfaces; other plugins act on \
                     body `{}`",
                    self.body(plate).name
                );
                return Err((plugin, SetupError::value("", message, expected)));
            }
            let changes = [plate, window].map(|b| self.world.phase_change[b]);
            if changes[0] != changes[1] {
                let message = format!(
                    "bodies `{}` and `{}` do not melt alike",
                    self.body(plate).name,
                    self.body(window).name
                );
                let expected = "`phase_change` with the same keys for both bodies, or for none";
                let plugin = self.window_followers.iter().find(|(_, b)| *b == window);
                let plugin = plugin.map_or(0, |(plugin, _)| *plugin);
                return Err((plugin, SetupError::value("fine", message, expected)));
            }
        }
        Ok(())
    }
}
