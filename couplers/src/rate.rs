//! Heat from the rate of a work between two applications of a coupler.

use perimelt_core::field::Value;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Key, LoadError, Read, Report, RunError, RunningCoupler, SavedState, Setup, SetupError, Step,
    Stepping, World, Write, keys,
};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Computes the factors at each point that turn the rates of the components of a field into a power per volume (W/m³).
type FindFactors = Box<dyn FnMut(&World, &mut [f64])>;

/// Heat from the rate of a field, such as a work per volume that a physics does. All changes of the field are counted exactly
/// once, for any step size of the physics that changes it.
pub(crate) struct WorkHeat<T> {
    body: BodyIndex,
    field: Read<T>,
    heat_source: Write<f64>,
    find_factors: FindFactors,
    /// Last factors, component by component of each point.
    factor: Vec<f64>,
    /// The field when the heat was last computed, zero before the first time; part of a checkpoint.
    seen: Vec<T>,
    /// Heat by point, W/m³.
    heat: Vec<f64>,
    /// Name of the power in reports.
    name: &'static str,
    /// Heat in the macro step so far, J.
    energy: f64,
    /// Duration of the macro step so far, s.
    duration: f64,
}

impl<T: Value + Serialize + DeserializeOwned> WorkHeat<T> {
    /// Heat from the rate of the field `key` of a body; its power is reported under `name`.
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        key: &Key<T>,
        name: &'static str,
        find_factors: impl FnMut(&World, &mut [f64]) + 'static,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let points = setup.body(body).points.len();
        setup.stepping(Stepping {
            acts_by_rate: true,
            ..Stepping::default()
        });
        Ok(Box::new(WorkHeat {
            body,
            field: setup.read(body, key)?,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            find_factors: Box::new(find_factors),
            factor: vec![0.0; points * T::COMPONENTS],
            seen: vec![T::default(); points],
            heat: vec![0.0; points],
            name,
            energy: 0.0,
            duration: 0.0,
        }))
    }
}

impl<T: Value + Serialize + DeserializeOwned> RunningCoupler for WorkHeat<T> {
    fn begin_step(&mut self, _world: &World, _time: f64) {
        (self.energy, self.duration) = (0.0, 0.0);
    }

    /// In a step of size zero the rate is zero.
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        (self.find_factors)(world, &mut self.factor);
        let now = world.read(self.field);
        let now: &[f64] = bytemuck::cast_slice(&now);
        let rate_of = |(now, seen): (&f64, &mut f64)| {
            let change = now - std::mem::replace(seen, *now);
            match step.size > 0.0 {
                true => change / step.size,
                false => 0.0,
            }
        };
        let seen: &mut [f64] = bytemuck::cast_slice_mut(&mut self.seen);
        let components = now
            .chunks(T::COMPONENTS)
            .zip(seen.chunks_mut(T::COMPONENTS));
        let points = self.heat.iter_mut().zip(self.factor.chunks(T::COMPONENTS));
        for ((heat, factors), (now, seen)) in points.zip(components) {
            let rates = now.iter().zip(seen).map(rate_of);
            *heat = factors
                .iter()
                .zip(rates)
                .map(|(factor, rate)| factor * rate)
                .sum();
        }
        let mut heat_source = world.write(self.heat_source);
        let points = heat_source.par_iter_mut().zip(&self.heat);
        points.for_all(|(sum, heat)| *sum += heat);
        let volume = &world.body(self.body).points.volume;
        let points = world.reducer(self.body);
        let power = points.sum_of([&self.heat, volume], |[heat, volume]| heat * volume);
        self.energy += power * step.size;
        self.duration += step.size;
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let power = match self.duration > 0.0 {
            true => self.energy / self.duration,
            false => 0.0,
        };
        vec![Report::new(self.name, "W", power)]
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(world.whole_of(self.body, &self.seen))
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.seen = world.load_points(self.body, state)?;
        Ok(())
    }
}
