//! Factors that correct the bonds of a discrete family.

use nalgebra::{Matrix3, Vector3};

use crate::body::Body;

use super::{Bond, Correction, FamilySpec};

/// The correction of the bonds of a point from its own family.
#[derive(Debug)]
pub(super) struct Calibration {
    dimension: usize,
    correction: Correction,
    /// Volume of a full horizon over its moment, for a horizon of 1 m: [`FamilySpec::volume`] and
    /// [`FamilySpec::moment`].
    volume_over_moment: f64,
}

impl Calibration {
    pub(super) fn new(body: &Body, spec: &FamilySpec) -> Self {
        Calibration {
            dimension: body.dimension,
            correction: spec.correction,
            volume_over_moment: spec.volume(body, 1.0) / spec.moment(body, 1.0),
        }
    }

    /// Factors along the axes of the bonds of a point with this horizon, m.
    pub(super) fn factors<'a>(
        &self,
        horizon: f64,
        bonds: impl Iterator<Item = &'a Bond> + Clone,
    ) -> [f64; 3] {
        let sum = |part: fn(&Bond) -> f64| bonds.clone().map(part).sum::<f64>();
        let strain = match self.correction {
            Correction::None => return [1.0; 3],
            Correction::Lattice | Correction::Zone => {
                return [self.dimension as f64 / sum(|b| b.weight * b.length); 3];
            }
            Correction::Volume => {
                return [self.volume_over_moment / horizon / sum(|b| b.weight); 3];
            }
            Correction::Point | Correction::Balanced => Strain::Isotropic,
            Correction::Uniaxial => Strain::Uniaxial,
        };
        calibration(self.dimension, strain, bonds)
    }
}

/// Factors `a_m` along the axes that calibrate the bonds of a point: weighted with the [`factor_along`]
/// each of them, `sum_j weight |xi| n_m^2 = 1` along every axis m, so that the energy of conduction
/// under any gradient and of elasticity under isotropic strain is the classical one.
///
/// Wang (2025), eqs. 4.4 to 4.8, takes the radius of an ellipsoid with directional factors as
/// semi-axes and the mean of both ends, which corrects surfaces only in part. Families too asymmetric
/// for positive weights get one factor for all directions.
///
/// Under uniaxial strain `sum_j weight |xi| n_m^4 = 3/(dimension + 2)` instead.
fn calibration<'a>(
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
    // a large stiffness along single bonds would limit the step
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
enum Strain {
    Isotropic,
    Uniaxial,
}

#[cfg(test)]
mod tests {
    use crate::body::{Body, Store};
    use crate::family::{Family, FamilySpec, Influence, PartialVolume};
    use crate::shape::{BoxShape, Shape};

    use super::*;

    #[test]
    fn the_volume_correction_gives_each_point_the_volume_of_a_complete_family() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.4, 1.2, 0.1],
        });
        let mut body = Body::fill("gate", &shape, 2, 0.1, 0.5).expect("valid");
        for store in [Store::Lattice, Store::List] {
            body.store = store;
            for influence in [Influence::Constant, Influence::Conical] {
                let spec = FamilySpec {
                    influence,
                    correction: Correction::Volume,
                    partial_volume: PartialVolume::None,
                    ..FamilySpec::new(0.36)
                };
                let family = Family::build(&body, &spec).expect("valid");
                let complete = spec.volume(&body, 0.36) / spec.moment(&body, 0.36);
                if influence == Influence::Constant {
                    // pi delta^2 / (pi delta^3 / 3)
                    assert!((complete - 3.0 / 0.36).abs() < 1e-9);
                }
                for point in 0..body.points.len() {
                    let (mut own, mut ratios) = (0.0, Vec::new());
                    family.for_each_bond(point, |_, bond, _| {
                        own += bond.weight;
                        let share = spec.share(0.36, 0.1, bond.length);
                        ratios.push(bond.weight / share);
                    });
                    assert!((own / complete - 1.0).abs() < 1e-12, "point {point}");
                    // one factor for all bonds of a point
                    assert!(ratios.iter().all(|r| (r / ratios[0] - 1.0).abs() < 1e-12));
                }
            }
        }
    }

    fn bond(xi: [f64; 3], weight: f64) -> Bond {
        let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
        Bond::new(xi, length, [weight; 2])
    }

    /// Sum of `weight |xi| n_m^2` over corrected bonds, for each axis m.
    fn moments(bonds: &[Bond], factors: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|m| {
            let along = |b: &Bond| b.weight * (b.xi[m] / b.length).powi(2) * b.length;
            bonds
                .iter()
                .map(|b| factor_along(b, factors) * along(b))
                .sum()
        })
    }

    #[test]
    fn conduction_is_exact_along_every_axis_of_a_skewed_family() {
        let bonds = [
            bond([0.3, 0.1, 0.0], 0.7),
            bond([0.0, 0.2, 0.0], 1.1),
            bond([-0.2, 0.2, 0.0], 0.4),
            bond([0.4, 0.0, 0.0], 0.5),
        ];
        let factors = calibration(2, Strain::Isotropic, bonds.iter());
        assert!(factors[0] != factors[1], "{factors:?}");
        let [x, y, _] = moments(&bonds, &factors);
        assert!(
            (x - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12,
            "{x} {y}"
        );
    }

    /// One factor keeps the sum over the axes, which is the energy under the mean of all gradients.
    #[test]
    fn a_family_without_positive_factors_keeps_the_sum_over_the_axes() {
        // bonds along one line; and bonds whose exact factor along x is zero
        let line = [bond([0.2, 0.0, 0.0], 0.3), bond([-0.4, 0.0, 0.0], 1.7)];
        let fan = [bond([0.2, 0.0, 0.0], 5.0), bond([0.3, 0.3, 0.0], 2.0)];
        for bonds in [&line, &fan] {
            let factors = calibration(2, Strain::Isotropic, bonds.iter());
            assert_eq!(factors, [factors[0]; 3]);
            let [x, y, _] = moments(bonds, &factors);
            assert!((x + y - 2.0).abs() < 1e-12, "{x} + {y}");
        }
    }
}
