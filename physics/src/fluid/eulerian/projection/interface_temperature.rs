//! Temperature of the interface between two fluids, as it follows from that of each point of the layer.
//!
//! Where heat flows across the interface, the temperature has a kink there, and the mean of a layer in which both fluids conduct in series
//! differs from that of a sharp interface by the order of its width. With the flux `q = k dT/dn` along the normal into the first fluid
//!
//! ```text
//! T_s = T - q eps [ln(c)/k_2 - ln(1 - c)/k_1],   k grad T = sum_j b xi k_ij (T_j - T_i),   k_ij = 2 k_i k_j / (k_i + k_j)
//! ```
//!
//! since the bracket times eps is the thermal resistance from a sharp interface to a point of the layer: through either fluid it is the distance over
//! the conductivity far from the layer. Not for layers that are heated from inside, where the flux changes across the layer.

use perimelt_core::family::Mirrored;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, SlotField};
use rayon::prelude::*;

use super::Projection;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::fluid::viscosity::of_bond;

/// Fraction of either fluid below which a point lies outside of the layer.
const OUTSIDE: f64 = 1e-4;

/// `sum_j b xi k_ij (T_j - T_i)`, from temperature and conductivity.
struct HeatFlux {
    /// `1 / a`, 1/m.
    inverse: f64,
}

impl<const D: usize> BondKernel<2, D> for HeatFlux {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; D] {
        let conductivity = of_bond::<true>(own[1], other[1]);
        let part = bond.weight * self.inverse * conductivity * (other[0] - own[0]);
        let mut sums = [0.0; D];
        for (sum, xi) in sums.iter_mut().zip(bond.xi) {
            *sum = part * xi;
        }
        sums
    }
}

/// Conductivities of two fluids that conduct in series.
#[derive(Debug)]
pub(in crate::fluid) struct LayeredConductivity {
    /// Of each, W/(m K).
    pub(in crate::fluid) conductivity: [Property; 2],
    /// Enthalpy of the first one, which may melt.
    pub(in crate::fluid) first: EnthalpyCurve,
}

impl LayeredConductivity {
    /// Thermal resistivities of both fluids at a temperature (K), m K/W.
    fn resistivities(&self, temperature: f64) -> [f64; 2] {
        let liquid = self.first.liquid_fraction(temperature);
        let [first, second] = &self.conductivity;
        [first.at(temperature, liquid), second.at(temperature, 0.0)].map(f64::recip)
    }
}

/// Temperature of the interface by point.
#[derive(Debug)]
pub(super) struct InterfaceTemperature {
    /// None where the layer is heated from inside.
    conductivity: Option<LayeredConductivity>,
    /// By slot, K and W/(m K).
    temperature: SlotField,
    mixed: SlotField,
    /// Rows of points, W/m².
    flux: Vec<f64>,
    /// K.
    pub(super) value: Vec<f64>,
}

impl InterfaceTemperature {
    pub(super) fn new(
        conductivity: Option<LayeredConductivity>,
        points: usize,
        dimension: usize,
    ) -> Self {
        InterfaceTemperature {
            conductivity,
            temperature: SlotField::default(),
            mixed: SlotField::default(),
            flux: vec![0.0; points * dimension],
            value: Vec::new(),
        }
    }
}

impl Projection {
    /// Finds the temperature of the interface from those of the points at the start of the step.
    pub(super) fn find_interface_temperature<const D: usize>(
        &self,
        interface: &mut InterfaceTemperature,
    ) {
        let (Some(heat), Some(phase)) = (&self.heat, &self.phase) else {
            return;
        };
        let InterfaceTemperature {
            conductivity,
            temperature: slots,
            mixed,
            flux,
            value,
        } = interface;
        let (temperature, fraction) = (heat.temperature(), &phase.fraction);
        value.clear();
        value.extend_from_slice(temperature);
        let Some(conductivity) = conductivity else {
            return;
        };
        let conductivity_at = |i: usize| {
            let c = fraction[i].clamp(0.0, 1.0);
            let [first, second] = conductivity.resistivities(temperature[i]);
            1.0 / (c * first + (1.0 - c) * second)
        };
        slots.load(&self.family, temperature, Mirrored::Scalar);
        mixed.load(&self.family, conductivity_at, Mirrored::Scalar);
        let (flux, _) = flux.as_chunks_mut::<D>();
        let inverse = self.inverse();
        (self.family).sum(&HeatFlux { inverse }, [&*slots, &*mixed], flux);
        let width = phase.pair.width * self.spacing;
        let points = value.par_iter_mut().zip(&*flux).enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(i, (value, flux))| {
                let c = fraction[i];
                let resistivities = conductivity.resistivities(*value);
                if !(OUTSIDE..=1.0 - OUTSIDE).contains(&c)
                    || !resistivities.iter().all(|r| r.is_finite())
                {
                    return;
                }
                let [first, second] = resistivities;
                let mut across = 0.0;
                for (flux, normal) in flux.iter().zip(phase.normal_in::<D>(self.slot[i])) {
                    across += flux * normal;
                }
                *value -= across * width * (second * c.ln() - first * (1.0 - c).ln());
            });
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::TensionLaw;

    use super::super::tests::{STEEL_AND_GAS, Tank, sides};
    use super::super::thermocapillary::SurfaceLaws;
    use super::super::thermocapillary::tests::heat;
    use super::*;

    /// All points of a plane layer through which heat flows have the temperature of the sharp interface, whatever the conductivities.
    #[test]
    fn points_of_a_layer_know_the_temperature_of_the_interface() {
        for conductivity in [[1.0, 2.0], [2.0, 1.0], [50.0, 1.0]] {
            let (n, flux) = (32, 3.0);
            let mut tank = Tank::with(2, n, sides(2), 2.015, Some(STEEL_AND_GAS));
            let spacing = 1.0 / n as f64;
            let width = STEEL_AND_GAS.width * spacing;
            let fraction = |y: f64| 1.0 / (1.0 + (-(y - 0.51) / width).exp());
            let resistivity = |y: f64| {
                let c = fraction(y);
                c / conductivity[0] + (1.0 - c) / conductivity[1]
            };
            // the first fluid is hot: heat flows downwards through halves of bonds in series
            let mut temperature = vec![300.0 + flux * (0.5 * spacing - 0.51) / conductivity[1]];
            for row in 1..n {
                let [below, here] = [row - 1, row].map(|row| (row as f64 + 0.5) * spacing);
                let rise = 0.5 * flux * spacing * (resistivity(below) + resistivity(here));
                temperature.push(temperature[row - 1] + rise);
            }
            let metal = EnthalpyCurve::new(1.0, &Property::Constant(1.0), None);
            let laws = SurfaceLaws {
                interface: Some(TensionLaw::linear(5.0, 300.0, -1.0)),
                conductivity: Some(LayeredConductivity {
                    conductivity: conductivity.map(Property::Constant),
                    first: metal.expect("valid"),
                }),
                faces: Vec::new(),
            };
            let row = |y: f64| (y / spacing) as usize;
            heat(&mut tank, laws, |x| temperature[row(x.y)]);
            let places = &tank.body.points.position;
            let fractions: Vec<f64> = places.iter().map(|x| fraction(x.y)).collect();
            tank.rates.set_fraction(&fractions);
            (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
            let scale = flux * width * (1.0 / conductivity[0] - 1.0 / conductivity[1]).abs();
            for (point, place) in tank.body.points.position.iter().enumerate() {
                if (place.y - 0.51).abs() < 3.0 * spacing {
                    // gamma = 5 - (T - 300)
                    let found = 305.0 - tank.rates.state.tension[point];
                    let error = (found - 300.0) / scale;
                    // a sum over points and an integral differ by dx^2/12 times the slope of the resistivity, 0.04 of the scale
                    assert!(error.abs() < 0.05, "{conductivity:?} {}: {error}", place.y);
                }
            }
        }
    }
}
