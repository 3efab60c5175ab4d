//! Latent heat of the transformations of steel in the solid state
//!
//! ```text
//! heat_source += -density latent_heat d(austenite)/dt          (W/m³)
//! ```
//!
//! Steel releases heat on cooling where austenite transforms, and absorbs it again on heating. The heat contains the whole change
//! of the fraction of austenite since it was last computed, for any step sizes of the two physics.
//!
//! Not beside a specific heat that contains the heat of transformation, such as that of the library's S355, which has
//! its peak at 735 °C: the heat would count twice.

use perimelt_core::numbers::check_at_least;
use perimelt_core::{Coupler, Prepared, RunningCoupler, Setup, World, keys};
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
}

fn heat_of_pearlite() -> f64 {
    77e3
}

#[typetag::serialize(name = "transformation_heat")]
impl Coupler for TransformationHeat {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_at_least("latent_heat", self.latent_heat, 0.0, "J/kg")?;
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<Self>(body)?;
        let density = setup.world().density_at_points(body)?;
        let find_factors = move |_: &World, factors: &mut [f64]| {
            let points = factors.iter_mut().zip(&density);
            points.for_each(|(factor, density)| *factor = -density * self.latent_heat);
        };
        let key = &keys::AUSTENITE;
        WorkHeat::prepare(setup, body, key, "power from transformation", find_factors)
    }
}

perimelt_core::register_coupler!("transformation_heat", TransformationHeat, supports: [Motion, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, set, values};
    use perimelt_core::Step;

    #[test]
    fn austenite_that_transforms_gives_off_its_heat() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let coupler: TransformationHeat = read("latent_heat = 80e3");
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
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
