//! Swelling: `eigenstrain += coefficient (moisture - dry)`.
use perimelt_core::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Strain from moisture, wherever a physics takes up `eigenstrain`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Swelling {
    /// Body that swells; may be left out when there is only one.
    body: Option<String>,
    /// Strain for each kg/m³ of moisture, m³/kg.
    coefficient: f64,
    /// Moisture at which the body is free of stress, kg/m³.
    dry: f64,
}

struct RunningSwelling {
    keys: Swelling,
    moisture: Read<f64>,
    eigenstrain: Write<f64>,
}

#[typetag::serialize(name = "swelling")]
impl Coupler for Swelling {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        Ok(Box::new(RunningSwelling {
            moisture: setup.read(body, &crate::diffusion::MOISTURE)?,
            eigenstrain: setup.add(body, &keys::EIGENSTRAIN)?,
            keys: *self,
        }))
    }
}

register_coupler!("swelling", Swelling);

impl RunningCoupler for RunningSwelling {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let mut eigenstrain = world.write(self.eigenstrain);
        for (e, m) in eigenstrain.iter_mut().zip(&*world.read(self.moisture)) {
            *e += self.keys.coefficient * (m - self.keys.dry);
        }
        Ok(())
    }
}
