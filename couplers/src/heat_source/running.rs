//! A moving source while it heats.

use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Report, RunError, RunningCoupler, Step, StepLimits, World, Write};
use serde::{Deserialize, Serialize};

use super::account::{Account, mirror_copies};
use super::heading::Heading;
use super::lattice::LatticeBody;
use super::shape::{CellGrid, Cells, Depositor, HeatedSurface};
use super::step_positions::StepPositions;
use crate::toolpath::{ClockState, TimedPath};

/// A heat source on a toolpath that is ready to heat.
pub(super) struct RunningSource {
    pub body: BodyIndex,
    pub grid: CellGrid,
    pub path: Rc<TimedPath>,
    pub depositor: Depositor,
    pub surface: HeatedSurface,
    pub heat_source: Write<f64>,
    /// Longest distance that the source may move over the points in a step while it is on, m.
    pub longest_way: f64,
    /// Largest speed on the path, m/s.
    pub speed: f64,
    /// Position at the end of the last step, m.
    pub position: Vector3<f64>,
    /// Directions in the middle of the last step.
    pub heading: Heading,
    pub account: Account,
    pub positions: StepPositions,
}

/// State for a checkpoint.
#[derive(Serialize, Deserialize)]
struct Saved {
    account: Account,
    clock: Option<ClockState>,
    /// Speed of the fastest point of a fluid, m/s.
    point_speed: f64,
}

impl RunningCoupler for RunningSource {
    /// Stores the positions, and begins the passes whose wait has ended.
    fn begin_step(&mut self, world: &World, time: f64) {
        self.positions.begin_step(world, self.body, time);
        if !self.path.track().passes().is_empty() {
            self.path.begin_step(world, time);
        }
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let body = world.body(self.body);
        let mut pose = self.path.pose(step.middle());
        let left = self.path.left(step.middle(), self.depositor.efficiency());
        if left < 0.0 {
            return Err(RunError::Plugin {
                plugin: "deposit".into(),
                time: step.start,
                cause: format!(
                    "the droplets take {:.3} times the heat of the source in this pass; expected less than 1",
                    1.0 - left
                )
                .into(),
            });
        }
        pose.power *= left;
        // points of a window are stored at their positions at set-up
        pose.position -= world.window_shift(self.body);
        let mut heat_source = world.write(self.heat_source);
        let now = self.positions.at(world, self.body, step.middle());
        let deposit = match Cells::of(world, self.body, now, self.grid) {
            Some(cells) => (self.depositor).add_to_cells(&cells, &pose, &mut heat_source),
            None => {
                let body = LatticeBody {
                    body,
                    grid: self.grid,
                    activity: world.activity(self.body),
                };
                self.depositor.add(&body, &pose, &mut heat_source)
            }
        };
        let copies = mirror_copies(&self.grid, &world.symmetry(self.body), &pose);
        // between two pulses the source counts as on
        let is_on = self.path.is_on_after(step.middle());
        let speed = is_on.then_some(pose.speed);
        self.account.book(&deposit, copies, step.size, speed);
        self.position = self.path.pose(step.end()).position;
        let moves = self.speed > 0.0;
        // a jump without power does not turn the melt pool
        let pose = self.path.last_pose_with_power(step.middle());
        self.heading = Heading::new(&self.depositor, self.surface, &pose, moves);
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let speed = self.speed + self.positions.speed;
        let is_limited = speed > 0.0 && self.path.will_be_on(time);
        StepLimits {
            next_event: self.path.next_event(time),
            longest: is_limited.then(|| self.longest_way / speed),
        }
    }

    fn report(&self) -> Vec<Report> {
        let mut reports = self.account.report();
        let axes = ["x", "y", "z"].into_iter().enumerate();
        reports.extend(
            axes.map(|(axis, name)| {
                Report::new(format!("position.{name}"), "m", self.position[axis])
            }),
        );
        reports.extend(self.heading.report());
        reports.extend(self.path.report());
        reports
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(Saved {
            account: self.account,
            clock: Some(self.path.save()),
            point_speed: self.positions.speed,
        })
    }

    fn load(
        &mut self,
        _world: &World,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let saved = Saved::deserialize(state)?;
        self.account = saved.account;
        self.positions.speed = saved.point_speed;
        if let Some(clock) = saved.clock {
            self.path.load(clock);
        }
        Ok(())
    }
}
