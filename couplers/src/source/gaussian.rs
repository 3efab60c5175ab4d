//! Surface Gaussian `q = q_m exp(-r²/(2 sigma²))` (W/m²), `q_m = Q/(2 pi sigma²)`, turned into a
//! volume source `h = q / h_eff` (Wang (2025), eqs. 7.7, 7.8, 7.33).
//!
//! In 3D the power is spread evenly over the effective depth below the heated face. A 2D plate of
//! thickness H receives `h` throughout, hence the power `Q H / h_eff`: it is Q only for
//! `h_eff = H`, the default there. The thesis takes `h_eff = dx` and so deposits Q H/dx; the
//! power asked for that is logged is `Q H / h_eff`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beam::Beam;
use super::profile::{DepthProfile, Footprint};
use super::{
    ArcProcess, CellGrid, HeatedSurface, Sampling, SourceError, arc_efficiency, default_normalise,
    positive,
};

/// A Gaussian on the surface with an effective depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaussian {
    /// Power where the toolpath gives none (W).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
    /// Part of the power that enters the body, 0 to 1; default that of `process`, else 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub efficiency: Option<f64>,
    /// Arc process, whose efficiency counts where `efficiency` is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process: Option<ArcProcess>,
    /// Standard deviation (m): the flux falls to exp(-1/2) of its peak there.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sigma: f64,
    /// Depth over which the flux is spread (m); a 2D plate may leave it out and takes its
    /// thickness, the only depth that conserves the power there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub effective_depth: Option<f64>,
    /// Cell average or value at the cell centre; default `cell_average`.
    #[serde(default)]
    pub sampling: Sampling,
    /// Whether the power is made exact; default yes.
    #[serde(default = "default_normalise")]
    pub normalise: bool,
    /// The heated face; default z+ at the height of the toolpath.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

impl Gaussian {
    pub(super) fn beam(&self, grid: &CellGrid) -> Result<Beam, SourceError> {
        arc_efficiency(self.efficiency, self.process)?;
        let axis = self.heated_surface.face.axis();
        let depth = match self.effective_depth {
            Some(depth) => positive("effective_depth", depth)?,
            None if grid.is_thickness(axis) => grid.spacing[axis],
            None => return Err(SourceError::EffectiveDepth),
        };
        Ok(Beam {
            // exp(-r²/2 sigma²) = exp(-3 r²/c²)
            footprint: Footprint::round(6_f64.sqrt() * positive("sigma", self.sigma)?),
            depth: DepthProfile::Uniform { depth },
            plate_depth: Some(depth),
            sampling: self.sampling,
            normalise: self.normalise,
            surface: self.heated_surface,
            widest_key: "sigma",
        })
    }
}
