//! What a fluid needs of its body and of other plugins.

use perimelt_core::{Body, SetupError};

use super::kinds::{EulerianForm, FluidKeys, PointKeys};
use super::walls::Walls;

/// A need; where it is not met, the key is refused with the message.
struct Need {
    is_met: bool,
    key: &'static str,
    message: &'static str,
    expected: &'static str,
}

fn check(needs: impl IntoIterator<Item = Need>) -> Result<(), SetupError> {
    match needs.into_iter().find(|need| !need.is_met) {
        Some(need) => Err(SetupError::value(need.key, need.message, need.expected)),
        None => Ok(()),
    }
}

impl FluidKeys {
    /// Refuses a body that does not fit these keys.
    pub(super) fn check_body(&self, body: &Body) -> Result<(), SetupError> {
        let has_fluxes = matches!(self.points, PointKeys::Eulerian(_)) && self.is_conservative();
        let is_uniform = body.finest_spacing() >= body.coarsest_spacing();
        check([
            Need {
                is_met: body.dimension > 1,
                key: "body",
                message: "a fluid needs two or three dimensions",
                expected: "a 2D or 3D body",
            },
            Need {
                is_met: !has_fluxes || body.lattice().is_some(),
                key: "description",
                message: "the conservative form of an Eulerian fluid needs the points of a lattice",
                expected: "a body with `spacing` and without `jitter`",
            },
            Need {
                is_met: !self.is_conservative() || is_uniform,
                key: "form",
                message: "the conservative form needs a uniform spacing",
                expected: "points of one spacing",
            },
        ])
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
        check([
            Need {
                is_met: has_walls || !follows,
                key: "description",
                message: "no body is a wall for this fluid, which its points could follow",
                expected: "a coupler `fluid_structure`, or `description = \"eulerian\"`",
            },
            Need {
                is_met: !has_walls || self.is_conservative(),
                key: "form",
                message: "a body is a wall for this fluid, which only the conservative form supports",
                expected: "`form = \"conservative\"`",
            },
            Need {
                is_met: has_walls || !collides,
                key: "collisions",
                message: "no body is a wall for this fluid, with which its points could collide",
                expected: "a coupler `fluid_structure`, or leave `collisions` out",
            },
            Need {
                is_met: !has_walls || !self.zero_surface_pressure,
                key: "surface",
                message: "zero pressure at surfaces would also act at the body that is a wall",
                expected: "`surface = \"natural\"` or `\"closed\"`",
            },
        ])
    }
}
