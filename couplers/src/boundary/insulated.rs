//! Insulated faces: the layer behind a face has the mirrored field, `theta(layer) = theta(mirror)`, so
//! that the flux is zero and families at the face are complete.
//!
//! Wang (2025), section 7.2, calls `theta_b = 0` in eq. 7.17 insulated; that condition holds the face at
//! zero. A face without any boundary is insulated too: its families are truncated.

use perimelt_core::{
    Coupler, Face, Key, LayerRole, Prepared, RunningCoupler, Setup, SetupError, Stepping, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Idle;
use crate::surface::all_faces;

/// Faces without flux.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Insulated {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Faces of the body's box, such as `["y-", "y+"]`; default all that the body has.
    #[serde(default = "all_faces")]
    pub faces: Vec<Face>,
    /// The scalar field that is mirrored; default `temperature`.
    #[serde(default = "temperature")]
    pub field: String,
}

fn temperature() -> String {
    keys::TEMPERATURE.name.into_owned()
}

#[typetag::serialize(name = "insulated")]
impl Coupler for Insulated {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        // the owner of the field gives it its unit
        let key = Key::<f64>::named(self.field.clone(), String::new());
        let dimension = setup.body(body).dimension;
        let all = self.faces.len() == Face::ALL.len();
        let faces = self.faces.iter().copied();
        for face in faces.filter(|f| !all || f.axis() < dimension) {
            // a fresh layer is even
            setup
                .layer(body, &key, face, LayerRole::Free)
                .map_err(|e| SetupError::new("faces", e.problem))?;
        }
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(Idle))
    }
}

perimelt_core::register_coupler!("insulated", Insulated, supports: [Motion, Flow, Births, Cuts, Window, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, refusal};
    use perimelt_core::World;

    #[test]
    fn layers_are_even_and_not_prescribed() {
        let mut world = World::new(vec![block([3, 2, 1], 2, STEEL)]);
        let (_, layers) = prepare(&mut world, read::<Insulated>(""), |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.layers(0, &keys::TEMPERATURE)
        })
        .expect("valid");
        assert_eq!(layers.faces(), Face::ALL[..4], "a plate has four faces");
        assert!(layers.prescribed.is_empty());
        let even = |r: &perimelt_core::family::LayerRule| (r.scale[0], r.offset[0]) == (1.0, 0.0);
        assert!(world.layer_rules(layers.handle).iter().all(even));
        let unit = &world.fields().iter().next().expect("one field").unit;
        assert_eq!(unit, "K", "the owner gives the unit");
    }

    #[test]
    fn a_field_that_nobody_owns_is_refused() {
        let mut world = World::new(vec![block([3, 2, 1], 2, STEEL)]);
        let boundary: Insulated = read("field = 'moisture'");
        assert!(refusal(&mut world, boundary).contains("field `moisture`"));
    }
}
