//! Prescribed heat flux: a flux q into the body heats the points of the surface by
//! `q area / volume` (Wang (2025), eq. 7.18; here q is positive into the body).

use perimelt_core::world::exchange::{SurfaceFlux, SurfaceLaw};
use perimelt_core::{
    Coupler, Face, Prepared, Programme, Report, RunError, RunningCoupler, Setup, Step, StepLimits,
    World, flattened,
};

use super::with_programme;
use crate::InTime;
use crate::surface::{OnSurface, SurfaceHeat, SurfacePlace};

flattened! {
    /// Heat through the surface at a given rate.
    #[derive(Debug)]
    pub struct HeatFlux {
        ..place: OnSurface,
        /// Outward directions of the heated surface, such as `["z+"]`.
        pub faces: Vec<Face>,
        /// Flux into the body (W/m²): a number, or `{ time = [...], value = [...] }`, times in s.
        pub flux: InTime,
    }
}

/// A heat flux that is ready to act.
struct RunningHeatFlux {
    flux: InTime,
    heat: SurfaceHeat<PrescribedFlux>,
}

/// A flux that does not depend on the temperature, W/m².
#[derive(Debug)]
pub(crate) struct PrescribedFlux(pub f64);

impl SurfaceLaw for PrescribedFlux {
    fn flux(&self, _: usize, _: f64) -> SurfaceFlux {
        SurfaceFlux {
            flux: self.0,
            slope: 0.0,
        }
    }

    fn stiffness(&self, _: f64) -> f64 {
        0.0
    }

    fn is_linear(&self) -> bool {
        true
    }
}

#[typetag::serialize(name = "heat_flux")]
impl Coupler for HeatFlux {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let region = self.place.region.as_deref();
        let law = PrescribedFlux(self.flux.at(0.0));
        let heat = SurfaceHeat::prepare(setup, body, SurfacePlace::new(&self.faces, region), law)?;
        let programme = Programme::of_values([("flux", &self.flux)]);
        setup.stepping(with_programme(programme));
        let flux = self.flux;
        Ok(Box::new(RunningHeatFlux { flux, heat }))
    }
}

impl RunningCoupler for RunningHeatFlux {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        let flux = self.flux.value_at("flux", step.middle());
        self.heat.law().0 = flux.map_err(|e| RunError::wrong_value("heat_flux", e))?;
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.flux.next_event(time),
            ..StepLimits::default()
        }
    }

    fn report(&self) -> Vec<Report> {
        self.heat.report()
    }
}

perimelt_core::register_coupler!("heat_flux", HeatFlux, supports: [Flow, Births, Cuts, Window, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, exchange, heat, read};

    #[test]
    fn the_power_is_the_flux_at_the_middle_of_the_step_times_the_area() {
        for (table, power) in [
            ("faces = ['z+', 'x-']\nflux = 10", 10.0 * (12.0 + 6.0)),
            (
                "faces = ['z+']\nregion = 'left'\nflux = { time = [0, 4], value = [0, 8] }",
                9.0,
            ),
        ] {
            let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
            let (mut boundary, exchange) = exchange(&mut world, read::<HeatFlux>(table));
            apply(&world, &mut *boundary, 1.0);
            let heat = heat(&world, &exchange, |_| 300.0);
            assert_eq!(heat.iter().sum::<f64>(), power, "{table}");
        }
    }
}
