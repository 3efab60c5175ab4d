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
    #[serde(skip)]
    handles: Option<(Read<f64>, Write<f64>)>,
}

#[typetag::serialize(name = "swelling")]
impl Coupler for Swelling {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let moisture = setup.read(body, &crate::diffusion::MOISTURE)?;
        self.handles = Some((moisture, setup.add(body, &keys::EIGENSTRAIN)?));
        Ok(())
    }

    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let (moisture, eigenstrain) = self.handles.expect("prepared");
        for (e, m) in world
            .write(eigenstrain)
            .iter_mut()
            .zip(&*world.read(moisture))
        {
            *e += self.coefficient * (m - self.dry);
        }
        Ok(())
    }
}

register_coupler!("swelling", Swelling);
