//! Thermoelastic heat: a solid cools when it is extended and heats when compressed
//!
//! ```text
//! heat_source -= alpha T d(conjugate_stress)/dt                        (W/m³)
//! heat_source -= alpha_ij T d(conjugate_stress_tensor_ij)/dt           where a material expands differently along its axes
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

use perimelt_core::material::{
    Directional, Expansion, ExpansionError, MaterialError, ThermalState,
};
use perimelt_core::orientation::{PointAxes, tensor};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Prepared, Read, ReadIfProvided, RunningCoupler, Setup, SetupError, World, keys,
};
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
        setup.once::<Self>(body)?;
        let expansion = setup.world().expansions(body)?;
        let lacks = |e: &Directional<Expansion>| e.values().iter().any(Expansion::lacks_reference);
        let mut materials = setup.body(body).materials.iter().zip(&expansion);
        if let Some((material, _)) = materials.find(|(_, e)| lacks(e)) {
            let error = MaterialError::Expansion {
                material: material.name().to_string(),
                source: ExpansionError::NoReference,
            };
            return Err(SetupError::other("", error));
        }
        let has_directions = expansion.iter().any(Directional::has_directions);
        let factors = Factors {
            body,
            expansion,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            liquid_fraction: setup.read_if_provided(body, &keys::LIQUID_FRACTION)?,
            linearised_at: self.linearised_at,
        };
        let name = "power from deformation";
        if !has_directions {
            let find = move |world: &World, found: &mut [f64]| {
                factors.with(world, |along| {
                    let points = found.par_iter_mut().enumerate();
                    points.for_all(|(point, factor)| *factor = along(point, 0));
                });
            };
            return WorkHeat::prepare(setup, body, &keys::CONJUGATE_STRESS, name, find);
        }
        let orientation = setup.given(body, &keys::ORIENTATION)?;
        let mut axes = PointAxes::new(setup.body(body).points.len());
        let find = move |world: &World, found: &mut [f64]| {
            axes.follow(&world.read(orientation));
            factors.with(world, |along| {
                let points = found.par_chunks_exact_mut(9).enumerate();
                points.for_all(|(point, factors)| {
                    let principal = [0, 1, 2].map(|axis| along(point, axis));
                    factors.copy_from_slice(tensor(axes.of(point), principal).as_slice());
                });
            });
        };
        WorkHeat::prepare(setup, body, &keys::CONJUGATE_STRESS_TENSOR, name, find)
    }
}

/// Finds `-alpha T` of the points.
struct Factors {
    body: BodyIndex,
    /// By material.
    expansion: Vec<Directional<Expansion>>,
    temperature: Read<f64>,
    liquid_fraction: ReadIfProvided<f64>,
    linearised_at: Option<f64>,
}

impl Factors {
    /// Passes `-alpha T` as a function of a point and an axis of its material.
    fn with(&self, world: &World, find: impl FnOnce(&(dyn Fn(usize, usize) -> f64 + Sync))) {
        let temperature: &[f64] = &world.read(self.temperature);
        let liquid_fraction = world.read_if_provided(self.liquid_fraction);
        let liquid_fraction = liquid_fraction.as_deref();
        let material = &world.body(self.body).material_of_point;
        let linearised_at = self.linearised_at;
        let expansion = &self.expansion;
        find(&|point, axis| {
            let state = ThermalState {
                temperature: temperature[point],
                liquid_fraction: liquid_fraction.map_or(0.0, |f| f[point]),
            };
            let along = expansion[material[point] as usize].along(axis);
            let coefficient = along.instantaneous(state);
            -coefficient.expect("the reference is checked at set-up")
                * linearised_at.unwrap_or(temperature[point])
        });
    }
}

perimelt_core::register_coupler!("deformation_heat", DeformationHeat, supports: [Layers, Division]);

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

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

    /// `-T alpha_ij d(stress_ij)` of fibres at 30 degrees, in two steps: the stress that was seen before counts no more.
    #[test]
    fn heat_follows_the_expansion_along_each_axis() {
        let ply = "thermal_expansion = { along = -1e-6, across = 3e-5 }";
        let mut world = World::new(vec![block([2, 1, 1], 3, ply)]);
        let coupler: DeformationHeat = read("linearised_at = 300");
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::ORIENTATION).expect("free");
            setup.own(0, &keys::CONJUGATE_STRESS_TENSOR).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        let turn = Vector3::new(0.0, 0.0, 30_f64.to_radians());
        set(&mut world, &keys::ORIENTATION, |_| turn);
        let stress = Matrix3::new(4e8, 1e8, 0.0, 1e8, -2e8, 0.0, 0.0, 0.0, 3e8);
        let expansion = Matrix3::new(
            0.25 * 3e-5 - 0.75e-6,
            -3.1e-5 * 0.75_f64.sqrt() * 0.5,
            0.0,
            -3.1e-5 * 0.75_f64.sqrt() * 0.5,
            0.75 * 3e-5 - 0.25e-6,
            0.0,
            0.0,
            0.0,
            3e-5,
        );
        let heat = -300.0 * expansion.dot(&stress);
        for factor in [1.0, 3.0] {
            set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
            set(&mut world, &keys::CONJUGATE_STRESS_TENSOR, |i| {
                stress * factor * [1.0, -1.0][i]
            });
            apply(&world, &mut *coupler, 0.0);
            // from zero to one, and from one to three
            let expected = heat * if factor == 1.0 { 1.0 } else { 2.0 };
            for (value, expected) in values(&world, &keys::HEAT_SOURCE)
                .iter()
                .zip([expected, -expected])
            {
                assert!((value / expected - 1.0).abs() < 1e-12, "{value} {expected}");
            }
        }
    }
}
