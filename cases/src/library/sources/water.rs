//! Sources of water and ice. Viscosity and conductivity of the liquid are compared with IAPWS SR6-08, whose formulas at
//! 0.1 MPa are others than those from which the file was computed.

use super::formulas::hemispherical_emissivity;
use super::{PropertyCheck, constant, formula, rows};

/// IAPWS SR6-08 (2011): sum of aᵢ (T/300 K)^bᵢ.
fn sr6_08(a: [f64; 4], b: [f64; 4]) -> impl Fn(f64) -> f64 + 'static {
    move |t| a.iter().zip(b).map(|(a, b)| a * (t / 300.0).powf(b)).sum()
}

/// Wavelength (µm), refractive index and extinction coefficient of water at 25 °C, Hale and Querry (1973).
const OPTICAL: &[[f64; 3]] = &[
    [2.6, 1.242, 0.00317],
    [2.8, 1.142, 0.115],
    [3.0, 1.371, 0.272],
    [3.2, 1.478, 0.0924],
    [3.5, 1.4, 0.0094],
    [4.0, 1.351, 0.0046],
    [4.5, 1.332, 0.0134],
    [5.0, 1.325, 0.0124],
    [5.5, 1.298, 0.0116],
    [6.0, 1.265, 0.107],
    [6.5, 1.339, 0.0392],
    [7.0, 1.317, 0.032],
    [7.5, 1.304, 0.0326],
    [8.0, 1.291, 0.0343],
    [9.0, 1.262, 0.0399],
    [10.0, 1.218, 0.0508],
    [11.0, 1.153, 0.0968],
    [12.0, 1.111, 0.199],
    [13.0, 1.146, 0.305],
    [14.0, 1.21, 0.37],
    [15.0, 1.27, 0.402],
    [16.0, 1.325, 0.422],
    [18.0, 1.423, 0.426],
    [20.0, 1.48, 0.393],
    [25.0, 1.531, 0.356],
    [30.0, 1.551, 0.328],
    [40.0, 1.519, 0.385],
    [50.0, 1.587, 0.514],
    [70.0, 1.821, 0.576],
    [100.0, 1.957, 0.532],
    [200.0, 2.13, 0.504],
];

/// The liquid at 0 to 100 °C, rows of the file; releases R6-95 and R10-06 evaluated at 101325 Pa.
pub(super) fn water() -> Vec<PropertyCheck> {
    let viscosity = sr6_08(
        [280.68, 511.45, 61.131, 0.45903],
        [-1.9, -7.7, -19.6, -40.0],
    );
    let conductivity = sr6_08(
        [1.6630, -1.7781, 1.1567, -0.432_115],
        [-1.15, -3.4, -6.0, -7.6],
    );
    vec![
        constant("density.solid", 916.722),
        constant("density.liquid", 998.207),
        rows(
            "specific_heat.solid",
            &[(233.15, 1804.507), (253.15, 1949.832), (273.15, 2096.695)],
        ),
        rows(
            "specific_heat.liquid",
            &[
                (273.15, 4219.445),
                (283.15, 4195.159),
                (293.15, 4184.051),
                (303.15, 4179.820),
                (313.15, 4179.415),
                (333.15, 4184.953),
                (353.15, 4196.753),
                (373.12, 4215.644),
            ],
        ),
        formula("conductivity.solid", 233.0, 274.0, |t| 651.0 / t),
        formula("conductivity.liquid", 273.0, 374.0, conductivity),
        constant("solidus", 273.1525),
        constant("liquidus", 273.1525),
        constant("latent_heat", 333_426.0),
        constant("boiling_temperature", 373.1243),
        constant("vaporisation_heat", 2_256_472.0),
        constant("molar_mass", 0.018_015_268),
        constant("thermal_expansion", 4.98892e-5),
        constant("youngs_modulus", 9.0e9),
        constant("poissons_ratio", 0.32),
        constant("emissivity", hemispherical_emissivity(OPTICAL, 298.15)),
        formula("viscosity", 273.0, 374.0, move |t| 1e-6 * viscosity(t)),
        formula("surface_tension", 273.0, 374.0, |t| {
            let tau = 1.0 - t / 647.096;
            0.2358 * tau.powf(1.256) * (1.0 - 0.625 * tau)
        }),
    ]
}
