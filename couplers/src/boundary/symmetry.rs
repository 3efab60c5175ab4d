//! Plane of symmetry: the body continues as its mirror image behind a face.
//!
//! Temperature is even; of displacement and velocity the normal component is odd and the others are
//! even. Only the fields that the case has are mirrored.

use perimelt_core::world::LayerHandle;
use perimelt_core::world::SymmetryPlane;
use perimelt_core::{
    Coupler, Face, LayerRole, Prepared, RunError, RunningCoupler, Setup, SetupError, Step,
    Stepping, World, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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

/// A plane of symmetry that is ready to act.
struct RunningSymmetry {
    face: Face,
    /// Layers of vector fields.
    vectors: [LayerHandle; 2],
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
        let mut layer = |vector| setup.layer(body, vector, self.face, LayerRole::IfProvided);
        let vectors = [layer(&keys::DISPLACEMENT)?, layer(&keys::VELOCITY)?];
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(RunningSymmetry {
            face: self.face,
            vectors,
        }))
    }
}

impl RunningCoupler for RunningSymmetry {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let mut scale = [1.0; 3];
        scale[self.face.axis()] = -1.0;
        for layer in self.vectors {
            world.set_layer(layer, scale, [0.0; 3]);
        }
        Ok(())
    }
}

perimelt_core::register_coupler!("symmetry", Symmetry, supports: [Motion, Flow, Births, Cuts, Window, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read};

    #[test]
    fn the_normal_displacement_is_odd_and_temperature_need_not_exist() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let (mut boundary, layers) =
            prepare(&mut world, read::<Symmetry>("face = 'y-'"), |setup| {
                setup.own(0, &keys::DISPLACEMENT).expect("free");
                setup.layers(0, &keys::DISPLACEMENT)
            })
            .expect("a case without temperature is fine");
        assert_eq!(layers.faces(), [Face::YMin]);
        assert_eq!(layers.prescribed, []);
        apply(&world, &mut *boundary, 0.0);
        let rule = &world.layer_rules(layers.handle)[0];
        assert_eq!((rule.scale, rule.offset), ([1.0, -1.0, 1.0], [0.0; 3]));
    }
}
