//! Thermoelastic heat: a solid cools when it is extended and heats when compressed
//!
//! ```text
//! heat_source -= alpha T d(conjugate_stress)/dt           (W/m³)
//! ```
//!
//! `conjugate_stress` comes from the mechanical physics: in a bond-based solid it is
//! `sum_j (c/2) (extension) v V`, positive in extension (Gao (2020), eq. A.10a, which lacks a factor of the horizon; see
//! `docs/theory/thermomechanics.md`). The heat contains its whole change since the heat was last computed, for any
//! step sizes of the two physics.
//! With `linearised_at = T0` the factor is alpha T0. This is the linear theory of closed forms and
//! published benchmarks; `temperature` may then be the difference from T0.
//!
//! With the default single pass of a macro step, heat and expansion lag one step behind. In a slow
//! process this error vanishes with the step; a free vibration gains energy in proportion to the
//! step. With `time.iteration` both are consistent at the end of the step, and energy is kept to the
//! order of the integrator.
//!
//! Alpha is the instantaneous coefficient at the temperature of the point, `de/dT` of the elongation e by which
//! `thermal_expansion` strains the body; a table of mean coefficients must say from which temperature they count
//! (`expansion_reference`). Not for plastic or viscous heat.

use perimelt_core::material::{ExpansionError, MaterialError, ThermalState};
use perimelt_core::{Coupler, Prepared, RunningCoupler, Setup, SetupError, World, keys};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rate::WorkHeat;

/// Heat from the rate of deformation; needs the thermal expansion of the material.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeformationHeat {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Temperature of the linear theory (K); the current temperature when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linearised_at: Option<f64>,
}

#[typetag::serialize(name = "deformation_heat")]
impl Coupler for DeformationHeat {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let expansion = setup.world().expansions(body)?;
        let mut materials = setup.body(body).materials.iter().zip(&expansion);
        if let Some((material, _)) = materials.find(|(_, e)| e.lacks_reference()) {
            let error = MaterialError::Expansion {
                material: material.name().to_string(),
                source: ExpansionError::NoReference,
            };
            return Err(SetupError::other("", error));
        }
        let temperature = setup.read(body, &keys::TEMPERATURE)?;
        let liquid_fraction = setup.read_if_provided(body, &keys::LIQUID_FRACTION)?;
        let linearised_at = self.linearised_at;
        let find_factors = move |world: &World, factors: &mut [f64]| {
            let temperature: &[f64] = &world.read(temperature);
            let liquid_fraction = world.read_if_provided(liquid_fraction);
            let liquid_fraction = liquid_fraction.as_deref();
            let material = &world.body(body).material_of_point;
            let points = factors.par_iter_mut().enumerate();
            points.for_each(|(point, factor)| {
                let state = ThermalState {
                    temperature: temperature[point],
                    liquid_fraction: liquid_fraction.map_or(0.0, |f| f[point]),
                };
                let coefficient = expansion[material[point] as usize].instantaneous(state);
                *factor = -coefficient.expect("the reference is checked at set-up")
                    * linearised_at.unwrap_or(temperature[point]);
            });
        };
        let key = &keys::CONJUGATE_STRESS;
        WorkHeat::prepare(setup, body, key, "power from deformation", find_factors)
    }
}

perimelt_core::register_coupler!("deformation_heat", DeformationHeat);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    /// Mean coefficients of 10e-6 to 20e-6 from 300 to 1300 K, which count from 300 K: their elongation rises by 20e-6 per
    /// kelvin at 800 K.
    #[test]
    fn the_heat_takes_the_instantaneous_coefficient() {
        let mut world = World::new(vec![block([1, 1, 1], 1, STEEL)]);
        let message = refusal(&mut world, read::<DeformationHeat>(""));
        assert!(
            message.contains("add `expansion_reference` [K]"),
            "{message}"
        );

        let metal = format!("{STEEL}\nexpansion_reference = 300");
        let mut world = World::new(vec![block([1, 1, 1], 1, &metal)]);
        let coupler: DeformationHeat = read("");
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::CONJUGATE_STRESS).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 800.0);
        set(&mut world, &keys::CONJUGATE_STRESS, |_| 1e9);
        apply(&world, &mut *coupler, 0.0);
        let heat = values(&world, &keys::HEAT_SOURCE)[0];
        assert!(
            (heat / (-20e-6 * 800.0 * 1e9) - 1.0).abs() < 1e-12,
            "{heat}"
        );
    }

    #[test]
    fn extension_cools_in_proportion_to_the_temperature_or_to_the_given_one() {
        for (keys_given, heat) in [("", -12e-6 * 400.0 * 1e9), ("linearised_at = 300", -3.6e6)] {
            let mut world = World::new(vec![block([2, 1, 1], 1, "thermal_expansion = 12e-6")]);
            let coupler: DeformationHeat = read(keys_given);
            let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
                setup.own(0, &keys::TEMPERATURE).expect("free");
                setup.own(0, &keys::CONJUGATE_STRESS).expect("free");
                setup.consume(0, &keys::HEAT_SOURCE).expect("free");
            })
            .expect("valid");
            set(&mut world, &keys::TEMPERATURE, |_| 400.0);
            set(&mut world, &keys::CONJUGATE_STRESS, |i| [1e9, -1e9][i]);
            apply(&world, &mut *coupler, 0.0);
            for (value, expected) in values(&world, &keys::HEAT_SOURCE).iter().zip([heat, -heat]) {
                // rounding of three factors
                assert!((value - expected).abs() < 1e-9 * heat.abs());
            }
            assert_eq!(coupler.report()[0].value, 0.0, "the two points cancel");
        }
    }
}
