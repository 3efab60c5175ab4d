//! Plane of symmetry: the body continues as its mirror image behind a face.
//!
//! Temperature is even; of displacement and velocity the normal component is odd and the others are
//! even. Only the fields that the case has are mirrored.

use perimelt_core::family::LayerRule;
use perimelt_core::world::SymmetryPlane;
use perimelt_core::{
    Coupler, Face, LayerRole, Prepared, RunningCoupler, Setup, SetupError, Stepping, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Idle;

/// A face in which the body is mirrored.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Symmetry {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Face of the body's box, such as `"y-"`.
    pub face: Face,
}

#[typetag::serialize(name = "symmetry")]
impl Coupler for Symmetry {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.publish(body, SymmetryPlane(self.face))
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        // a fresh layer is even
        setup.layer(body, &keys::TEMPERATURE, self.face, LayerRole::IfProvided)?;
        let mut scale = [1.0; 3];
        scale[self.face.axis()] = -1.0;
        for vector in [&keys::DISPLACEMENT, &keys::VELOCITY] {
            let layer = setup.layer(body, vector, self.face, LayerRole::IfProvided)?;
            let rule = LayerRule {
                scale,
                ..LayerRule::even(self.face)
            };
            setup.announce_layer(layer, rule);
        }
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(Idle))
    }
}

perimelt_core::register_coupler!("symmetry", Symmetry, supports: [Motion, Flow, Births, Cuts, Window, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read};
    use perimelt_core::World;

    #[test]
    fn the_normal_displacement_is_odd_and_temperature_need_not_exist() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let (_, layers) = prepare(&mut world, read::<Symmetry>("face = 'y-'"), |setup| {
            setup.own(0, &keys::DISPLACEMENT).expect("free");
            setup.layers(0, &keys::DISPLACEMENT)
        })
        .expect("a case without temperature is fine");
        assert_eq!(layers.faces(), [Face::YMin]);
        assert_eq!(layers.prescribed, []);
        let rule = &world.layer_rules(layers.handle)[0];
        assert_eq!((rule.scale, rule.offset), ([1.0, -1.0, 1.0], [0.0; 3]));
    }
}
