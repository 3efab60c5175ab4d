//! Interfaces between the layers of a laminate.

use nalgebra::Matrix2;
use perimelt_core::SetupError;
use perimelt_core::body::{Layer, Layers};

use super::kernels::Crossing;
use super::law::PlyConstants;
use crate::plies::{CompleteFamily, TensorBonds, turned};

/// The bonds between two layers, one above the other.
#[derive(Debug)]
pub(super) struct Interface {
    pub(super) crossing: Crossing,
    /// Young's modulus across, Pa.
    pub(super) modulus: f64,
    /// Fractions of the distance that lie in the ply of the lower and of the upper layer.
    pub(super) fractions: [f64; 2],
}

impl Interface {
    /// Moduli of the parts in both plies in series.
    ///
    /// # Errors
    /// Shear moduli for which a bond would have a negative stiffness.
    pub(super) fn new(
        layers: &Layers,
        [lower, upper]: [&Layer; 2],
        complete: &CompleteFamily,
        constants: &PlyConstants,
    ) -> Result<Self, SetupError> {
        let distance = upper.z - lower.z;
        let above = match lower.ply == upper.ply {
            true => 0.5,
            false => (upper.z - layers.plies()[upper.ply].low) / distance,
        };
        let fractions = [1.0 - above, above];
        let compliance: Matrix2<f64> = [lower, upper]
            .iter()
            .zip(fractions)
            .map(|(layer, fraction)| {
                let (sin, cos) = layers.plies()[layer.ply].angle.sin_cos();
                fraction
                    * turned(
                        [cos, sin],
                        constants.shear_across.map(|modulus| 1.0 / modulus),
                    )
            })
            .sum();
        let refused = || {
            let [along, across] = constants.shear_across;
            let message = format!(
                "shear moduli across the ply of {along} Pa along its fibres and {across} Pa across them give bonds of negative \
                 stiffness between layers"
            );
            let expected =
                "`shear_modulus_13` and `shear_modulus_23` that differ by less than a factor of 3";
            SetupError::value("law.lamina", message, expected)
        };
        let moduli = compliance.try_inverse().ok_or_else(refused)?;
        Ok(Interface {
            crossing: Crossing {
                bonds: TensorBonds::new(complete, &moduli).ok_or_else(refused)?,
                distance,
            },
            modulus: constants.modulus_across,
            fractions,
        })
    }
}
