//! A number, or a few, measured while a simulation runs.
//!
//! `prepare` finds bodies, fields and points that a `measure` key names, `sample` takes the values.

mod prepare;
mod sample;

use perimelt_core::{SetupError, Simulation};

use super::check::{Measure, OverTime};
use crate::probe::largest;
use prepare::Schedule;
use sample::Sampler;

/// A measurement during a run.
pub struct Measurement {
    sampler: Sampler,
    schedule: Schedule,
    /// Number of states in `values`.
    states: u32,
    /// Time of the first state, s, and its values, of a rate.
    first: Option<(f64, Vec<f64>)>,
    values: Option<Vec<f64>>,
}

impl Measurement {
    /// Finds the bodies, fields and points of `measure` in a composed simulation.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(measure: &Measure, simulation: &Simulation) -> Result<Measurement, SetupError> {
        let (sampler, schedule) = prepare::sampler(measure, simulation)?;
        Ok(Measurement {
            sampler,
            schedule,
            states: 0,
            first: None,
            values: None,
        })
    }

    /// Updates the values after a step; `logging`: the state is logged.
    pub fn observe(&mut self, simulation: &Simulation, logging: bool) {
        if self.sampler.is_followed() {
            self.sampler.follow(simulation, logging, &mut self.values);
        } else if logging {
            self.take(simulation);
        }
    }

    /// Takes the values of a state within the schedule.
    fn take(&mut self, simulation: &Simulation) {
        let (now, end) = (simulation.time(), simulation.options().end);
        if !self.schedule.includes(now, end) {
            return;
        }
        let Some(taken) = self.sampler.take(simulation) else {
            return;
        };
        if self.schedule.over_time == OverTime::Rate {
            let (start, first) = &*self.first.get_or_insert_with(|| (now, taken.clone()));
            let changes = taken.iter().zip(first).map(|(last, first)| last - first);
            let rates = changes.map(|change| change / (now - start)).collect();
            self.values = (now > *start).then_some(rates);
            return;
        }
        self.states += 1;
        let fraction = 1.0 / f64::from(self.states);
        let combine = |all: f64, value: f64| match self.schedule.over_time {
            OverTime::Last | OverTime::Rate => value,
            OverTime::Max => largest([all, value].into_iter()),
            OverTime::Min => -largest([-all, -value].into_iter()),
            OverTime::Mean => all + fraction * (value - all),
        };
        match &mut self.values {
            None => self.values = Some(taken),
            Some(values) => {
                let pairs = values.iter_mut().zip(taken);
                pairs.for_each(|(all, value)| *all = combine(*all, value));
            }
        }
    }

    /// The measured values; `None` if no logged state at the time of the measurement has them.
    pub fn values(&self) -> Option<&[f64]> {
        self.values.as_deref()
    }
}
