//! Stress-free strain of steel that transforms: thermal expansion of its constituents, and the step in volume between
//! them
//!
//! ```text
//! eigenstrain += e(T, a) - e(T_ref, a_ref)
//! e(T, a) = a (alpha_a (T - T_0) - contraction) + (1 - a) alpha (T - T_0)
//! ```
//!
//! with the fraction a of austenite, the coefficients alpha_a of austenite and alpha of all other constituents, and the contraction
//! from these to austenite at the temperature T_0, `contraction_temperature`. A body of ferrite, pearlite, bainite or martensite
//! is free of stress at T_ref, or a body of austenite with `reference_austenite = 1`.
//!
//! Coefficients and contraction when left out follow from the lattice of iron: 0.287 nm for ferrite and 0.357 nm for
//! austenite with 0.15 % carbon at 20 °C give a contraction of 0.92 %; with 14.5e-6/K and 22.5e-6/K (means to 800 °C)
//! 0.3 % are left of it at 780 °C. [estimated: dilatometer curves of low-alloy steels show 0.2 to 0.4 %]
//!
//! Above the cut-off temperature the strain is constant, as for `thermal_expansion`, which this coupler replaces.

use perimelt_core::numbers::{check_above, check_fraction};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{
    Coupler, Prepared, Read, RunError, RunningCoupler, Setup, SetupError, Step, Stepping, World,
    Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expansion::ExpansionByTemperature;

/// Strain from temperature and from the fraction of austenite of a `metallurgy`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseExpansion {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Temperature at which the body is free of stress (K).
    pub reference_temperature: f64,
    /// Share of austenite with which the body is free of stress at that temperature.
    #[serde(default)]
    pub reference_austenite: f64,
    /// Mean coefficient of expansion of ferrite, pearlite, bainite and martensite (1/K).
    #[serde(default = "usual_expansion")]
    pub expansion: f64,
    /// Mean coefficient of expansion of austenite (1/K).
    #[serde(default = "usual_austenite_expansion")]
    pub austenite_expansion: f64,
    /// Linear contraction from the other constituents to austenite at `contraction_temperature`; 0.0092 when left out, which
    /// is that at 20 °C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contraction: Option<f64>,
    /// Temperature at which the contraction is that given (K); the reference temperature when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contraction_temperature: Option<f64>,
    /// Temperature above which the body expands no further (K), where it has lost its strength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cutoff_temperature: Option<f64>,
}

fn usual_expansion() -> f64 {
    14.5e-6
}

fn usual_austenite_expansion() -> f64 {
    22.5e-6
}

/// Contraction at a temperature (K).
const USUAL_CONTRACTION: (f64, f64) = (9.2e-3, 293.15);

/// An expansion that is ready to act.
struct RunningPhaseExpansion {
    keys: PhaseExpansion,
    temperature: Read<f64>,
    austenite: Read<f64>,
    eigenstrain: Write<f64>,
}

impl PhaseExpansion {
    /// Strain at a temperature (K) and a fraction of austenite.
    fn strain(&self, temperature: f64, austenite: f64) -> f64 {
        let (contraction, counted_from) = match self.contraction {
            Some(given) => {
                let at = self.contraction_temperature;
                (given, at.unwrap_or(self.reference_temperature))
            }
            None => USUAL_CONTRACTION,
        };
        let elongation = |temperature: f64, austenite: f64| {
            let rise = temperature - counted_from;
            austenite * (self.austenite_expansion * rise - contraction)
                + (1.0 - austenite) * self.expansion * rise
        };
        elongation(temperature, austenite)
            - elongation(self.reference_temperature, self.reference_austenite)
    }
}

#[typetag::serialize(name = "phase_expansion")]
impl Coupler for PhaseExpansion {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_fraction("reference_austenite", self.reference_austenite)?;
        check_above(
            "cutoff_temperature",
            self.cutoff_temperature,
            self.reference_temperature,
            "K, the reference temperature",
        )?;
        if let (None, Some(temperature)) = (self.contraction, self.contraction_temperature) {
            let message =
                format!("`contraction_temperature` is {temperature} K without `contraction`");
            let expected = "`contraction` at that temperature, or neither of both keys";
            return Err(SetupError::value(
                "contraction_temperature",
                message,
                expected,
            ));
        }
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<ExpansionByTemperature>(body)?;
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(RunningPhaseExpansion {
            keys: *self,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            austenite: setup.read(body, &keys::AUSTENITE)?,
            eigenstrain: setup.add(body, &keys::EIGENSTRAIN)?,
        }))
    }
}

impl RunningCoupler for RunningPhaseExpansion {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let temperature: &[f64] = &world.read(self.temperature);
        let austenite: &[f64] = &world.read(self.austenite);
        let cutoff = self.keys.cutoff_temperature.unwrap_or(f64::INFINITY);
        let mut eigenstrain = world.write(self.eigenstrain);
        let points = eigenstrain.par_iter_mut().zip(temperature).zip(austenite);
        points.for_all(|((sum, t), a)| *sum += self.keys.strain(t.min(cutoff), *a));
        Ok(())
    }
}

perimelt_core::register_coupler!("phase_expansion", PhaseExpansion, supports: [Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    #[test]
    fn strain_is_that_of_the_mixture() {
        let keys_given = "reference_temperature = 300\nexpansion = 15e-6\naustenite_expansion = 20e-6\ncontraction = 0.01\ncutoff_temperature = 1300";
        let mut world = World::new(vec![block([4, 1, 1], 1, STEEL)]);
        let coupler: PhaseExpansion = read(keys_given);
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::AUSTENITE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| {
            [300.0, 1300.0, 800.0, 1500.0][i]
        });
        set(&mut world, &keys::AUSTENITE, |i| [0.0, 1.0, 0.5, 1.0][i]);
        apply(&world, &mut *coupler, 0.0);
        let expected = [0.0, 0.02 - 0.01, 0.5 * (10e-3 - 0.01) + 0.5 * 7.5e-3, 0.01];
        for (strain, expected) in values(&world, &keys::EIGENSTRAIN).iter().zip(expected) {
            assert!((strain - expected).abs() < 1e-15, "{strain} {expected}");
        }
    }

    /// A body is free of stress at its reference temperature with its fraction of austenite there.
    #[test]
    fn a_body_may_be_free_of_stress_with_some_austenite() {
        let coupler: PhaseExpansion = read(
            "reference_temperature = 300\nreference_austenite = 0.4\nexpansion = 15e-6\naustenite_expansion = 20e-6\ncontraction = 0.01",
        );
        for (temperature, austenite, expected) in [
            (300.0, 0.4, 0.0),
            (300.0, 0.0, 0.4 * 0.01),
            (300.0, 1.0, -0.6 * 0.01),
            (400.0, 0.4, 0.4 * 2e-3 + 0.6 * 1.5e-3),
            (200.0, 1.0, -2e-3 - 0.6 * 0.01),
        ] {
            let found = coupler.strain(temperature, austenite);
            assert!(
                (found - expected).abs() < 1e-15,
                "{temperature} {austenite}: {found}"
            );
        }
    }

    /// The contraction grows by the difference of the coefficients with the temperature at which it takes place; the usual one
    /// is that at 20 °C, wherever the body is free of stress.
    #[test]
    fn the_contraction_counts_from_its_own_temperature() {
        let coefficients = "expansion = 15e-6\naustenite_expansion = 20e-6";
        for (keys, contraction_at_300) in [
            ("contraction = 0.01", 0.01 - 5e-6 * (300.0 - 1100.0)),
            ("contraction = 0.01\ncontraction_temperature = 300", 0.01),
            ("", 9.2e-3 - 5e-6 * (300.0 - 293.15)),
        ] {
            let text = format!(
                "reference_temperature = 1100\nreference_austenite = 1\n{coefficients}\n{keys}"
            );
            let coupler: PhaseExpansion = read(&text);
            assert!(coupler.strain(1100.0, 1.0).abs() < 1e-18, "{keys}");
            let contraction = coupler.strain(300.0, 0.0) - coupler.strain(300.0, 1.0);
            assert!(
                (contraction - contraction_at_300).abs() < 1e-16,
                "{keys}: {contraction}"
            );
            let cooled = coupler.strain(300.0, 1.0);
            assert!((cooled + 20e-6 * 800.0).abs() < 1e-16, "{keys}: {cooled}");
        }
    }

    #[test]
    fn mistakes_are_refused() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        for keys in [
            "reference_austenite = 2",
            "cutoff_temperature = 200",
            "cutoff_temperature = 300",
            "cutoff_temperature = nan",
            "contraction_temperature = 300",
        ] {
            let coupler: PhaseExpansion = read(&format!("reference_temperature = 300\n{keys}"));
            let key = keys.split(' ').next().expect("a key");
            assert!(refusal(&mut world, coupler).starts_with(key));
        }
    }
}
