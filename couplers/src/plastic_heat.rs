//! Heat from plastic work (Taylor-Quinney)
//!
//! ```text
//! heat_source += fraction d(plastic_work)/dt          (W/m³)
//! ```
//!
//! The rest of the work is stored in dislocations; the fraction is 0.8 to 1 in metals. The heat contains
//! the whole change of the work since it was last computed, for any step sizes of the two physics.

use perimelt_core::numbers::check_fraction;
use perimelt_core::{Coupler, Prepared, RunningCoupler, Setup, World, keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rate::WorkHeat;

/// Heat from the plastic work of a `mechanical` with `plasticity`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticHeat {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Fraction of the plastic work that becomes heat (Taylor and Quinney), 0 to 1.
    #[serde(default = "usual_fraction")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub fraction: f64,
}

fn usual_fraction() -> f64 {
    0.9
}

#[typetag::serialize(name = "plastic_heat")]
impl Coupler for PlasticHeat {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_fraction("fraction", self.fraction)?;
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<Self>(body)?;
        let fraction = self.fraction;
        let find_factors = move |_: &World, factors: &mut [f64]| factors.fill(fraction);
        let key = &keys::PLASTIC_WORK;
        WorkHeat::prepare(setup, body, key, "power from plastic work", find_factors)
    }
}

perimelt_core::register_coupler!("plastic_heat", PlasticHeat, supports: [Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, refusal, set, values};
    use perimelt_core::Step;

    #[test]
    fn the_change_of_the_work_becomes_heat_over_the_step() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let coupler: PlasticHeat = read("fraction = 0.8");
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::PLASTIC_WORK).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        coupler.apply(&world, Step::new(0.0, 0.0)).expect("applies");
        set(&mut world, &keys::PLASTIC_WORK, |i| [0.0, 5e6][i]);
        coupler.apply(&world, Step::new(0.0, 0.5)).expect("applies");
        assert_eq!(values(&world, &keys::HEAT_SOURCE), [0.0, 0.8 * 5e6 / 0.5]);
    }

    #[test]
    fn a_fraction_above_one_is_refused() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let coupler: PlasticHeat = read("fraction = 1.2");
        assert!(refusal(&mut world, coupler).contains("expected a number from 0 to 1"));
    }
}
