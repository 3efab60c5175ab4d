//! Weight: `body_force += rho g`, with the reference density of each material.

use nalgebra::Vector3;
use perimelt_core::numbers::check_vector;
use perimelt_core::{Coupler, Prepared, RunError, RunningCoupler, Setup, Step, World, Write, keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A uniform acceleration of every point; needs the material property `density`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Acceleration (m/s²), such as `[0.0, 0.0, -9.81]`.
    pub acceleration: [f64; 3],
}

/// A weight that is ready to act.
struct RunningGravity {
    body: usize,
    /// Weight per volume by material, N/m³.
    weight: Vec<Vector3<f64>>,
    body_force: Write<Vector3<f64>>,
}

#[typetag::serialize(name = "gravity")]
impl Coupler for Gravity {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        check_vector("acceleration", self.acceleration, setup.body(body))?;
        setup.world().property(body, "density")?;
        let acceleration = Vector3::from(self.acceleration);
        let densities = setup.world().reference_densities(body)?;
        Ok(Box::new(RunningGravity {
            body,
            weight: densities
                .into_iter()
                .map(|rho| rho * acceleration)
                .collect(),
            body_force: setup.add(body, &keys::BODY_FORCE)?,
        }))
    }
}

impl RunningCoupler for RunningGravity {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let material = &world.body(self.body).material_of_point;
        let mut body_force = world.write(self.body_force);
        let points = body_force.iter_mut().zip(material);
        points.for_each(|(sum, material)| *sum += self.weight[*material as usize]);
        Ok(())
    }
}

perimelt_core::register_coupler!("gravity", Gravity, supports: [Motion, Flow, Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, values};

    #[test]
    fn every_point_has_its_weight() {
        let mut world = World::new(vec![block([2, 1, 1], 3, STEEL)]);
        let gravity: Gravity = read("acceleration = [0, 0, -10]");
        let (mut gravity, _) = prepare(&mut world, gravity, |setup| {
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *gravity, 0.0);
        assert_eq!(
            values(&world, &keys::BODY_FORCE),
            [0.0, 0.0, -8e4, 0.0, 0.0, -8e4]
        );
    }

    #[test]
    fn a_plane_body_has_no_weight_across_its_plane() {
        let told = |dimension: usize, acceleration: &str| {
            let mut world = World::new(vec![block([2, 2, 1], dimension, STEEL)]);
            let gravity: Gravity = read(&format!("acceleration = {acceleration}"));
            let prepared = prepare(&mut world, gravity, |setup| {
                setup.consume(0, &keys::BODY_FORCE).expect("free");
            });
            prepared.err().map_or(String::new(), |e| e.to_string())
        };
        assert!(told(2, "[0, 0, -10]").contains("component -10 along z"));
        assert!(told(2, "[0, nan, 0]").contains("`acceleration` is NaN"));
        assert_eq!(told(2, "[0, -10, 0]"), "");
        assert_eq!(told(3, "[0, 0, -10]"), "");
    }
}
