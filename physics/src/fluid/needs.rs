//! What a fluid needs of its body and of other plugins.

use perimelt_core::{Body, SetupError};

use crate::dependent_keys::need;

use super::kinds::{EulerianForm, FluidKeys, PointKeys};
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

    /// Refuses bodies that are walls, and their absence, where they do not fit these keys.
    pub(super) fn check_walls(&self, walls: &Walls) -> Result<(), SetupError> {
        let follows = match self.points {
            PointKeys::Eulerian(keys) => keys.form == EulerianForm::FollowingWalls,
            PointKeys::Lagrangian(_) => false,
        };
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
            !has_walls || !self.zero_surface_pressure,
            "surface",
            "the condition of zero pressure would also act at the wall",
            "`surface = \"natural\"` or `\"closed\"`",
        )
    }
}
