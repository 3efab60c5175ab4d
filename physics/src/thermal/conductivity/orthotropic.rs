//! Conductivities along three axes at right angles, such as those of a ply: along its fibres, across them in its plane, and
//! through it.

use nalgebra::Vector3;
use perimelt_core::SetupError;
use perimelt_core::law::Constant;
use perimelt_core::material::{Property, ValueRange};
use perimelt_core::numbers::check_finite;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Conductivity, ConductivityLaw, Principal};

perimelt_core::register_property! { "conductivity_1", "W/(m K)", "thermal conductivity along the first axis of the material, such as its fibres", ValueRange::Positive }
perimelt_core::register_property! { "conductivity_2", "W/(m K)", "thermal conductivity along the second axis of the material", ValueRange::Positive }
perimelt_core::register_property! { "conductivity_3", "W/(m K)", "thermal conductivity along the third axis of the material, z; without effect in plane bodies", ValueRange::Positive }

/// Conductivities along three axes at right angles, the third of which is z.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orthotropic {
    /// Angle of the first axis from x towards y, in degrees.
    #[serde(default)]
    pub angle: f64,
}

impl ConductivityLaw for Orthotropic {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("conductivity_1"),
        Constant::required("conductivity_2"),
        Constant::required("conductivity_3"),
    ];

    fn check(&self) -> Result<(), SetupError> {
        check_finite("angle", self.angle).map(drop)
    }

    fn conductivity(&self, properties: &[Property]) -> Conductivity {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        Conductivity::Principal(Principal {
            conductivity: [0, 1, 2].map(|axis| properties[axis].clone()),
            axes: [
                Vector3::new(cos, sin, 0.0),
                Vector3::new(-sin, cos, 0.0),
                Vector3::z(),
            ],
        })
    }
}

crate::register_conductivity_law!("orthotropic", Orthotropic);
