//! Heat from the rate of a work between two applications of a coupler.

use perimelt_core::plugin::load_points;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Key, LoadError, Read, Report, RunError, RunningCoupler, SavedState, Setup, SetupError, Step,
    World, Write, keys,
};
use rayon::prelude::*;

/// Computes the factor at each point that turns the rate of a field into a power per volume (W/m³).
type FindFactors = Box<dyn Fn(&World, &mut [f64])>;

/// Heat from the rate of a field, such as a work per volume that a physics does. All changes of the field are counted exactly
/// once, for any step size of the physics that changes it.
pub(crate) struct WorkHeat {
    body: BodyIndex,
    field: Read<f64>,
    heat_source: Write<f64>,
    find_factors: FindFactors,
    /// Last factor by point.
    factor: Vec<f64>,
    /// Values of the field when the heat was last computed, zero before the first time; part of a checkpoint.
    seen: Vec<f64>,
    /// Heat by point, W/m³.
    heat: Vec<f64>,
    /// Name of the power in reports.
    name: &'static str,
    /// Power of the last step, W.
    power: f64,
}

impl WorkHeat {
    /// Heat from the rate of the field `key` of a body; its power is reported under `name`.
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        key: &Key<f64>,
        name: &'static str,
        find_factors: impl Fn(&World, &mut [f64]) + 'static,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let zero = vec![0.0; setup.body(body).points.len()];
        Ok(Box::new(WorkHeat {
            body,
            field: setup.read(body, key)?,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            find_factors: Box::new(find_factors),
            factor: zero.clone(),
            seen: zero.clone(),
            heat: zero,
            name,
            power: 0.0,
        }))
    }
}

impl RunningCoupler for WorkHeat {
    /// In a step of size zero the rate is zero.
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        (self.find_factors)(world, &mut self.factor);
        let now: &[f64] = &world.read(self.field);
        let heat = self.heat.iter_mut().zip(&self.factor);
        for ((heat, factor), (seen, now)) in heat.zip(self.seen.iter_mut().zip(now)) {
            let rate = match step.size > 0.0 {
                true => (now - *seen) / step.size,
                false => 0.0,
            };
            *heat = factor * rate;
            *seen = *now;
        }
        let mut heat_source = world.write(self.heat_source);
        let points = heat_source.par_iter_mut().zip(&self.heat);
        points.for_each(|(sum, heat)| *sum += heat);
        // in order, so that the sum does not depend on the number of threads
        let points = self.heat.iter().zip(&world.body(self.body).points.volume);
        self.power = points.map(|(heat, volume)| heat * volume).sum();
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        vec![Report::new(self.name, "W", self.power)]
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(&self.seen)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.seen = load_points(state, self.heat.len())?;
        Ok(())
    }
}
