//! Factors that make a discrete family exact.

use nalgebra::{Matrix3, Vector3};

use super::{Bond, Correction};

/// Factors `a_m` along the axes that calibrate the bonds of a point: weighted with the [`factor_along`]
/// each of them, `sum_j weight |xi| n_m^2 = 1` along every axis m, so that the energy of conduction
/// under any gradient and of elasticity under isotropic strain is the classical one.
///
/// Wang (2025), eqs. 4.4 to 4.8, takes the radius of an ellipsoid with directional factors as
/// semi-axes and the mean of both ends, which repairs surfaces but in part. Families too asymmetric
/// for positive weights get one factor for all directions.
///
/// Under uniaxial strain `sum_j weight |xi| n_m^4 = 3/(dimension + 2)` instead.
pub(super) fn calibration<'a>(
    dimension: usize,
    strain: Strain,
    bonds: impl Iterator<Item = &'a Bond> + Clone,
) -> [f64; 3] {
    let power = match strain {
        Strain::Isotropic => 1,
        Strain::Uniaxial => 2,
    };
    let target = match strain {
        Strain::Isotropic => 1.0,
        Strain::Uniaxial => 3.0 / (dimension + 2) as f64,
    };
    let mut matrix = Matrix3::identity();
    matrix.view_mut((0, 0), (dimension, dimension)).fill(0.0);
    let mut trace = 0.0;
    for bond in bonds.clone() {
        let squares = bond.xi.map(|x| (x / bond.length).powi(2));
        for row in 0..dimension {
            let moment = bond.weight * bond.length * squares[row].powi(power);
            trace += moment;
            for column in 0..dimension {
                matrix[(row, column)] += moment * squares[column];
            }
        }
    }
    let isotropic = [dimension as f64 * target / trace; 3];
    let Some(inverse) = matrix.try_inverse() else {
        return isotropic;
    };
    let factors = (inverse * Vector3::repeat(target)).into();
    let least = bonds
        .map(|b| factor_along(b, &factors))
        .fold(f64::INFINITY, f64::min);
    // an excess of stiffness along single bonds would bind the step
    if least > 0.1 * isotropic[0] {
        factors
    } else {
        isotropic
    }
}

/// The factor of a bond from those of its point along the axes.
pub(super) fn factor_along(bond: &Bond, factors: &[f64; 3]) -> f64 {
    let parts = bond.xi.iter().zip(factors);
    parts.map(|(x, a)| (x / bond.length).powi(2) * a).sum()
}

/// The strain whose energy a calibration makes exact.
#[derive(Clone, Copy)]
pub(super) enum Strain {
    Isotropic,
    Uniaxial,
}

impl Strain {
    pub(super) fn of(correction: Correction) -> Self {
        match correction {
            Correction::Uniaxial => Strain::Uniaxial,
            _ => Strain::Isotropic,
        }
    }
}
