//! Temperatures of fires, as functions of time for formulas of case files.
//!
//! Each is the rise of the gas temperature (K) above that before the fire, at the time t (s) after its start; it is zero
//! before. With the time in minutes, `m = t / 60` \[CEN2002\], section 3.2:
//!
//! | function | rise, K |
//! |---|---|
//! | `fire_iso_834(t)` | `345 log10(8 m + 1)`, the standard curve of ISO 834 |
//! | `fire_hydrocarbon(t)` | `1080 (1 - 0.325 exp(-0.167 m) - 0.675 exp(-2.5 m))` |
//! | `fire_external(t)` | `660 (1 - 0.687 exp(-0.32 m) - 0.313 exp(-3.8 m))`, outside of a building |

/// A function of the time, by the name that it has in formulas.
#[derive(Clone, Copy, Debug)]
pub struct FireCurve {
    /// Name in formulas.
    pub name: &'static str,
    /// Rise of the temperature (K) at a time (s) after the start of the fire.
    pub rise: fn(f64) -> f64,
}

/// All curves.
pub const FIRE_CURVES: [FireCurve; 3] = [
    FireCurve {
        name: "fire_iso_834",
        rise: iso_834,
    },
    FireCurve {
        name: "fire_hydrocarbon",
        rise: hydrocarbon,
    },
    FireCurve {
        name: "fire_external",
        rise: external,
    },
];

/// Minutes since the start of the fire, zero before.
fn minutes(time: f64) -> f64 {
    // a time that is not a number remains one
    if time < 0.0 { 0.0 } else { time / 60.0 }
}

/// `345 log10(8 m + 1)` K, m in minutes; \[CEN2002\], eq. 3.4.
fn iso_834(time: f64) -> f64 {
    345.0 * (8.0 * minutes(time) + 1.0).log10()
}

/// `1080 (1 - 0.325 exp(-0.167 m) - 0.675 exp(-2.5 m))` K, m in minutes; \[CEN2002\], eq. 3.6.
fn hydrocarbon(time: f64) -> f64 {
    let m = minutes(time);
    1080.0 * (1.0 - 0.325 * (-0.167 * m).exp() - 0.675 * (-2.5 * m).exp())
}

/// `660 (1 - 0.687 exp(-0.32 m) - 0.313 exp(-3.8 m))` K, m in minutes; \[CEN2002\], eq. 3.5.
fn external(time: f64) -> f64 {
    let m = minutes(time);
    660.0 * (1.0 - 0.687 * (-0.32 * m).exp() - 0.313 * (-3.8 * m).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::Formula;

    /// Values of the tables of \[CEN2002\], °C, at 10, 30 and 60 minutes.
    #[test]
    fn curves_have_the_values_of_the_standard() {
        for (formula, expected) in [
            ("20 + fire_iso_834(t)", [678.427, 841.796, 945.340]),
            ("20 + fire_hydrocarbon(t)", [1033.925, 1097.659, 1099.984]),
            ("20 + fire_external(t)", [661.518, 679.969, 680.000]),
        ] {
            let curve = Formula::new(formula).expect(formula);
            for (minutes, expected) in [10.0, 30.0, 60.0].into_iter().zip(expected) {
                let value = curve.at([0.0; 3], 60.0 * minutes);
                assert!((value - expected).abs() < 5e-4, "{formula}: {value}");
            }
            // nothing burns before the start
            for time in [0.0, -100.0] {
                let value = curve.at([0.0; 3], time);
                assert!((value - 20.0).abs() < 1e-12, "{formula}: {value}");
            }
        }
    }

    /// Fires may start later, burn at one place only and be followed by others.
    #[test]
    fn curves_are_functions_like_all_others() {
        let text = "293 + fire_iso_834(t - 60) * max(signum(0.0125 - abs(y - 0.05)), 0)";
        let local = Formula::new(text).expect("valid");
        assert!(!local.is_of_time() && local.depends_on_time());
        let rise = local.at([0.0, 0.06, 0.0], 560.0) - 293.0;
        assert!((rise - 631.479).abs() < 5e-4, "{rise}");
        assert_eq!(local.at([0.0, 0.07, 0.0], 560.0), 293.0);
        assert!(FIRE_CURVES.iter().all(|c| (c.rise)(f64::NAN).is_nan()));
    }
}
