//! Sources of S355.

use super::formulas::{absorptivity_1070nm, viscosity};
use super::{PropertyCheck, SourceData, celsius, check, constant, formula};

/// EN 1993-1-2, 3.4.1.2 (J/(kg K)).
fn specific_heat(kelvin: f64) -> f64 {
    let t = kelvin - 273.15;
    if t < 600.0 {
        425.0 + 0.773 * t - 1.69e-3 * t.powi(2) + 2.22e-6 * t.powi(3)
    } else if t < 735.0 {
        666.0 + 13002.0 / (738.0 - t)
    } else if t < 900.0 {
        545.0 + 17820.0 / (t - 731.0)
    } else {
        650.0
    }
}

/// EN 1993-1-2, 3.4.1.3 (W/(m K)).
fn conductivity(kelvin: f64) -> f64 {
    let t = kelvin - 273.15;
    if t < 799.9 { 54.0 - 3.33e-2 * t } else { 27.3 }
}

/// EN 1993-1-2, 3.4.1.1: relative elongation over the difference to 20 °C (1/K).
fn expansion(kelvin: f64) -> f64 {
    let t = kelvin - 273.15;
    let elongation = if t < 749.9 {
        1.2e-5 * t + 0.4e-8 * t * t - 2.416e-4
    } else if t < 860.1 {
        1.1e-2
    } else {
        2e-5 * t - 6.2e-3
    };
    elongation / (t - 20.0)
}

/// EN 1993-1-2, table 3.1: the columns of k_E and k_y.
const STIFFNESS: &[(f64, f64)] = &[
    (20.0, 1.0),
    (100.0, 1.0),
    (200.0, 0.9),
    (300.0, 0.8),
    (400.0, 0.7),
    (500.0, 0.6),
    (600.0, 0.31),
    (700.0, 0.13),
    (800.0, 0.09),
    (900.0, 0.0675),
];
const STRENGTH: &[(f64, f64)] = &[
    (20.0, 1.0),
    (100.0, 1.0),
    (200.0, 1.0),
    (300.0, 1.0),
    (400.0, 1.0),
    (500.0, 0.78),
    (600.0, 0.47),
    (700.0, 0.23),
    (800.0, 0.11),
    (900.0, 0.06),
    (1000.0, 0.04),
    (1100.0, 0.02),
];

fn poissons_ratio() -> Vec<(f64, f64)> {
    let ratio = |stiffness: f64| 0.5 - 210.0 * stiffness / (6.0 * 168.0);
    // hot steel is held at 10 GPa
    const HELD: f64 = 10.0 / 210.0;
    let rows = STIFFNESS.iter().copied().chain([(1000.0, HELD)]);
    rows.map(|(t, stiffness)| (t, ratio(stiffness.max(HELD)).max(0.3)))
        .collect()
}

pub(super) fn s355() -> Vec<PropertyCheck> {
    let iron = 55.845e-3;
    let (c, mn, si) = (0.17, 1.4, 0.3);
    vec![
        constant("density", 7850.0),
        // the peak of the transformation is a hyperbola, between rows 5 K apart
        formula("specific_heat.solid", 293.15, 1473.15, specific_heat).between(0.25),
        constant("specific_heat.liquid", 46.024 / iron),
        formula("conductivity.solid", 293.15, 1473.15, conductivity),
        // Wiedemann and Franz; resistivity of the melt in µΩ cm
        formula("conductivity.liquid", 1750.0, 2500.0, |t| {
            2.445e-8 * t / (1e-8 * (93.691_938_59 + 0.023_986_89 * t))
        }),
        // Hirai, in °C
        constant("solidus", 1495.0 - (20.5 * si + 6.5 * mn) + 273.15),
        constant(
            "liquidus",
            1538.0 - (55.0 * c + 80.0 * c * c + 13.0 * si + 4.8 * mn) + 273.15,
        ),
        constant("latent_heat", 13_810.0 / iron),
        constant("boiling_temperature", 3134.15),
        constant("vaporisation_heat", 349_576.0 / iron),
        constant("molar_mass", iron),
        formula("thermal_expansion", 373.15, 1473.15, expansion),
        constant("expansion_reference", 293.15),
        celsius("youngs_modulus", 210e9, STIFFNESS).floor(1273.0),
        // EN 1993-1-1; bulk modulus of iron, Rayne and Chandrasekhar (1961)
        celsius("poissons_ratio", 1.0, &poissons_ratio()),
        celsius("yield_stress", 355e6, STRENGTH).floor(1473.0),
        constant("emissivity", 0.7),
        check("carbon", SourceData::Range(0.17, 0.20)),
        check("manganese", SourceData::Range(1.20, 1.60)),
        check("silicon", SourceData::Range(0.10, 0.40)),
        // Johnson and Christy (1974), iron
        constant(
            "absorptivity",
            absorptivity_1070nm([0.984, 2.92, 3.79], [1.088, 2.97, 4.06]),
        ),
        formula("viscosity", 1750.0, 3000.0, viscosity(-0.7209, 2694.95)),
        // Sahoo, DebRoy and McNallan (1988), without sulphur
        formula("surface_tension", 1811.0, 3100.0, |t| {
            1.943 - 4.3e-4 * (t - 1811.0)
        }),
    ]
}
