//! Super-Gaussian beam of order k: `q = A P k 4^(1/k) / (2 pi w² Gamma(2/k)) exp(-2 (r/w)^k)`
//! (W/m²), A the absorptivity; k = 2 is a Gaussian beam with the 1/e² radius w, large k a top hat.
//! It is absorbed below the surface as `exp(-zeta/l)/l` or evenly down to the depth l.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beam::Beam;
use super::profile::{DepthProfile, Footprint};
use super::{HeatedSurface, Sampling, SourceError, positive, within, yes};

/// A laser beam with an adjustable edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuperGaussian {
    /// Power of the laser where the toolpath gives none (W).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// Part of the laser power that is absorbed, 0 to 1.
    pub absorptivity: f64,
    /// w, radius at which the flux is exp(-2) of its peak (m).
    pub radius: f64,
    /// k, 1 to 50: 2 is a Gaussian, large values approach a top hat; default 2.
    #[serde(default = "gaussian_order")]
    pub order: f64,
    /// l, penetration depth (m). A 2D plate absorbs all of it through its thickness.
    pub penetration_depth: f64,
    /// How the power falls with depth; default `exponential`.
    #[serde(default)]
    pub penetration: Penetration,
    /// Cell average or value at the cell centre; default `cell_average`.
    #[serde(default)]
    pub sampling: Sampling,
    /// Whether the power is made exact; default yes.
    #[serde(default = "yes")]
    pub normalise: bool,
    /// The heated face; default z+ at the height of the toolpath.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

/// How absorbed power falls with depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Penetration {
    /// `exp(-zeta/l)/l`.
    #[default]
    Exponential,
    /// `1/l` down to l.
    Uniform,
}

fn gaussian_order() -> f64 {
    2.0
}

impl SuperGaussian {
    pub(super) fn beam(&self) -> Result<Beam, SourceError> {
        within("absorptivity", self.absorptivity, 0.0, 1.0)?;
        let radius = positive("radius", self.radius)?;
        let order = within("order", self.order, 1.0, 50.0)?;
        let length = positive("penetration_depth", self.penetration_depth)?;
        Ok(Beam {
            footprint: Footprint::super_gaussian(radius, order),
            depth: match self.penetration {
                Penetration::Exponential => DepthProfile::Exponential { length },
                Penetration::Uniform => DepthProfile::Uniform { depth: length },
            },
            plate_depth: None,
            sampling: self.sampling,
            normalise: self.normalise,
            surface: self.heated_surface,
            widest_key: "radius",
        })
    }
}
