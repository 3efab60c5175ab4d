//! Heat from viscous friction in a fluid
//!
//! ```text
//! heat_source += d(viscous_work)/dt          (W/m³)          Gao (2020), eq. 5.65
//! ```
//!
//! The heat contains the whole change of the work since it was last computed, for any step sizes of the two physics.

use perimelt_core::{Coupler, Prepared, RunningCoupler, Setup, World, keys};
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
}

#[typetag::serialize(name = "viscous_heat")]
impl Coupler for ViscousHeat {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<Self>(body)?;
        let find_factors = |_: &World, factors: &mut [f64]| factors.fill(1.0);
        let key = &keys::VISCOUS_WORK;
        WorkHeat::prepare(setup, body, key, "power from friction", find_factors)
    }
}

perimelt_core::register_coupler!("viscous_heat", ViscousHeat, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, prepare_after, read, set, values};
    use perimelt_core::Step;

    #[test]
    fn the_change_of_the_work_becomes_heat_over_the_step() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let coupler: ViscousHeat = read("");
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.own(0, &keys::VISCOUS_WORK).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        coupler.apply(&world, Step::new(0.0, 0.0)).expect("applies");
        set(&mut world, &keys::VISCOUS_WORK, |i| [0.0, 5e6][i]);
        coupler.apply(&world, Step::new(0.0, 0.5)).expect("applies");
        assert_eq!(values(&world, &keys::HEAT_SOURCE), [0.0, 5e6 / 0.5]);
    }

    /// Of a macro step in which heat takes two steps and the flow one.
    #[test]
    fn the_power_is_the_mean_of_the_macro_step() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let (mut coupler, ()) = prepare(&mut world, read::<ViscousHeat>(""), |setup| {
            setup.own(0, &keys::VISCOUS_WORK).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        for (work, power) in [(5e6, 1e6), (6e6, 2e5)] {
            coupler.begin_step(&world, 0.0);
            set(&mut world, &keys::VISCOUS_WORK, |_| work / 2.0);
            for start in [0.0, 2.5] {
                coupler
                    .apply(&world, Step::new(start, 2.5))
                    .expect("applies");
            }
            assert_eq!(coupler.report()[0].value, power);
        }
    }

    #[test]
    fn heat_of_work_counts_once() {
        let mut world = World::new(vec![block([2, 1, 1], 1, STEEL)]);
        let first = |setup: &mut Setup<'_>| {
            setup.own(0, &keys::VISCOUS_WORK).expect("free");
            let first = Box::new(read::<ViscousHeat>(""));
            first.prepare(setup).expect("valid");
        };
        let second = prepare_after(
            &mut world,
            first,
            read::<ViscousHeat>("body = 'block'"),
            |_| (),
        );
        let refused = second
            .err()
            .expect("the heat would count twice")
            .to_string();
        assert!(
            refused.contains("the whole effect on body `block` is that of"),
            "{refused}"
        );
    }
}
