//! Latent heat of the transformations of steel in the solid state
//!
//! ```text
//! heat_source += -density latent_heat d(austenite)/dt          (W/m³)
//! ```
//!
//! Cooling steel gets warmer where austenite transforms, heating steel takes the heat up again. The change of the share of
//! austenite since the heat was last computed is taken up in full, whatever the steps of the two physics.
//!
//! Not beside a specific heat that contains the heat of transformation, such as that of the library's S355, which has
//! its peak at 735 °C: the heat would count twice.

use perimelt_core::{Coupler, Report, RunError, Setup, SetupError, Step, World, keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rate::WorkHeat;

/// Heat from the transformations of a `metallurgy`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransformationHeat {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Heat that a mass of austenite gives off when it transforms (J/kg); about 77e3 for pearlite.
    #[serde(default = "heat_of_pearlite")]
    #[schemars(extend("minimum" = 0))]
    pub latent_heat: f64,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<State>,
}

fn heat_of_pearlite() -> f64 {
    77e3
}

#[derive(Debug)]
struct State {
    heat: WorkHeat,
    /// kg/m³, by point.
    density: Vec<f64>,
}

#[typetag::serialize(name = "transformation_heat")]
impl Coupler for TransformationHeat {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        if !(self.latent_heat >= 0.0 && self.latent_heat.is_finite()) {
            let message = format!("`latent_heat` is {}", self.latent_heat);
            return Err(SetupError::value(
                "latent_heat",
                message,
                "zero or above, J/kg",
            ));
        }
        let body = setup.find_body(self.body.as_deref())?;
        self.prepared = Some(State {
            heat: WorkHeat::prepare(setup, body, &keys::AUSTENITE)?,
            density: setup.density_at_points(body)?,
        });
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let State { heat, density } = self.prepared.as_mut().expect("prepared before the run");
        let latent = self.latent_heat;
        heat.add(world, |point| -density[point] * latent, step.size);
        Ok(())
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let prepared = self.prepared.as_ref().expect("prepared before a save");
        prepared.heat.save()
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let prepared = self.prepared.as_mut().expect("prepared before a restart");
        prepared.heat.load(state)
    }

    fn report(&self) -> Vec<Report> {
        let heat = self.prepared.as_ref().map(|p| &p.heat);
        WorkHeat::report(heat, "power from transformation")
    }
}

perimelt_core::register_coupler!("transformation_heat", TransformationHeat, supports: [Motion]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, set, values};

    #[test]
    fn austenite_that_transforms_gives_off_its_heat() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let mut coupler: TransformationHeat = read("latent_heat = 80e3");
        prepare(&mut world, &mut coupler, |setup| {
            setup.own(0, &keys::AUSTENITE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::AUSTENITE, |i| [1.0, 0.0][i]);
        coupler.apply(&world, Step::new(0.0, 0.0)).expect("applies");
        set(&mut world, &keys::AUSTENITE, |i| [0.75, 0.5][i]);
        coupler.apply(&world, Step::new(0.0, 0.5)).expect("applies");
        let heat = values(&world, &keys::HEAT_SOURCE);
        for (heat, expected) in heat.iter().zip([0.5 * 8000.0 * 80e3, -8000.0 * 80e3]) {
            assert!((heat - expected).abs() < 1e-3, "rounding: {heat}");
        }
        let power = coupler.report()[0].value;
        assert!((power + 0.5 * 8000.0 * 80e3).abs() < 1e-3, "{power}");
    }
}
