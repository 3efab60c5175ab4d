//! Powder that turns into dense metal when it melts, and stays dense.
//!
//! ```text
//! consolidated = max over time of the liquid fraction
//! k = consolidated k_dense + (1 - consolidated) k_powder
//! ```
//!
//! The coupler owns the field `consolidated`: 0 in powder, 1 in dense metal, between them where the metal was in the mushy
//! zone and froze again. `thermal` computes the conductivity from it, with the material property `powder_conductivity`;
//! between powder and metal bonds conduct in series.
//!
//! A point has the volume and mass of the dense metal at all times: a layer of powder is as thick as the metal that it
//! becomes. Shrinkage of the bed and the emissivity of powder are not modelled.

use perimelt_core::{
    Coupler, Prepared, Read, RunError, RunningCoupler, Setup, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Points that are powder until they melt; needs `phase_change` and the material property `powder_conductivity`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Powder {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region of the points that are powder at first; left out, the whole body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
}

/// Powder that is ready to melt.
struct RunningPowder {
    body: usize,
    liquid_fraction: Read<f64>,
    consolidated: Write<f64>,
}

#[typetag::serialize(name = "powder")]
impl Coupler for Powder {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let powder = match &self.region {
            Some(name) => setup.region(body, "region", name)?.points,
            None => (0..setup.body(body).points.len() as u32).collect(),
        };
        // `thermal` needs the property; checked here, the mistake has the line of this table
        setup.world().property(body, "powder_conductivity")?;
        let consolidated = setup.write(body, &keys::CONSOLIDATED)?;
        setup.set_first(consolidated, |point| {
            let is_powder = powder.binary_search(&(point as u32)).is_ok();
            f64::from(u8::from(!is_powder))
        });
        Ok(Box::new(RunningPowder {
            body,
            liquid_fraction: setup.read(body, &keys::LIQUID_FRACTION)?,
            consolidated,
        }))
    }
}

impl RunningCoupler for RunningPowder {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let liquid = world.read(self.liquid_fraction);
        let mut consolidated = world.write(self.consolidated);
        let activity = world.activity(self.body);
        let points = consolidated.iter_mut().zip(&*liquid).enumerate();
        for (point, (consolidated, liquid)) in points {
            let is_there = activity
                .as_ref()
                .is_none_or(|a| perimelt_core::world::activity::is_active(a[point]));
            if is_there && *liquid > *consolidated {
                *consolidated = *liquid;
            }
        }
        Ok(())
    }
}

perimelt_core::register_coupler!("powder", Powder, supports: [Motion, Births, Cuts, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    const METAL: &str =
        "density = 8000\nspecific_heat = 500\nconductivity = 40\npowder_conductivity = 0.3";

    #[test]
    fn powder_that_melted_stays_dense() {
        let mut world = World::new(vec![block([3, 1, 1], 1, METAL)]);
        let (mut powder, _) = prepare(&mut world, read::<Powder>("region = 'left'"), |setup| {
            setup.own(0, &keys::LIQUID_FRACTION).expect("free");
        })
        .expect("valid");
        assert_eq!(values(&world, &keys::CONSOLIDATED), [0.0, 1.0, 1.0]);
        for (liquid, expected) in [(0.0, 0.0), (0.4, 0.4), (0.1, 0.4), (1.0, 1.0), (0.0, 1.0)] {
            set(&mut world, &keys::LIQUID_FRACTION, |_| liquid);
            apply(&world, &mut *powder, 0.0);
            assert_eq!(values(&world, &keys::CONSOLIDATED), [expected, 1.0, 1.0]);
        }
    }

    #[test]
    fn a_material_without_a_conductivity_as_powder_is_refused() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        assert!(refusal(&mut world, read::<Powder>("")).contains("powder_conductivity"));
    }
}
