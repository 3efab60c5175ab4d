//! A number, or a few, measured while a simulation runs.
//!
//! `prepare` finds bodies, fields and points that a `measure` key names, `sample` takes the values.

mod prepare;
mod sample;

use perimelt_core::{SetupError, Simulation};

use super::check::Measure;
use prepare::Schedule;
use sample::Sampler;

/// A measurement during a run.
pub struct Measurement {
    sampler: Sampler,
    schedule: Schedule,
    /// States in the mean so far.
    states: u32,
    values: Option<Vec<f64>>,
}

impl Measurement {
    /// Finds what `measure` names in a composed simulation.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(measure: &Measure, simulation: &Simulation) -> Result<Measurement, SetupError> {
        let (sampler, schedule) = prepare::sampler(measure, simulation)?;
        Ok(Measurement {
            sampler,
            schedule,
            states: 0,
            values: None,
        })
    }

    /// Looks at the state after a step; `logging`: the state is logged.
    pub fn observe(&mut self, simulation: &Simulation, logging: bool) {
        if self.sampler.is_followed() {
            self.sampler.follow(simulation, logging, &mut self.values);
        } else if logging {
            self.take(simulation);
        }
    }

    /// Takes the values, or adds them to their mean, if it is time.
    fn take(&mut self, simulation: &Simulation) {
        let (now, end) = (simulation.time(), simulation.options().end);
        let time = self.schedule.time.unwrap_or(end);
        let near = 1e-9 * end;
        match self.schedule.since {
            None if (now - time).abs() <= near => {
                self.values = Some(self.sampler.take(simulation));
            }
            Some(since) if now >= since - near && now <= time + near => {
                let taken = self.sampler.take(simulation);
                let means = self.values.get_or_insert_with(|| vec![0.0; taken.len()]);
                self.states += 1;
                let fraction = 1.0 / f64::from(self.states);
                let pairs = means.iter_mut().zip(taken);
                pairs.for_each(|(mean, value)| *mean += fraction * (value - *mean));
            }
            _ => {}
        }
    }

    /// The measured values; `None` if the run ended before the time of the measurement.
    pub fn values(&self) -> Option<&[f64]> {
        self.values.as_deref()
    }
}
