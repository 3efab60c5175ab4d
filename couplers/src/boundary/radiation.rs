//! Radiation to black surroundings: `q = eps sigma (T_ambient^4 - T^4)` into the body, T of the surface in K, which balances
//! this flux and that from the point half a cell below (`docs/theory/surfaces.md`).
//!
//! The surface exchanges heat with the surroundings only, not with other parts of itself. At 3000 K the
//! exchange equals a convection of 6 kW/(m² K).

use perimelt_core::material::Property;
use perimelt_core::world::exchange::{SurfaceFlux, SurfaceLaw};
use perimelt_core::{
    Coupler, Face, LoadError, Report, RunError, RunningCoupler, SavedState, Setup, SetupError,
    Step, StepLimits, World, flattened,
};

use super::ambient::{Ambient, AmbientTemperatures, RunningAmbient};
use super::with_programme;
use crate::point_materials::PointMaterials;
use crate::surface::{OnSurface, SurfaceHeat, all_faces};

/// Stefan-Boltzmann constant, W/(m² K⁴).
pub const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;

flattened! {
    /// Heat radiated to the surroundings; needs `emissivity` here or in the material.
    #[derive(Debug)]
    pub struct Radiation {
        ..place: OnSurface,
        /// Outward directions of the radiating surface; default all.
        #[serde(default = "all_faces")]
        pub faces: Vec<Face>,
        /// Emissivity, 0 to 1: a number, or `{ temperature = [...], value = [...] }`; default that
        /// of the material.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub emissivity: Option<Property>,
        /// Temperature of the surroundings (K): a number, `{ time = [...], value = [...] }`, times in s, a formula in the time
        /// t (s), such as that of a fire, `"293.15 + fire_iso_834(t)"`, or that of a body, `{ body = "gas" }`, near each point of the surface.
        pub ambient: Ambient,
    }
}

/// A radiation that is ready to act.
struct RunningRadiation {
    body: usize,
    materials: PointMaterials,
    ambient: RunningAmbient,
    heat: SurfaceHeat<RadiationLaw>,
}

/// `eps(T) sigma (T_ambient^4 - T^4)`.
#[derive(Debug)]
struct RadiationLaw {
    /// Emissivity by material.
    emissivity: Vec<Property>,
    largest_emissivity: f64,
    /// Materials by cell face, with their shares; empty where there is one material.
    shares: Vec<[(usize, f64); 2]>,
    /// Version of the cell faces that `shares` belong to.
    version: Option<u64>,
    /// Present temperatures of the surroundings.
    ambient: AmbientTemperatures,
    /// The highest one that is known in advance, K: that of numbers and tables.
    highest_ambient: f64,
}

impl SurfaceLaw for RadiationLaw {
    fn flux(&self, cell: usize, temperature: f64) -> SurfaceFlux {
        let of = |material: usize| self.emissivity[material].with_slope(temperature);
        let (emissivity, slope) = match self.shares.get(cell) {
            None => of(0),
            Some(shares) => {
                let [one, other] = shares.map(|(material, share)| (of(material), share));
                let mean = |a: f64, b: f64| one.1 * a + other.1 * b;
                (mean(one.0.0, other.0.0), mean(one.0.1, other.0.1))
            }
        };
        let cube = temperature * temperature * temperature;
        let ambient = self.ambient.at(cell);
        let square = ambient * ambient;
        let difference = STEFAN_BOLTZMANN * (square * square - cube * temperature);
        SurfaceFlux {
            flux: emissivity * difference,
            slope: slope * difference - 4.0 * emissivity * STEFAN_BOLTZMANN * cube,
        }
    }

    fn stiffness(&self, hottest: f64) -> f64 {
        let hottest = hottest.max(self.highest_ambient);
        4.0 * self.largest_emissivity * STEFAN_BOLTZMANN * hottest.powi(3)
    }

    fn surroundings(&self) -> f64 {
        let ambient = self.ambient.highest();
        match ambient > self.highest_ambient {
            true => ambient,
            false => 0.0,
        }
    }
}

#[typetag::serialize(name = "radiation")]
impl Coupler for Radiation {
    fn prepare(
        self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let emissivity = match self.emissivity {
            Some(given) => vec![given; setup.body(body).materials.len()],
            None => setup.world().property(body, "emissivity")?,
        };
        let mut values = emissivity.iter().flat_map(Property::values);
        if let Some(value) = values.find(|e| !(0.0..=1.0).contains(e)) {
            let message = format!("the emissivity {value} is outside its range");
            return Err(SetupError::value("emissivity", message, "0 to 1"));
        }
        if let Some(value) = self.ambient.values().iter().find(|t| **t < 0.0) {
            let message = format!("{value} K is below absolute zero");
            return Err(SetupError::value(
                "ambient",
                message,
                "a temperature in kelvin",
            ));
        }
        let ambients = self.ambient.values();
        let law = RadiationLaw {
            largest_emissivity: emissivity
                .iter()
                .flat_map(Property::values)
                .fold(0.0, f64::max),
            emissivity,
            shares: Vec::new(),
            version: None,
            ambient: self.ambient.first(),
            highest_ambient: ambients.iter().copied().fold(0.0, f64::max),
        };
        let programme = self.ambient.programme();
        let reach = self.ambient.prepare(setup, body, self.faces)?;
        let region = self.place.region.as_deref();
        let heat = SurfaceHeat::prepare(setup, body, reach.place(region), law)?;
        setup.stepping(with_programme(programme));
        Ok(Box::new(RunningRadiation {
            body,
            materials: PointMaterials::prepare(setup, body)?,
            ambient: reach.ambient,
            heat,
        }))
    }
}

impl RunningCoupler for RunningRadiation {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        let mut law = self.heat.law();
        let around = self.heat.around();
        self.ambient.update(world, step, around, &mut law.ambient);
        let known = law.ambient.check(step.middle());
        known.map_err(|e| RunError::wrong_value("radiation", e))?;
        let is_known = law.version == Some(self.heat.version()) && !self.materials.are_fluids();
        if law.emissivity.len() > 1 && !is_known {
            law.version = Some(self.heat.version());
            let fraction = self.materials.fraction(world);
            let body = world.body(self.body);
            let materials = self.materials.with(body, fraction.as_deref());
            let cells = self.heat.cells();
            let shares = cells.iter().map(|c| materials.shares(c.point as usize));
            law.shares.clear();
            law.shares.extend(shares);
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

perimelt_core::register_coupler!("radiation", Radiation, supports: [Flow, Births, Cuts, Window, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{
        STEEL, add_gas, apply, block, check_slopes, exchange, heat, prepare_after, read, refusal,
        set, two_fluids,
    };
    use perimelt_core::keys;
    use perimelt_core::world::exchange::Exchange;
    use std::rc::Rc;

    fn power(table: &str) -> f64 {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let (mut boundary, exchange) = exchange(&mut world, read::<Radiation>(table));
        apply(&world, &mut *boundary, 0.0);
        check_slopes(&exchange, &[310.0, 1000.0, 1900.0]);
        heat(&world, &exchange, |_| 1000.0).iter().sum()
    }

    #[test]
    fn a_grey_surface_follows_the_fourth_powers() {
        // 56.70374 kW/m² from a black surface at 1000 K; rounding of a sum of 54 faces
        let close = |value: f64, expected: f64| (value / expected - 1.0).abs() < 1e-9;
        assert!(close(
            power("ambient = 0\nemissivity = 1"),
            -54.0 * 56703.74419
        ));
        assert!(close(power("ambient = 0"), -54.0 * 0.8 * 56703.74419));
        assert_eq!(power("ambient = 1000"), 0.0);
        assert!(power("ambient = 1200") > 0.0);
        power("ambient = 300\nemissivity = { temperature = [300, 2000], value = [0.3, 0.9] }");
    }

    /// A formula has no highest value: that so far limits the step.
    #[test]
    fn surroundings_that_become_hotter_are_known_when_they_are() {
        let surroundings = |ambient: &str| {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            let table = format!("ambient = {ambient}");
            let (mut boundary, exchange) = exchange(&mut world, read::<Radiation>(&table));
            [0.0, 599.5].map(|start| {
                apply(&world, &mut *boundary, start);
                exchange.law().surroundings()
            })
        };
        let [start, later] = surroundings("'293.15 + fire_iso_834(t)'");
        // in the middle of the steps, at 0.5 s and 600 s
        assert!((start - 293.15 - 345.0 * (1.0_f64 + 4.0 / 60.0).log10()).abs() < 1e-9);
        assert!((later - 951.577).abs() < 5e-4, "{later}");
        let table = "{ time = [0, 600], value = [300, 1000] }";
        for known in ["300", table] {
            assert_eq!(surroundings(known), [0.0; 2], "`stiffness` knows it");
        }
    }

    #[test]
    fn impossible_numbers_are_refused() {
        for (table, key) in [
            ("ambient = 3\nemissivity = 2", "emissivity"),
            ("ambient = -3", "ambient"),
        ] {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            assert!(refusal(&mut world, read::<Radiation>(table)).starts_with(key));
        }
    }

    /// A surface radiates as the fluid that is there now.
    #[test]
    fn two_fluids_radiate_by_their_shares() {
        let mut body = block([3, 1, 1], 3, STEEL);
        add_gas(&mut body, "density = 2\nemissivity = 0.1");
        let mut world = World::new(vec![body]);
        let fluid = |setup: &mut Setup<'_>| {
            two_fluids(setup, 0);
            setup.own(0, &keys::TEMPERATURE).expect("free");
        };
        let radiation = read::<Radiation>("ambient = 0\nfaces = ['z+']");
        let exchange = |setup: &mut Setup<'_>| setup.facts::<Rc<Exchange>>(0).next().cloned();
        let prepared = prepare_after(&mut world, fluid, radiation, exchange);
        let (mut radiation, exchange) = prepared.expect("valid");
        let exchange = exchange.expect("one");
        // the fluids change places
        for fractions in [[1.0, 0.0, 0.25], [0.0, 1.0, 0.75]] {
            set(&mut world, &keys::FLUID_FRACTION, |i| fractions[i]);
            apply(&world, &mut *radiation, 0.0);
            let found = heat(&world, &exchange, |_| 1000.0);
            for (c, found) in fractions.into_iter().zip(found) {
                let expected = -(c * 0.8 + (1.0 - c) * 0.1) * 56703.74419;
                assert!((found / expected - 1.0).abs() < 1e-12, "{c}: {found}");
            }
        }
    }
}
