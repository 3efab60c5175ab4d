//! Keys of the `[[physics]]` table of a fluid, and which of them fit together.

use perimelt_core::{Body, Description, Horizon, Influence, PartialVolume, SetupError, StepSize};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::advection::Convection;

use super::collision::Collisions;
use super::state::State;
use super::walls::Walls;

/// Weakly compressible laminar flow; owns `velocity`, `density` and `pressure`. Heat is the matter of `thermal`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Body that flows; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Whether points move, and whether they change neighbours.
    #[serde(default)]
    pub description: Description,
    /// Horizon in spacings of each point, or `{ length = ... }` in m; when left out 3.015 as published, and 2.015 for an
    /// Eulerian fluid on a lattice: less than half the error, and half the work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<Horizon>,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Influence of neighbours by their distance; when left out, "gaussian" as published, and "wendland" in the
    /// conservative form.
    #[serde(default)]
    pub influence: Option<Influence>,
    /// Equation of state: how the pressure follows from the flow.
    pub state: State,
    /// How derivatives become sums.
    #[serde(default)]
    pub form: Form,
    /// Condition at a free surface.
    #[serde(default)]
    pub surface: Surface,
    /// Viscous stress.
    #[serde(default)]
    pub stress: Stress,
    /// Order of the parts of a step.
    #[serde(default)]
    pub scheme: Scheme,
    /// Stabilisation of the convective terms of an Eulerian fluid.
    #[serde(default)]
    pub convection: Convection,
    /// Diffusion of density, as a fraction of spacing times speed of sound, such as 0.05: smooths the
    /// pressure, with an error of second order in pressure gradients that change.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub density_diffusion: f64,
    /// Rate at which the density of the conservative form approaches the kernel sum of the masses, as a fraction of
    /// the speed of sound over the spacing. It keeps the volume over long times; larger values add noise where points
    /// are in disorder.
    #[serde(default = "usual_volume_relaxation")]
    #[schemars(extend("minimum" = 0))]
    pub volume_relaxation: f64,
    /// Distance by which points of an updated Lagrangian fluid are moved away from crowded places, as a fraction of
    /// the distance that the fastest point moves, such as 0.05, or 0.5 where a lid stirs (Gao (2020), eqs. 6.46 to
    /// 6.50, where the sign is printed that would move points together). The fields stay with the points: an error of
    /// the order of the shift.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub shifting: f64,
    /// Fraction of the mean velocity of the neighbours with which points of an updated Lagrangian fluid move, from 0
    /// to 1 (XSPH; Gao (2020), eq. 6.53, with the mass of the neighbour). It keeps the points in order; where the
    /// velocity has a curvature, they do not follow the fluid exactly.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub xsph: f64,
    /// Collision of points with solids (`fluid_structure`) that they would penetrate, for impacts and edges at which
    /// pressure does not keep points out; when left out, points do not collide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collisions: Option<Collisions>,
    /// Least distance of two points of an updated Lagrangian fluid, in spacings, such as 0.5: points that would come nearer
    /// collide without rebound, and points come no nearer to walls given by faces than half of it. It prevents pairs of
    /// points where a flow stretches and takes kinetic energy there; 0: none.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub least_distance: f64,
    /// Viscosity between points that approach each other, as a fraction of 1.2 spacings times the speed of sound,
    /// such as 0.02 (Gao (2020), eq. 6.56, as an acceleration). It damps sound and impacts, and also shear,
    /// by about a tenth of it in two dimensions.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub artificial_viscosity: f64,
    /// Number of steps after which velocity and density are smoothed by moving least squares, such as 20 (Gao (2020),
    /// eqs. 5.111 to 5.114, with the volumes that eq. 5.114c lacks); 0: never. Linear fields do not change; each smoothing
    /// acts as a diffusion by about a tenth of the squared horizon.
    #[serde(default)]
    pub smoothing: u32,
    /// Time during which accelerations grow smoothly from zero, s (Gao (2020), eq. 5.110).
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub startup: f64,
    /// Step in s, or "auto".
    #[serde(default)]
    pub step: StepSize,
}

fn usual_volume_relaxation() -> f64 {
    1e-4
}

/// How derivatives become sums.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Derivatives of second order, as published: the most accurate form on complete families. Momentum is kept
    /// only as far as the derivatives are exact, and families must be complete.
    #[default]
    Differences,
    /// The divergence of first order and its adjoint, with pairwise viscosity (docs/theory/fluids.md, "Conservative
    /// form"). Momentum is kept to rounding, surfaces may be free. For the updated Lagrangian description and points
    /// of one spacing.
    Conservative,
}

/// Condition at a free surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// No external pressure, which follows from the conservative form without a condition.
    #[default]
    Natural,
    /// There is none: the fluid fills a closed container, and its total volume stays that of the start. The sum of
    /// the volumes of points that move drifts otherwise, as divergences of points in disorder do not add up to zero,
    /// and the level of the pressure with it. For the conservative form.
    Closed,
    /// Points of the first row have no pressure and the reference density (Gao (2020), eq. 6.59). Their
    /// compression does no work, so that impacts may become unstable.
    ZeroPressure,
}

/// Viscous stress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stress {
    /// That of a flow without divergence.
    #[default]
    Incompressible,
    /// With `mu/3 grad div v`.
    Compressible,
    /// Along the bonds, `mu (lap v + 2 grad div v)`: keeps angular momentum to rounding and lets a fluid with a free
    /// surface turn without friction. Conservative form only.
    Central,
}

/// Order of the parts of a step; all but `published` keep the amplitude of sound waves (docs/theory/fluids.md, "Order
/// of a step").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// New density and pressure, then the velocity from them.
    #[default]
    Symplectic,
    /// Velocity by half a step before and after the density: second order for sound, twice the work.
    KickDriftKick,
    /// Velocity from the pressure before the step, as printed (eq. 5.83): sound waves grow unless viscosity
    /// damps them.
    Published,
}

impl Fluid {
    /// Stabilisation of the convective terms; `None` for points that move with the fluid.
    pub(super) fn eulerian_convection(&self) -> Option<Convection> {
        (self.description.flows_through()).then_some(self.convection)
    }

    /// Whether surfaces without a wall are allowed.
    pub(super) fn may_have_free_surface(&self) -> bool {
        self.form == Form::Conservative || self.surface == Surface::ZeroPressure
    }

    /// Refuses keys that fit neither the body nor each other.
    pub(super) fn check(&self, body: &Body) -> Result<(), SetupError> {
        self.horizon.map_or(Ok(()), |h| h.check(body))?;
        self.state.check()?;
        self.check_numbers()?;
        if body.dimension == 1 {
            let message = "a fluid needs two or three dimensions";
            return Err(SetupError::value("body", message, "a 2D or 3D body"));
        }
        if self.form == Form::Conservative {
            self.check_conservative(body)?;
        }
        self.check_description()
    }

    fn check_numbers(&self) -> Result<(), SetupError> {
        let numbers = [
            ("density_diffusion", self.density_diffusion),
            ("startup", self.startup),
            ("shifting", self.shifting),
            ("volume_relaxation", self.volume_relaxation),
            ("xsph", self.xsph),
            ("artificial_viscosity", self.artificial_viscosity),
        ];
        let wrong = |(_, value): &(&str, f64)| !(value.is_finite() && *value >= 0.0);
        if let Some((key, value)) = numbers.into_iter().find(wrong) {
            let message = format!("`{key}` is {value}");
            return Err(SetupError::value(key, message, "zero or above"));
        }
        if !(0.0..1.0).contains(&self.least_distance) {
            let message = format!("`least_distance` is {}", self.least_distance);
            let expected = "a number from 0 to below 1, such as 0.5";
            return Err(SetupError::value("least_distance", message, expected));
        }
        self.collisions.map_or(Ok(()), |c| c.check())
    }

    /// Refuses bodies as walls where the form does not know them.
    pub(super) fn check_walls(&self, walls: &Walls) -> Result<(), SetupError> {
        if walls.is_empty() && self.description == Description::ArbitraryLagrangianEulerian {
            let message = "no body is a wall for this fluid, which its points could follow";
            let expected = "a coupler `fluid_structure`, or `description = \"eulerian\"`";
            return Err(SetupError::value("description", message, expected));
        }
        if !walls.is_empty() && self.form != Form::Conservative {
            let message = "a body is a wall for this fluid, which only the conservative form knows";
            let expected = "`form = \"conservative\"`";
            return Err(SetupError::value("form", message, expected));
        }
        if walls.is_empty() && self.collisions.is_some() {
            let message = "no body is a wall for this fluid, with which its points could collide";
            let expected = "a coupler `fluid_structure`, or leave `collisions` out";
            return Err(SetupError::value("collisions", message, expected));
        }
        if !walls.is_empty() && self.surface == Surface::ZeroPressure {
            let message = "zero pressure at surfaces would also act at the body that is a wall";
            return Err(SetupError::value(
                "surface",
                message,
                "`surface = \"natural\"` or `\"closed\"`",
            ));
        }
        Ok(())
    }

    /// Whether forces act along bonds or keep moments, and points move with their own velocity.
    pub(super) fn keeps_angular_momentum(&self) -> bool {
        self.form == Form::Conservative
            && self.stress == Stress::Central
            && self.surface != Surface::ZeroPressure
            && self.smoothing == 0
            && self.xsph == 0.0
            && self.shifting == 0.0
    }

    fn check_conservative(&self, body: &Body) -> Result<(), SetupError> {
        if self.description == Description::TotalLagrangian {
            let message =
                "the conservative form is defined for points that change neighbours or rest";
            let expected = "`description = \"updated_lagrangian\"` or `\"eulerian\"`";
            return Err(SetupError::value("description", message, expected));
        }
        if self.description.flows_through() {
            self.check_fluxes(body)?;
        }
        if self.stress == Stress::Compressible {
            let message = "the pairwise viscosity of the conservative form is incompressible";
            let expected = "`stress = \"incompressible\"` or `\"central\"`";
            return Err(SetupError::value("stress", message, expected));
        }
        if body.finest_spacing() < body.coarsest_spacing() {
            let message = "the conservative form needs a uniform spacing";
            return Err(SetupError::value("form", message, "points of one spacing"));
        }
        Ok(())
    }

    /// Of the conservative form at points that rest.
    fn check_fluxes(&self, body: &Body) -> Result<(), SetupError> {
        if body.lattice().is_none() {
            let message =
                "the conservative form of an Eulerian fluid needs the points of a lattice";
            let expected = "a body with `spacing` and without `jitter`";
            return Err(SetupError::value("description", message, expected));
        }
        if self.stress != Stress::Incompressible {
            let message = "viscous forces along bonds are those of points that move";
            let expected = "`stress = \"incompressible\"`";
            return Err(SetupError::value("stress", message, expected));
        }
        if self.surface != Surface::Natural {
            let message =
                "an Eulerian fluid has no free surface, and keeps its mass without a condition";
            return Err(SetupError::value("surface", message, "leave `surface` out"));
        }
        if self.collisions.is_some() {
            let message = "points that rest do not collide";
            return Err(SetupError::value(
                "collisions",
                message,
                "leave `collisions` out",
            ));
        }
        Ok(())
    }

    fn check_description(&self) -> Result<(), SetupError> {
        let follows = self.description == Description::ArbitraryLagrangianEulerian;
        if follows && self.form != Form::Conservative {
            let message = "points that follow walls belong to the conservative form";
            let expected = "`form = \"conservative\"`, or another `description`";
            return Err(SetupError::value("description", message, expected));
        }
        if follows && self.smoothing > 0 {
            let message = "`smoothing` takes the volumes of points that rest or carry their mass";
            let expected = "leave `smoothing` out";
            return Err(SetupError::value("smoothing", message, expected));
        }
        if self.surface == Surface::Closed && self.form != Form::Conservative {
            let message = "closed containers belong to the conservative form";
            let expected = "`form = \"conservative\"`, or another `surface`";
            return Err(SetupError::value("surface", message, expected));
        }
        if self.stress == Stress::Central && self.form != Form::Conservative {
            let message = "forces along bonds belong to the conservative form";
            let expected = "`form = \"conservative\"`, or another `stress`";
            return Err(SetupError::value("stress", message, expected));
        }
        if self.convection != Convection::default() && self.eulerian_convection().is_none() {
            let message = "`convection` applies where the fluid flows through the points";
            let expected = "`description = \"eulerian\"` or `\"arbitrary_lagrangian_eulerian\"`";
            return Err(SetupError::value("convection", message, expected));
        }
        let only_updated = [
            ("shifting", self.shifting),
            ("xsph", self.xsph),
            ("least_distance", self.least_distance),
        ];
        match only_updated.into_iter().find(|(_, value)| *value > 0.0) {
            Some((key, _)) if self.description != Description::UpdatedLagrangian => {
                let message = format!("`{key}` applies to the updated Lagrangian description only");
                let expected = "`description = \"updated_lagrangian\"`";
                Err(SetupError::value(key, message, expected))
            }
            _ => Ok(()),
        }
    }
}
