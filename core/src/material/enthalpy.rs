//! Volumetric enthalpy of a material against temperature, with melting.
//!
//! Wang (2025), eqs. 7.11, 7.12, 7.31, 7.32; see docs/theory/phase_change.md. Between
//! the solidus θ_s and the liquidus θ_l the latent heat L is released evenly over temperature:
//!
//! ```text
//! latent only:            C(θ) = ρ L/(θ_l − θ_s)
//! latent plus sensible:   C(θ) = ρ L/(θ_l − θ_s) + ρ c(θ)          θ_s ≤ θ ≤ θ_l
//! h(θ) = ∫ C dθ,  h(θ_s) = 0                                       [J/m³]
//! ```
//!
//! The density is the constant reference density: mass is conserved, and the volume change on melting
//! belongs to the mechanics. With a specific heat piecewise linear in temperature, h is piecewise quadratic
//! and both directions are exact. Not for vaporisation: above the liquidus the liquid stays
//! liquid at any temperature.

mod pieces;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::property::Property;
use pieces::{Piece, VolumetricCapacity};

/// Temperature (K) at which enthalpy is zero in a material that does not melt.
pub const REFERENCE_TEMPERATURE: f64 = 293.15;

/// Heat capacity between solidus and liquidus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MushyCapacity {
    /// Latent heat only: the interval absorbs exactly ρL (Wang (2025), eq. 7.11).
    LatentOnly,
    /// Latent heat and specific heat: the interval absorbs ρL + ρ∫c dθ, the convention of measured
    /// specific and latent heats.
    #[default]
    LatentPlusSensible,
}

/// How a step of heating finds the new temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LatentHeatForm {
    /// Advance enthalpy and invert it: conserves energy for any step, cannot skip the interval.
    #[default]
    Enthalpy,
    /// Divide by the capacity at the old temperature, as published; needs steps in which the
    /// temperature changes much less than θ_l − θ_s.
    Apparent,
}

/// Melting of a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentHeat {
    /// Temperature at which melting starts (K).
    pub solidus: f64,
    /// Temperature at which melting ends (K); equal to the solidus for a pure substance.
    pub liquidus: f64,
    /// Heat of fusion (J/kg).
    pub latent_heat: f64,
    /// Heat capacity in the interval.
    pub mushy_capacity: MushyCapacity,
    /// How a step finds the new temperature.
    pub form: LatentHeatForm,
}

/// Why a material has no enthalpy curve.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EnthalpyError {
    /// A property that must be positive is not.
    #[error("{property} must be above 0 and finite, not {value}")]
    NotPositive {
        /// The property.
        property: &'static str,
        /// Value of the property.
        value: f64,
    },
    /// The liquidus lies below the solidus.
    #[error("the liquidus ({liquidus} K) lies below the solidus ({solidus} K)")]
    LiquidusBelowSolidus {
        /// Solidus (K).
        solidus: f64,
        /// Liquidus (K).
        liquidus: f64,
    },
    /// No capacity in the interval.
    #[error(
        "a latent heat of {latent_heat} J/kg leaves no heat capacity between solidus and \
         liquidus; give a positive one, or let the mushy capacity be `latent_plus_sensible`"
    )]
    NoMushyCapacity {
        /// Latent heat (J/kg).
        latent_heat: f64,
    },
    /// Latent heat at one temperature has no finite capacity.
    #[error(
        "solidus and liquidus are both {temperature} K, so the apparent heat capacity is infinite; \
         use `form = \"enthalpy\"`, or an interval of a few kelvin"
    )]
    IsothermalApparent {
        /// Melting temperature (K).
        temperature: f64,
    },
    /// The specific heat is given by phase, but there are no phases.
    #[error(
        "the specific heat differs between solid and liquid, but the body has no coupler `phase_change`, which \
         decides what is liquid; add the coupler, which takes solidus, liquidus and latent heat from the \
         material, or give the material one specific heat"
    )]
    PhasesWithoutMelting,
}

/// Volumetric enthalpy h(θ) (J/m³) of a material, its inverse and its slope.
///
/// h is 0 at the solidus, or at [`REFERENCE_TEMPERATURE`] in a material that does not melt.
/// Beyond the rows of a specific heat table the capacity stays constant, so every finite
/// temperature has an enthalpy and vice versa.
#[derive(Debug, Clone, PartialEq)]
pub struct EnthalpyCurve {
    /// Where piece 1, 2, ... starts, as temperature and as enthalpy; piece 0 lies below.
    temperatures: Vec<f64>,
    enthalpies: Vec<f64>,
    /// Starts of the pieces as combined temperatures, K.
    combined: Vec<f64>,
    pieces: Vec<Piece>,
    density: f64,
    melting: Option<Melting>,
    minimum_capacity: f64,
    maximum_capacity: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Melting {
    latent: LatentHeat,
    /// Enthalpies at solidus and liquidus, J/m³.
    interval: [f64; 2],
    /// Capacity at the liquidus, which belongs to the interval.
    capacity_at_liquidus: f64,
}

impl EnthalpyCurve {
    /// Builds the curve from density (kg/m³), specific heat (J/(kg K)) and melting.
    ///
    /// A specific heat by phase takes its solid value up to the solidus, its liquid value from
    /// the liquidus on, and between them (used by `latent_plus_sensible` only) the straight line
    /// from c_solid(θ_s) to c_liquid(θ_l).
    ///
    /// # Errors
    /// [`EnthalpyError`] when a value is not positive, the liquidus lies below the solidus, the
    /// interval has no capacity, or the apparent form is requested for isothermal melting.
    pub fn new(
        density: f64,
        specific_heat: &Property,
        latent: Option<LatentHeat>,
    ) -> Result<Self, EnthalpyError> {
        check_positive("density", density)?;
        for value in specific_heat.values() {
            check_positive("specific heat", value)?;
        }
        match &latent {
            Some(latent) => check_latent(latent)?,
            None if specific_heat.is_by_phase() => {
                return Err(EnthalpyError::PhasesWithoutMelting);
            }
            None => {}
        }
        let capacity = VolumetricCapacity {
            density,
            specific_heat,
            latent,
        };
        let knots = capacity.knots();
        let mut pieces = capacity.pieces(&knots);
        let enthalpies = capacity.knot_enthalpies(&knots, &pieces);
        pieces[0].enthalpy = enthalpies[0];
        for (piece, enthalpy) in pieces[1..].iter_mut().zip(&enthalpies) {
            piece.enthalpy = *enthalpy;
        }

        let ends = pieces.iter().enumerate().flat_map(|(i, piece)| {
            let right = knots.get(i).copied().unwrap_or(piece.temperature);
            [piece.capacity, piece.capacity(right)]
        });
        let finite = ends.filter(|capacity| capacity.is_finite());
        let (minimum_capacity, maximum_capacity) = finite
            .fold((f64::INFINITY, 0.0), |(low, high), capacity| {
                (capacity.min(low), capacity.max(high))
            });
        let melting = latent.map(|latent| {
            let mushy = knots.partition_point(|&knot| knot < latent.liquidus);
            Melting {
                latent,
                interval: [latent.solidus, latent.liquidus].map(|t| {
                    let piece = &pieces[piece_index(&knots, t)];
                    piece.enthalpy(t)
                }),
                capacity_at_liquidus: pieces[mushy].capacity(latent.liquidus),
            }
        });
        let total = COMBINED_CAPACITY * maximum_capacity;
        let starts = knots.iter().zip(&enthalpies);
        let combined = starts.map(|(t, h)| t + h / total).collect();
        Ok(Self {
            combined,
            temperatures: knots,
            enthalpies,
            pieces,
            density,
            melting,
            minimum_capacity,
            maximum_capacity,
        })
    }

    /// Enthalpy (J/m³) at a temperature (K).
    ///
    /// At an isothermal melting temperature it is that of the liquid, ρL.
    pub fn enthalpy(&self, temperature: f64) -> f64 {
        self.pieces[piece_index(&self.temperatures, temperature)].enthalpy(temperature)
    }

    /// Temperature (K) at an enthalpy (J/m³).
    pub fn temperature(&self, enthalpy: f64) -> f64 {
        self.pieces[piece_index(&self.enthalpies, enthalpy)].temperature(enthalpy)
    }

    /// Slope dh/dθ (J/(m³ K)); solidus and liquidus both belong to the interval.
    ///
    /// At an isothermal melting temperature, where h jumps, it is that of the solid.
    pub fn capacity(&self, temperature: f64) -> f64 {
        match &self.melting {
            Some(melting) if temperature == melting.latent.liquidus => melting.capacity_at_liquidus,
            _ => self.pieces[piece_index(&self.temperatures, temperature)].capacity(temperature),
        }
    }

    /// Slope dh/dθ (J/(m³ K)) at an enthalpy (J/m³); infinite while a pure substance melts.
    pub fn capacity_from_enthalpy(&self, enthalpy: f64) -> f64 {
        let piece = &self.pieces[piece_index(&self.enthalpies, enthalpy)];
        piece.capacity(piece.temperature(enthalpy))
    }

    /// The combined temperature θ + h/C (K) at an enthalpy (J/m³), with a capacity C far above that of the material: nearly a
    /// temperature, and yet it rises while a pure substance melts at one.
    pub fn combined(&self, enthalpy: f64) -> f64 {
        self.temperature(enthalpy) + enthalpy / self.combined_capacity()
    }

    /// Enthalpy (J/m³) at a combined temperature (K), and its derivative by it, J/(m³ K).
    pub fn from_combined(&self, combined: f64) -> (f64, f64) {
        let total = self.combined_capacity();
        let index = piece_index(&self.combined, combined);
        let piece = &self.pieces[index];
        // piece 0 ends at the knot at which the others start
        let start = self.combined[index.saturating_sub(1)];
        if piece.capacity.is_infinite() {
            return (piece.enthalpy + total * (combined - start), total);
        }
        let of_combined = Piece {
            temperature: piece.temperature,
            enthalpy: start,
            capacity: 1.0 + piece.capacity / total,
            slope: piece.slope / total,
        };
        let temperature = of_combined.temperature(combined);
        let capacity = piece.capacity(temperature);
        (
            piece.enthalpy(temperature),
            capacity / (1.0 + capacity / total),
        )
    }

    /// C of [`Self::combined`], J/(m³ K).
    fn combined_capacity(&self) -> f64 {
        COMBINED_CAPACITY * self.maximum_capacity
    }

    /// Liquid fraction, clamp((θ − θ_s)/(θ_l − θ_s), 0, 1); 0 in a material that does not melt.
    ///
    /// At an isothermal melting temperature it is 1, as [`Self::enthalpy`] is there; only
    /// [`Self::liquid_fraction_from_enthalpy`] distinguishes a partly molten point.
    pub fn liquid_fraction(&self, temperature: f64) -> f64 {
        let Some(LatentHeat {
            solidus, liquidus, ..
        }) = self.melting.map(|melting| melting.latent)
        else {
            return 0.0;
        };
        if temperature >= liquidus {
            1.0
        } else if temperature <= solidus {
            0.0
        } else {
            (temperature - solidus) / (liquidus - solidus)
        }
    }

    /// Liquid fraction at an enthalpy (J/m³); for an isothermal melting clamp(h/(ρL), 0, 1).
    pub fn liquid_fraction_from_enthalpy(&self, enthalpy: f64) -> f64 {
        match &self.melting {
            Some(Melting { latent, .. }) if latent.solidus == latent.liquidus => {
                (enthalpy / (self.density * latent.latent_heat)).clamp(0.0, 1.0)
            }
            Some(Melting { interval, .. }) if enthalpy < interval[0] => 0.0,
            Some(Melting { interval, .. }) if enthalpy >= interval[1] => 1.0,
            _ => self.liquid_fraction(self.temperature(enthalpy)),
        }
    }

    /// Enthalpy (J/m³) at a liquid fraction between 0 and 1; `None` in a material that does not melt.
    pub fn enthalpy_at_liquid_fraction(&self, fraction: f64) -> Option<f64> {
        let LatentHeat {
            solidus,
            liquidus,
            latent_heat,
            ..
        } = *self.latent_heat()?;
        Some(match solidus == liquidus {
            true => fraction * self.density * latent_heat,
            false => self.enthalpy(solidus + fraction * (liquidus - solidus)),
        })
    }

    /// Enthalpy of the liquid (J/m³) at a temperature (K), relative to that at the liquidus: below the liquidus that of a liquid
    /// with the heat capacity at the liquidus. For a material that melts.
    pub fn liquid_enthalpy(&self, temperature: f64) -> f64 {
        let Some(LatentHeat { liquidus, .. }) = self.latent_heat() else {
            return 0.0;
        };
        let first = &self.pieces[piece_index(&self.temperatures, *liquidus)];
        match temperature > *liquidus {
            true => self.enthalpy(temperature) - first.enthalpy(*liquidus),
            false => first.capacity(*liquidus) * (temperature - liquidus),
        }
    }

    /// Temperature (K) and enthalpy (J/m³) after adding `heat` (J/m³).
    ///
    /// Enthalpy form: h' = h + heat, θ' = h⁻¹(h'). Apparent form: θ' = θ + heat/C(θ) and
    /// h' = h(θ'), so that h' − h − heat is the energy that the form gains or loses.
    pub fn advance(&self, temperature: f64, enthalpy: f64, heat: f64) -> (f64, f64) {
        match self.form() {
            LatentHeatForm::Enthalpy => {
                let enthalpy = enthalpy + heat;
                (self.temperature(enthalpy), enthalpy)
            }
            LatentHeatForm::Apparent => {
                let temperature = temperature + heat / self.capacity(temperature);
                (temperature, self.enthalpy(temperature))
            }
        }
    }

    /// Form of the latent heat; the enthalpy form in a material that does not melt.
    pub fn form(&self) -> LatentHeatForm {
        self.melting
            .map_or(LatentHeatForm::Enthalpy, |melting| melting.latent.form)
    }

    /// Melting of the material, if it melts.
    pub fn latent_heat(&self) -> Option<&LatentHeat> {
        self.melting.as_ref().map(|melting| &melting.latent)
    }

    /// Smallest capacity (J/(m³ K)) at any temperature, which determines the stable step.
    pub fn minimum_capacity(&self) -> f64 {
        self.minimum_capacity
    }

    /// Largest finite capacity (J/(m³ K)) at any temperature.
    pub fn maximum_capacity(&self) -> f64 {
        self.maximum_capacity
    }
}

/// C of [`EnthalpyCurve::combined`] over the largest capacity of the material.
const COMBINED_CAPACITY: f64 = 10.0;

/// Number of starts at or below `value`; 0 for a NaN, which then runs through the arithmetic.
#[inline]
fn piece_index(starts: &[f64], value: f64) -> usize {
    starts.partition_point(|&start| start <= value)
}

fn check_positive(property: &'static str, value: f64) -> Result<(), EnthalpyError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(EnthalpyError::NotPositive { property, value })
    }
}

fn check_latent(latent: &LatentHeat) -> Result<(), EnthalpyError> {
    let LatentHeat {
        solidus,
        liquidus,
        latent_heat,
        ..
    } = *latent;
    for (property, value) in [("solidus", solidus), ("liquidus", liquidus)] {
        check_positive(property, value)?;
    }
    if liquidus < solidus {
        return Err(EnthalpyError::LiquidusBelowSolidus { solidus, liquidus });
    }
    let sensible = latent.mushy_capacity == MushyCapacity::LatentPlusSensible;
    if latent_heat == 0.0 && (!sensible || liquidus == solidus) {
        return Err(EnthalpyError::NoMushyCapacity { latent_heat });
    }
    if latent_heat != 0.0 {
        check_positive("latent heat", latent_heat)?;
    }
    if liquidus == solidus && latent.form == LatentHeatForm::Apparent {
        return Err(EnthalpyError::IsothermalApparent {
            temperature: solidus,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
