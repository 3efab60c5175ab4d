//! Diffusion of moisture, bond-based, behind sealed faces:
//! `dm_i/dt = sum_j (D_i + D_j) w_ij (m_j - m_i) / |xi|`, `w` the weights of the bonds.
use perimelt_core::material::ValueRange;
use perimelt_core::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State of the physics.
pub const MOISTURE: Key<f64> = Key::new("moisture", "kg/m3", "mass of water per volume");

register_property! { "moisture_diffusivity", "m²/s", "diffusivity of moisture", ValueRange::Positive }

/// Diffusion of moisture; owns `moisture`, needs the material property `moisture_diffusivity`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MoistureDiffusion {
    /// Body that is moist; may be left out when there is only one.
    body: Option<String>,
    /// Horizon in spacings.
    horizon: f64,
}

struct RunningDiffusion {
    body: usize,
    moisture: Write<f64>,
    diffusivity: Vec<f64>,
    operator: Operator<2, 2>,
    /// Mass of moisture at the start, kg.
    initial: f64,
}

struct Diffusion;

impl BondKernel<2, 2> for Diffusion {
    /// Rate of the moisture, kg/(m³ s), and its coefficient, 1/s, which limits the step.
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 2] {
        let coefficient = (own[1] + other[1]) * bond.mean() * bond.inverse_length;
        [coefficient * (other[0] - own[0]), coefficient]
    }
}

impl RunningDiffusion {
    fn rates(&mut self, moisture: &[f64]) -> &[[f64; 2]] {
        self.operator.sum(&Diffusion, [moisture, &self.diffusivity])
    }
}

#[typetag::serialize(name = "moisture_diffusion")]
impl Physics for MoistureDiffusion {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let body = setup.find_body(self.body.as_deref())?;
        let spec = FamilySpec::mirrored(setup.body(body), self.horizon);
        let (family, property) = (setup.family(body, &spec)?, "moisture_diffusivity");
        Ok(Box::new(RunningDiffusion {
            body,
            moisture: setup.own(body, &MOISTURE)?,
            diffusivity: setup.world().constant_at_points(body, property)?,
            operator: Operator::new(setup.world().family(family)),
            initial: 0.0,
        }))
    }
}

register_physics!("moisture_diffusion", MoistureDiffusion);

impl RunningPhysics for RunningDiffusion {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.initial = world.integral(self.body, self.moisture.into());
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let rates = self.rates(&world.read(self.moisture.into()));
        Some(1.0 / rates.iter().map(|r| r[1]).fold(0.0, f64::max))
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let mut moisture = world.write(self.moisture);
        let rates = self.rates(&moisture);
        for (m, [rate, _]) in moisture.iter_mut().zip(rates) {
            *m += step.size * rate;
        }
        Ok(Work::default())
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let now = world.integral(self.body, self.moisture.into());
        vec![Balance::new("moisture", "kg", now, self.initial, 0.0).of_size(self.initial)]
    }

    fn save(&self, _: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.initial)
    }

    fn load(
        &mut self,
        _world: &World,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> erased_serde::Result<()> {
        self.initial = erased_serde::deserialize(state)?;
        Ok(())
    }
}
