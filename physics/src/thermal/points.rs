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
    /// Conductivity of a point, W/(m K).
    pub(super) fn conductivity(&self, point: usize) -> f64 {
        let (m, t) = (self.material[point], self.temperature[point]);
        let liquid = self.curves[m as usize].liquid_fraction(t);
        self.conduction.conductivity(point, m, t, liquid)
    }

    /// Liquidus (K) of a point that is colder, and the conductivity of its melt, W/(m K).
    pub(super) fn melt(&self, point: usize) -> Option<(f64, f64)> {
        let m = self.material[point];
        let liquidus = self.curves[m as usize].latent_heat()?.liquidus;
        let is_colder = self.temperature[point] < liquidus;
        is_colder.then(|| (liquidus, self.conduction.melt_conductivity(m, liquidus)))
    }
}
