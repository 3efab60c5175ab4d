//! The quadratic pieces of an enthalpy curve and how they follow from the specific heat.

use super::{LatentHeat, MushyCapacity, REFERENCE_TEMPERATURE};
use crate::material::property::Property;

/// h = enthalpy + capacity d + slope d²/2 with d = θ − temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    pub temperature: f64,
    pub enthalpy: f64,
    pub capacity: f64,
    pub slope: f64,
}

impl Piece {
    pub fn constant(temperature: f64, capacity: f64) -> Self {
        Self {
            temperature,
            enthalpy: 0.0,
            capacity,
            slope: 0.0,
        }
    }

    pub fn enthalpy(&self, temperature: f64) -> f64 {
        let d = temperature - self.temperature;
        self.enthalpy + d * (self.capacity + 0.5 * self.slope * d)
    }

    /// Root of slope d²/2 + capacity d = h − enthalpy in the form without cancellation.
    pub fn temperature(&self, enthalpy: f64) -> f64 {
        let gain = enthalpy - self.enthalpy;
        if self.slope == 0.0 {
            return self.temperature + gain / self.capacity;
        }
        let root = (self.capacity * self.capacity + 2.0 * self.slope * gain)
            .max(0.0)
            .sqrt();
        self.temperature + 2.0 * gain / (self.capacity + root)
    }

    pub fn capacity(&self, temperature: f64) -> f64 {
        self.capacity + self.slope * (temperature - self.temperature)
    }
}

const SOLID: f64 = 0.0;
const LIQUID: f64 = 1.0;

/// C(θ) (J/(m³ K)) as it is given.
pub struct VolumetricCapacity<'a> {
    pub density: f64,
    pub specific_heat: &'a Property,
    pub latent: Option<LatentHeat>,
}

impl VolumetricCapacity<'_> {
    /// Temperatures between which the capacity is linear; the temperature of isothermal melting occurs twice.
    pub fn knots(&self) -> Vec<f64> {
        let mut knots = self.specific_heat.temperatures();
        match self.latent {
            None => knots.push(REFERENCE_TEMPERATURE),
            Some(latent) => {
                let mushy_is_linear = latent.mushy_capacity == MushyCapacity::LatentOnly
                    || self.specific_heat.is_by_phase();
                knots.retain(|&knot| {
                    !mushy_is_linear || knot < latent.solidus || knot > latent.liquidus
                });
                knots.extend([latent.solidus, latent.liquidus]);
            }
        }
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        if let Some(latent) = self
            .latent
            .filter(|latent| latent.solidus == latent.liquidus)
        {
            let at = knots.partition_point(|&knot| knot < latent.solidus);
            knots.insert(at, latent.solidus);
        }
        knots
    }

    /// The piece below the first knot, between each two, and above the last; enthalpies still 0.
    pub fn pieces(&self, knots: &[f64]) -> Vec<Piece> {
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        let mut pieces = vec![Piece::constant(first, self.sensible(first, SOLID))];
        for pair in knots.windows(2) {
            let (left, right) = (pair[0], pair[1]);
            let (at_left, at_right) = self.ends(left, right);
            let mut piece = Piece::constant(left, at_left);
            if right > left {
                piece.slope = (at_right - at_left) / (right - left);
            }
            pieces.push(piece);
        }
        pieces.push(Piece::constant(last, self.sensible(last, LIQUID)));
        pieces
    }

    /// Capacity just above `left` and just below `right`, two neighbouring knots.
    fn ends(&self, left: f64, right: f64) -> (f64, f64) {
        let liquid_fraction = match self.latent {
            Some(latent) if left >= latent.solidus && right <= latent.liquidus => {
                // an isothermal jump gets an infinite capacity: θ does not change with h
                let evenly = self.density * latent.latent_heat / (latent.liquidus - latent.solidus);
                return match latent.mushy_capacity {
                    _ if left == right => (f64::INFINITY, f64::INFINITY),
                    MushyCapacity::LatentOnly => (evenly, evenly),
                    MushyCapacity::LatentPlusSensible => (
                        evenly + self.mushy_sensible(left, &latent),
                        evenly + self.mushy_sensible(right, &latent),
                    ),
                };
            }
            Some(latent) if left >= latent.liquidus => LIQUID,
            _ => SOLID,
        };
        (
            self.sensible(left, liquid_fraction),
            self.sensible(right, liquid_fraction),
        )
    }

    /// Enthalpy at the knots, 0 at the reference.
    ///
    /// Summed outwards from the zero, so that the enthalpies of the melting interval contain no rounding errors of the
    /// neighbouring pieces. Piece i + 1 lies between knots i and i + 1.
    pub fn knot_enthalpies(&self, knots: &[f64], pieces: &[Piece]) -> Vec<f64> {
        let reference = self
            .latent
            .map_or(REFERENCE_TEMPERATURE, |latent| latent.solidus);
        let origin = knots.partition_point(|&knot| knot < reference);
        let rise = |i: usize| match self.latent {
            Some(latent) if knots[i] == knots[i + 1] => self.density * latent.latent_heat,
            _ => pieces[i + 1].enthalpy(knots[i + 1]),
        };
        let mut enthalpies = vec![0.0; knots.len()];
        for i in origin..knots.len() - 1 {
            enthalpies[i + 1] = enthalpies[i] + rise(i);
        }
        for i in (0..origin).rev() {
            enthalpies[i] = enthalpies[i + 1] - rise(i);
        }
        enthalpies
    }

    fn sensible(&self, temperature: f64, liquid_fraction: f64) -> f64 {
        self.density * self.specific_heat.at(temperature, liquid_fraction)
    }

    fn mushy_sensible(&self, temperature: f64, latent: &LatentHeat) -> f64 {
        if !self.specific_heat.is_by_phase() {
            return self.sensible(temperature, SOLID);
        }
        let solid = self.sensible(latent.solidus, SOLID);
        let liquid = self.sensible(latent.liquidus, LIQUID);
        let fraction = (temperature - latent.solidus) / (latent.liquidus - latent.solidus);
        solid + fraction * (liquid - solid)
    }
}
