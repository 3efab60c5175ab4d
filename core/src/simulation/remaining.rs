//! Steps that are left until the end of a run, and the wall time that steps took so far: what an estimate of the duration is
//! made of.

use super::Simulation;
use crate::stepping::Update;

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

/// Part of the time that is left below which a phase is not told apart.
const SHORTEST_PHASE: f64 = 0.02;

/// Part of the time that is left above which a phase is divided.
const LONGEST_PHASE: f64 = 0.25;

impl Simulation {
    /// Times (s) between which the work of a step may change, the last one the end of the run: ends of the programmes of plugins, such
    /// as toolpaths, and some in between where these are far apart.
    pub fn phases(&self) -> Vec<f64> {
        let end = self.options.end;
        let mut ends: Vec<f64> = self.programmes(end).map(|(_, p)| p.end).collect();
        ends.retain(|time| *time < end);
        ends.sort_by(f64::total_cmp);
        ends.push(end);
        let left = end - self.clock.time;
        let mut phases = Vec::new();
        let mut from = self.clock.time;
        for to in ends {
            let is_apart = to - from > SHORTEST_PHASE * left && end - to > SHORTEST_PHASE * left;
            if is_apart || to == end {
                let parts = count((to - from) / (LONGEST_PHASE * left));
                let part = (to - from) / parts;
                phases.extend((1..parts as u32).map(|k| from + f64::from(k) * part));
                phases.push(to);
                from = to;
            }
        }
        phases
    }

    /// Goes on at another time (s) with the present state. The results are of no use; the time that later steps take is.
    pub fn skip_to(&mut self, time: f64) {
        self.clock.time = time;
        self.clock.logs = self.logs_until(time);
        self.clock.advanced_to.fill(time);
    }

    /// Steps that are left.
    pub fn remaining(&self) -> Remaining {
        self.steps_between(self.clock.time, self.options.end)
    }

    /// Steps from one time (s) to another, as they are now.
    pub fn steps_between(&self, from: f64, end: f64) -> Remaining {
        let mut left = Remaining {
            macro_steps: 0.0,
            logs: self.options.log.left(from, end) as f64,
            sub_steps: vec![0.0; self.physics.len()],
        };
        let (mut time, mut log) = (from, self.logs_until(from) + 1);
        let mut advanced_to = self.clock.advanced_to.clone();
        if from != self.clock.time {
            advanced_to.fill(from);
        }
        for _ in 0..MOST_TARGETS {
            if time >= end {
                return left;
            }
            let next_log = self.options.log.time_until(log, end);
            let limit = self.macro_step_at(time);
            let target = self.next_target(time, next_log, limit);
            let is_log = target >= next_log;
            let steps = count((target - time) / limit);
            left.macro_steps += steps;
            for (p, physics) in self.physics.iter().enumerate() {
                let is_rare = physics.stepping.update == Update::Log;
                if is_rare && !is_log {
                    continue;
                }
                let (start, steps) = match is_rare {
                    true => (advanced_to[p], 1.0),
                    false => (time, steps),
                };
                left.sub_steps[p] += steps * self.sub_steps_within(p, (target - start) / steps);
                advanced_to[p] = target;
            }
            log += u64::from(is_log);
            time = target;
        }
        let rest = (end - from) / (time - from);
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
