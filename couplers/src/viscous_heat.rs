//! Heat from viscous friction in a fluid
//!
//! ```text
//! heat_source += d(viscous_work)/dt          (W/m³)          Gao (2020), eq. 5.65
//! ```
//!
//! The change of the work since the heat was last computed is taken up in full, whatever the steps of the two physics.

use perimelt_core::{Coupler, Report, RunError, Setup, SetupError, Step, World, keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rate::WorkHeat;

/// Heat from the work of viscous friction of a `fluid`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViscousHeat {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    #[serde(skip)]
    #[schemars(skip)]
    heat: Option<WorkHeat>,
}

#[typetag::serialize(name = "viscous_heat")]
impl Coupler for ViscousHeat {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        self.heat = Some(WorkHeat::prepare(setup, body, &keys::VISCOUS_WORK)?);
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let heat = self.heat.as_mut().expect("prepared before the run");
        heat.add(world, |_| 1.0, step.size);
        Ok(())
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let heat = self.heat.as_ref().expect("prepared before a save");
        heat.save()
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let heat = self.heat.as_mut().expect("prepared before a restart");
        heat.load(state)
    }

    fn report(&self) -> Vec<Report> {
        WorkHeat::report(self.heat.as_ref(), "power from friction")
    }
}

perimelt_core::register_coupler!("viscous_heat", ViscousHeat, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, set, values};

    #[test]
    fn the_change_of_the_work_becomes_heat_over_the_step() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let mut coupler: ViscousHeat = read("");
        prepare(&mut world, &mut coupler, |setup| {
            setup.own(0, &keys::VISCOUS_WORK).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        coupler.apply(&world, Step::new(0.0, 0.0)).expect("applies");
        set(&mut world, &keys::VISCOUS_WORK, |i| [0.0, 5e6][i]);
        coupler.apply(&world, Step::new(0.0, 0.5)).expect("applies");
        assert_eq!(values(&world, &keys::HEAT_SOURCE), [0.0, 5e6 / 0.5]);
    }
}
