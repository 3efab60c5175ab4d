//! Sources of 304L and 316L.

use super::formulas::{absorptivity_1070nm, boiling, viscosity};
use super::{PropertyCheck, celsius, constant, constant_bulk_modulus, formula, kelvin};

/// Reduction of Young's modulus by temperature (°C).
const STIFFNESS: &[(f64, f64)] = &[
    (20.0, 1.0),
    (100.0, 0.96),
    (200.0, 0.92),
    (300.0, 0.88),
    (400.0, 0.84),
    (500.0, 0.80),
    (600.0, 0.76),
    (700.0, 0.71),
    (800.0, 0.63),
    (900.0, 0.45),
    (1000.0, 0.20),
    (1100.0, 0.10),
];

/// EN 1993-1-2 annex C and EN 1993-1-4, for both steels; the optical constants of Karlsson and Ribbing (1982).
fn both() -> Vec<PropertyCheck> {
    vec![
        formula("thermal_expansion", 293.15, 1473.15, |kelvin| {
            let t = kelvin - 273.15;
            1e-6 * (16.0 + 4.79e-3 * t - 1.243e-6 * t * t)
        }),
        constant("expansion_reference", 293.15),
        constant_bulk_modulus(0.3, kelvin(STIFFNESS, (1200.0, 0.05))),
        celsius("youngs_modulus", 200e9, STIFFNESS).floor(1473.0),
        constant("emissivity", 0.4),
        constant(
            "absorptivity",
            absorptivity_1070nm([1.06, 3.8220, 5.3277], [1.08, 3.8610, 5.3660]),
        ),
    ]
}

/// Pichler et al. (2022), molten 316L.
fn melt_conductivity(temperature: f64) -> f64 {
    2.27 + 1.76e-2 * temperature - 1.39e-6 * temperature.powi(2)
}

/// Kim (1975), molten 316, and Pichler et al. (2022), 316L.
fn melt(from: f64) -> Vec<PropertyCheck> {
    vec![
        formula("conductivity.liquid", from, 2500.0, melt_conductivity),
        formula("viscosity", 1700.0, 3000.0, viscosity(-0.5958, 2385.2)),
        formula("surface_tension", 1700.0, 3000.0, |t| {
            1.593 - 1.9e-4 * (t - 1708.0)
        }),
    ]
}

pub(super) fn s304l() -> Vec<PropertyCheck> {
    let boiling = boiling(&[("Fe", 72.0), ("Cr", 19.0), ("Ni", 9.0)]);
    let calorie = 4184.0;
    let mut checks = vec![
        constant(
            "density",
            7984.1 - 0.26506 * 300.0 - 1.158e-4 * 300.0 * 300.0,
        ),
        formula("specific_heat.solid", 298.0, 1670.0, move |t| {
            calorie * (0.1122 + 3.222e-5 * t)
        }),
        constant("specific_heat.liquid", calorie * 0.190),
        formula("conductivity.solid", 298.0, 1670.0, |t| 8.116 + 0.01618 * t),
        constant("solidus", 1670.0),
        constant("liquidus", 1730.0),
        constant("latent_heat", calorie * 64.0),
        constant("boiling_temperature", boiling.temperature),
        constant("vaporisation_heat", boiling.heat),
        constant("molar_mass", boiling.molar_mass),
        celsius(
            "yield_stress",
            220e6,
            &[
                (20.0, 1.0),
                (100.0, 0.82),
                (200.0, 0.68),
                (300.0, 0.64),
                (400.0, 0.60),
                (500.0, 0.54),
                (600.0, 0.49),
                (700.0, 0.40),
                (800.0, 0.27),
                (900.0, 0.14),
                (1000.0, 0.06),
                (1100.0, 0.03),
            ],
        )
        .floor(1473.0),
    ];
    checks.extend(melt(1730.0));
    checks.extend(both());
    checks
}

pub(super) fn s316l() -> Vec<PropertyCheck> {
    let mut checks = vec![
        constant("density", 7955.0),
        formula("specific_heat.solid", 298.0, 1573.15, |t| {
            428.46 + 0.1816 * t
        }),
        constant("specific_heat.liquid", 770.4),
        formula("conductivity.solid", 298.0, 1573.15, |t| {
            6.308 + 0.02716 * t - 7.301e-6 * t * t
        }),
        constant("solidus", 1658.15),
        constant("liquidus", 1723.15),
        constant("latent_heat", 2.68e5),
        constant("boiling_temperature", 3090.0),
        constant("vaporisation_heat", 7.41e6),
        constant(
            "molar_mass",
            boiling(&[("Fe", 69.0), ("Cr", 17.0), ("Ni", 12.0), ("Mo", 2.0)]).molar_mass,
        ),
        celsius(
            "yield_stress",
            240e6,
            &[
                (20.0, 1.0),
                (100.0, 0.88),
                (200.0, 0.76),
                (300.0, 0.71),
                (400.0, 0.66),
                (500.0, 0.63),
                (600.0, 0.61),
                (700.0, 0.51),
                (800.0, 0.40),
                (900.0, 0.19),
                (1000.0, 0.10),
            ],
        )
        .floor(1473.0),
    ];
    checks.extend(melt(1723.15));
    checks.extend(both());
    checks
}
