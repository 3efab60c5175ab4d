//! The `[[physics]]` table of heat. Keys that are left out and have no default here belong to some forms, solvers and points only
//! ([`ThermalKeys`](super::kinds::ThermalKeys)).

use perimelt_core::law::Law;
use perimelt_core::{Correction, Horizon, PartialVolume, StepSize, Update};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::advection::Convection;

use super::conductivity::AnyConductivity;

/// Heat conduction, and convection with an Eulerian fluid; owns `temperature` and `enthalpy`, consumes `heat_source`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thermal {
    /// Body that conducts; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Law of conductivity; when left out `fourier`, the property `conductivity` of the material. Laws with directions need
    /// `form = "ordinary"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conductivity: Option<Law<dyn AnyConductivity>>,
    /// How the divergence of the heat flux becomes a sum.
    #[serde(default)]
    pub form: Form,
    /// Horizon in spacings of each point, or `{ length = ... }` in m, the same everywhere; when left out 3, and in an
    /// Eulerian flow that of a `fluid` without one, 2.015. On a lattice 1 is the classical stencil of nearest neighbours,
    /// the least expensive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<Horizon>,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Calibration of the bonds; when left out "point", or "lattice" where points move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// Stabilisation of zero-energy modes of `form = "ordinary"`, 0 to 1: how strongly temperatures are drawn to the mean
    /// gradient of their family. With 1 a complete calibrated family conducts as in the form of bonds; with 0 nothing
    /// removes temperatures that alternate from point to point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 1.0, "minimum" = 0, "maximum" = 1))]
    pub stabilisation: Option<f64>,
    /// Heat flow across broken bonds of the mechanics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "insulate"))]
    pub broken_bonds: Option<BrokenConduction>,
    /// Whether the faces of the body continue in mirrored layers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "auto"))]
    pub surfaces: Option<Surfaces>,
    /// Stabilisation of the convective terms in an Eulerian fluid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = "hybrid"))]
    pub convection: Option<Convection>,
    /// Time integration.
    #[serde(default)]
    pub solver: ThermalSolver,
    /// Relative accuracy of the implicit and steady solvers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 1e-10, "exclusiveMinimum" = 0))]
    pub tolerance: Option<f64>,
    /// Largest error in time of a step of `rkl2`, `implicit` and `crank_nicolson`, over the difference of temperature that
    /// the body has had so far. Longer steps are divided; without an effect on stability.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 1e-3, "exclusiveMinimum" = 0))]
    pub time_tolerance: Option<f64>,
    /// Step in s, or "auto".
    #[serde(default)]
    pub step: StepSize,
    /// Advance in every macro `step`, or once per `log` interval.
    #[serde(default)]
    pub update: Update,
}

/// How the divergence of the heat flux becomes a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Each bond carries heat: heat is conserved to rounding, surfaces may be of any shape.
    #[default]
    Bonds,
    /// Ordinary state-based: the heat flow of a bond also depends on the mean gradients at both ends, so that a family of
    /// any shape, at a bare surface or beside a crack, has the conductivity of its material without a correction. Heat is
    /// conserved to rounding;
    /// a step costs about three times as much. The conductivity of a bond is the mean of its ends.
    Ordinary,
    /// `k lap T + grad k . grad T` with second derivatives of the differential operator, as published (Gao (2020),
    /// eq. 5.65): second order also at mirrored faces, but heat is conserved only as far as the derivatives are
    /// exact. For bodies that fill their box and whose points stay.
    SecondDerivatives,
}

/// Whether heat crosses a crack that the mechanics opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BrokenConduction {
    /// Points whose mechanical bond broke exchange no heat.
    #[default]
    Insulate,
    /// Heat flows as if no bond had broken.
    Conduct,
}

/// What lies behind the faces of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Surfaces {
    /// Mirrored where the body fills its box, bare elsewhere.
    #[default]
    Auto,
    /// A mirrored layer behind every face of the box.
    Mirrored,
    /// Nothing, except for layers that boundaries ask for.
    Bare,
}

/// How heat is stepped in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThermalSolver {
    /// Forward Euler, as published; the step is limited.
    #[default]
    Explicit,
    /// Stabilised explicit (Runge-Kutta-Legendre, second order): steps far above the explicit
    /// limit for the square root of the work; best for long coolings.
    Rkl2,
    /// Implicit Euler, Newton-Krylov: any step, first order.
    Implicit,
    /// Crank-Nicolson, Newton-Krylov: any step, second order, for smooth data.
    CrankNicolson,
    /// The steady state under the present sources and boundaries.
    Steady,
}
