//! Sources of Ti-6Al-4V.

use super::formulas::absorptivity_1070nm;
use super::{PropertyCheck, constant, constant_bulk_modulus, formula, rows};

/// Young's modulus, K and Pa.
const STIFFNESS: &[(f64, f64)] = &[
    (296.3, 103.3e9),
    (418.4, 98.7e9),
    (549.2, 92.5e9),
    (663.1, 87.2e9),
    (781.4, 80.9e9),
    (896.7, 75.4e9),
    (995.3, 70.2e9),
    (1107.8, 64.0e9),
    (1233.5, 48.5e9),
    (1263.0, 33.5e9),
];

/// K, W/(m K).
const CONDUCTIVITY: &[(f64, f64)] = &[
    (297.09, 7.05),
    (374.95, 7.48),
    (472.93, 8.80),
    (572.18, 10.21),
    (672.66, 11.40),
    (773.16, 12.64),
    (872.41, 14.22),
    (974.16, 15.54),
    (1072.18, 17.80),
    (1171.46, 20.11),
    (1265.73, 22.71),
    (1266.6, 19.30),
    (1369.86, 20.92),
    (1470.38, 22.79),
    (1570.85, 23.65),
    (1670.08, 24.59),
    (1770.57, 25.74),
    (1869.80, 26.93),
];

pub(super) fn ti_6al_4v() -> Vec<PropertyCheck> {
    // McCormick and Brooks (1996): densities at 295.75 K and at 1871.62 K
    let elongation = (4419.90f64 / 4198.77).cbrt() - 1.0;
    vec![
        constant("density", 4419.90),
        formula("specific_heat.solid", 298.0, 1877.0, |t| {
            if t <= 1268.0 {
                483.04 + 0.22 * t
            } else {
                412.7 + 0.18 * t
            }
        }),
        constant("specific_heat.liquid", 831.0),
        // Polev, Zinovyev and Korshunov (1985)
        rows("conductivity.solid", CONDUCTIVITY),
        // Boivineau et al. (2006)
        formula("conductivity.liquid", 1950.0, 2700.0, |t| {
            1.83e-2 * t - 6.66
        }),
        constant("solidus", 1877.0),
        constant("liquidus", 1923.0),
        constant("latent_heat", 2.86e5),
        constant("boiling_temperature", 3533.0),
        constant("vaporisation_heat", 9.83e6),
        constant("molar_mass", 0.047867),
        rows(
            "thermal_expansion",
            &[
                (373.15, 8.6e-6),
                (573.15, 9.2e-6),
                (
                    1871.62,
                    (elongation + 8.6e-6 * (295.75 - 273.15)) / (1871.62 - 273.15),
                ),
            ],
        ),
        constant("expansion_reference", 273.15),
        constant_bulk_modulus(0.342, STIFFNESS.iter().copied().chain([(1877.0, 5e9)])),
        // Fukuhara and Sanpei (1993)
        rows("youngs_modulus", STIFFNESS).floor(1877.0),
        // Johnson and Cook, exponent of Xin et al.
        formula("yield_stress", 298.0, 1877.0, |t| {
            880e6 * (1.0 - ((t - 298.0) / (1877.0 - 298.0)).powf(0.633))
        })
        .floor(1877.0),
        // Parker and Abbott (1965), 170 µΩ cm
        formula("emissivity", 300.0, 1877.0, |t| {
            let x = 170e-6 * t;
            0.766 * x.sqrt() - (0.309 - 0.0889 * x.ln()) * x - 0.0175 * x.powf(1.5)
        }),
        // Johnson and Christy (1974), titanium
        constant(
            "absorptivity",
            absorptivity_1070nm([0.984, 3.35, 3.97], [1.088, 3.50, 4.02]),
        ),
        formula("viscosity", 1923.0, 3500.0, |t| {
            1e-3 * (-1.6 + 5346.0 / t).exp()
        }),
        formula("surface_tension", 1923.0, 3500.0, |t| {
            1.52 - 1.56e-4 * (t - 1923.0)
        }),
    ]
}
