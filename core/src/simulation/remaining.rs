//! Steps that are left until the end of a run, and the wall time that steps took so far: what an estimate of the duration is
//! made of.

use super::Simulation;
use crate::plugin::Update;

/// Numbers of steps from now to the end of the run. Events that plugins do not know yet, such as those of a path that waits for a
/// temperature, are not among them, and limits of automatic steps are those of the present state.
#[derive(Clone, Debug, PartialEq)]
pub struct Remaining {
    /// Macro steps.
    pub macro_steps: f64,
    /// Logged states.
    pub logs: f64,
    /// Sub-steps by physics: those of one with `update = "log"` belong to the logged states.
    pub sub_steps: Vec<f64>,
}

/// Log times and events after which the rest of the run is taken to be like its beginning.
const MOST_TARGETS: usize = 200_000;

impl Simulation {
    /// Steps that are left.
    pub fn remaining(&self) -> Remaining {
        let now = self.clock.time;
        let end = self.options.end;
        let mut left = Remaining {
            macro_steps: 0.0,
            logs: self.options.log.left(now, end) as f64,
            sub_steps: vec![0.0; self.physics.len()],
        };
        let (mut time, mut log) = (now, self.clock.logs + 1);
        let mut advanced_to = self.clock.advanced_to.clone();
        for _ in 0..MOST_TARGETS {
            if time >= end {
                return left;
            }
            let next_log = self.options.log.time(log).min(end);
            let limit = self.macro_step_at(time);
            let target = self.next_target(time, next_log, limit);
            let is_log = target >= next_log;
            let steps = count((target - time) / limit);
            left.macro_steps += steps;
            for (p, physics) in self.physics.iter().enumerate() {
                let is_rare = physics.plugin.clock().update == Update::Log;
                if is_rare && !is_log {
                    continue;
                }
                let (from, steps) = match is_rare {
                    true => (advanced_to[p], 1.0),
                    false => (time, steps),
                };
                left.sub_steps[p] += steps * self.sub_steps_within(p, (target - from) / steps);
                advanced_to[p] = target;
            }
            log += u64::from(is_log);
            time = target;
        }
        let rest = (end - now) / (time - now);
        left.macro_steps *= rest;
        left.sub_steps.iter_mut().for_each(|s| *s *= rest);
        left
    }

    /// Number of sub-steps of a physics in a step of a size (s), with the steps of its group.
    fn sub_steps_within(&self, p: usize, size: f64) -> f64 {
        let mut groups = self.plan.groups.iter().zip(&self.group_steps);
        let group = groups.find(|(group, _)| group.members.contains(&p));
        let common = group.filter(|(g, _)| g.members.len() > 1 || !g.couplers.is_empty());
        let outer = common.map_or(1.0, |(_, step)| count(size / step));
        outer * count(size / outer / self.sub_step[p])
    }
}

/// Number of equal steps for this many of the longest allowed ones.
fn count(steps: f64) -> f64 {
    (steps * (1.0 - 1e-9)).ceil().max(1.0)
}
