//! Sizes of steps: what is stable, what was asked for, and macro steps that land on log times and events.

use super::{Culprit, Ready, Simulation};
use crate::error::{Problem, RunError, SetupError};
use crate::plugin::RunningCoupler;
use crate::schedule::Group;
use crate::stepping::{Step, StepSize};

impl Simulation {
    pub(super) fn find_steps(&mut self) {
        let processes = self.world.processes();
        let ask = |c: &mut Ready<dyn RunningCoupler>| {
            let stable = c.plugin.stable_step(&self.world);
            stable.map(|step| processes.min(step))
        };
        self.stable_exchange = self.couplers.iter_mut().map(ask).collect();
        self.limit_steps();
        self.find_group_steps();
    }

    /// A group advances by the longest step of its members, as far as exchanges and members that give amounts allow.
    fn find_group_steps(&mut self) {
        let step = |group: &Group| {
            let finite = group.members.iter().map(|&p| self.sub_step[p]);
            let longest = finite.filter(|s| s.is_finite()).fold(0.0, f64::max);
            let longest = if longest > 0.0 {
                longest
            } else {
                f64::INFINITY
            };
            let stable = |&c: &usize| self.stable_exchange[c].map(|s| self.options.safety * s);
            let exchanges = group.couplers.iter().filter_map(stable);
            let givers = group.givers.iter().map(|&p| self.sub_step[p]);
            exchanges.chain(givers).fold(longest, f64::min)
        };
        self.group_steps = self.plan.groups.iter().map(step).collect();
    }

    /// Takes up the stable steps of physics, which may change during the run.
    fn limit_steps(&mut self) {
        let mut any = false;
        for (i, p) in self.physics.iter_mut().enumerate() {
            let stable = p.plugin.stable_step(&self.world);
            let stable = stable.map(|step| self.world.processes().min(step));
            any |= std::mem::replace(&mut self.stable_step[i], stable) != stable;
            let exchanges = self.plan.before[i].iter();
            let exchanges = exchanges.filter_map(|&c| self.stable_exchange[c]);
            let stable = exchanges.chain(stable).fold(f64::INFINITY, f64::min);
            self.sub_step[i] = match p.stepping.step {
                StepSize::Fixed(step) => step,
                StepSize::Auto => self.options.safety * stable,
            };
        }
        if any {
            self.find_group_steps();
        }
    }

    /// Refuses fixed steps above the stable ones, those of physics and of the couplers before them.
    ///
    /// # Errors
    /// The physics at fault, with both numbers.
    pub fn check_steps(&self) -> Result<(), (Culprit, SetupError)> {
        for (i, p) in self.physics.iter().enumerate() {
            let StepSize::Fixed(fixed) = p.stepping.step else {
                continue;
            };
            let exceeds = |stable: &f64| fixed > stable * (1.0 + 1e-9);
            let refuse = |problem| Err((Culprit::Physics(i), SetupError::new("step", problem)));
            if let Some(stable) = self.stable_step[i].filter(exceeds) {
                return refuse(Problem::UnstableStep {
                    physics: p.label.clone(),
                    fixed,
                    stable,
                });
            }
            let group = self.plan.groups.iter().find(|g| g.members.contains(&i));
            let exchanges = group.map_or(&[][..], |g| &g.couplers);
            for &c in self.plan.before[i].iter().chain(exchanges) {
                if let Some(stable) = self.stable_exchange[c].filter(exceeds) {
                    return refuse(Problem::UnstableExchange {
                        physics: p.label.clone(),
                        fixed,
                        coupler: self.couplers[c].label.clone(),
                        stable,
                    });
                }
            }
        }
        Ok(())
    }

    /// Largest macro step, s: as asked for, or the longest sub-step that physics and couplers allow.
    pub fn macro_step(&self) -> f64 {
        self.macro_step_at(self.clock.time)
    }

    /// Largest macro step in the stage of a time (s), s.
    pub(super) fn macro_step_at(&self, time: f64) -> f64 {
        let stages = self.options.stages.iter();
        let stage = stages.take_while(|s| s.from <= time).last();
        if let StepSize::Fixed(step) = stage.map_or(self.options.step, |s| s.step) {
            return step;
        }
        let longest = self
            .sub_step
            .iter()
            .copied()
            .filter(|s| s.is_finite())
            .fold(0.0, f64::max);
        let longest = if longest > 0.0 {
            longest
        } else {
            self.options.log.interval_at(time)
        };
        let physics = self
            .physics
            .iter()
            .filter_map(|p| p.plugin.step_limits(time).longest);
        let couplers = self
            .couplers
            .iter()
            .filter_map(|c| c.plugin.step_limits(time).longest);
        physics.chain(couplers).fold(longest, f64::min)
    }

    /// The next time at which the state is to be logged, s.
    pub fn next_log(&self) -> f64 {
        let next = self.clock.logs + 1;
        self.options.log.time_until(next, self.options.end)
    }

    /// Number of log times until a time (s) of a run that may have had another interval or end.
    pub(super) fn logs_until(&self, time: f64) -> u64 {
        self.options.log.until(time)
    }

    /// The time (s) on which the macro steps after `time` must land: the next log, or an event or a stage before it.
    pub(super) fn next_target(&self, time: f64, log: f64, limit: f64) -> f64 {
        // an event within rounding of now, or of the log, is as good as reached
        let tolerance = 1e-9 * limit.min(log - time);
        let after = time + tolerance;
        let couplers = self
            .couplers
            .iter()
            .filter_map(|c| c.plugin.step_limits(after).next_event);
        let physics = self
            .physics
            .iter()
            .filter_map(|p| p.plugin.step_limits(after).next_event);
        let stages = self.options.stages.iter().map(|s| s.from);
        let stage = stages.filter(|from| *from > after).fold(log, f64::min);
        let event = couplers.chain(physics).fold(stage, f64::min);
        if log - event <= tolerance { log } else { event }
    }

    /// Takes a macro step. Returns whether the state is now to be logged.
    ///
    /// # Errors
    /// What stops the run.
    pub fn step(&mut self) -> Result<bool, RunError> {
        self.limit_steps();
        let time = self.clock.time;
        for c in &mut self.couplers {
            c.plugin.begin_step(&self.world, time);
        }
        let log = self.next_log();
        let limit = self.macro_step();
        let target = self.next_target(time, log, limit);
        let steps = ((target - time) / limit * (1.0 - 1e-9)).ceil().max(1.0);
        let end = if steps == 1.0 {
            target
        } else {
            time + (target - time) / steps
        };
        let logging = steps == 1.0 && target == log;
        if end <= time {
            let count = (self.options.end - time) / limit;
            let physics = "the schedule".to_string();
            return Err(RunError::StepTooSmall {
                physics,
                step: end - time,
                time,
                count,
            });
        }

        match self.options.iteration {
            None => self.pass(end, logging)?,
            Some(iteration) => self.iterate(end, logging, iteration)?,
        }
        self.apply_rest(Step::new(time, end - time))?;
        self.clock.time = end;
        self.clock.progress.macro_steps += 1;
        self.clock.progress.last_step = end - time;
        if logging {
            self.observe()?;
            self.clock.logs += 1;
        }
        Ok(logging)
    }
}
