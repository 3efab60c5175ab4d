//! Equations of state: how the pressure of a fluid follows from its flow, by a law ([`StateLaw`]).

mod incompressible;
mod law;
mod rate;
mod tait;

pub use incompressible::Incompressible;
pub use law::{CopyState, DensityChange, FACTS, StateLaw, StateRegistration};
pub use rate::Rate;
pub use tait::Tait;

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::SetupError;
    use perimelt_core::law::Law;
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    use crate::testing::read;

    /// `p = c² (rho - rho0)`.
    #[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Acoustic {
        speed: f64,
    }

    impl StateLaw for Acoustic {
        fn check(&self) -> Result<(), SetupError> {
            perimelt_core::numbers::check_positive("speed", self.speed, "m/s").map(|_| ())
        }

        fn pressure(&self, change: DensityChange) -> f64 {
            self.speed.powi(2) * (change.after - change.reference)
        }

        fn density(&self, pressure: f64, reference: f64) -> f64 {
            reference + pressure / self.speed.powi(2)
        }

        fn sound_speed(&self, _: f64) -> f64 {
            self.speed
        }
    }

    crate::register_state_law!("test_acoustic", Acoustic);

    #[derive(Debug, Serialize, Deserialize)]
    struct Table {
        state: Law<dyn StateLaw>,
    }

    #[test]
    fn a_law_of_ones_own_is_read_and_written_by_its_name() {
        let table: Table = read("state.test_acoustic = { speed = 3 }");
        let law = &table.state.law;
        assert_eq!(law.pressure(change(5.0, 6.0, 1.0, 4.0)), 18.0);
        assert_eq!(law.density(18.0, 4.0), 6.0);
        let text = toml::to_string(&table).expect("TOML");
        assert_eq!(text.trim(), "[state.test_acoustic]\nspeed = 3.0");
        assert_eq!(table.state.key(), "state.test_acoustic");
    }

    fn tait(exponent: f64) -> Tait {
        Tait {
            sound_speed: 20.0,
            exponent,
            background: 30.0,
        }
    }

    fn change(before: f64, after: f64, pressure: f64, reference: f64) -> DensityChange {
        DensityChange {
            before,
            after,
            pressure,
            reference,
        }
    }

    /// `p = rho0 c²/gamma ((rho/rho0)^gamma - 1) + p0` of 5 kg/m³ and 20 m/s, whatever the pressure before; and
    /// `p + K (rho/rho_before - 1)`. The density belongs to the pressure of a medium that was at rest.
    #[test]
    fn pressure_and_density_belong_to_each_other() {
        for (exponent, density, pressure) in [
            (1.0, 5.5, 2000.0 * 0.1 + 30.0),
            (2.0, 4.0, 1000.0 * (0.64 - 1.0) + 30.0),
            (7.0, 5.5, 2000.0 / 7.0 * (1.1_f64.powi(7) - 1.0) + 30.0),
            (7.0, 5.0, 30.0),
        ] {
            let state: Box<dyn StateLaw> = Box::new(tait(exponent));
            let found = state.pressure(change(77.0, density, -9.0, 5.0));
            assert!((found - pressure).abs() < 1e-10, "{exponent}: {found}");
            let found = state.density(pressure, 5.0);
            assert!((found - density).abs() < 1e-12, "{exponent}: {found}");
            assert_eq!(state.sound_speed(density), 20.0);
        }
        let rate: Box<dyn StateLaw> = Box::new(Rate {
            bulk_modulus: 2000.0,
        });
        assert!((rate.pressure(change(4.0, 5.0, 7.0, 77.0)) - 507.0).abs() < 1e-10);
        assert!((rate.density(500.0, 4.0) - 5.0).abs() < 1e-12);
        assert_eq!(rate.sound_speed(5.0), 20.0);
        let still: Box<dyn StateLaw> = Box::new(Incompressible { tolerance: 0.01 });
        assert_eq!(still.pressure(change(4.0, 5.0, 7.0, 77.0)), 7.0);
        assert_eq!(still.density(500.0, 4.0), 4.0);
        assert_eq!(still.incompressible(), Some(0.01));
        assert_eq!(rate.incompressible(), None);
    }

    #[test]
    fn numbers_of_a_state_are_positive() {
        let rate = |bulk_modulus| -> Box<dyn StateLaw> { Box::new(Rate { bulk_modulus }) };
        let still = |tolerance| -> Box<dyn StateLaw> { Box::new(Incompressible { tolerance }) };
        let tait = |exponent| -> Box<dyn StateLaw> { Box::new(tait(exponent)) };
        let sound = |sound_speed| -> Box<dyn StateLaw> {
            Box::new(Tait {
                sound_speed,
                exponent: 7.0,
                background: -5.0,
            })
        };
        for (state, at_fault) in [
            (tait(7.0), None),
            (sound(1e-9), None),
            (rate(1.0), None),
            (tait(0.0), Some("exponent")),
            (tait(f64::NAN), Some("exponent")),
            (sound(0.0), Some("sound_speed")),
            (sound(f64::INFINITY), Some("sound_speed")),
            (rate(0.0), Some("bulk_modulus")),
            (rate(-1.0), Some("bulk_modulus")),
            (still(1e-6), None),
            (still(0.0), Some("tolerance")),
            (still(f64::NAN), Some("tolerance")),
        ] {
            let found = state.check().err().map(|e| e.key);
            assert_eq!(found.as_deref(), at_fault, "{state:?}");
        }
    }
}
