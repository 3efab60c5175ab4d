//! Sources of IN625 and IN718.

use super::formulas::boiling;
use super::{PropertyCheck, celsius, constant, constant_bulk_modulus, formula, rows};

/// Nickel, Aziz, Schmon and Pottlacher (2015); Keller et al. (2015); Honda and Watanabe (2025).
fn both() -> Vec<PropertyCheck> {
    vec![
        formula("surface_tension", 1600.0, 3000.0, |t| {
            1.864 - 0.35e-3 * (t - 1728.0)
        }),
        constant("emissivity", 0.3),
        constant("absorptivity", 0.36),
    ]
}

/// °C, and the value of the source.
const IN625_SPECIFIC_HEAT: [(f64, f64); 11] = [
    (21.0, 410.0),
    (93.0, 427.0),
    (204.0, 456.0),
    (316.0, 481.0),
    (427.0, 511.0),
    (538.0, 536.0),
    (649.0, 565.0),
    (760.0, 590.0),
    (871.0, 620.0),
    (982.0, 645.0),
    (1093.0, 670.0),
];

/// °C, and the value of the source.
const IN625_THERMAL_EXPANSION: [(f64, f64); 9] = [
    (93.0, 12.8),
    (204.0, 13.1),
    (316.0, 13.3),
    (427.0, 13.7),
    (538.0, 14.0),
    (649.0, 14.8),
    (760.0, 15.3),
    (871.0, 15.8),
    (927.0, 16.2),
];

pub(super) fn in625() -> Vec<PropertyCheck> {
    let boiling = boiling(&[
        ("Ni", 62.5),
        ("Cr", 21.5),
        ("Mo", 9.0),
        ("Nb", 3.65),
        ("Fe", 2.5),
    ]);
    let solidus = 1290.0f64;
    let carried_on = 2.7474e-6 * solidus.powi(2) + 0.012907 * solidus + 9.62532;
    let mut checks = vec![
        constant("density", 8440.0),
        celsius("specific_heat.solid", 1.0, &IN625_SPECIFIC_HEAT),
        constant("specific_heat.liquid", 709.25),
        celsius(
            "conductivity.solid",
            1.0,
            &[
                (21.0, 9.8),
                (38.0, 10.1),
                (93.0, 10.8),
                (204.0, 12.5),
                (316.0, 14.1),
                (427.0, 15.7),
                (538.0, 17.5),
                (649.0, 19.0),
                (760.0, 20.8),
                (871.0, 22.8),
                (982.0, 25.2),
                (1289.85, carried_on),
            ],
        ),
        constant("conductivity.liquid", 30.078),
        constant("solidus", solidus + 273.15),
        constant("liquidus", 1350.0 + 273.15),
        constant("latent_heat", 2.9e5),
        constant("boiling_temperature", boiling.temperature),
        constant("vaporisation_heat", boiling.heat),
        constant("molar_mass", boiling.molar_mass),
        celsius("thermal_expansion", 1e-6, &IN625_THERMAL_EXPANSION),
        constant("expansion_reference", 294.15),
        constant("viscosity", 7.0e-3),
        // the ends of the table of Special Metals
        celsius("youngs_modulus", 1e9, &[(21.0, 207.5), (871.0, 147.5)]).floor(1563.0),
        // and the bulk modulus of 871 °C
        celsius(
            "poissons_ratio",
            1.0,
            &[
                (21.0, 0.278),
                (871.0, 0.336),
                (1289.85, 0.5 - (0.5 - 0.336) * 10.0 / 147.5),
            ],
        ),
        // Callister, and the fall of HASTELLOY X, Haynes International
        celsius(
            "yield_stress",
            517e6 / 340.0,
            &[
                (21.0, 340.0),
                (538.0, 224.0),
                (649.0, 212.0),
                (760.0, 218.0),
                (871.0, 189.0),
                (982.0, 94.0),
                (1093.0, 45.0),
            ],
        )
        .floor(1563.0),
    ];
    checks.extend(both());
    checks
}

pub(super) fn in718() -> Vec<PropertyCheck> {
    let boiling = boiling(&[
        ("Ni", 52.5),
        ("Cr", 19.0),
        ("Fe", 19.0),
        ("Nb", 5.1),
        ("Mo", 3.0),
    ]);
    // Btu in/(ft² h °F)
    let btu = 0.144_227_9;
    let mut checks = vec![
        constant("density", 8170.0),
        formula("specific_heat.solid", 298.0, 1361.0, |t| {
            let below = |t: f64| 1e3 * (0.362 + 2.118e-4 * t);
            let above = |t: f64| 1e3 * (0.639 - 3.355e-6 * t);
            if t <= 800.0 {
                below(t)
            } else if t >= 1070.0 {
                above(t)
            } else {
                let part = (t - 800.0) / 270.0;
                (1.0 - part) * below(800.0) + part * above(1070.0)
            }
        }),
        // FLOW-3D deck, cgs
        constant("specific_heat.liquid", 7.2e6 * 1e-4),
        constant("latent_heat", 2.1e9 * 1e-4),
        constant("viscosity", 0.072 * 0.1),
        rows(
            "conductivity.solid",
            &[
                (fahrenheit(70.0), 79.0 * btu),
                (fahrenheit(200.0), 87.0 * btu),
                (fahrenheit(400.0), 100.0 * btu),
                (fahrenheit(600.0), 112.0 * btu),
                (fahrenheit(800.0), 124.0 * btu),
                (fahrenheit(1000.0), 136.0 * btu),
                (fahrenheit(1200.0), 148.0 * btu),
                (1100.0, 24.3),
            ],
        ),
        constant("conductivity.liquid", 30.0),
        constant("solidus", 1260.0 + 273.15),
        constant("liquidus", 1336.0 + 273.15),
        constant("boiling_temperature", boiling.temperature),
        constant("vaporisation_heat", boiling.heat),
        constant("molar_mass", boiling.molar_mass),
        rows(
            "thermal_expansion",
            &[
                (fahrenheit(200.0), 12.8e-6),
                (fahrenheit(400.0), 13.5e-6),
                (fahrenheit(600.0), 13.9e-6),
                (fahrenheit(800.0), 14.2e-6),
                (fahrenheit(1000.0), 14.4e-6),
                (fahrenheit(1200.0), 15.1e-6),
                (fahrenheit(1400.0), 16.0e-6),
            ],
        ),
        constant("expansion_reference", 298.15),
        rows("youngs_modulus", &stiffness_718()).floor(1533.0),
        constant_bulk_modulus(0.30, stiffness_718().into_iter().chain([(1533.0, 10e9)])),
        rows(
            "yield_stress",
            &[
                (fahrenheit(70.0), 1157e6),
                (fahrenheit(800.0), 1027e6),
                (fahrenheit(1000.0), 1006e6),
                (fahrenheit(1200.0), 965e6),
                (fahrenheit(1400.0), 723e6),
                (fahrenheit(1600.0), 236e6),
            ],
        )
        .floor(1533.0),
    ];
    checks.extend(both());
    checks
}

/// Temperature (K), of a whole degree celsius as in the tables that have both.
fn fahrenheit(t: f64) -> f64 {
    ((t - 32.0) / 1.8).round() + 273.15
}

/// Young's modulus of IN718, K and Pa.
fn stiffness_718() -> Vec<(f64, f64)> {
    vec![
        (fahrenheit(70.0), 208e9),
        (fahrenheit(200.0), 205e9),
        (fahrenheit(400.0), 202e9),
        (fahrenheit(600.0), 194e9),
        (fahrenheit(800.0), 186e9),
        (fahrenheit(1000.0), 179e9),
        (fahrenheit(1200.0), 172e9),
        (fahrenheit(1400.0), 162e9),
        (fahrenheit(1600.0), 127e9),
        (fahrenheit(1749.0), 78e9),
    ]
}
