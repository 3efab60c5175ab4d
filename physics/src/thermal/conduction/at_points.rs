//! Conductivity of points.

use super::Conduction;

impl Conduction {
    /// Conductivity of a point of a material at a temperature (K) and liquid fraction, W/(m K); the mean over its axes where it has
    /// directions.
    pub(in crate::thermal) fn conductivity(
        &self,
        point: usize,
        material: u16,
        temperature: f64,
        liquid: f64,
    ) -> f64 {
        let m = material as usize;
        if let Some(directions) = &self.directions {
            return directions.mean(m, temperature, liquid);
        }
        if let Some(fluids) = &self.fluids {
            return fluids.at(&self.conductivity, point, temperature);
        }
        let mut conductivity = self.conductivity[m].at(temperature, liquid);
        if let Some(austenite) = &self.austenite {
            conductivity = austenite.mixed(point, m, temperature, conductivity, 1.0 - liquid);
        }
        if let Some(powder) = &self.powder {
            conductivity = powder.mixed(point, m, temperature, conductivity, 1.0);
        }
        conductivity
    }

    /// [`Conduction::conductivity`], of plies along an axis of space.
    pub(in crate::thermal) fn conductivity_along(
        &self,
        point: usize,
        axis: usize,
        material: u16,
        temperature: f64,
        liquid: f64,
    ) -> f64 {
        match &self.plies {
            Some(plies) => plies.along(point, axis, material, temperature, liquid),
            None => self.conductivity(point, material, temperature, liquid),
        }
    }

    /// Conductivity of molten material at a temperature along an axis of space, W/(m K): what was powder is dense.
    pub(in crate::thermal) fn melt_conductivity(
        &self,
        point: usize,
        axis: usize,
        material: u16,
        temperature: f64,
    ) -> f64 {
        match &self.plies {
            Some(plies) => plies.along(point, axis, material, temperature, 1.0),
            None => self.conductivity[material as usize].at(temperature, 1.0),
        }
    }

    /// The largest conductivity of a point along an axis of space, W/(m K).
    pub(in crate::thermal) fn largest_conductivity_along(
        &self,
        point: usize,
        axis: usize,
        material: u16,
    ) -> f64 {
        match &self.plies {
            Some(plies) => plies.largest_along(point, axis, material),
            None => self.largest[material as usize],
        }
    }

    /// Largest conductivity of a material, W/(m K).
    pub(in crate::thermal) fn largest_conductivity(&self, material: u16) -> f64 {
        self.largest[material as usize]
    }
}
