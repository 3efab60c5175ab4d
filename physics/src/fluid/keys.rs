//! The `[[physics]]` table of a fluid. Keys that are left out and have no default here belong to some fluids only
//! ([`FluidKeys`](super::kinds::FluidKeys)).

use perimelt_core::law::Law;
use perimelt_core::numbers::check_at_least;
use perimelt_core::{Body, Description, Horizon, Influence, PartialVolume, SetupError, StepSize};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::advection::Convection;
use crate::dependent_keys::need;

use super::lagrangian::collision::Collisions;
use super::pair::Interface;
use super::state::StateLaw;
use super::viscosity::ViscositySweep;

/// Laminar flow, weakly compressible or incompressible; owns `velocity`, `density` and `pressure`. `thermal` computes heat.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
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
    /// How the pressure follows from the flow: an equation of state, such as `state.tait = { sound_speed = 20 }`, or
    /// `state.incompressible = {}`.
    pub state: Law<dyn StateLaw>,
    /// Materials of two fluids, such as `["steel", "argon"]`: the field `fluid_fraction` is 1 in the first and 0 in the second. It
    /// begins with the materials of the points. Fluids that keep their volume share the points through which they flow; a formula
    /// of the distance from the interface, `initial.fluid_fraction = "1 / (1 + exp(-d / length))"`, is a smoother start. In the updated
    /// Lagrangian form of differences points keep their material: the published scheme (continuum surface force), which is less accurate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluids: Option<Vec<String>>,
    /// The interface between two fluids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interface: Option<Interface>,
    /// Law of viscosity; when left out `newtonian`, by the property `viscosity` of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Law<dyn ViscositySweep>>,
    /// How derivatives become sums.
    #[serde(default)]
    pub form: Form,
    /// Condition at a free surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "natural"))]
    pub surface: Option<Surface>,
    /// Viscous stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "incompressible"))]
    pub stress: Option<Stress>,
    /// Order of the parts of a step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "symplectic"))]
    pub scheme: Option<Scheme>,
    /// Stabilisation of the convective terms of an Eulerian fluid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "hybrid"))]
    pub convection: Option<Convection>,
    /// Diffusion of density, as a fraction of spacing times speed of sound, such as 0.05: smooths the
    /// pressure, with an error of second order in pressure gradients that change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub density_diffusion: Option<f64>,
    /// Rate at which the density of the conservative form approaches the kernel sum of the masses, as a fraction of
    /// the speed of sound over the spacing. It keeps the volume over long times; larger values add noise where points
    /// are in disorder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 1e-4, "minimum" = 0))]
    pub volume_relaxation: Option<f64>,
    /// Distance by which points of an updated Lagrangian fluid are moved away from crowded places, as a fraction of
    /// the distance that the fastest point moves, such as 0.05, or 0.5 where a lid stirs (Gao (2020), eqs. 6.46 to
    /// 6.50, where the sign is printed that would move points together). The fields stay with the points: an error of
    /// the order of the shift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub shifting: Option<f64>,
    /// Fraction of the mean velocity of the neighbours with which points of an updated Lagrangian fluid move, from 0
    /// to 1 (XSPH; Gao (2020), eq. 6.53, with the mass of the neighbour). It keeps the points in order; where the
    /// velocity has a curvature, they do not follow the fluid exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub xsph: Option<f64>,
    /// Collision of points with solids (`fluid_structure`) that they would penetrate, for impacts and edges at which
    /// pressure does not keep points out; when left out, points do not collide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collisions: Option<Collisions>,
    /// Least distance of two points of an updated Lagrangian fluid, in spacings, such as 0.5: points that would come nearer
    /// collide without rebound, and points come no nearer to walls given by faces than half of it. It prevents pairs of
    /// points where a flow stretches and takes kinetic energy there; 0: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 1))]
    pub least_distance: Option<f64>,
    /// Viscosity between points that approach each other, as a fraction of 1.2 spacings times the speed of sound,
    /// such as 0.02 (Gao (2020), eq. 6.56, as an acceleration). It damps sound and impacts, and also shear,
    /// by about a tenth of it in two dimensions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub artificial_viscosity: Option<f64>,
    /// Number of steps after which velocity and density are smoothed by moving least squares, such as 20 (Gao (2020),
    /// eqs. 5.111 to 5.114, with the volumes that eq. 5.114c lacks); 0: never. Linear fields do not change; each smoothing
    /// acts as a diffusion by about a tenth of the squared horizon. `smoothed` leaves out the velocity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0))]
    pub smoothing: Option<u32>,
    /// What `smoothing` acts on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "velocity_and_density"))]
    pub smoothed: Option<Smoothed>,
    /// Time during which accelerations grow smoothly from zero, s (Gao (2020), eq. 5.110).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub startup: Option<f64>,
    /// Step in s, or "auto".
    #[serde(default)]
    pub step: StepSize,
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

/// Fields that moving least squares smooth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Smoothed {
    /// Velocity and density.
    #[default]
    VelocityAndDensity,
    /// The density, and the pressure with it: no friction is added.
    Density,
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
    /// Without the terms of a divergence.
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
    /// Refuses numbers outside of their ranges.
    pub(super) fn check_numbers(&self, body: &Body) -> Result<(), SetupError> {
        self.horizon.map_or(Ok(()), |h| h.check(body))?;
        let state = &self.state;
        state.law.check().map_err(|e| e.below(&state.key()))?;
        let numbers = [
            ("density_diffusion", self.density_diffusion),
            ("startup", self.startup),
            ("shifting", self.shifting),
            ("volume_relaxation", self.volume_relaxation),
            ("xsph", self.xsph),
            ("artificial_viscosity", self.artificial_viscosity),
        ];
        for (key, value) in numbers {
            check_at_least(key, value, 0.0, "")?;
        }
        need(
            self.smoothing.is_some_and(|steps| steps > 0) || self.smoothed.is_none(),
            "smoothed",
            "nothing is smoothed",
            "`smoothing` with a number of steps, or no `smoothed`",
        )?;
        need(
            self.fluids.is_some() || self.interface.is_none(),
            "interface",
            "there is one fluid, which has no interface",
            "`fluids` with two materials of the body, or no `interface`",
        )?;
        if let Some(distance) = self.least_distance.filter(|d| !(0.0..1.0).contains(d)) {
            let message = format!("`least_distance` is {distance}");
            let expected = "a number from 0 to below 1, such as 0.5";
            return Err(SetupError::value("least_distance", message, expected));
        }
        self.collisions.map_or(Ok(()), |c| c.check())
    }
}
