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
    #[serde(skip)]
    run: Option<Run>,
}

struct Run {
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

impl Run {
    fn rates(&mut self, moisture: &[f64]) -> &[[f64; 2]] {
        self.operator.sum(&Diffusion, [moisture, &self.diffusivity])
    }
}

#[typetag::serialize(name = "moisture_diffusion")]
impl Physics for MoistureDiffusion {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let spec = FamilySpec::mirrored(setup.body(body), self.horizon);
        let family = setup.family(body, &spec)?;
        self.run = Some(Run {
            body,
            moisture: setup.own(body, &MOISTURE)?,
            diffusivity: setup.constant_at_points(body, "moisture_diffusivity")?,
            operator: Operator::new(setup.world().family(family)),
            initial: 0.0,
        });
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared");
        run.initial = world.integral(run.body, run.moisture.into());
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_mut().expect("prepared");
        let rates = run.rates(&world.read(run.moisture.into()));
        Some(1.0 / rates.iter().map(|r| r[1]).fold(0.0, f64::max))
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = self.run.as_mut().expect("prepared");
        let mut moisture = world.write(run.moisture);
        let rates = run.rates(&moisture);
        for (m, [rate, _]) in moisture.iter_mut().zip(rates) {
            *m += step.size * rate;
        }
        Ok(Work::default())
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run.as_ref().expect("prepared");
        let now = world.integral(run.body, run.moisture.into());
        vec![Balance::new("moisture", "kg", now, run.initial, 0.0).of_size(run.initial)]
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.run.as_ref().expect("prepared").initial)
    }

    fn load(&mut self, state: &mut dyn erased_serde::Deserializer<'_>) -> erased_serde::Result<()> {
        self.run.as_mut().expect("prepared").initial = erased_serde::deserialize(state)?;
        Ok(())
    }
}

register_physics!("moisture_diffusion", MoistureDiffusion);
