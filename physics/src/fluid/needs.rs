//! What a fluid needs of its body and of other plugins.

use perimelt_core::{Body, SetupError};

use crate::dependent_keys::need;

use super::kinds::{EulerianForm, FluidKeys, PointKeys};
use super::pair::Interface;
use super::viscosity::Viscosity;
use super::walls::Walls;

impl FluidKeys {
    /// Refuses a body that does not fit these keys.
    pub(super) fn check_body(&self, body: &Body) -> Result<(), SetupError> {
        let has_fluxes = matches!(self.points, PointKeys::Eulerian(_)) && self.is_conservative();
        let is_uniform = body.finest_spacing() >= body.coarsest_spacing();
        need(
            body.dimension > 1,
            "body",
            "a fluid needs two or three dimensions",
            "a 2D or 3D body",
        )?;
        need(
            !has_fluxes || body.lattice().is_some(),
            "description",
            "the conservative form of an Eulerian fluid needs the points of a lattice",
            "a body with `spacing` and without `jitter`",
        )?;
        need(
            !self.is_conservative() || is_uniform,
            "form",
            "the conservative form needs a uniform spacing",
            "points of one spacing",
        )
    }

    /// Whether points follow bodies that are walls.
    fn follows_walls(&self) -> bool {
        match self.points {
            PointKeys::Eulerian(keys) => keys.form == EulerianForm::FollowingWalls,
            PointKeys::Lagrangian(_) => false,
        }
    }

    /// Whether the fluid keeps its volume.
    pub(super) fn is_incompressible(&self) -> bool {
        match self.points {
            PointKeys::Eulerian(keys) => matches!(keys.form, EulerianForm::Projection(_)),
            PointKeys::Lagrangian(_) => false,
        }
    }

    /// Refuses keys that do not fit two fluids whose points keep their material.
    pub(super) fn check_interface(
        &self,
        interface: Interface,
        has_two_fluids: bool,
    ) -> Result<(), SetupError> {
        if !has_two_fluids || self.is_incompressible() {
            return Ok(());
        }
        need(
            interface.width.is_none(),
            "interface.width",
            "points that move keep their material, and the layer between the fluids has no width",
            "no `width`, or `description = \"eulerian\"`",
        )?;
        need(
            self.settings.density_diffusion == 0.0,
            "density_diffusion",
            "density would diffuse from one fluid to the other",
            "no `density_diffusion`; `smoothing` acts within each fluid",
        )
    }

    /// Refuses a law of viscosity that does not fit these keys.
    pub(super) fn check_viscosity(&self, viscosity: &Viscosity) -> Result<(), SetupError> {
        need(
            !viscosity.needs_shear_rate() || self.is_conservative(),
            "form",
            "the law of viscosity depends on the shear rate, and forces of differences do not balance where the viscosity varies \
             strongly",
            "`form = \"conservative\"`, or `viscosity.newtonian`",
        )?;
        need(
            !viscosity.needs_shear_rate() || !self.follows_walls(),
            "viscosity",
            "the law of viscosity needs the shear rate, which is not computed for points that follow walls",
            "`viscosity.newtonian`, or another `description`",
        )
    }

    /// Refuses bodies that are walls, and their absence, where they do not fit these keys.
    pub(super) fn check_walls(&self, walls: &Walls) -> Result<(), SetupError> {
        let follows = self.follows_walls();
        let collides = self
            .conservative()
            .is_some_and(|keys| keys.collisions.is_some());
        let has_walls = !walls.is_empty();
        need(
            has_walls || !follows,
            "description",
            "no body is a wall of this fluid, so that its points have nothing to follow",
            "a coupler `fluid_structure`, or `description = \"eulerian\"`",
        )?;
        need(
            !has_walls || self.is_conservative(),
            "form",
            "a body is a wall of this fluid, which needs the conservative form",
            "`form = \"conservative\"`",
        )?;
        need(
            has_walls || !collides,
            "collisions",
            "no body is a wall of this fluid, so that its points cannot collide",
            "a coupler `fluid_structure`, or no `collisions`",
        )?;
        need(
            !has_walls || !self.settings.zero_surface_pressure,
            "surface",
            "the condition of zero pressure would also act at the wall",
            "`surface = \"natural\"` or `\"closed\"`",
        )
    }
}
