//! The `[[physics]]` table of melt flow.

use perimelt_core::numbers::{
    check_above, check_at_least, check_distinct, check_positive, check_vector, check_within,
};
use perimelt_core::{Body, Face, SetupError, SurfaceTension};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::advection::Convection;
use crate::dependent_keys::need;

/// Flow of the melt through the points of a solid body, such as in a weld pool; owns `melt_velocity` and `melt_pressure`. The
/// body needs `thermal` and `phase_change`; the material `viscosity`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeltFlow {
    /// Body that melts; may be left out when there is only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Lift of the hot melt; the material needs `liquid_expansion`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub buoyancy: Option<Buoyancy>,
    /// Free surface. The melt sticks to all other faces of the body but for planes of `symmetry`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<FreeSurface>,
    /// Friction between the grains of the mushy zone, kg/(m³ s), such as 1.6e6 (Voller & Prakash (1987)):
    /// `drag (1 - f)^2/(f^3 + 1e-3)` per volume and velocity, with the liquid fraction f.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub drag: Option<f64>,
    /// Liquid fraction above which a point flows; when left out 0.5, with `drag` 0.01.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub least_liquid: Option<f64>,
    /// Stabilisation of the convective terms.
    #[serde(default)]
    pub convection: Convection,
    /// Factor of the viscosity, for a layer under the surface that is thinner than the points, or a turbulent flow.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity_factor: f64,
    /// Factor of the conductivity between points that flow, 1 or more, for a turbulent flow.
    #[serde(default = "one")]
    #[schemars(extend("minimum" = 1))]
    pub conductivity_factor: f64,
    /// Volume that a point gains or loses, relative to the one that the fastest melt carries over the spacing: where the
    /// search for the pressure stops. Heat is conserved whatever it is.
    #[serde(default = "tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.1))]
    pub tolerance: f64,
    /// Time between two exchanges of heat with `thermal`, in times in which the fastest melt flows over the spacing, at
    /// most: automatic steps of the case are not longer.
    #[serde(default = "largest_lag")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub largest_lag: f64,
}

/// Lift of the hot melt (Boussinesq).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Buoyancy {
    /// Acceleration of gravity (m/s²), such as `[0.0, 0.0, -9.81]`.
    pub gravity: [f64; 3],
    /// Temperature without lift, K; when left out the liquidus of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_temperature: Option<f64>,
}

/// Faces along which the melt slips.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeSurface {
    /// Faces of the body, such as `["z+"]`.
    pub faces: Vec<Face>,
    /// Surface tension that depends on temperature and drives the melt along the faces; when left out, nothing does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension: Option<SurfaceTension>,
}

fn one() -> f64 {
    1.0
}

fn tolerance() -> f64 {
    1e-4
}

fn largest_lag() -> f64 {
    10.0
}

impl MeltFlow {
    /// Liquid fraction above which a point flows.
    pub(super) fn least_liquid(&self) -> f64 {
        let usual = if self.drag.is_some() { 0.01 } else { 0.5 };
        self.least_liquid.unwrap_or(usual)
    }

    /// Refuses numbers outside of their ranges, and faces that the body does not have.
    pub(super) fn check(&self, body: &Body) -> Result<(), SetupError> {
        check_at_least("drag", self.drag, 0.0, "kg/(m³ s)")?;
        check_positive("viscosity_factor", self.viscosity_factor, "")?;
        check_at_least("conductivity_factor", self.conductivity_factor, 1.0, "")?;
        check_positive("largest_lag", self.largest_lag, "")?;
        check_positive("tolerance", self.tolerance, "")?;
        check_within("tolerance", self.tolerance, 0.0, 0.1)?;
        check_above("least_liquid", self.least_liquid, 0.0, "")?;
        need(
            self.least_liquid() < 1.0,
            "least_liquid",
            "no point has a liquid fraction above 1",
            "a number below 1, such as 0.5",
        )?;
        if let Some(buoyancy) = &self.buoyancy {
            check_vector("buoyancy.gravity", buoyancy.gravity, body)?;
            let reference = buoyancy.reference_temperature;
            check_positive("buoyancy.reference_temperature", reference, "K")?;
        }
        let Some(surface) = &self.surface else {
            return Ok(());
        };
        need(
            !surface.faces.is_empty(),
            "surface.faces",
            "the free surface has no faces",
            "faces such as [\"z+\"], or no `surface`",
        )?;
        check_distinct("surface.faces", &surface.faces)?;
        for face in &surface.faces {
            if face.axis() >= body.dimension || body.periodic[face.axis()] {
                let message = format!("body `{}` has no face `{}`", body.name, face.name());
                let expected = "faces along the axes of the body that are not periodic";
                return Err(SetupError::value("surface.faces", message, expected));
            }
        }
        Ok(())
    }
}
