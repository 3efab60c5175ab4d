//! Sources of 6061 and AlSi10Mg.

use super::formulas::{absorptivity_1070nm, mixture, viscosity};
use super::{PropertyCheck, celsius, constant, constant_bulk_modulus, formula, kelvin};

/// Molar masses, g/mol.
const AL: f64 = 26.982;
const MG: f64 = 24.305;
const SI: f64 = 28.0855;

/// Young's modulus by temperature, °C and GPa.
const STIFFNESS_6061: &[(f64, f64)] = &[
    (20.0, 70.0),
    (50.0, 69.3),
    (100.0, 67.9),
    (150.0, 65.1),
    (200.0, 60.2),
    (250.0, 54.6),
    (300.0, 47.6),
    (350.0, 37.8),
    (400.0, 28.0),
];

/// Young's modulus by temperature, °C and GPa.
const STIFFNESS_ALSI10MG: &[(f64, f64)] = &[
    (25.0, 77.6),
    (50.0, 75.5),
    (100.0, 72.8),
    (150.0, 63.2),
    (200.0, 60.0),
    (250.0, 55.0),
    (300.0, 45.0),
    (350.0, 37.0),
    (400.0, 28.0),
];

/// Aluminium, and EN 1999-1-2.
fn both() -> Vec<PropertyCheck> {
    vec![
        // CRC Handbook
        constant("boiling_temperature", 2792.15),
        constant("vaporisation_heat", 294e3 / (1e-3 * AL)),
        constant("molar_mass", 1e-3 * AL),
        constant("emissivity", 0.3),
        // Rakic (1995)
        constant(
            "absorptivity",
            absorptivity_1070nm([1.0332, 1.3998, 9.8914], [1.1271, 1.3281, 10.969]),
        ),
        // the polynomial in public codes for the combustion of aluminium
        formula("conductivity.liquid", 933.0, 1700.0, |t| {
            33.9 + 7.892e-2 * t - 2.099e-5 * t * t
        }),
        formula("viscosity", 880.0, 2500.0, viscosity(-0.7324, 803.49)),
        // 6056, Math. Probl. Eng. (2016) 1409872
        formula("surface_tension", 880.0, 2700.0, |t| {
            0.914 - 3.5e-4 * (t - 917.0)
        }),
    ]
}

pub(super) fn a6061() -> Vec<PropertyCheck> {
    let mut checks = vec![
        constant("density", 2700.0),
        formula("specific_heat.solid", 293.0, 774.0, |t| {
            0.41 * (t - 273.15) + 903.0
        }),
        constant("specific_heat.liquid", 31.751 / (1e-3 * AL)),
        formula("conductivity.solid", 293.0, 774.0, |t| {
            167.0 + 0.07 * (t - 293.15)
        }),
        constant("solidus", 855.15),
        constant("liquidus", 925.15),
        constant(
            "latent_heat",
            mixture(&[
                [0.979, 10_710.0, AL],
                [0.010, 8480.0, MG],
                [0.006, 50_210.0, SI],
            ]),
        ),
        formula("thermal_expansion", 373.0, 774.0, |kelvin| {
            let t = kelvin - 273.15;
            (0.1e-7 * t * t + 22.5e-6 * t - 4.5e-4) / (t - 20.0)
        }),
        constant("expansion_reference", 293.15),
        constant_bulk_modulus(0.33, kelvin(STIFFNESS_6061, (550.0, 3.5))),
        celsius("youngs_modulus", 1e9, STIFFNESS_6061).floor(823.0),
        celsius(
            "yield_stress",
            276e6,
            &[
                (20.0, 1.0),
                (100.0, 0.95),
                (150.0, 0.91),
                (200.0, 0.79),
                (250.0, 0.55),
                (300.0, 0.31),
                (350.0, 0.10),
            ],
        )
        .floor(823.0),
    ];
    checks.extend(both());
    checks
}

pub(super) fn alsi10mg() -> Vec<PropertyCheck> {
    let mut checks = vec![
        constant("density", 2670.0),
        // Akwaboa et al. (2023)
        celsius(
            "specific_heat.solid",
            1.0,
            &[(100.0, 800.0), (200.0, 835.0), (300.0, 862.0)],
        ),
        celsius(
            "conductivity.solid",
            1.0,
            &[
                (100.0, 138.4),
                (200.0, 153.9),
                (300.0, 169.8),
                (400.0, 155.2),
            ],
        ),
        constant(
            "specific_heat.liquid",
            mixture(&[
                [0.8965, 31.751, AL],
                [0.10, 27.196, SI],
                [0.0035, 34.309, MG],
            ]),
        ),
        constant("solidus", 843.15),
        constant("liquidus", 883.15),
        constant(
            "latent_heat",
            mixture(&[
                [0.8965, 10_710.0, AL],
                [0.10, 50_210.0, SI],
                [0.0035, 8480.0, MG],
            ]),
        ),
        constant("thermal_expansion", 21e-6),
        // Uzan et al. (2018)
        constant_bulk_modulus(0.33, kelvin(STIFFNESS_ALSI10MG, (569.85, 3.8))),
        celsius("youngs_modulus", 1e9, STIFFNESS_ALSI10MG).floor(843.0),
        celsius(
            "yield_stress",
            1e6,
            &[
                (25.0, 204.0),
                (50.0, 198.0),
                (100.0, 181.0),
                (150.0, 182.0),
                (200.0, 158.0),
                (250.0, 132.0),
                (300.0, 70.0),
                (350.0, 30.0),
                (400.0, 12.0),
            ],
        )
        .floor(843.0),
    ];
    checks.extend(both());
    checks
}
