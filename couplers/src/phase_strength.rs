//! Yield stress of steel by its constituents
//!
//! ```text
//! yield_stress = sum of fraction times yield stress of the constituent at the temperature
//! ```
//!
//! A constituent without its own yield stress has the yield stress of the material. `mechanical` uses the field instead of the
//! material property `yield_stress`.

use perimelt_core::material::Property;
use perimelt_core::numbers::check_positive;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{
    Coupler, Key, Prepared, Read, RunError, RunningCoupler, Setup, Step, Stepping, World, Write,
    keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Yield stress from the shares of a `metallurgy`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseStrength {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Yield stress of austenite (Pa), a number or a table over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub austenite: Option<Property>,
    /// Yield stress of ferrite (Pa), a number or a table over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ferrite: Option<Property>,
    /// Yield stress of pearlite (Pa), a number or a table over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pearlite: Option<Property>,
    /// Yield stress of bainite (Pa), a number or a table over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bainite: Option<Property>,
    /// Yield stress of martensite (Pa), a number or a table over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub martensite: Option<Property>,
}

/// A strength that is ready to act.
struct RunningPhaseStrength {
    body: usize,
    /// Yield stresses of the constituents that have one of their own.
    given: [Option<Property>; 5],
    /// Yield stresses of the materials.
    common: Vec<Property>,
    temperature: Read<f64>,
    shares: [Read<f64>; 5],
    yield_stress: Write<f64>,
}

/// Fractions of the constituents, by whose names the keys are called.
const FRACTIONS: [Key<f64>; 5] = [
    keys::AUSTENITE,
    keys::FERRITE,
    keys::PEARLITE,
    keys::BAINITE,
    keys::MARTENSITE,
];

impl PhaseStrength {
    /// Yield stresses, in the order of [`FRACTIONS`].
    fn given(self) -> [Option<Property>; 5] {
        [
            self.austenite,
            self.ferrite,
            self.pearlite,
            self.bainite,
            self.martensite,
        ]
    }
}

#[typetag::serialize(name = "phase_strength")]
impl Coupler for PhaseStrength {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let given = self.given();
        for (key, given) in FRACTIONS.iter().zip(&given) {
            let values = given.as_ref().map(Property::values).unwrap_or_default();
            for value in values {
                check_positive(&key.name, value, "Pa")?;
            }
        }
        let [a, f, p, b, m] = FRACTIONS;
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(RunningPhaseStrength {
            body,
            given,
            common: setup.world().property(body, "yield_stress")?,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            shares: [
                setup.read(body, &a)?,
                setup.read(body, &f)?,
                setup.read(body, &p)?,
                setup.read(body, &b)?,
                setup.read(body, &m)?,
            ],
            yield_stress: setup.write(body, &keys::YIELD_STRESS)?,
        }))
    }
}

impl RunningCoupler for RunningPhaseStrength {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let material = &world.body(self.body).material_of_point;
        let temperature: &[f64] = &world.read(self.temperature);
        let shares = self.shares.map(|share| world.read(share));
        let shares: [&[f64]; 5] = std::array::from_fn(|c| &shares[c][..]);
        let mut yield_stress = world.write(self.yield_stress);
        yield_stress.par_iter_mut().enumerate().for_all(|(i, sum)| {
            let common = &self.common[material[i] as usize];
            let of = |c: usize| {
                self.given[c]
                    .as_ref()
                    .unwrap_or(common)
                    .at(temperature[i], 0.0)
            };
            *sum = (0..5).map(|c| shares[c][i] * of(c)).sum();
        });
        Ok(())
    }
}

perimelt_core::register_coupler!("phase_strength", PhaseStrength, supports: [Births, Cuts, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{apply, block, prepare, read, refusal, set, values};

    #[test]
    fn yield_stress_is_that_of_the_mixture() {
        let mut world = World::new(vec![block([2, 1, 1], 1, "yield_stress = 400e6")]);
        let coupler: PhaseStrength = read(
            "martensite = { temperature = [300, 500], value = [1000e6, 800e6] }\naustenite = 200e6",
        );
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            for key in FRACTIONS {
                setup.own(0, &key).expect("free");
            }
            setup.read(0, &keys::YIELD_STRESS).expect("written");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 400.0);
        set(&mut world, &keys::AUSTENITE, |i| [0.2, 0.0][i]);
        set(&mut world, &keys::BAINITE, |i| [0.3, 1.0][i]);
        set(&mut world, &keys::MARTENSITE, |i| [0.5, 0.0][i]);
        apply(&world, &mut *coupler, 0.0);
        let expected = [0.2 * 200e6 + 0.3 * 400e6 + 0.5 * 900e6, 400e6];
        for (stress, expected) in values(&world, &keys::YIELD_STRESS).iter().zip(expected) {
            assert!((stress - expected).abs() < 1.0, "{stress} {expected}");
        }
    }

    #[test]
    fn strength_that_cannot_be_is_refused() {
        let mut world = World::new(vec![block([2, 1, 1], 1, "yield_stress = 400e6")]);
        let coupler: PhaseStrength = read("bainite = -5");
        assert!(refusal(&mut world, coupler).contains("-5"));
    }
}
