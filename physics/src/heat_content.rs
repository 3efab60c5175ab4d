//! Enthalpy of the matter of points: that of their materials, or of a mixture of two fluids.
//!
//! ```text
//! h = c h_1(T) + (1 - c) h_2(T)        J/m³, with the fraction c of the first fluid
//! ```
//!
//! The fraction may lie outside of 0 to 1 by a thousandth, so that a mixture has a capacity as long as those of the two fluids differ by
//! less than [`LARGEST_RATIO`], also where the first one melts. Not for: fluids that melt at one temperature.

use perimelt_core::material::EnthalpyCurve;

/// Largest ratio of the heat capacities per volume of two fluids.
pub(crate) const LARGEST_RATIO: f64 = 500.0;

/// Steps of Newton's method for a temperature; one is enough where capacities are constant.
const MOST_STEPS: usize = 50;

/// What the enthalpy of points depends on.
#[derive(Clone, Copy)]
pub(crate) struct HeatContent<'a> {
    /// By material.
    pub(crate) curves: &'a [EnthalpyCurve],
    /// Of each point.
    pub(crate) material: &'a [u16],
    /// Where there are two fluids.
    pub(crate) mixture: Option<Mixture<'a>>,
}

/// Two fluids at the points.
#[derive(Clone, Copy)]
pub(crate) struct Mixture<'a> {
    pub(crate) materials: [u16; 2],
    /// Of the first one, by point.
    pub(crate) fraction: &'a [f64],
}

impl HeatContent<'_> {
    fn curve(&self, point: usize) -> &EnthalpyCurve {
        &self.curves[self.material[point] as usize]
    }

    /// Enthalpies of the first and of the second fluid at a temperature (K), J/m³; that of a single one is the second.
    pub(crate) fn of_fluids(&self, point: usize, temperature: f64) -> [f64; 2] {
        match self.mixture {
            None => [0.0, self.curve(point).enthalpy(temperature)],
            Some(Mixture { materials, .. }) => {
                materials.map(|m| self.curves[m as usize].enthalpy(temperature))
            }
        }
    }

    /// Enthalpy at a temperature (K), J/m³.
    pub(crate) fn enthalpy(&self, point: usize, temperature: f64) -> f64 {
        let [first, second] = self.of_fluids(point, temperature);
        match self.mixture {
            None => second,
            Some(Mixture { fraction, .. }) => second + fraction[point] * (first - second),
        }
    }

    /// Temperature at an enthalpy (J/m³), K; `near` is one from which a mixture is searched, K.
    pub(crate) fn temperature(&self, point: usize, enthalpy: f64, near: f64) -> f64 {
        let Some(Mixture {
            materials,
            fraction,
        }) = self.mixture
        else {
            return self.curve(point).temperature(enthalpy);
        };
        let mut temperature = near;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for _ in 0..MOST_STEPS {
            let [first, second] = materials.map(|m| self.curves[m as usize].capacity(temperature));
            let capacity = second + fraction[point] * (first - second);
            let missing = (enthalpy - self.enthalpy(point, temperature)) / capacity;
            let next = temperature + missing;
            // the error that is left is of the order of its square
            if missing.abs() <= 1e-9 * temperature.abs() {
                return next;
            }
            match missing > 0.0 {
                true => low = low.max(temperature),
                false => high = high.min(temperature),
            }
            // where the capacity jumps at solidus and liquidus, Newton's method may go to and fro between both sides
            temperature = match next < high && next > low {
                true => next,
                false if low.is_finite() && high.is_finite() => 0.5 * (low + high),
                false => next,
            };
        }
        temperature
    }

    /// Temperature (K) and enthalpy (J/m³) after adding `heat` (J/m³).
    #[inline]
    pub(crate) fn advance(
        &self,
        point: usize,
        temperature: f64,
        enthalpy: f64,
        heat: f64,
    ) -> (f64, f64) {
        match self.mixture {
            None => self.curve(point).advance(temperature, enthalpy, heat),
            Some(_) => {
                let enthalpy = enthalpy + heat;
                (self.temperature(point, enthalpy, temperature), enthalpy)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::material::{LatentHeat, LatentHeatForm, MushyCapacity, Property, Table};

    /// A metal that melts and a gas, from far on both sides of the melting range.
    #[test]
    fn the_temperature_of_a_mixture_that_melts_is_that_of_its_enthalpy() {
        let latent = LatentHeat {
            solidus: 1658.0,
            liquidus: 1723.0,
            latent_heat: 2.7e5,
            mushy_capacity: MushyCapacity::default(),
            form: LatentHeatForm::default(),
        };
        let metal = EnthalpyCurve::new(7900.0, &Property::Constant(700.0), Some(latent));
        let gas = EnthalpyCurve::new(80.0, &Property::Constant(1000.0), None);
        let curves = [metal.expect("valid"), gas.expect("valid")];
        let fraction = [0.0, 0.01, 0.5, 1.0, 1.0005, -0.0005];
        let content = HeatContent {
            curves: &curves,
            material: &[0; 6],
            mixture: Some(Mixture {
                materials: [0, 1],
                fraction: &fraction,
            }),
        };
        for point in 0..fraction.len() {
            for temperature in [300.0, 1657.9, 1658.0, 1690.0, 1722.9, 1723.1, 4000.0] {
                let enthalpy = content.enthalpy(point, temperature);
                for near in [300.0, 1600.0, 1700.0, 1800.0, 5000.0] {
                    let found = content.temperature(point, enthalpy, near);
                    assert!(
                        (found / temperature - 1.0).abs() < 1e-12,
                        "{point}: {found} for {temperature} from {near}"
                    );
                }
            }
        }
    }

    /// Between a fluid of constant capacity and one whose capacity grows threefold, also a little outside of 0 to 1.
    #[test]
    fn the_temperature_of_a_mixture_is_that_of_its_enthalpy() {
        let table = Table::new(vec![300.0, 400.0, 900.0], vec![100.0, 250.0, 300.0]);
        let rising = Property::Table(table.expect("valid rows"));
        let curves = [(2.0, Property::Constant(50.0)), (3.0, rising)];
        let curves = curves.map(|(density, specific_heat)| {
            EnthalpyCurve::new(density, &specific_heat, None).expect("valid")
        });
        let fraction = [0.0, 0.3, 1.0, 1.001, -0.001];
        let content = HeatContent {
            curves: &curves,
            material: &[0; 5],
            mixture: Some(Mixture {
                materials: [0, 1],
                fraction: &fraction,
            }),
        };
        for (point, c) in fraction.into_iter().enumerate() {
            for temperature in [250.0, 399.0, 650.0, 1200.0] {
                let enthalpy = content.enthalpy(point, temperature);
                let [first, second] = content.of_fluids(point, temperature);
                assert!((enthalpy - c * first - (1.0 - c) * second).abs() < 1e-9);
                let found = content.temperature(point, enthalpy, 293.15);
                assert!((found / temperature - 1.0).abs() < 1e-13, "{c}: {found}");
                let (after, _) = content.advance(point, temperature, enthalpy, 700.0);
                let gained = content.enthalpy(point, after) - enthalpy;
                assert!((gained - 700.0).abs() < 1e-8, "{c}: {gained}");
            }
        }
    }
}
