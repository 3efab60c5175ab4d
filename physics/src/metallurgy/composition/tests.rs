//! Coefficients of the published formulas, element by element.

use super::*;

/// Mass % of C, Mn, Si, Ni, Cr, Mo, V.
fn composition(
    [
        carbon,
        manganese,
        silicon,
        nickel,
        chromium,
        molybdenum,
        vanadium,
    ]: [f64; 7],
) -> Composition {
    Composition {
        carbon,
        manganese,
        silicon,
        nickel,
        chromium,
        molybdenum,
        vanadium,
    }
}

/// Maynier, Jungmann and Dollet (1978): hardness by each per cent of C, Si, Mn, Ni, Cr, Mo, V, and that times the logarithm of
/// the rate in K/h.
#[test]
fn hardness_rises_with_each_element_as_published() {
    let published = [
        (
            [223.0, 53.0, 30.0, 12.6, 7.0, 19.0, 0.0],
            [0.0, -19.0, 0.0, 4.0, 8.0, 0.0, 130.0],
        ),
        (
            [185.0, 330.0, 153.0, 65.0, 144.0, 191.0, 0.0],
            [53.0, -55.0, -22.0, -10.0, -20.0, -33.0, 0.0],
        ),
        ([949.0, 27.0, 11.0, 8.0, 16.0, 0.0, 0.0], [0.0; 7]),
    ];
    let with = |[c, si, mn, ni, cr, mo, v]: [f64; 7]| composition([c, mn, si, ni, cr, mo, v]);
    // K/s, and the logarithm of the rate in K/h
    for (rate, logarithm) in [(1.0 / 3600.0, 0.0), (100.0 / 3600.0, 2.0)] {
        for element in 0..7 {
            let mut content = [0.3; 7];
            let less = with(content).hardness(rate);
            content[element] += 1.0;
            let more = with(content).hardness(rate);
            for (i, (constant, slope)) in published.iter().enumerate() {
                let expected = constant[element] + logarithm * slope[element];
                let found = more[i] - less[i];
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }
    }
    let [ferrite, bainite, martensite] = Composition::default().hardness(10.0 / 3600.0);
    assert!((ferrite - 52.0).abs() < 1e-9 && (bainite + 234.0).abs() < 1e-9);
    assert!((martensite - 148.0).abs() < 1e-9);
}

#[test]
fn temperatures_of_the_composition() {
    let steel = Composition {
        carbon: 0.17,
        manganese: 1.4,
        silicon: 0.3,
        ..Composition::default()
    };
    let celsius = [steel.ac1(), steel.ac3(), steel.martensite_start()].map(|t| t - 273.15);
    for (found, by_hand) in celsius.into_iter().zip([716.75, 797.71, 424.53]) {
        assert!((found - by_hand).abs() < 0.01, "{celsius:?}");
    }
    assert!((steel.equilibrium_austenite(steel.ac3() - 1e-9) - 1.0).abs() < 1e-9);
}

/// Li et al. (1998), eqs. 10 to 12: logarithms of the factors of ferrite, pearlite and bainite without alloy, and their
/// change by each per cent of C, Mn, Si, Ni, Cr, Mo, V (for pearlite by the root of Mo), and the exponents of 2 by the grain
/// size number.
#[test]
fn factors_of_the_kinetics_rise_with_each_element_as_published() {
    let published = [
        (1.00, [6.31, 1.78, 0.31, 1.12, 2.70, 4.06, 0.0], 0.41, 3),
        (-4.25, [4.12, 4.36, 0.44, 1.71, 3.33, 5.19, 0.0], 0.32, 3),
        (-10.23, [10.18, 0.85, 0.0, 0.55, 0.90, 0.36, 0.0], 0.29, 2),
    ];
    let laws = |content: [f64; 7], grain_size: f64| {
        let laws = composition(content).kinetics(grain_size);
        laws.map(|law| match law {
            Kinetics::Kirkaldy(law) => law,
            other => panic!("{other:?}"),
        })
    };
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    };
    for (law, (constant, slopes, grain, exponent)) in published.into_iter().enumerate() {
        let of = |content, grain_size| laws(content, grain_size)[law].factor;
        let iron = of([0.0; 7], 0.0);
        close(iron.ln(), constant);
        close((of([0.0; 7], 8.0) / iron).log2(), -8.0 * grain);
        assert_eq!(laws([0.0; 7], 0.0)[law].exponent, exponent);
        for (element, slope) in slopes.into_iter().enumerate() {
            let mut alloy = [0.0; 7];
            alloy[element] = 0.25;
            let is_root = (law, element) == (1, 5);
            let amount = if is_root { 0.5 } else { 0.25 };
            close(of(alloy, 0.0).ln(), constant + slope * amount);
        }
    }
    let content = [0.4, 0.8, 0.3, 1.2, 0.7, 0.2, 0.1];
    let steel = composition(content);
    let [ferrite, pearlite, bainite] = laws(content, 8.0);
    assert_eq!(ferrite.range, steel.bainite_start()..steel.ac3());
    assert_eq!(pearlite.range, steel.bainite_start()..steel.ac1());
    assert_eq!(
        bainite.range,
        steel.martensite_start()..steel.bainite_start()
    );
}

/// Andrews (1965), and Li et al. (1998) for bainite: temperatures (°C) of pure iron, and their change by each per cent of
/// C, Mn, Si, Ni, Cr, Mo, V; that of `Ac3` by carbon goes with its root.
#[test]
fn temperatures_change_with_each_element_as_published() {
    type Of = fn(&Composition) -> f64;
    let published: [(Of, f64, [f64; 7]); 4] = [
        (
            Composition::ac1,
            723.0,
            [0.0, -10.7, 29.1, -16.9, 16.9, 0.0, 0.0],
        ),
        (
            Composition::ac3,
            910.0,
            [-203.0, -30.0, 44.7, -15.2, -11.0, 31.5, 104.0],
        ),
        (
            Composition::bainite_start,
            637.0,
            [-58.0, -35.0, 0.0, -15.0, -34.0, -41.0, 0.0],
        ),
        (
            Composition::martensite_start,
            539.0,
            [-423.0, -30.4, 0.0, -17.7, -12.1, -7.5, 0.0],
        ),
    ];
    for (of, constant, slopes) in published {
        for (element, slope) in slopes.into_iter().enumerate() {
            let mut content = [0.0; 7];
            assert!((of(&composition(content)) - 273.15 - constant).abs() < 1e-9);
            content[element] = 0.25;
            let is_root = constant == 910.0 && element == 0;
            let amount = if is_root { 0.5 } else { 0.25 };
            let found = of(&composition(content)) - 273.15;
            assert!(
                (found - constant - slope * amount).abs() < 1e-9,
                "{constant} {element}: {found}"
            );
        }
    }
}

/// The lever rule between ferrite of 0.02 % carbon and the austenite whose `Ac3 = 910 °C - 203 K sqrt(C)` is the temperature.
#[test]
fn austenite_in_equilibrium_follows_the_lever_rule() {
    let of = |carbon: f64, temperature: f64| {
        let steel = composition([carbon, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        steel.equilibrium_austenite(temperature + 273.15)
    };
    for (carbon, temperature, expected) in [
        // austenite of 0.25 % at 808.5 °C, of 0.64 % at 747.6 °C
        (0.17, 808.5, 0.15 / 0.23),
        (0.17, 747.6, 0.15 / 0.62),
        (0.16, 910.0 - 203.0 * 0.4, 1.0),
        (0.16, 840.0, 1.0),
        (0.17, 950.0, 1.0),
        // less carbon than ferrite dissolves
        (0.01, 808.5, 0.0),
    ] {
        let found = of(carbon, temperature);
        assert!(
            (found - expected).abs() < 1e-9,
            "{carbon} {temperature}: {found}"
        );
    }
}
