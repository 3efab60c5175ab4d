//! Tests of the enthalpy curve.

use proptest::prelude::*;

use super::*;
use crate::material::table::Table;

const DENSITY: f64 = 7800.0;

fn table(temperature: &[f64], value: &[f64]) -> Property {
    Property::Table(Table::new(temperature.to_vec(), value.to_vec()).expect("valid rows"))
}

/// Steps, a peak and a valley, rows inside the mushy interval and above it.
fn peaked() -> Property {
    table(
        &[293.0, 600.0, 1000.0, 1010.0, 1100.0, 1690.0, 2000.0],
        &[450.0, 550.0, 800.0, 2500.0, 650.0, 700.0, 820.0],
    )
}

fn by_phase() -> Property {
    Property::ByPhase {
        solid: Box::new(peaked()),
        liquid: Box::new(Property::Constant(830.0)),
    }
}

fn melting(mushy_capacity: MushyCapacity) -> LatentHeat {
    LatentHeat {
        solidus: 1658.0,
        liquidus: 1723.0,
        latent_heat: 260e3,
        mushy_capacity,
        form: LatentHeatForm::Enthalpy,
    }
}

fn pure() -> LatentHeat {
    LatentHeat {
        solidus: 1700.0,
        liquidus: 1700.0,
        ..melting(MushyCapacity::LatentPlusSensible)
    }
}

fn curve(specific_heat: &Property, latent: Option<LatentHeat>) -> EnthalpyCurve {
    EnthalpyCurve::new(DENSITY, specific_heat, latent).expect("valid curve")
}

fn curves() -> Vec<EnthalpyCurve> {
    let constant = Property::Constant(490.0);
    let only = melting(MushyCapacity::LatentOnly);
    let plus = melting(MushyCapacity::LatentPlusSensible);
    vec![
        curve(&constant, None),
        curve(&peaked(), None),
        curve(&constant, Some(only)),
        curve(&peaked(), Some(only)),
        curve(&peaked(), Some(plus)),
        curve(&by_phase(), Some(only)),
        curve(&by_phase(), Some(plus)),
        curve(&by_phase(), Some(pure())),
    ]
}

/// The liquid is continued below the liquidus with its heat capacity there; the enthalpy at a liquid fraction has that fraction.
#[test]
fn liquid_keeps_its_heat_capacity_below_the_liquidus() {
    for latent in [melting(MushyCapacity::LatentPlusSensible), pure()] {
        let curve = curve(&by_phase(), Some(latent));
        let capacity = 830.0 * DENSITY;
        for difference in [-50.0, 0.0, 300.0] {
            let found = curve.liquid_enthalpy(latent.liquidus + difference);
            assert!(
                (found - capacity * difference).abs() < 1e-6 * capacity,
                "{difference}: {found}"
            );
        }
        for fraction in [0.01, 0.5, 0.99] {
            let enthalpy = curve
                .enthalpy_at_liquid_fraction(fraction)
                .expect("it melts");
            let found = curve.liquid_fraction_from_enthalpy(enthalpy);
            assert!((found - fraction).abs() < 1e-12, "{fraction}: {found}");
        }
    }
    let solid = curve(&peaked(), None);
    assert_eq!(solid.enthalpy_at_liquid_fraction(0.5), None);
}

proptest! {
    /// Up to 3e9 J/m³ about the melting interval.
    #[test]
    fn enthalpy_to_combined_temperature_and_back(enthalpy in -3e9..3e9, rise in 1e-3..100.0) {
        for (i, curve) in curves().iter().enumerate() {
            let combined = curve.combined(enthalpy);
            let (back, slope) = curve.from_combined(combined);
            let scale = curve.maximum_capacity() * 16.0 * f64::EPSILON * 10.0 * combined.abs().max(1000.0);
            prop_assert!((back - enthalpy).abs() <= scale, "curve {i}: {enthalpy} -> {back}");
            prop_assert!(slope > 0.0 && slope.is_finite(), "curve {i}: {slope}");
            let (above, other) = curve.from_combined(combined + rise);
            // the slope is c / (1 + c / C), and C ten times the largest c
            let least = curve.minimum_capacity() / 1.1;
            prop_assert!(above - back >= least * rise - scale, "curve {i}");
            // the derivative, where no knot lies between and the capacity changes linearly
            let pieces = [enthalpy, above].map(|h| piece_index(&curve.enthalpies, h));
            if pieces[0] == pieces[1] {
                let mean = 0.5 * (slope + other);
                let error: f64 = above - back - mean * rise;
                prop_assert!(error.abs() <= 2e-2 * mean * rise + scale, "curve {i}: {error}");
            }
        }
    }

    #[test]
    fn temperature_to_enthalpy_and_back(temperature in 1.0..30_000.0) {
        for (i, curve) in curves().iter().enumerate() {
            let back = curve.temperature(curve.enthalpy(temperature));
            // h is a few 1e9 J/m³ from its zero at one end and the capacity as low as 3.5e6:
            // its rounding is a few ulp of the temperature
            let scale = temperature.max(2000.0);
            prop_assert!((back - temperature).abs() <= 16.0 * f64::EPSILON * scale,
                "curve {i}: {temperature} -> {back}");
        }
    }

    #[test]
    fn enthalpy_to_temperature_and_back(enthalpy in -8e9..1e11) {
        for (i, curve) in curves().iter().enumerate() {
            if i == 7 && (0.0..DENSITY * 260e3).contains(&enthalpy) {
                continue; // inside the jump one temperature has many enthalpies
            }
            let back = curve.enthalpy(curve.temperature(enthalpy));
            // one ulp of temperature is worth one ulp times the capacity times the temperature
            let scale = enthalpy.abs() + curve.maximum_capacity() * 2000.0;
            prop_assert!((back - enthalpy).abs() <= 16.0 * f64::EPSILON * scale,
                "curve {i}: {enthalpy} -> {back}");
        }
    }

    #[test]
    fn enthalpy_and_temperature_increase_together(low in 1.0..3000.0, step in 1e-3..500.0) {
        for curve in curves() {
            let (h_low, h_high) = (curve.enthalpy(low), curve.enthalpy(low + step));
            // the least capacity times the step, less rounding of numbers up to 1e10
            prop_assert!(h_high - h_low >= curve.minimum_capacity() * step - 1e-5);
            prop_assert!(curve.temperature(h_high) > curve.temperature(h_low));
        }
    }

    #[test]
    fn capacity_is_the_slope_of_the_enthalpy(temperature in 100.0..2500.0) {
        let knots = [293.0, 293.15, 600.0, 1000.0, 1010.0, 1100.0, 1658.0, 1690.0, 1700.0, 1723.0, 2000.0];
        let d = 0.01;
        prop_assume!(knots.iter().all(|knot| f64::abs(temperature - knot) > d));
        for curve in curves() {
            let slope = (curve.enthalpy(temperature + d) - curve.enthalpy(temperature - d)) / (2.0 * d);
            // exact for a quadratic; h up to 1e10 rounds at 2e-6, divided by 2 d
            prop_assert!((slope - curve.capacity(temperature)).abs() < 1e-3);
            prop_assert!((curve.minimum_capacity()..=curve.maximum_capacity())
                .contains(&curve.capacity(temperature)));
        }
    }

    #[test]
    fn constant_capacity_gives_density_heat_and_difference(
        from in 1.0..20_000.0, to in 1.0..20_000.0,
    ) {
        let curve = curve(&Property::Constant(490.0), None);
        let rise = curve.enthalpy(to) - curve.enthalpy(from);
        // rounding of numbers up to 8e10
        prop_assert!((rise - DENSITY * 490.0 * (to - from)).abs() < 1e-4);
    }

    #[test]
    fn heating_in_the_enthalpy_form_conserves_energy_in_any_step(
        from in 300.0..2500.0, heat in -5e9..2e10,
    ) {
        for curve in curves() {
            let before = curve.enthalpy(from);
            let (temperature, after) = curve.advance(from, before, heat);
            prop_assert_eq!(after, before + heat);
            prop_assert_eq!(temperature, curve.temperature(after));
        }
    }

    #[test]
    fn table_enthalpy_is_the_integral_of_the_table(from in 200.0..2500.0, to in 200.0..2500.0) {
        let Property::Table(rows) = peaked() else { unreachable!("peaked is a table") };
        let curve = curve(&peaked(), None);
        let rise = curve.enthalpy(to) - curve.enthalpy(from);
        // rounding of numbers up to 2e10
        prop_assert!((rise - DENSITY * rows.integral(from, to)).abs() < 1e-4);
    }
}

#[test]
fn the_interval_takes_up_its_latent_heat_in_both_conventions() {
    let latent = DENSITY * 260e3;
    let Property::Table(rows) = peaked() else {
        unreachable!("peaked is a table")
    };
    let solid_end = rows.at(1658.0);
    let cases = [
        (peaked(), MushyCapacity::LatentOnly, 0.0),
        (by_phase(), MushyCapacity::LatentOnly, 0.0),
        (
            Property::Constant(490.0),
            MushyCapacity::LatentPlusSensible,
            490.0 * 65.0,
        ),
        (
            peaked(),
            MushyCapacity::LatentPlusSensible,
            rows.integral(1658.0, 1723.0),
        ),
        (
            by_phase(),
            MushyCapacity::LatentPlusSensible,
            0.5 * (solid_end + 830.0) * 65.0,
        ),
    ];
    for (specific_heat, convention, sensible) in cases {
        let curve = curve(&specific_heat, Some(melting(convention)));
        assert_eq!(curve.enthalpy(1658.0), 0.0, "zero at the solidus");
        let content = curve.enthalpy(1723.0);
        let expected = latent + DENSITY * sensible;
        // a handful of roundings
        assert!(
            (content - expected).abs() < 1e-14 * expected,
            "{content} is not {expected}"
        );
    }
}

#[test]
fn the_published_curve_of_the_goldak_block_is_reproduced() {
    // [Wang2025] eq. 7.31: C_p = 4000 J/(kg K) between 1385 and 1450
    let latent = LatentHeat {
        solidus: 1385.0,
        liquidus: 1450.0,
        ..melting(MushyCapacity::LatentOnly)
    };
    let curve =
        EnthalpyCurve::new(7820.0, &Property::Constant(490.0), Some(latent)).expect("valid");
    for (temperature, specific_heat) in [
        (1384.9, 490.0),
        (1385.0, 4000.0),
        (1400.0, 4000.0),
        (1450.0, 4000.0),
        (1450.1, 490.0),
    ] {
        assert_eq!(
            curve.capacity(temperature),
            7820.0 * specific_heat,
            "{temperature}"
        );
    }
    assert_eq!(curve.liquid_fraction(1417.5), 0.5);
    assert_eq!(curve.minimum_capacity(), 7820.0 * 490.0);
    assert_eq!(curve.maximum_capacity(), 7820.0 * 4000.0);
}

#[test]
fn small_apparent_steps_approach_the_enthalpy_form() {
    let apparent = LatentHeat {
        form: LatentHeatForm::Apparent,
        ..melting(MushyCapacity::LatentPlusSensible)
    };
    let curve = curve(&by_phase(), Some(apparent));
    let (mut temperature, mut enthalpy) = (1500.0, curve.enthalpy(1500.0));
    let start = enthalpy;
    let (heat, steps) = (4e9, 40_000);
    for _ in 0..steps {
        (temperature, enthalpy) = curve.advance(temperature, enthalpy, heat / f64::from(steps));
    }
    // first order: one step overshoots each end of the interval by at most heat/steps = 1e5
    // times the ratio of capacities, about 8
    assert!((enthalpy - start - heat).abs() < 2.0 * 8.0 * 1e5);
    assert_eq!(enthalpy, curve.enthalpy(temperature));
}

#[test]
fn cooling_from_the_liquidus_releases_latent_heat_in_both_forms() {
    // docs/theory/phase_change.md: wang-7.5.1 starts exactly at the liquidus, which must count as mushy
    for form in [LatentHeatForm::Enthalpy, LatentHeatForm::Apparent] {
        let latent = LatentHeat {
            form,
            ..melting(MushyCapacity::LatentOnly)
        };
        let curve = curve(&Property::Constant(490.0), Some(latent));
        let (temperature, _) = curve.advance(1723.0, curve.enthalpy(1723.0), -4000.0 * DENSITY);
        // one kelvin of 4000 J/(kg K); rounding of 1e9 J/m³
        assert!(
            (temperature - 1722.0).abs() < 1e-9,
            "{form:?}: {temperature}"
        );
    }
}

#[test]
fn a_pure_substance_melts_at_one_temperature() {
    let curve = curve(&by_phase(), Some(pure()));
    let latent = DENSITY * 260e3;
    for fraction in [0.0, 0.25, 0.5, 1.0] {
        let enthalpy = fraction * latent;
        assert_eq!(curve.temperature(enthalpy), 1700.0);
        assert_eq!(curve.liquid_fraction_from_enthalpy(enthalpy), fraction);
    }
    assert_eq!(
        curve.enthalpy(1700.0),
        latent,
        "liquid at the melting temperature"
    );
    assert_eq!(curve.liquid_fraction(1700.0), 1.0);
    assert!(curve.temperature(-1.0) < 1700.0 && curve.temperature(latent + 1.0) > 1700.0);
    assert!(curve.maximum_capacity().is_finite());
}

#[test]
fn liquid_fraction_follows_enthalpy_and_temperature_alike() {
    let curve = curve(&peaked(), Some(melting(MushyCapacity::LatentPlusSensible)));
    for (temperature, fraction) in [(300.0, 0.0), (1690.5, 0.5), (1723.0, 1.0), (9000.0, 1.0)] {
        assert_eq!(curve.liquid_fraction(temperature), fraction);
        let from_enthalpy = curve.liquid_fraction_from_enthalpy(curve.enthalpy(temperature));
        // rounding of the temperature, over an interval of 65 K
        assert!((from_enthalpy - fraction).abs() < 1e-13 * 1700.0 / 65.0);
    }
    assert_eq!(
        super::EnthalpyCurve::liquid_fraction(&curves()[0], 9000.0),
        0.0
    );
}

#[test]
fn not_a_number_stays_one() {
    for curve in curves() {
        assert!(curve.temperature(f64::NAN).is_nan() && curve.enthalpy(f64::NAN).is_nan());
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_reason() {
    let constant = Property::Constant(490.0);
    let good = melting(MushyCapacity::LatentOnly);
    let cases = [
        (
            -1.0,
            constant.clone(),
            Some(good),
            "density must be above 0",
        ),
        (
            DENSITY,
            table(&[1.0, 2.0], &[5.0, 0.0]),
            None,
            "specific heat must be above 0",
        ),
        (DENSITY, by_phase(), None, "has no coupler `phase_change`"),
        (
            DENSITY,
            constant.clone(),
            Some(LatentHeat {
                liquidus: 1600.0,
                ..good
            }),
            "lies below the solidus",
        ),
        (
            DENSITY,
            constant.clone(),
            Some(LatentHeat {
                latent_heat: 0.0,
                ..good
            }),
            "leaves no heat capacity",
        ),
        (
            DENSITY,
            constant,
            Some(LatentHeat {
                form: LatentHeatForm::Apparent,
                ..pure()
            }),
            "infinite",
        ),
    ];
    for (density, specific_heat, latent, message) in cases {
        let error = EnthalpyCurve::new(density, &specific_heat, latent).expect_err(message);
        assert!(error.to_string().contains(message), "{error}");
    }
}
