//! One pass over all physics: groups in order, sub-steps, couplers before them, and checks of the state.

use std::time::Instant;

use super::Simulation;
use crate::error::RunError;
use crate::solver::reduce::max_abs;
use crate::stepping::{Step, Update};

/// Sub-steps between two checks for a blow-up: rare enough to cost nothing, often enough to name the time. What others
/// see is always checked: the culprit is to be named, not its victim.
const CHECK: u64 = 64;

impl Simulation {
    pub(super) fn pass(&mut self, end: f64, logging: bool) -> Result<(), RunError> {
        self.clock.progress.passes += 1;
        (0..self.plan.groups.len()).try_for_each(|g| self.advance_group(g, end, logging))
    }

    fn is_due(&self, physics: usize, logging: bool) -> bool {
        logging || self.physics[physics].stepping.update == Update::Step
    }

    /// Advances the physics of a group to `end` (s): a single one as it likes, several in common steps.
    pub(super) fn advance_group(
        &mut self,
        g: usize,
        end: f64,
        logging: bool,
    ) -> Result<(), RunError> {
        let group = &self.plan.groups[g];
        let first = group.members[0];
        if !self.is_due(first, logging) {
            return Ok(());
        }
        let start = self.clock.advanced_to[first];
        if group.members.len() == 1 && group.couplers.is_empty() {
            self.advance(first, end, logging, false)?;
            self.set_time(first, end);
            return Ok(());
        }
        let members = &self.plan.groups[g].members;
        if members.iter().all(|&p| self.physics[p].stepping.is_steady) {
            return self.find_steady_group(g, start, end, logging);
        }
        let count = self.steps_within(first, self.group_steps[g], end - start)?;
        let size = (end - start) / count as f64;
        for s in 0..count {
            let step = Step::new(start + s as f64 * size, size);
            let step_end = if s + 1 == count {
                end
            } else {
                start + (s + 1) as f64 * size
            };
            self.exchange(g, step)?;
            for m in 0..self.plan.groups[g].members.len() {
                let p = self.plan.groups[g].members[m];
                self.advance(p, step_end, logging && s + 1 == count, true)?;
                self.set_time(p, step_end);
            }
        }
        Ok(())
    }

    /// Applies the exchanges of a group, whose members are all at the start of `step`, and keeps the rates that
    /// they add for all sub-steps.
    pub(super) fn exchange(&mut self, g: usize, step: Step) -> Result<(), RunError> {
        let group = &self.plan.groups[g];
        for &p in &group.members {
            let sinks = self.plan.sinks[p].iter().chain(&self.plan.amounts[p]);
            sinks.for_each(|&sink| self.world.fields.field(sink).fill(0.0));
        }
        for &c in &group.couplers {
            self.couplers[c].plugin.apply(&self.world, step)?;
        }
        for (&sink, kept) in group.rates.iter().zip(&mut self.rates[g]) {
            kept.clear();
            kept.extend_from_slice(self.world.fields.field(sink).data().flat());
        }
        Ok(())
    }

    /// The time to which a physics has advanced is that of the fields that it owns.
    pub(super) fn set_time(&mut self, physics: usize, time: f64) {
        self.clock.advanced_to[physics] = time;
        self.world.set_times(&self.plan.owned[physics], time);
    }

    /// Number of steps of a physics, of at most `size` (s), in a span (s).
    fn steps_within(&self, physics: usize, size: f64, span: f64) -> Result<u64, RunError> {
        let count = (span / size * (1.0 - 1e-9)).ceil().max(1.0);
        if count > 1e12 {
            return Err(RunError::StepTooSmall {
                physics: self.physics[physics].label.clone(),
                step: size,
                time: self.clock.advanced_to[physics],
                count,
            });
        }
        Ok(count as u64)
    }

    /// Advances a physics to `end` (s) in sub-steps of its own; `in_group`: after the exchanges of its group.
    pub(super) fn advance(
        &mut self,
        p: usize,
        end: f64,
        logging: bool,
        in_group: bool,
    ) -> Result<(), RunError> {
        let begun = Instant::now();
        let start = self.clock.advanced_to[p];
        let count = self.steps_within(p, self.sub_step[p], end - start)?;
        let size = (end - start) / count as f64;
        let steady = |&c: &usize| self.couplers[c].stepping.is_steady;
        let repeatable = self.plan.one_way[p] && self.plan.before[p].iter().all(steady);
        for s in 0..count {
            let step = Step {
                start: start + s as f64 * size,
                size,
                repeated: s > 0 && repeatable,
            };
            if !(in_group && s == 0) {
                let amounts = self.plan.amounts[p].iter();
                amounts.for_each(|&sink| self.world.fields.field(sink).fill(0.0));
            }
            if !step.repeated {
                self.apply(p, step)?;
            }
            let advanced = self.physics[p].plugin.advance(&self.world, step);
            if advanced.is_err() {
                // a state that is not finite is the cause of whatever failed
                self.check_state(p, step)?;
            }
            let work = advanced?;
            self.world.exchange(&self.plan.state[p]);
            self.clock.progress.sub_steps[p] += 1;
            self.clock.progress.iterations[p] += work.iterations as u64;
            self.clock.progress.evaluations[p] += work.evaluations as u64;
            let is_single = count == 1 && work.evaluations <= 1 && !logging;
            let is_last = s + 1 == count && !(is_single && self.physics.len() == 1);
            if is_last || self.clock.progress.sub_steps[p].is_multiple_of(CHECK) {
                self.check_state(p, step)?;
            }
        }
        self.wall[p] += begun.elapsed().as_secs_f64();
        Ok(())
    }

    /// Zeroes the sinks of a physics, but for the rates of exchanges, and applies its couplers.
    pub(super) fn apply(&mut self, p: usize, step: Step) -> Result<(), RunError> {
        for &sink in &self.plan.sinks[p] {
            self.world.fields.field(sink).fill(0.0);
        }
        for (group, rates) in self.plan.groups.iter().zip(&self.rates) {
            for (sink, kept) in group.rates.iter().zip(rates) {
                if self.plan.sinks[p].contains(sink) && !kept.is_empty() {
                    let field = self.world.fields.field(*sink);
                    field.data_mut().flat_mut().copy_from_slice(kept);
                }
            }
        }
        self.world.taken = Some(std::mem::take(&mut self.plan.sinks[p]));
        let mut before = self.plan.before[p].iter();
        let applied = before.try_for_each(|&c| self.couplers[c].plugin.apply(&self.world, step));
        self.plan.sinks[p] = self.world.taken.take().unwrap_or_default();
        applied
    }

    pub(super) fn apply_rest(&mut self, step: Step) -> Result<(), RunError> {
        for &c in &self.plan.after {
            self.couplers[c].plugin.apply(&self.world, step)?;
        }
        Ok(())
    }

    /// Applies all couplers for the initial state.
    pub(super) fn apply_all(&mut self, step: Step) -> Result<(), RunError> {
        for g in 0..self.plan.groups.len() {
            if !self.plan.groups[g].couplers.is_empty() {
                self.exchange(g, step)?;
            }
        }
        for p in 0..self.physics.len() {
            self.apply(p, step)?;
        }
        self.apply_rest(step)
    }

    pub(super) fn check_state(&mut self, p: usize, step: Step) -> Result<(), RunError> {
        for &index in &self.plan.owned[p] {
            let field = self.world.fields.field(index);
            let data = field.data();
            let points = self.world.reducer(field.body);
            let own = points.own(data.flat());
            let largest = max_abs(own);
            let components = data.components();
            let at = match largest.is_finite() {
                false => own.iter().position(|v| !v.is_finite()).unwrap_or(0),
                true => {
                    drop(data);
                    let plugin = &mut self.physics[p].plugin;
                    let Some(point) = plugin.find_blow_up(&self.world, &field.name, largest) else {
                        continue;
                    };
                    let data = field.data();
                    let size = |c: &usize| data.flat()[components * point + c].abs();
                    let largest = (0..components).max_by(|a, b| size(a).total_cmp(&size(b)));
                    components * point + largest.unwrap_or(0)
                }
            };
            let field = self.world.fields.field(index);
            let data = field.data();
            let body = &self.world.bodies[field.body];
            return Err(RunError::BlowUp {
                physics: self.physics[p].label.clone(),
                field: field.name.clone(),
                body: body.name.clone(),
                point: at / components,
                position: body.points.position.at(at / components).into(),
                value: data.flat()[at],
                time: step.end(),
                step: step.size,
                stable: self.stable_step[p],
            });
        }
        Ok(())
    }
}
