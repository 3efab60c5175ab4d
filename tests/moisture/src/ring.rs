//! A laser whose beam is a ring: a shape of a moving heat source.
use std::rc::Rc;

use perimelt_core::SetupError;
use perimelt_couplers::heat_source::SourceShape;
use perimelt_couplers::heat_source::shape::{
    CellGrid, Density, DensityOnFace, HeatedSurface, PowerDensity,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A beam that is a ring, absorbed evenly down to a depth.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Power where the toolpath gives none (W).
    power: Option<f64>,
    /// Radius of the middle of the ring (m).
    radius: f64,
    /// Half width of the ring (m): the flux is exp(-2) of its peak there.
    half_width: f64,
    /// Depth that absorbs the power (m).
    depth: f64,
    /// The heated face; default z+ at the height of the toolpath.
    #[serde(default)]
    heated_surface: HeatedSurface,
}

impl Density for Ring {
    fn at(&self, x: f64, y: f64, z: f64) -> f64 {
        let off = (x.hypot(y) - self.radius) / self.half_width;
        if z <= self.depth {
            (-2.0 * off * off).exp()
        } else {
            0.0
        }
    }

    fn reach(&self) -> [f64; 3] {
        let lateral = self.radius + 2.5 * self.half_width;
        [lateral, lateral, self.depth]
    }

    fn finest(&self) -> f64 {
        self.half_width
    }
}

impl SourceShape for Ring {
    fn power(&self) -> Option<f64> {
        self.power
    }

    fn efficiency(&self) -> f64 {
        1.0
    }

    fn length(&self) -> f64 {
        self.half_width
    }

    fn surface(&self) -> HeatedSurface {
        self.heated_surface
    }

    fn power_density(&self, _: &CellGrid) -> Result<PowerDensity, SetupError> {
        Ok(PowerDensity::Sampled(DensityOnFace {
            density: Rc::new(self.clone()),
            surface: self.heated_surface,
        }))
    }
}

perimelt_couplers::register_source!("ring_source", RingSource, Ring);
