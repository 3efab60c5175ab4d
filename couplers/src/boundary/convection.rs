//! Convection: `q = f(x, y, z, t) h(T) (T_ambient - T)` into the body, T of the surface.
//!
//! The factor f lies between 0 and 1, so that h(T) is the largest coefficient at all positions and times and limits the
//! step. It describes zones with and without spray, jets that move, and water that is turned on.
//!
//! The surface lies half a cell from its points. Its temperature balances the fluxes on both sides, so that the exchange is
//! of second order in the spacing (`docs/theory/surfaces.md`).

use perimelt_core::formula::Formula;
use perimelt_core::material::Property;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::exchange::{SurfaceFlux, SurfaceLaw};
use perimelt_core::{
    Coupler, Face, Programme, Report, RunError, RunningCoupler, Setup, SetupError, Step,
    StepLimits, World, flattened,
};

use super::with_programme;
use crate::InTime;
use crate::surface::{OnSurface, SurfaceHeat, all_faces};

flattened! {
    /// Heat exchange with a fluid around the body.
    #[derive(Debug)]
    pub struct Convection {
        ..place: OnSurface,
        /// Outward directions of the cooled surface; default all.
        #[serde(default = "all_faces")]
        pub faces: Vec<Face>,
        /// Heat transfer coefficient (W/(m² K)): a number, or `{ temperature = [...], value = [...] }`
        /// with the temperature of the surface in K.
        pub coefficient: Property,
        /// What the coefficient is multiplied by, from 0 to 1: a formula in the position x, y, z (m) of a surface point and the
        /// time t (s), such as `"exp(-((x - 0.1 * t) / 0.02)^2)"`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub factor: Option<Formula>,
        /// Temperature of the fluid (K): a number, `{ time = [...], value = [...] }`, times in s, or a formula in the time t (s), such
        /// as that of a fire, `"293.15 + fire_iso_834(t)"`.
        pub ambient: InTime,
    }
}

/// Expected value of a factor, for messages.
const FACTORS: &str =
    "a value from 0 to 1 at all places and times; `coefficient` is the largest coefficient";

fn is_fraction(value: f64) -> bool {
    // rounding of sums and quotients
    (-1e-12..=1.0 + 1e-12).contains(&value)
}

/// A convection that is ready to act.
struct RunningConvection {
    body: BodyIndex,
    factor: Option<Formula>,
    ambient: InTime,
    heat: SurfaceHeat<ConvectionLaw>,
}

/// `f h(T) (T_ambient - T)`.
#[derive(Debug)]
struct ConvectionLaw {
    coefficient: Property,
    /// Largest coefficient, W/(m² K).
    largest: f64,
    /// Ambient temperature, K.
    ambient: f64,
    /// Factor by cell face; empty where it is 1.
    factor: Vec<f64>,
}

impl SurfaceLaw for ConvectionLaw {
    fn is_film(&self) -> bool {
        true
    }

    fn flux(&self, cell: usize, temperature: f64) -> SurfaceFlux {
        let factor = self.factor.get(cell).copied().unwrap_or(1.0);
        let (coefficient, slope) = self.coefficient.with_slope(temperature);
        let difference = self.ambient - temperature;
        SurfaceFlux {
            flux: factor * coefficient * difference,
            slope: factor * (slope * difference - coefficient),
        }
    }

    fn stiffness(&self, _: f64) -> f64 {
        self.largest
    }

    fn is_linear(&self) -> bool {
        self.coefficient.constant().is_some()
    }
}

#[typetag::serialize(name = "convection")]
impl Coupler for Convection {
    fn prepare(
        self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let coefficients = self.coefficient.values();
        if self.coefficient.is_by_phase() || coefficients.iter().any(|h| *h < 0.0) {
            return Err(SetupError::value(
                "coefficient",
                "the heat transfer coefficient is negative or given by phase",
                "a number or a table in temperature, nowhere below 0",
            ));
        }
        let law = ConvectionLaw {
            largest: coefficients.iter().fold(0.0, |a: f64, h| a.max(*h)),
            coefficient: self.coefficient,
            ambient: self.ambient.at(0.0),
            factor: Vec::new(),
        };
        let region = self.place.region.as_deref();
        let heat = SurfaceHeat::prepare(setup, body, &self.faces, region, law)?;
        if let Some(factor) = &self.factor {
            let positions = &setup.body(body).points.position;
            for cell in heat.cells().iter() {
                let at = positions[cell.point as usize].into();
                let value = factor.at(at, 0.0);
                if !is_fraction(value) {
                    let message = format!("`factor` is {value} at {at:?} m at the start");
                    return Err(SetupError::value("factor", message, FACTORS));
                }
            }
        }
        let programme = Programme::of_values([("ambient", &self.ambient)]);
        setup.stepping(with_programme(programme));
        Ok(Box::new(RunningConvection {
            body,
            factor: self.factor,
            ambient: self.ambient,
            heat,
        }))
    }
}

impl RunningCoupler for RunningConvection {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        let mut law = self.heat.law();
        law.ambient = self.ambient.at(step.middle());
        let Some(factor) = &self.factor else {
            return Ok(());
        };
        let positions = &world.body(self.body).points.position;
        let shift = world.window_shift(self.body);
        law.factor.clear();
        for cell in self.heat.cells().iter() {
            let at = (positions[cell.point as usize] + shift).into();
            let value = factor.at(at, step.middle());
            if !is_fraction(value) {
                return Err(RunError::Plugin {
                    plugin: "convection".into(),
                    time: step.middle(),
                    cause: format!("`factor` is {value} at {at:?} m; expected {FACTORS}").into(),
                });
            }
            law.factor.push(value);
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.ambient.next_event(time),
            ..StepLimits::default()
        }
    }

    fn report(&self) -> Vec<Report> {
        self.heat.report()
    }
}

perimelt_core::register_coupler!("convection", Convection, supports: [Flow, Births, Cuts, Window, Layers]);

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use super::*;
    use crate::testing::{
        STEEL, apply, block, check_slopes, exchange, heat, prepare, read, refusal,
    };
    use perimelt_core::keys;
    use perimelt_core::world::exchange::Exchange;

    #[test]
    fn each_surface_point_exchanges_at_its_own_temperature_and_area() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let boundary: Convection = read(
            "coefficient = { temperature = [300, 500], value = [10, 30] }
             ambient = { time = [0, 2], value = [250, 350] }",
        );
        let (mut boundary, exchange) = exchange(&mut world, boundary);
        apply(&world, &mut *boundary, 0.0);
        // middle of the first second: 275 K; coefficient 20; corner, edge, face, heart
        let heat = heat(&world, &exchange, |_| 400.0);
        let expected = [3.0, 2.0, 1.0, 0.0].map(|faces| faces * 20.0 * (275.0 - 400.0));
        assert_eq!([heat[0], heat[1], heat[4], heat[13]], expected);
        check_slopes(&exchange, &[310.0, 400.0, 490.0, 600.0]);
        assert_eq!(exchange.law().stiffness(400.0), 30.0);
        assert!(!exchange.law().is_linear());
    }

    /// q = h f(x, y, z, t) (T_ambient - T) at the middle of the step.
    #[test]
    fn the_coefficient_depends_on_place_and_time() {
        let mut world = World::new(vec![block([5, 3, 3], 3, STEEL)]);
        let boundary: Convection = read(
            "faces = ['z+']
             coefficient = { temperature = [300, 500], value = [10, 30] }
             factor = 'exp(-((x - 2 * t) / 1.5)^2) * (1 + y) / 4'
             ambient = 300",
        );
        let (mut boundary, exchange) = exchange(&mut world, boundary);
        let positions = world.body(0).points.position.clone();
        for start in [0.0, 1.0, 7.0] {
            apply(&world, &mut *boundary, start);
            let heat = heat(&world, &exchange, |_| 400.0);
            for (x, heat) in positions.iter().zip(heat) {
                let at_top = if x.z > 2.0 { 1.0 } else { 0.0 };
                let jet = (-((x.x - 2.0 * (start + 0.5)) / 1.5).powi(2)).exp();
                let expected = at_top * jet * (1.0 + x.y) / 4.0 * 20.0 * (300.0 - 400.0);
                assert!(
                    (heat - expected).abs() < 1e-11,
                    "{x} at {start} s: {heat} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_factor_outside_0_to_1_is_refused() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let boundary: Convection = read("coefficient = 1\nambient = 300\nfactor = '0.5 * x'");
        let message = refusal(&mut world, boundary);
        assert!(
            message.starts_with("factor: `factor` is 1.25 at"),
            "{message}"
        );
        let later: Convection = read("coefficient = 1\nambient = 300\nfactor = '0.5 * t'");
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let (mut later, _) = prepare(&mut world, later, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            assert_eq!(setup.facts::<Rc<Exchange>>(0).count(), 1);
        })
        .expect("valid at first");
        later.apply(&world, Step::new(0.0, 1.0)).expect("0.25");
        let error = later.apply(&world, Step::new(2.0, 1.0)).expect_err("1.25");
        assert!(error.to_string().contains("1.25"), "{error}");
    }

    #[test]
    fn a_negative_coefficient_is_refused() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let boundary: Convection = read("coefficient = -1\nambient = 300");
        assert!(refusal(&mut world, boundary).starts_with("coefficient: "));
    }

    #[test]
    fn a_body_without_heat_is_refused() {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let boundary: Convection = read("coefficient = 1\nambient = 300");
        assert!(refusal(&mut world, boundary).contains("temperature"));
    }
}
