//! The rate of a field between the times at which a coupler is applied, and heat from the rate of a work.

use perimelt_core::plugin::load_points;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Key, Read, Report, Setup, SetupError, World, Write, keys};
use rayon::prelude::*;

/// Rate of a field from its values when the rate was last taken. All changes are counted exactly once, whatever
/// the step size of the physics that changes the field.
#[derive(Debug)]
pub(crate) struct Rate {
    /// Values when the rate was last taken, zero before the first time. A restart needs them.
    pub seen: Vec<f64>,
    /// Change per second, by point.
    pub values: Vec<f64>,
}

impl Rate {
    /// The rate of a field of `points` values that is zero at first.
    pub fn new(points: usize) -> Self {
        Rate {
            seen: vec![0.0; points],
            values: vec![0.0; points],
        }
    }

    /// Takes the values of `now` at the end of a step of `size` (s); in a step of size zero the rate is zero.
    pub fn take(&mut self, now: &[f64], size: f64) {
        for ((rate, now), seen) in self.values.iter_mut().zip(now).zip(&mut self.seen) {
            *rate = if size > 0.0 {
                (now - *seen) / size
            } else {
                0.0
            };
            *seen = *now;
        }
    }
}

/// Heat from the rate of a field, such as a work per volume that a physics does.
#[derive(Debug)]
pub(crate) struct WorkHeat {
    body: BodyIndex,
    field: Read<f64>,
    heat_source: Write<f64>,
    /// Rate of the field; what it has seen is the state of a restart.
    pub rate: Rate,
    /// Of the last step, W.
    power: f64,
}

impl WorkHeat {
    /// Heat from the rate of the field `key` of a body.
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        key: &Key<f64>,
    ) -> Result<WorkHeat, SetupError> {
        Ok(WorkHeat {
            body,
            field: setup.read(body, key)?,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            rate: Rate::new(setup.body(body).points.len()),
            power: 0.0,
        })
    }

    /// Adds the change of the field since the last time as heat over a step of `size` (s): at each point, the rate times
    /// a factor that makes it W/m³.
    pub fn add(&mut self, world: &World, factor: impl Fn(usize) -> f64 + Sync, size: f64) {
        self.rate.take(&world.read(self.field), size);
        let rate = &self.rate.values;
        let heat = |point: usize| factor(point) * rate[point];
        let mut heat_source = world.write(self.heat_source);
        let points = heat_source.par_iter_mut().enumerate();
        points.for_each(|(point, sum)| *sum += heat(point));
        // in order, so that the sum does not depend on the number of threads
        let volumes = world.body(self.body).points.volume.iter().enumerate();
        self.power = volumes.map(|(point, volume)| heat(point) * volume).sum();
    }

    /// What a restart needs.
    pub fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(&self.rate.seen)
    }

    /// Takes what [`WorkHeat::save`] gave.
    pub fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        self.rate.seen = load_points(state, self.rate.values.len())?;
        Ok(())
    }

    /// The power of the last step under a name.
    pub fn report(heat: Option<&WorkHeat>, name: &str) -> Vec<Report> {
        vec![Report {
            name: name.into(),
            unit: "W".into(),
            value: heat.map_or(0.0, |h| h.power),
        }]
    }
}
