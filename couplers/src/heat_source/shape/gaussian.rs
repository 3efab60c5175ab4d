//! Surface Gaussian `q = q_m exp(-r²/(2 sigma²))` (W/m²), `q_m = Q/(2 pi sigma²)`, turned into a
//! volume source `h = q / h_eff` (Wang (2025), eqs. 7.7, 7.8, 7.33).
//!
//! In 3D the power is spread evenly over the effective depth below the heated face. A 2D plate of
//! thickness H receives `h` throughout, hence the power `Q H / h_eff`: it is Q only for
//! `h_eff = H`, the default there. The thesis takes `h_eff = dx` and so deposits Q H/dx; the
//! power asked for that is logged is `Q H / h_eff`.

use perimelt_core::{SetupError, flattened};

use super::beam::Beam;
use super::profile::{DepthProfile, Footprint};
use super::{ArcPower, CellGrid, CellSampling, HeatedSurface, PowerDensity, SourceShape};
use perimelt_core::numbers::check_positive;

flattened! {
    /// A Gaussian on the surface with an effective depth.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Gaussian {
        ..supplied: ArcPower,
        ..sampled: CellSampling,
        /// Standard deviation (m): the flux falls to exp(-1/2) of its peak there.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub sigma: f64,
        /// Depth over which the flux is spread (m); a 2D plate may leave it out and takes its
        /// thickness, the only depth that conserves the power there.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub effective_depth: Option<f64>,
    }
}

impl SourceShape for Gaussian {
    fn power(&self) -> Option<f64> {
        self.supplied.power
    }

    fn efficiency(&self) -> f64 {
        self.supplied.efficiency()
    }

    fn length(&self) -> f64 {
        self.sigma
    }

    fn surface(&self) -> HeatedSurface {
        self.sampled.heated_surface
    }

    fn power_density(&self, grid: &CellGrid) -> Result<PowerDensity, SetupError> {
        let axis = self.sampled.heated_surface.face.axis();
        let depth = match self.effective_depth {
            Some(depth) => check_positive("effective_depth", depth, "m")?,
            None if grid.is_thickness(axis) => grid.spacing[axis],
            None => {
                let message = "a surface source on a 3D body needs `effective_depth`";
                return Err(SetupError::value(
                    "effective_depth",
                    message,
                    "the depth it heats, m",
                ));
            }
        };
        Ok(PowerDensity::Beam(Beam {
            // exp(-r²/2 sigma²) = exp(-3 r²/c²)
            footprint: Footprint::round(6_f64.sqrt() * check_positive("sigma", self.sigma, "m")?),
            depth: DepthProfile::Uniform { depth },
            plate_depth: Some(depth),
            sampled: self.sampled.clone(),
            widest_key: "sigma",
        }))
    }
}
