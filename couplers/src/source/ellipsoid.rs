//! Semi-ellipsoid and Goldak double ellipsoid, with xi along the travel, eta across, zeta in depth:
//!
//! `q = f q_m exp(-3 xi²/c² - 3 eta²/a² - 3 zeta²/b²)` [W/m³],
//! `q_m = 6 sqrt(3) Q / (a b c pi sqrt(pi))` (Wang (2025), eqs. 7.9, 7.10; the printed q_m lacks
//! the 3 under the root, spec 02, E8: only with it does the half space receive Q).
//!
//! The double ellipsoid has c = c_f, f = f_f in front and c_r, f_r behind with `f_f + f_r = 2`.
//! It is continuous at xi = 0 for `f_f = 2 c_f / (c_f + c_r)`, the default. The semi-ellipsoid is
//! `c_f = c_r`, `f_f = f_r = 1`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beam::Beam;
use super::profile::{DepthProfile, Footprint};
use super::{HeatedSurface, Sampling, SourceError, positive, whole, within, yes};

/// An ellipsoid cut in half by the heated face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SemiEllipsoid {
    /// Power where the toolpath gives none [W].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// Part of the power that enters the body, 0 to 1; default 1.
    #[serde(default = "whole")]
    pub efficiency: f64,
    /// c, half length along the travel direction [m]: exp(-3) of the peak there.
    pub half_length: f64,
    /// a, half width [m].
    pub half_width: f64,
    /// b, depth [m]. A 2D plate heats through its thickness.
    pub depth: f64,
    /// Cell average or value at the cell centre; default `cell_average`.
    #[serde(default)]
    pub sampling: Sampling,
    /// Whether the power is made exact; default yes.
    #[serde(default = "yes")]
    pub normalise: bool,
    /// The heated face; default z_max at the height of the toolpath.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

/// Goldak's double ellipsoid: a short front and a long rear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goldak {
    /// Power where the toolpath gives none [W].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// Part of the power that enters the body, 0 to 1; default 1.
    #[serde(default = "whole")]
    pub efficiency: f64,
    /// c_f, length of the front [m]: exp(-3) of the peak there.
    pub front_length: f64,
    /// c_r, length of the rear [m].
    pub rear_length: f64,
    /// a, half width [m].
    pub half_width: f64,
    /// b, depth [m]. A 2D plate heats through its thickness.
    pub depth: f64,
    /// f_f, 0 to 2: twice the part of the power in front. Default 2 - f_r, or what makes the
    /// density continuous.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front_fraction: Option<f64>,
    /// f_r, 0 to 2: twice the part of the power behind. Default 2 - f_f.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rear_fraction: Option<f64>,
    /// Cell average or value at the cell centre; default `cell_average`.
    #[serde(default)]
    pub sampling: Sampling,
    /// Whether the power is made exact; default yes.
    #[serde(default = "yes")]
    pub normalise: bool,
    /// The heated face; default z_max at the height of the toolpath.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

impl SemiEllipsoid {
    pub(super) fn beam(&self) -> Result<Beam, SourceError> {
        within("efficiency", self.efficiency, 0.0, 1.0)?;
        let length = positive("half_length", self.half_length)?;
        Ok(Beam {
            footprint: Footprint::Ellipse {
                front: length,
                rear: length,
                half_width: positive("half_width", self.half_width)?,
                front_share: 0.5,
            },
            depth: DepthProfile::Bell {
                depth: positive("depth", self.depth)?,
            },
            plate_depth: None,
            sampling: self.sampling,
            normalise: self.normalise,
            surface: self.heated_surface,
            widest_key: "half_length",
        })
    }
}

impl Goldak {
    /// f_f and f_r, given or computed.
    pub fn fractions(&self) -> Result<[f64; 2], SourceError> {
        let front = match (self.front_fraction, self.rear_fraction) {
            (Some(front), Some(rear)) if (front + rear - 2.0).abs() > 1e-9 => {
                return Err(SourceError::Fractions { front, rear });
            }
            (Some(front), _) => within("front_fraction", front, 0.0, 2.0)?,
            (None, Some(rear)) => 2.0 - within("rear_fraction", rear, 0.0, 2.0)?,
            (None, None) => 2.0 * self.front_length / (self.front_length + self.rear_length),
        };
        Ok([front, 2.0 - front])
    }

    pub(super) fn beam(&self) -> Result<Beam, SourceError> {
        within("efficiency", self.efficiency, 0.0, 1.0)?;
        let front = positive("front_length", self.front_length)?;
        let rear = positive("rear_length", self.rear_length)?;
        let [front_fraction, _] = self.fractions()?;
        Ok(Beam {
            footprint: Footprint::Ellipse {
                front,
                rear,
                half_width: positive("half_width", self.half_width)?,
                front_share: 0.5 * front_fraction,
            },
            depth: DepthProfile::Bell {
                depth: positive("depth", self.depth)?,
            },
            plate_depth: None,
            sampling: self.sampling,
            normalise: self.normalise,
            surface: self.heated_surface,
            widest_key: if rear > front {
                "rear_length"
            } else {
                "front_length"
            },
        })
    }
}
