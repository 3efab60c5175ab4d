//! The longest step of a fluid that keeps its volume.

use nalgebra::Vector3;

use super::Projection;
use super::flow::largest;
use super::phase::Phase;
use crate::fluid::rates::Rates;

/// Largest way of the fluid in a step, in spacings.
const LARGEST_WAY: f64 = 0.4;

impl Projection {
    /// Largest step (s) for this velocity of the fluid (m/s): viscosity as in other fluids, and a way of [`LARGEST_WAY`] of the
    /// fluid and of the walls, also under the forces of the last step.
    pub(in crate::fluid) fn stable_step(&self, velocity: &[Vector3<f64>], diffusivity: f64) -> f64 {
        let diffusivity = (self.phase.as_ref()).map_or(diffusivity, |p| p.pair.diffusivity());
        let speed = largest(velocity).max(self.state.wall_speed);
        let way = self.largest_way();
        let half = 0.5 * (largest(&self.state.acceleration) + self.state.surface_acceleration);
        let by_way = 2.0 * way / (speed + (speed * speed + 4.0 * half * way).sqrt());
        let by_viscosity = 1.0 / (self.stability().laplacian * diffusivity);
        let by_layer = self.layer_way().map_or(f64::INFINITY, |(phase, way)| {
            way / phase.least_mobility(self.spacing)
        });
        by_way
            .min(by_viscosity)
            .min(by_layer)
            .min(self.capillary_step())
    }

    /// Largest way of the fluid in a step, m.
    fn largest_way(&self) -> f64 {
        let of_layer = self
            .layer_way()
            .map_or(f64::INFINITY, |(phase, way)| way / phase.pair.mobility());
        of_layer.min(LARGEST_WAY * self.spacing)
    }

    /// The layer between two fluids, and the largest step times the speed at which it is kept thin, m: this diffuses the fraction, explicitly.
    fn layer_way(&self) -> Option<(&Phase, f64)> {
        const SAFETY: f64 = 0.9;
        let phase = self.phase.as_ref()?;
        let eps = phase.pair.width * self.spacing;
        let laplacian = 2.0 * self.inverse() * self.complete.content;
        Some((phase, SAFETY / (laplacian * eps)))
    }

    /// Largest step (s) that capillary waves allow (Brackbill et al. (1992)).
    pub(in crate::fluid) fn capillary_step(&self) -> f64 {
        let tension = |phase: &Phase| phase.pair.capillary_step(self.spacing);
        self.phase.as_ref().map_or(f64::INFINITY, tension)
    }
}
