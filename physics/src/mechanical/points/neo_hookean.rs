//! `law.neo_hookean`: compressible rubber, Bonet & Wood (2008), section 6.4.3; docs/theory/mechanics.md.
//!
//! ```text
//! W = mu/2 (F : F - 3) - mu ln J + lame/2 ln^2 J,   J = det F
//! P = mu (F - F^-T) + lame ln J F^-T
//! ```

use nalgebra::Matrix3;
use perimelt_core::SetupError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{LawPoint, Measure, PointLaw, StepStates};

/// Compressible rubber (neo-Hookean), by Young's modulus and Poisson's ratio at small strains; needs `kinematics = "finite"`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeoHookean {
    /// The least stretch along any direction that occurs; the step of explicit motion is stable down to it.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    #[serde(default = "half")]
    least_stretch: f64,
}

fn half() -> f64 {
    0.5
}

impl PointLaw for NeoHookean {
    const STRAIN: Measure = Measure::Gradient;
    const HAS_TANGENT: bool = true;

    fn prepare(&mut self) -> Result<(), SetupError> {
        match self.least_stretch > 0.0 && self.least_stretch <= 1.0 {
            true => Ok(()),
            false => {
                let message = format!("the least stretch is {}", self.least_stretch);
                let expected = "a number above 0, at most 1";
                Err(SetupError::value("least_stretch", message, expected))
            }
        }
    }

    fn stress(&self, point: &LawPoint<'_>, gradient: &Matrix3<f64>, _: &[f64]) -> Matrix3<f64> {
        let (shear, lame) = (point.shear_modulus, point.lame());
        let (inverse, log) = inverse_and_log(gradient);
        gradient * shear + inverse.transpose() * (lame * log - shear)
    }

    fn energy(&self, point: &LawPoint<'_>, gradient: &Matrix3<f64>, _: &[f64]) -> f64 {
        let (shear, lame) = (point.shear_modulus, point.lame());
        let (_, log) = inverse_and_log(gradient);
        0.5 * shear * (gradient.norm_squared() - 3.0) - shear * log + 0.5 * lame * log * log
    }

    fn tangent(
        &self,
        point: &LawPoint<'_>,
        gradient: &Matrix3<f64>,
        _: StepStates<'_>,
        change: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        let (shear, lame) = (point.shear_modulus, point.lame());
        let (inverse, log) = inverse_and_log(gradient);
        let relative = inverse * change;
        let turned = (relative * inverse).transpose() * (shear - lame * log);
        Some(change * shear + turned + inverse.transpose() * (lame * relative.trace()))
    }

    /// The slope of uniaxial strain, `d P / d F = mu (1 + F^-2) + lame (1 - ln F) F^-2`.
    fn steepest(&self, point: &LawPoint<'_>) -> f64 {
        let (shear, lame) = (point.shear_modulus, point.lame());
        let (square, log) = (self.least_stretch.powi(-2), self.least_stretch.ln());
        (shear * (1.0 + square) + lame * (1.0 - log) * square) / (2.0 * shear + lame)
    }
}

/// `F^-1` and `ln det F`; not finite where F turns the point inside out.
fn inverse_and_log(gradient: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    let not_finite = Matrix3::from_element(f64::NAN);
    let inverse = gradient.try_inverse().unwrap_or(not_finite);
    (inverse, gradient.determinant().ln())
}

crate::register_point_law!("neo_hookean", NeoHookean);
