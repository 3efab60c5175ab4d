//! `law.orthotropic`: stiffness along the three axes of the material; docs/theory/mechanics.md, "Orthotropic solids".
//!
//! ```text
//! e_aa = sum_b S_ab s_bb,   S_aa = 1 / E_a,   S_ab = S_ba = -nu_ab / E_a,   s_ab = 2 G_ab e_ab,  a != b
//! ```

use nalgebra::{Matrix3, Vector3};
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use perimelt_core::{SetupError, register_property};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{LawPoint, Measure, PointLaw, StepStates};

register_property!(
    "poissons_ratio_13",
    "1",
    "contraction along the third axis of the material over the strain along the first one, under stress along the first one",
    ValueRange::Any
);
register_property!(
    "poissons_ratio_23",
    "1",
    "contraction along the third axis of the material over the strain along the second one, under stress along the second one",
    ValueRange::Any
);

/// Stiffness along the three axes of the material, which `initial.orientation` turns: single plies at any angle, wood, rolled
/// or printed metal.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orthotropic {}

/// Stiffness in the axes of the material, Pa.
struct Stiffness {
    /// Of the strains along the axes.
    normal: Matrix3<f64>,
    /// G of the planes across the axes: 23, 13, 12.
    shear: Vector3<f64>,
}

impl Stiffness {
    /// From the constants of the law; not finite where the compliance has no inverse.
    fn of(constants: &[f64]) -> Self {
        let not_finite = Matrix3::from_element(f64::NAN);
        Stiffness {
            normal: compliance(constants).try_inverse().unwrap_or(not_finite),
            shear: Vector3::new(constants[8], constants[7], constants[6]),
        }
    }

    /// Stress of a strain, both in the axes of the material.
    fn times(&self, strain: &Matrix3<f64>) -> Matrix3<f64> {
        let mut stress = Matrix3::from_diagonal(&(self.normal * strain.diagonal()));
        for axis in 0..3 {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let shear = self.shear[axis] * (strain[(a, b)] + strain[(b, a)]);
            (stress[(a, b)], stress[(b, a)]) = (shear, shear);
        }
        stress
    }
}

/// S of stresses along the axes, 1/Pa.
fn compliance(constants: &[f64]) -> Matrix3<f64> {
    let [e1, e2, e3, nu12, nu13, nu23] = std::array::from_fn(|i| constants[i]);
    let [s12, s13, s23] = [-nu12 / e1, -nu13 / e1, -nu23 / e2];
    Matrix3::new(1.0 / e1, s12, s13, s12, 1.0 / e2, s23, s13, s23, 1.0 / e3)
}

/// Stress of a strain in the axes of space.
fn stress(point: &LawPoint<'_>, strain: &Matrix3<f64>) -> Matrix3<f64> {
    let axes = &point.axes;
    let stress = Stiffness::of(point.constants).times(&(axes.transpose() * strain * axes));
    axes * stress * axes.transpose()
}

impl PointLaw for Orthotropic {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("youngs_modulus_1"),
        Constant::required("youngs_modulus_2"),
        Constant::required("youngs_modulus_3"),
        Constant::required("poissons_ratio_12"),
        Constant::required("poissons_ratio_13"),
        Constant::required("poissons_ratio_23"),
        Constant::required("shear_modulus_12"),
        Constant::required("shear_modulus_13"),
        Constant::required("shear_modulus_23"),
    ];
    const STRAIN: Measure = Measure::Strain;
    const HAS_TANGENT: bool = true;
    const HAS_DIRECTIONS: bool = true;
    const YOUNGS_MODULUS: Option<&'static str> = Some("youngs_modulus_2");

    fn check(&self, constants: &[f64], of: &str) -> Result<(), SetupError> {
        match compliance(constants).cholesky() {
            Some(_) => Ok(()),
            None => {
                let message = format!("{of} would release energy under some strains");
                let expected = "Poisson's ratios nearer to zero, such as a `poissons_ratio_12` whose square is below \
                                `youngs_modulus_1` / `youngs_modulus_2`";
                Err(SetupError::value("", message, expected))
            }
        }
    }

    fn stress(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, _: &[f64]) -> Matrix3<f64> {
        stress(point, strain)
    }

    fn energy(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, _: &[f64]) -> f64 {
        0.5 * stress(point, strain).dot(strain)
    }

    fn tangent(
        &self,
        point: &LawPoint<'_>,
        _: &Matrix3<f64>,
        _: StepStates<'_>,
        change: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        Some(stress(point, change))
    }

    /// The largest ratio of the energies of a strain.
    fn steepest(&self, point: &LawPoint<'_>) -> f64 {
        let (shear, lame) = (point.shear_modulus, point.lame());
        let isotropic = Matrix3::from_element(lame) + Matrix3::identity() * (2.0 * shear);
        let own = Stiffness::of(point.constants);
        let root = isotropic.cholesky().and_then(|c| c.l().try_inverse());
        let ratio = root.map_or(f64::NAN, |root| {
            let ratios = root * own.normal * root.transpose();
            ratios.symmetric_eigenvalues().max()
        });
        ratio.max(own.shear.max() / shear).max(1.0)
    }
}

crate::register_point_law!("orthotropic", Orthotropic);
