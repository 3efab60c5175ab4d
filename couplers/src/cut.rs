//! Cutting: material is removed from a body at a given time, such as the base plate of a part or the kerf of a saw.
//!
//! From then on the points of `region` have no bonds, no mass and no surface, as before a deposition. The stress of the
//! rest is no longer balanced across the cut and relaxes in the next step. The change of the displacement is the distortion
//! by the cut. Clamps on removed points have no effect; a part without clamps keeps its mean displacement and rotation.
//!
//! A kerf that separates two pieces must be at least as wide as the horizon of the mechanics, since bonds cross a narrower
//! one. A plane cut removes all material behind the plane.
//!
//! Not for: heat of the cut, and the forces of a tool.

use perimelt_core::numbers::check_at_least;
use perimelt_core::world::activity::is_active;
use perimelt_core::{
    Change, Coupler, Prepared, Programme, RunError, RunningCoupler, Setup, SetupError, Step,
    StepLimits, World, Write,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::boundary::with_programme;

/// Material that is cut off at a given time.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region of the points that lose their material.
    pub region: String,
    /// Time of the cut (s).
    pub time: f64,
}

/// A cut that is ready to be made.
struct RunningCut {
    body: usize,
    time: f64,
    points: Vec<u32>,
    active: Write<f64>,
}

#[typetag::serialize(name = "cut")]
impl Coupler for Cut {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        check_at_least("time", self.time, 0.0, "s")?;
        let points = setup.region(body, "region", &self.region)?.points;
        let is_part = points.len() < setup.body(body).points.len();
        if !setup.world().processes().any(is_part) {
            let message = format!("region `{}` is the whole body", self.region);
            return Err(SetupError::value("region", message, "a part of the body"));
        }
        let programme = Programme::new("the cut is made", self.time);
        setup.stepping(with_programme(Some(programme)));
        Ok(Box::new(RunningCut {
            body,
            time: self.time,
            points,
            active: setup.change_material(body, Change::Cuts, &[])?,
        }))
    }
}

impl RunningCoupler for RunningCut {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        // like births, cuts are part of the first step that begins at their time
        if step.size == 0.0 || step.middle() < self.time {
            return Ok(());
        }
        let is_done = |activity: &[f64]| {
            self.points
                .iter()
                .all(|&n| !is_active(activity[n as usize]))
        };
        let has_material = world.activity(self.body).is_none_or(|a| !is_done(&a));
        if !world.processes().any(has_material) {
            return Ok(());
        }
        let mut active = world.write(self.active);
        self.points.iter().for_each(|&n| active[n as usize] = 0.0);
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: Some(self.time).filter(|cut| *cut > time),
            ..StepLimits::default()
        }
    }
}

perimelt_core::register_coupler!("cut", Cut, supports: [Births, Cuts, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deposit::Deposit;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};
    use perimelt_core::keys;

    #[test]
    fn points_lose_their_material_in_the_step_that_begins_at_the_cut() {
        let mut world = World::new(vec![block([3, 1, 1], 3, STEEL)]);
        let cut: Cut = read("region = 'left'\ntime = 2");
        let (mut cut, _) = prepare(&mut world, cut, |_| ()).expect("valid");
        assert_eq!(
            (
                cut.step_limits(0.0).next_event,
                cut.step_limits(2.0).next_event
            ),
            (Some(2.0), None)
        );
        // the initial state of a run that begins at the cut is that before it
        cut.apply(&world, Step::new(2.0, 0.0)).expect("applies");
        for (start, left) in [(0.0, 1.0), (1.0, 1.0), (2.0, 0.0), (3.0, 0.0)] {
            apply(&world, &mut *cut, start);
            assert_eq!(values(&world, &keys::ACTIVE), [left, 1.0, 1.0], "{start}");
        }
    }

    #[test]
    fn what_was_deposited_can_be_cut_off() {
        let mut world = World::new(vec![block([3, 1, 1], 3, STEEL)]);
        let table =
            "region = 'left'\ntemperature = 900\nlayers = { height = 1, interval = 1, first = 1 }";
        let deposit: Deposit = read(table);
        let cut: Cut = read("region = 'left'\ntime = 2");
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("cut");
        let mut cut = Box::new(cut).prepare(&mut setup).expect("valid");
        setup.next_plugin("deposit");
        let mut deposit = Box::new(deposit).prepare(&mut setup).expect("valid");
        setup.finish().expect("both may change the activity");
        for (start, left) in [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 0.0)] {
            apply(&world, &mut *cut, start);
            apply(&world, &mut *deposit, start);
            assert_eq!(values(&world, &keys::ACTIVE), [left, 1.0, 1.0], "{start}");
        }
    }

    #[test]
    fn a_body_is_not_cut_off_as_a_whole() {
        let mut world = World::new(vec![block([1, 2, 1], 2, STEEL)]);
        let cut: Cut = read("region = 'left'\ntime = 1");
        assert!(refusal(&mut world, cut).contains("whole body"));
        for time in ["-1", "inf", "nan"] {
            let mut world = World::new(vec![block([3, 1, 1], 3, STEEL)]);
            let cut: Cut = read(&format!("region = 'left'\ntime = {time}"));
            assert!(refusal(&mut world, cut).starts_with("time: "));
        }
    }
}
