//! Conductivity of points at their temperatures.

use perimelt_core::material::EnthalpyCurve;

use super::conduction::Conduction;

/// Points with their temperatures, K.
#[derive(Clone, Copy)]
pub(super) struct ConductingPoints<'a> {
    pub(super) conduction: &'a Conduction,
    /// Enthalpy curves by material.
    pub(super) curves: &'a [EnthalpyCurve],
    /// Material of each point.
    pub(super) material: &'a [u16],
    pub(super) temperature: &'a [f64],
}

impl ConductingPoints<'_> {
    /// Conductivity of a point along an axis, W/(m K); the mean over all axes for materials with directions of their own.
    pub(super) fn conductivity_along(&self, point: usize, axis: usize) -> f64 {
        let (m, t) = (self.material[point], self.temperature[point]);
        let liquid = self.curves[m as usize].liquid_fraction(t);
        self.conduction
            .conductivity_along(point, axis, m, t, liquid)
    }

    /// Liquidus (K) of a point that is colder, and the conductivity of its melt along an axis, W/(m K).
    pub(super) fn melt(&self, point: usize, axis: usize) -> Option<(f64, f64)> {
        let m = self.material[point];
        let liquidus = self.curves[m as usize].latent_heat()?.liquidus;
        let is_colder = self.temperature[point] < liquidus;
        let melt = || self.conduction.melt_conductivity(point, axis, m, liquidus);
        is_colder.then(|| (liquidus, melt()))
    }
}
