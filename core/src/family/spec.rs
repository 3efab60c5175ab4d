//! Description of the family that a physics requests, and errors in it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::body::{Body, Face};
use crate::explanation::Explanation;

use super::Influence;
use crate::body::Horizon;

/// Ties such as |xi| = 3 dx belong to the family whatever the rounding, relative.
pub(super) const TIE: f64 = 1e-9;

/// Partial volume of members near the edge of the horizon (Wang (2025), eq. 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartialVolume {
    /// Members with `|xi| <= horizon`, full volumes.
    None,
    /// Members with `|xi| <= horizon`; within half a spacing of the edge the volume falls
    /// linearly to one half.
    #[default]
    Half,
    /// Members with `|xi| < horizon + spacing / 2`; the volume falls linearly to zero.
    Full,
}

/// How the bonds of a discrete family are corrected. `lattice`, `point` and `uniaxial` reproduce the classical
/// energy of conduction, and that of elasticity under isotropic (`uniaxial`: uniaxial) strain; other strains then
/// differ from the continuum by the anisotropy of the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Correction {
    /// The continuum constants as they are.
    None,
    /// One factor for all bonds, so that a complete family is exact. On a cloud one for each point, so that its own family
    /// is exact on the mean of all directions.
    Lattice,
    /// Like `lattice`, but on a cloud the factor of each point is that of a complete family among points of its own spacing,
    /// the calibration of regions of published dual-horizon models (docs/theory/heat_conduction.md). Beside an
    /// interface, and behind bare surfaces, no family is exact.
    Zone,
    /// Factors for each point, so that its own family is exact also where a bare surface cuts it
    /// (after Wang (2025), eqs. 4.4 to 4.8); a bond takes the mean of its ends.
    #[default]
    Point,
    /// Like `point`, and on a cloud bonds have factors of their own with which a linear field is in equilibrium at every
    /// point that no bare surface is near, also where spacings and horizons change. For conduction.
    Balanced,
    /// Like `point`, but elasticity is exact under uniaxial strain along each axis, as published.
    Uniaxial,
    /// One factor for each point, the volume of a complete family over that of its members (Gao (2020), 7.3.2, given
    /// in the text only; docs/theory/fluid_structure.md, "Thin solids"); a bond takes the mean of its ends. No energy
    /// is exact: a plate of four points across its thickness bends with an error of 3 to 8 %, without correction
    /// twice too far.
    Volume,
}

impl Correction {
    /// Whether each point has factors of its own.
    pub(super) fn is_by_point(self) -> bool {
        matches!(
            self,
            Correction::Point | Correction::Balanced | Correction::Uniaxial | Correction::Volume
        )
    }
}

/// Description of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct FamilySpec {
    /// Radius.
    pub horizon: Horizon,
    /// Rule for members at the edge.
    pub partial_volume: PartialVolume,
    /// Influence of members by their distance.
    pub influence: Influence,
    /// Correction of the bonds.
    pub correction: Correction,
    /// Faces behind which the body continues as a mirrored layer.
    pub layers: Vec<Face>,
    /// Faces of `layers` whose exchange with the body is summed ([`crate::Family::sum_from_layers`]).
    pub audited: Vec<Face>,
}

impl Default for FamilySpec {
    /// A family that reaches nothing.
    fn default() -> Self {
        FamilySpec::new(0.0)
    }
}

impl FamilySpec {
    /// A family with a horizon in m, all else by default, and nothing behind the faces.
    pub fn new(horizon: f64) -> Self {
        FamilySpec {
            horizon: Horizon::Length(horizon),
            partial_volume: PartialVolume::default(),
            influence: Influence::default(),
            correction: Correction::default(),
            layers: Vec::new(),
            audited: Vec::new(),
        }
    }

    /// The usual family: a horizon in spacings of each point, default partial volumes and
    /// correction, and, where the body fills its box, mirrored layers behind all faces.
    pub fn mirrored(body: &Body, horizon: f64) -> Self {
        let fills_box = body.fills_box();
        let is_mirrored = |face: &Face| fills_box && face.axis() < body.dimension;
        FamilySpec {
            horizon: Horizon::Spacings(horizon),
            layers: Face::ALL.into_iter().filter(is_mirrored).collect(),
            ..FamilySpec::new(horizon)
        }
    }

    /// How far a point with this horizon (m) holds others of this spacing (m), m.
    #[inline(always)]
    pub(super) fn reach(&self, horizon: f64, spacing: f64) -> f64 {
        match self.partial_volume {
            PartialVolume::Full => horizon + (0.5 - TIE) * spacing,
            _ => horizon * (1.0 + TIE),
        }
    }

    /// Influence times partial volume of a member of this spacing (m) at a distance (m) in a family
    /// of this horizon (m); zero beyond.
    pub(super) fn share(&self, horizon: f64, spacing: f64, length: f64) -> f64 {
        self.shares(horizon, [spacing], [length])[0]
    }

    /// [`FamilySpec::share`] of several members, side by side.
    #[inline(always)]
    pub(super) fn shares<const N: usize>(
        &self,
        horizon: f64,
        spacing: [f64; N],
        length: [f64; N],
    ) -> [f64; N] {
        let mut shares = self.influence.at_all(length.map(|l| l / horizon));
        if self.partial_volume != PartialVolume::None {
            for n in 0..N {
                let inside = horizon + 0.5 * spacing[n] - length[n];
                shares[n] *= (inside / spacing[n]).min(1.0);
            }
        }
        for n in 0..N {
            let reached = length[n] <= self.reach(horizon, spacing[n]);
            shares[n] = if reached { shares[n] } else { 0.0 };
        }
        shares
    }

    /// `integral of w |xi| n_m^2 dV` over a full horizon (m) on `body`, along any axis m, with the
    /// influence function w, m⁴ (3D). Weights of bonds are divided by it, and [`Correction`] restores it. The energy of
    /// conduction under a uniform gradient and that of elasticity under isotropic strain contain this moment.
    pub fn moment(&self, body: &Body, horizon: f64) -> f64 {
        self.integral(body, horizon, 1) / body.dimension as f64
    }

    /// Volume of a full horizon (m) on `body`, weighted with the influence function w, `integral of w dV`, m³.
    pub fn volume(&self, body: &Body, horizon: f64) -> f64 {
        self.integral(body, horizon, 0)
    }

    /// `integral of w |xi|^power dV` over a full horizon (m).
    fn integral(&self, body: &Body, horizon: f64, power: i32) -> f64 {
        use std::f64::consts::PI;
        let solid_angle = [2.0, 2.0 * PI, 4.0 * PI][body.dimension - 1];
        let power = body.dimension as i32 + power;
        let thickness = if body.dimension == 3 {
            1.0
        } else {
            body.thickness
        };
        solid_angle * self.influence.radial_moment(power) * horizon.powi(power) * thickness
    }
}

/// Mistakes in a family's description.
#[derive(Debug, thiserror::Error)]
pub enum FamilyError {
    /// The horizon is smaller than the distance to the nearest neighbour.
    #[error(
        "the horizon {horizon} m is below the spacing {spacing} m: every family would be empty"
    )]
    HorizonTooSmall {
        /// Horizon, m.
        horizon: f64,
        /// Spacing, m.
        spacing: f64,
    },
    /// Too many bonds.
    #[error("the horizon holds {bonds} neighbours of every point: choose a smaller one")]
    HorizonTooLarge {
        /// Bonds of a complete family.
        bonds: usize,
    },
    /// The points of a body in a tank do not move.
    #[error("the body has a `tank`, but its points keep their neighbours")]
    Tank,
    /// Points in layers have families in their own layer only.
    #[error(
        "the points of a lay-up have bonds within their ply and between plies, not with all points around them"
    )]
    Layers,
    /// The description of a family of moving points has something unsupported.
    #[error("a family of moving points does not support {what}")]
    Moving {
        /// What is not supported.
        what: &'static str,
        /// What is supported.
        expected: &'static str,
    },
    /// The description of a growing family has something unsupported.
    #[error("material is deposited on bodies with a lattice; {0} are not supported there")]
    Growing(&'static str),
    /// No factors of the bonds put a linear field in equilibrium.
    #[error("no positive factors of the bonds put a linear field in equilibrium ({reason})")]
    NotBalanced {
        /// What went wrong.
        reason: String,
    },
    /// Two points in one place.
    #[error("two points lie at ({}, {}, {}) m", at[0], at[1], at[2])]
    Coincident {
        /// Position, m.
        at: [f64; 3],
    },
    /// A point without a bond.
    #[error("the point at ({}, {}, {}) m has no neighbour within the horizon {horizon} m", at[0], at[1], at[2])]
    NoNeighbours {
        /// Position, m.
        at: [f64; 3],
        /// Horizon, m.
        horizon: f64,
    },
}

impl FamilyError {
    /// The mistake in words.
    pub fn explain(&self) -> Explanation {
        let explanation = Explanation::new(self.to_string());
        match self {
            FamilyError::Tank => explanation.expected("`description = \"updated_lagrangian\"`"),
            FamilyError::Layers => explanation.expected("a body without `layup`"),
            FamilyError::Moving { expected, .. } => explanation.expected(expected),
            FamilyError::NotBalanced { .. } => explanation.help("use `correction = \"point\"`"),
            _ => explanation,
        }
    }
}
