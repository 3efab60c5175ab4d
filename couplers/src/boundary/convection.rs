//! Convection: `q = f(x, y, z, t) h (T_ambient - T)` into the body, T of the surface, with the larger coefficient of two:
//!
//! ```text
//! h = max(h(T), C |T_ambient - T|^(1/3))      natural convection in turbulent flow, Gao (2020), eq. 8.38
//! ```
//!
//! The factor f lies between 0 and 1, so that h(T) is the largest coefficient at all positions and times and limits the
//! step. It describes zones with and without spray, jets that move, and water that is turned on.
//!
//! The surface lies half a cell from its points. Its temperature balances the fluxes on both sides, so that the exchange is
//! of second order in the spacing (`docs/theory/surfaces.md`).

use perimelt_core::formula::Formula;
use perimelt_core::material::Property;
use perimelt_core::numbers::check_positive;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::exchange::{SurfaceFlux, SurfaceLaw};
use perimelt_core::{
    Coupler, Face, LoadError, Report, RunError, RunningCoupler, SavedState, Setup, SetupError,
    Step, StepLimits, World, flattened,
};

use super::ambient::{Ambient, AmbientTemperatures, RunningAmbient};
use super::with_programme;
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
        /// with the temperature of the surface in K. May be left out where `natural` is given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub coefficient: Option<Property>,
        /// Natural convection: factor C of the coefficient `C |T_ambient - T|^(1/3)`, W/(m² K^(4/3)); for air 1.52 on horizontal surfaces and
        /// 1.38 on vertical ones. With `coefficient`, the larger one of both counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub natural: Option<f64>,
        /// What the coefficient is multiplied by, from 0 to 1: a formula in the position x, y, z (m) of a surface point and the
        /// time t (s), such as `"exp(-((x - 0.1 * t) / 0.02)^2)"`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub factor: Option<Formula>,
        /// Temperature of the fluid (K): a number, `{ time = [...], value = [...] }`, times in s, a formula in the time t (s), such
        /// as that of a fire, `"293.15 + fire_iso_834(t)"`, or that of a body, `{ body = "gas" }`, near each point of the surface.
        pub ambient: Ambient,
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
    ambient: RunningAmbient,
    heat: SurfaceHeat<ConvectionLaw>,
}

/// `f h (T_ambient - T)`.
#[derive(Debug)]
struct ConvectionLaw {
    coefficient: Property,
    /// Factor of natural convection, W/(m² K^(4/3)); zero without.
    natural: f64,
    /// Largest value of `coefficient`, W/(m² K).
    largest: f64,
    ambient: AmbientTemperatures,
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
        let difference = self.ambient.at(cell) - temperature;
        let natural = match self.natural {
            0.0 => 0.0,
            constant => constant * difference.abs().cbrt(),
        };
        let (coefficient, slope) = match natural > coefficient {
            true => (natural, -4.0 / 3.0 * natural),
            false => (coefficient, slope * difference - coefficient),
        };
        SurfaceFlux {
            flux: factor * coefficient * difference,
            slope: factor * slope,
        }
    }

    fn stiffness(&self, hottest: f64) -> f64 {
        // no difference of temperatures is larger than the hottest one
        self.largest.max(4.0 / 3.0 * self.natural * hottest.cbrt())
    }

    fn surroundings(&self) -> f64 {
        match self.natural {
            0.0 => 0.0,
            _ => self.ambient.highest(),
        }
    }

    fn is_linear(&self) -> bool {
        self.natural == 0.0 && self.coefficient.constant().is_some()
    }
}

impl Convection {
    /// The law with the temperatures at the start.
    fn law(&self) -> Result<ConvectionLaw, SetupError> {
        let natural = check_positive("natural", self.natural, "W/(m² K^(4/3))")?.unwrap_or(0.0);
        let coefficient = match &self.coefficient {
            Some(given) => given.clone(),
            None if natural > 0.0 => Property::Constant(0.0),
            None => {
                let message = "neither `coefficient` nor `natural` is given";
                let expected = "a heat transfer coefficient, or the factor of natural convection";
                return Err(SetupError::value("coefficient", message, expected));
            }
        };
        let coefficients = coefficient.values();
        if coefficient.is_by_phase() || coefficients.iter().any(|h| *h < 0.0) {
            return Err(SetupError::value(
                "coefficient",
                "the heat transfer coefficient is negative or given by phase",
                "a number or a table in temperature, nowhere below 0",
            ));
        }
        Ok(ConvectionLaw {
            largest: coefficients.iter().fold(0.0, |a: f64, h| a.max(*h)),
            natural,
            ambient: self.ambient.first(),
            factor: Vec::new(),
            coefficient,
        })
    }
}

#[typetag::serialize(name = "convection")]
impl Coupler for Convection {
    fn prepare(
        self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let law = self.law()?;
        let programme = self.ambient.programme();
        let reach = self.ambient.prepare(setup, body, self.faces)?;
        let region = self.place.region.as_deref();
        let heat = SurfaceHeat::prepare(setup, body, reach.place(region), law)?;
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
        setup.stepping(with_programme(programme));
        Ok(Box::new(RunningConvection {
            body,
            factor: self.factor,
            ambient: reach.ambient,
            heat,
        }))
    }
}

impl RunningCoupler for RunningConvection {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        let mut law = self.heat.law();
        let around = self.heat.around();
        self.ambient.update(world, step, around, &mut law.ambient);
        let known = law.ambient.check(step.middle());
        known.map_err(|e| RunError::wrong_value("convection", e))?;
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

    /// The exchange does not limit steps itself, but the physics that evaluates it needs the first surroundings.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let around = self.heat.around();
        self.ambient
            .begin(world, around, &mut self.heat.law().ambient);
        None
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

    /// The surroundings of the last step, on which the next stable step depends.
    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.heat.law().ambient.clone())
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.heat.law().ambient = erased_serde::deserialize(state)?;
        Ok(())
    }
}

perimelt_core::register_coupler!("convection", Convection, supports: [Flow, Births, Cuts, Window, Layers, Division]);

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
        let positions = world.body(0).points.position.to_vec();
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

    /// h = max(coefficient, C |T_ambient - T|^(1/3)).
    #[test]
    fn the_larger_coefficient_of_natural_and_given_convection_counts() {
        let mut world = World::new(vec![block([1, 1, 1], 3, STEEL)]);
        let boundary = read::<Convection>("natural = 1.38\ncoefficient = 5\nambient = 300");
        let (mut boundary, exchange) = exchange(&mut world, boundary);
        apply(&world, &mut *boundary, 0.0);
        // above and below the ambient temperature, on both sides of (5 / 1.38)^3 = 47.6 K
        for (t, h) in [
            (310.0, 5.0),
            (290.0, 5.0),
            (400.0, 6.40543),
            (173.0, 6.93661),
        ] {
            let found = heat(&world, &exchange, |_| t)[0];
            let expected = 6.0 * h * (300.0 - t);
            assert!(
                (found / expected - 1.0).abs() < 1e-5,
                "{t}: {found} {expected}"
            );
        }
        check_slopes(&exchange, &[280.0, 310.0, 400.0, 900.0]);
        for hottest in [350.0, 900.0] {
            for t in [1.0, 300.0, hottest] {
                let slope = exchange.law().flux(0, t).slope;
                assert!(exchange.law().stiffness(hottest) >= -slope, "{hottest} {t}");
            }
        }
        assert!(!exchange.law().is_linear());
        assert_eq!(exchange.law().surroundings(), 300.0);
    }

    #[test]
    fn a_film_needs_a_coefficient() {
        for (keys, key) in [
            ("", "coefficient"),
            ("natural = 0", "natural"),
            ("natural = -1", "natural"),
        ] {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            let boundary: Convection = read(&format!("{keys}\nambient = 300"));
            let message = refusal(&mut world, boundary);
            assert!(message.starts_with(key), "{message}");
        }
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
