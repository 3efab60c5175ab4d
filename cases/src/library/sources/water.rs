//! Sources of water and ice. Viscosity and conductivity of the liquid are compared with IAPWS SR6-08, whose formulas at
//! 0.1 MPa are others than those from which the file was computed.

use super::{Check, constant, formula, rows};

/// IAPWS SR6-08 (2011): sum of aᵢ (T/300 K)^bᵢ.
fn sr6_08(a: [f64; 4], b: [f64; 4]) -> impl Fn(f64) -> f64 + 'static {
    move |t| a.iter().zip(b).map(|(a, b)| a * (t / 300.0).powf(b)).sum()
}

/// The liquid at 0 to 100 °C, rows of the file; releases R6-95 and R10-06 evaluated at 101325 Pa.
pub(super) fn water() -> Vec<Check> {
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
        constant("thermal_expansion", 4.98892e-5),
        constant("youngs_modulus", 9.0e9),
        constant("poissons_ratio", 0.32),
        formula("viscosity", 273.0, 374.0, move |t| 1e-6 * viscosity(t)),
        formula("surface_tension", 273.0, 374.0, |t| {
            let tau = 1.0 - t / 647.096;
            0.2358 * tau.powf(1.256) * (1.0 - 0.625 * tau)
        }),
    ]
}
