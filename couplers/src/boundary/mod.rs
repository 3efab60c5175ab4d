//! Boundaries: what the surroundings do to a body.
//!
//! Values are prescribed in a mirrored layer behind a `face` of the body's box, which completes the
//! families there ([`LayerKind`]), or at the points of a `region`. Fluxes, tractions and heat exchange
//! act on the points of the bare surface.

mod ambient;
mod clamp;
mod convection;
mod crack;
mod gravity;
mod growing_crack;
mod heat_flux;
mod insulated;
mod prescribed_displacement;
mod prescribed_temperature;
mod radiation;
mod surface_force;
mod symmetry;
mod traction;
mod undex;
mod wall;
mod water_jet;

pub use ambient::{Ambient, AmbientBody, ExchangeKind};
pub use clamp::Clamp;
pub use convection::Convection;
pub use crack::InsulatedCrack;
pub use gravity::Gravity;
pub use growing_crack::GrowingCrack;
pub use heat_flux::HeatFlux;
#[cfg(test)]
pub(crate) use heat_flux::PrescribedFlux;
pub use insulated::Insulated;
pub use prescribed_displacement::PrescribedDisplacement;
pub use prescribed_temperature::PrescribedTemperature;
pub use radiation::Radiation;
pub use symmetry::Symmetry;
pub use traction::Traction;
pub use undex::Undex;
pub use wall::{Wall, WallKind};
pub use water_jet::WaterJet;

use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Face, Programme, RunError, RunningCoupler, Setup, SetupError, Step, Stepping, World,
    shared_keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Values in the layer behind a face for a prescribed value b.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LayerKind {
    /// `2 b - mirrored value`, so that the value on the face is b (Wang (2025), eq. 7.17).
    #[default]
    Mirrored,
    /// b in the whole layer; the field then reaches b a fraction of a spacing outside the face.
    Constant,
}

impl LayerKind {
    /// Scale and offset of the layer for the value `b`, in the unit of the field.
    pub fn rule(self, b: f64) -> (f64, f64) {
        match self {
            LayerKind::Mirrored => (-1.0, 2.0 * b),
            LayerKind::Constant => (0.0, b),
        }
    }
}

/// A coupler that has nothing to do while the case runs.
pub(crate) struct Idle;

impl RunningCoupler for Idle {
    fn apply(&mut self, _world: &World, _step: Step) -> Result<(), RunError> {
        Ok(())
    }
}

/// The stepping of a coupler whose programme is known at set-up.
pub(crate) fn with_programme(programme: Option<Programme>) -> Stepping {
    Stepping {
        programme: Some(Box::new(move |_| programme.clone())),
        ..Stepping::default()
    }
}

/// Location at which a value is prescribed.
enum BoundaryLocation {
    /// The layer behind a face.
    Face(Face),
    /// Points of the body.
    Points(Vec<u32>),
}

shared_keys! {
    /// The place at which a value is prescribed.
    #[derive(Clone, Debug, PartialEq)]
    pub struct HeldPlace {
        /// Body; may be left out when there is one only.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub body: Option<String>,
        /// Face of the body's box, such as `"x-"`; or give `region`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub face: Option<Face>,
        /// Region whose points are held; or give `face`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub region: Option<String>,
    }
}

impl HeldPlace {
    /// The location given by either `face` or `region`.
    fn location(&self, setup: &Setup<'_>, body: BodyIndex) -> Result<BoundaryLocation, SetupError> {
        match (self.face, self.region.as_deref()) {
            (Some(face), None) => Ok(BoundaryLocation::Face(face)),
            (None, Some(name)) => Ok(BoundaryLocation::Points(
                setup.region(body, "region", name)?.points,
            )),
            (Some(_), Some(_)) => Err(SetupError::value(
                "region",
                "both `face` and `region` are given",
                "one of the two",
            )),
            (None, None) => Err(SetupError::value(
                "face",
                "neither `face` nor `region` is given",
                "`face`, such as \"x-\", or `region`",
            )),
        }
    }
}
