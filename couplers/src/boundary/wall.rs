//! Walls along which a fluid flows.
//!
//! Behind the wall the fluid continues as its mirror image. The components of the velocity relative to the wall
//! that must vanish there (the normal one, and without slip the tangential ones) change sign, which is second
//! order. With `layer = "constant"` the fluid behind the wall moves with it, as published (Gao (2020), eq.
//! 5.102). This is first order: the velocity of the wall is reached a fraction of a spacing outside.
//!
//! A wall does not know which fluids meet there: it publishes the contact angle, for whoever has an interface, and the tension of a
//! surface, for whoever has a temperature.

use perimelt_core::numbers::{check_vector, check_within};
use perimelt_core::world::{ContactAngle, FaceTension, LayerHandle, WallPlace};
use perimelt_core::{
    Coupler, Face, LayerRole, Prepared, RunError, RunningCoupler, Setup, SetupError, Step,
    Stepping, SurfaceTension, World, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LayerKind;

/// Walls at faces of a fluid body. They are insulated unless a boundary prescribes a temperature or a heat flux.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Faces of the body's box, such as `["x-", "x+"]`.
    pub faces: Vec<Face>,
    /// Velocity of the wall, m/s; its component normal to the wall must be zero.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Whether the fluid sticks to the wall.
    #[serde(default)]
    pub kind: WallKind,
    /// The layer behind a wall without slip.
    #[serde(default)]
    pub layer: LayerKind,
    /// Angle at which the interface of two fluids meets the wall, in the first fluid, degrees; when left out, 90, and the
    /// wall has no energy of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 180))]
    pub contact_angle: Option<f64>,
    /// Surface tension of the fluid along the faces, which are its flat free surface: where it depends on the temperature it drives the
    /// fluid along them. For faces with `kind = "slip"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension: Option<SurfaceTension>,
}

/// Whether a fluid sticks to a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallKind {
    /// The fluid at the wall moves with the wall.
    #[default]
    NoSlip,
    /// The fluid slides along the wall without friction.
    Slip,
}

/// Walls that are ready to act.
struct RunningWall {
    /// Layers behind the faces, with the scale and the offset of each component.
    layers: Vec<(LayerHandle, [(f64, f64); 3])>,
}

impl Wall {
    /// Scale and offset of each component in the layer behind a face.
    fn rules(&self, face: Face) -> [(f64, f64); 3] {
        std::array::from_fn(|axis| match self.kind {
            WallKind::NoSlip => self.layer.rule(self.velocity[axis]),
            WallKind::Slip if axis == face.axis() => (-1.0, 0.0),
            WallKind::Slip => (1.0, 0.0),
        })
    }
}

#[typetag::serialize(name = "wall")]
impl Coupler for Wall {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let angle = check_within("contact_angle", self.contact_angle, 0.0, 180.0)?;
        let angles = angle.into_iter().flat_map(|angle| {
            let faces = self.faces.iter();
            faces.map(move |&face| ContactAngle {
                wall: WallPlace::Face(face),
                angle,
            })
        });
        angles
            .into_iter()
            .try_for_each(|angle| setup.publish(body, angle))?;
        let Some(tension) = self.tension else {
            return Ok(());
        };
        if self.kind == WallKind::NoSlip {
            let message = "the fluid sticks to the walls, which are no free surface";
            return Err(SetupError::value("tension", message, "`kind = \"slip\"`"));
        }
        let mut faces = self.faces.iter();
        faces.try_for_each(|&face| setup.publish(body, FaceTension { face, tension }))
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        if self.kind == WallKind::Slip && self.layer != LayerKind::default() {
            let message = "`layer` applies to walls without slip only";
            return Err(SetupError::value("layer", message, "`kind = \"no_slip\"`"));
        }
        if self.kind == WallKind::Slip && self.velocity != [0.0; 3] {
            let message =
                "the fluid slides along the wall without friction, whether the wall moves or not";
            return Err(SetupError::value(
                "velocity",
                message,
                "`kind = \"no_slip\"`, or no `velocity`",
            ));
        }
        let mut layers = Vec::new();
        check_vector("velocity", self.velocity, setup.body(body))?;
        for &face in &self.faces {
            let across = self.velocity[face.axis()];
            if across != 0.0 {
                let message = format!(
                    "the velocity of the wall at `{}` has a component normal to the wall",
                    face.name()
                );
                return Err(SetupError::value(
                    "velocity",
                    message,
                    "a velocity along the wall",
                ));
            }
            let layer = setup.layer(body, &keys::VELOCITY, face, LayerRole::Prescribed)?;
            layers.push((layer, self.rules(face)));
        }
        if self.faces.is_empty() {
            return Err(SetupError::value(
                "faces",
                "`faces` is empty",
                "faces such as [\"y-\"]",
            ));
        }
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        Ok(Box::new(RunningWall { layers }))
    }
}

impl RunningCoupler for RunningWall {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        for &(layer, rules) in &self.layers {
            world.set_layer(layer, rules.map(|r| r.0), rules.map(|r| r.1));
        }
        Ok(())
    }
}

perimelt_core::register_coupler!("wall", Wall, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal};
    use perimelt_core::family::LayerRule;

    fn rule(keys: &str) -> LayerRule {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let (mut wall, layers) = prepare(&mut world, read::<Wall>(keys), |setup| {
            setup.own(0, &keys::VELOCITY).expect("free");
            setup.layers(0, &keys::VELOCITY)
        })
        .expect("valid");
        apply(&world, &mut *wall, 0.0);
        world.layer_rules(layers.handle)[0].clone()
    }

    #[test]
    fn the_layer_holds_back_what_the_wall_does() {
        let moving = rule("faces = ['y+']\nvelocity = [2, 0, 0]");
        assert_eq!((moving.scale, moving.offset), ([-1.0; 3], [4.0, 0.0, 0.0]));
        let constant = rule("faces = ['y+']\nvelocity = [2, 0, 0]\nlayer = 'constant'");
        assert_eq!(
            (constant.scale, constant.offset),
            ([0.0; 3], [2.0, 0.0, 0.0])
        );
        let slip = rule("faces = ['y+']\nkind = 'slip'");
        assert_eq!((slip.scale, slip.offset), ([1.0, -1.0, 1.0], [0.0; 3]));
    }

    /// Angles reach whoever has an interface, and are a mistake where nobody has.
    #[test]
    fn angles_are_for_interfaces() {
        let with = |has_interface: bool| {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            let wall = read::<Wall>("faces = ['x-', 'y+']\ncontact_angle = 60");
            let prepared = prepare(&mut world, wall, |setup| {
                setup.own(0, &keys::VELOCITY).expect("free");
                match has_interface {
                    true => setup.facts::<ContactAngle>(0).copied().collect(),
                    false => Vec::new(),
                }
            });
            prepared.map(|(_, angles)| angles).map_err(|e| e.key)
        };
        let angles = [Face::XMin, Face::YMax].map(|face| ContactAngle {
            wall: WallPlace::Face(face),
            angle: 60.0,
        });
        assert_eq!(with(true), Ok(angles.to_vec()));
        assert_eq!(with(false), Err("contact_angle".to_string()));
    }

    #[test]
    fn walls_that_cannot_be_are_refused() {
        for (keys, key) in [
            ("faces = ['y+']\nvelocity = [0, 1, 0]", "velocity"),
            (
                "faces = ['x-', 'y+']\nvelocity = [0, 0, 1]\nkind = 'slip'\nlayer = 'constant'",
                "layer",
            ),
            ("faces = []", "faces"),
            ("faces = ['y+']\ncontact_angle = 181", "contact_angle"),
            ("faces = ['y+']\ntension.slope = -1e-3", "tension"),
        ] {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            let message = refusal(&mut world, read::<Wall>(keys));
            assert!(message.starts_with(&format!("{key}: ")), "{message}");
        }
    }
}
