//! Evaporation of the first of two fluids at their interface: the heat that it takes, and the recoil of the vapour.
//!
//! ```text
//! p_s = p_0 exp[(L_v M/R)(1/T_b - 1/T)]                       saturation pressure (Clausius and Clapeyron), p_0 = 101325 Pa
//! p_r = 0.54 p_s                                              pressure on the interface
//! q   = 0.82 p_s sqrt(M/(2 pi R T)) L_v                       heat per area
//! ```
//!
//! (\[Knight1979\]; \[Semak1997\]): of the atoms that leave into a vapour that streams away at the speed of sound 18 % return. The coupler
//! adds `-q |grad c^2|` to the heat source, c the fraction of the first fluid: in the same part of the layer a beam with
//! `penetration = "interface"` is absorbed. The recoil acts through the field `interface_pressure` of the fluid.
//!
//! The rate of evaporation is that of the temperature at the start of the step, with its decay in the step: with the exponential law
//! `q ~ exp(T/T_e)`, `T_e = R T^2/(L_v M)`, a point alone cools by `T_e ln(1 + q |grad c^2| dt/(C T_e))`, so that no step is too
//! long. The evaporated mass is reported and stays in the body. Not for: vapour that meets a surrounding gas of another pressure, alloys whose
//! elements evaporate one after the other.

use std::f64::consts::PI;

use perimelt_core::material::EnthalpyCurve;
use perimelt_core::numbers::check_within;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::world::{BodyIndex, LayerSideBySide, TwoFluids};
use perimelt_core::{
    Body, Coupler, Face, LoadError, Prepared, Read, Report, RunError, RunningCoupler, SavedState,
    Setup, SetupError, Step, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Gas constant, J/(mol K).
const GAS: f64 = 8.314_462_618;

/// Pressure at which materials boil at their `boiling_temperature`, Pa.
const ATMOSPHERE: f64 = 101_325.0;

/// Evaporation of the first of two fluids; needs its `boiling_temperature`, `vaporisation_heat` and `molar_mass`, and `fluids` of
/// `fluid` and `thermal` on the body.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaporation {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Recoil pressure over the saturation pressure; 0: none. Default 0.54 (Knight).
    #[serde(default = "knight_recoil")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub recoil: f64,
    /// Part of the evaporated atoms that do not return; 0: evaporation takes no heat. Default 0.82 (Knight).
    #[serde(default = "knight_escape")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub escape: f64,
}

fn knight_recoil() -> f64 {
    0.54
}

fn knight_escape() -> f64 {
    0.82
}

/// Vapour of a material.
#[derive(Clone, Copy, Debug)]
struct Vapour {
    /// K.
    boiling: f64,
    /// J/kg.
    heat: f64,
    /// kg/mol.
    molar_mass: f64,
}

impl Vapour {
    /// `p_0 exp[(L_v M/R)(1/T_b - 1/T)]` at a temperature (K), Pa.
    fn saturation(&self, temperature: f64) -> f64 {
        if temperature <= 0.0 {
            return 0.0;
        }
        let exponent = self.heat * self.molar_mass / GAS;
        ATMOSPHERE * (exponent * (1.0 / self.boiling - 1.0 / temperature)).exp()
    }

    /// Mass that leaves the surface and does not return, of which the part `escape` is, kg/(m² s).
    fn mass_flux(&self, temperature: f64, escape: f64) -> f64 {
        let thermal_speed = (self.molar_mass / (2.0 * PI * GAS * temperature)).sqrt();
        escape * self.saturation(temperature) * thermal_speed
    }

    /// `R T^2/(L_v M)`: rise of the temperature with which evaporation grows by a factor of e, K.
    fn scale(&self, temperature: f64) -> f64 {
        GAS * temperature * temperature / (self.heat * self.molar_mass)
    }
}

/// An evaporation that is ready to act.
struct RunningEvaporation {
    body: BodyIndex,
    recoil: f64,
    escape: f64,
    vapour: Vapour,
    /// Enthalpies of both fluids.
    curves: [EnthalpyCurve; 2],
    /// Points before and behind each point along each axis; its own number where there is none.
    neighbours: Vec<[[u32; 2]; 3]>,
    /// Twice the spacing, m.
    distance: f64,
    temperature: Read<f64>,
    fraction: Read<f64>,
    heat_source: Write<f64>,
    pressure: Option<Write<f64>>,
    /// By point: `|grad c^2|`, 1/m, and evaporated mass, kg/(m³ s).
    slope: Vec<f64>,
    mass: Vec<f64>,
    account: Account,
}

/// What is reported, and saved.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Account {
    /// Evaporated mass per time now, kg/s, and since the start, kg.
    rate: f64,
    mass: f64,
    /// Heat that evaporation takes per time, W, and has taken, J.
    power: f64,
    energy: f64,
    /// Largest recoil pressure, Pa.
    pressure: f64,
    /// Mean temperature of the surface, and that of its hottest point, K.
    surface: f64,
    hottest: f64,
}

/// Numbers of the points before and behind each point of a lattice.
fn neighbours(body: &Body) -> Vec<[[u32; 2]; 3]> {
    let beside = |point: usize, axis: usize, upper: usize| {
        let face = Face::ALL[2 * axis + upper];
        let other = match axis < body.dimension {
            true => body.neighbour(point, face),
            false => None,
        };
        other.unwrap_or(point) as u32
    };
    let points = 0..body.points.len();
    points
        .map(|point| [0, 1, 2].map(|axis| [0, 1].map(|upper| beside(point, axis, upper))))
        .collect()
}

#[typetag::serialize(name = "evaporation")]
impl Coupler for Evaporation {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.publish(body, LayerSideBySide)
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<Self>(body)?;
        check_within("recoil", self.recoil, 0.0, 1.0)?;
        check_within("escape", self.escape, 0.0, 1.0)?;
        let this = setup.body(body);
        let fluids = setup.facts::<TwoFluids>(body).next();
        let Some([first, second]) = fluids.and_then(|fluids| fluids.indices(this)) else {
            let name = &this.name;
            let message =
                format!("no two fluids flow through body `{name}`, so that it has no interface");
            let expected = "`fluids` of the physics `fluid`";
            return Err(SetupError::value("body", message, expected));
        };
        let property = |name: &str| {
            let material = &this.materials[usize::from(first)];
            let value = material.get(name).and_then(|p| p.constant());
            value.ok_or_else(|| {
                let material = material.name();
                let message =
                    format!("material `{material}` evaporates and has no constant `{name}`");
                let expected = format!("`{name}` of the material");
                SetupError::value("body", message, expected)
            })
        };
        let vapour = Vapour {
            boiling: property("boiling_temperature")?,
            heat: property("vaporisation_heat")?,
            molar_mass: property("molar_mass")?,
        };
        let points = this.points.len();
        let neighbours = neighbours(this);
        let distance = 2.0 * this.finest_spacing();
        let curves = setup.world().enthalpy_curves(body)?;
        Ok(Box::new(RunningEvaporation {
            body,
            recoil: self.recoil,
            escape: self.escape,
            vapour,
            curves: [first, second].map(|m| curves[usize::from(m)].clone()),
            neighbours,
            distance,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            fraction: setup.read(body, &keys::FLUID_FRACTION)?,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            pressure: match self.recoil > 0.0 {
                true => Some(setup.add(body, &keys::INTERFACE_PRESSURE)?),
                false => None,
            },
            slope: vec![0.0; points],
            mass: vec![0.0; points],
            account: Account::default(),
        }))
    }
}

impl RunningEvaporation {
    /// Finds `|grad c^2|` of each point.
    fn find_slopes(&mut self, fraction: &[f64]) {
        let square = |point: u32| fraction[point as usize].clamp(0.0, 1.0).powi(2);
        let distance = self.distance;
        let slopes = self.slope.par_iter_mut().zip(&self.neighbours);
        slopes.with_min_len(4096).for_all(|(slope, beside)| {
            let along = beside.map(|[low, high]| square(high) - square(low));
            *slope = along.iter().map(|d| d * d).sum::<f64>().sqrt() / distance;
        });
    }

    /// Finds the mass that evaporates during a step of `dt` (s).
    fn find_mass(&mut self, temperature: &[f64], fraction: &[f64], dt: f64) {
        let (vapour, escape, [first, second]) = (self.vapour, self.escape, &self.curves);
        let points = self.mass.par_iter_mut().zip(&self.slope);
        let points = points.zip(temperature.par_iter().zip(fraction));
        points
            .with_min_len(4096)
            .for_all(|((mass, slope), (&t, &c))| {
                *mass = 0.0;
                if *slope > 0.0 && t > 0.0 {
                    let c = c.clamp(0.0, 1.0);
                    let capacity = c * first.capacity(t) + (1.0 - c) * second.capacity(t);
                    let limit = capacity * vapour.scale(t);
                    let rate = vapour.mass_flux(t, escape) * slope;
                    let cooling = vapour.heat * rate * dt / limit;
                    *mass = match cooling > 0.0 {
                        true => rate * cooling.ln_1p() / cooling,
                        false => rate,
                    };
                }
            });
    }
}

impl RunningCoupler for RunningEvaporation {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let temperature: &[f64] = &world.read(self.temperature);
        let fraction: &[f64] = &world.read(self.fraction);
        self.find_slopes(fraction);
        self.find_mass(temperature, fraction, step.size);
        let heat = self.vapour.heat;
        let mut source = world.write(self.heat_source);
        let points = source.par_iter_mut().zip(&self.mass);
        points
            .with_min_len(4096)
            .for_all(|(source, mass)| *source -= heat * mass);
        if let Some(pressure) = self.pressure {
            let (recoil, vapour) = (self.recoil, self.vapour);
            let mut pressure = world.write(pressure);
            let points = pressure.par_iter_mut().zip(temperature);
            points
                .with_min_len(4096)
                .for_all(|(p, t)| *p += recoil * vapour.saturation(*t));
        }
        let volume = &world.body(self.body).points.volume;
        let (slope, mass) = (&self.slope, &self.mass);
        let [rate, area, mean] = sum_points(volume.len(), |i| {
            let area = volume[i] * slope[i];
            [volume[i] * mass[i], area, area * temperature[i]]
        });
        // in the half of the layer that is metal
        let is_surface = |i: &usize| fraction[*i] >= 0.5 && slope[*i] * self.distance > 0.05;
        let hottest = (0..volume.len()).filter(is_surface);
        let hottest = hottest.map(|i| temperature[i]).fold(0.0, f64::max);
        let before = self.account;
        // the coupler acts on the fluid and on the heat, which take steps of their own
        let time = match world.is_taken(self.heat_source) {
            true => step.size,
            false => 0.0,
        };
        self.account = Account {
            rate,
            mass: before.mass + rate * time,
            power: heat * rate,
            energy: before.energy + heat * rate * time,
            pressure: self.recoil * self.vapour.saturation(hottest),
            surface: if area > 0.0 { mean / area } else { 0.0 },
            hottest,
        };
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let Account {
            rate,
            mass,
            power,
            energy,
            pressure,
            surface,
            hottest,
            ..
        } = self.account;
        vec![
            Report::new("evaporated.rate", "kg/s", rate),
            Report::new("evaporated.mass", "kg", mass),
            Report::new("evaporated.power", "W", power),
            Report::new("evaporated.energy", "J", energy),
            Report::new("recoil.max", "Pa", pressure),
            Report::new("surface.temperature.mean", "K", surface),
            Report::new("surface.temperature.max", "K", hottest),
        ]
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.account)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.account = erased_serde::deserialize(state)?;
        Ok(())
    }
}

perimelt_core::register_coupler!("evaporation", Evaporation, supports: [Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{
        add_gas, apply, block, prepare_after, read, refusal, set, total, two_fluids, values,
    };

    const METAL: &str = "density = 8000\nspecific_heat = 700\nconductivity = 30\nboiling_temperature = 3000\nvaporisation_heat = 7e6\nmolar_mass = 0.056";
    const GAS_KEYS: &str = "density = 80\nspecific_heat = 1000\nconductivity = 0.05";

    /// A block of metal below y = 8 with gas above, its interface 0.75 thick.
    fn metal_and_gas() -> World {
        of_metal(METAL)
    }

    fn of_metal(metal: &str) -> World {
        let mut body = block([6, 16, 1], 2, metal);
        add_gas(&mut body, GAS_KEYS);
        World::new(vec![body])
    }

    fn running(
        world: &mut World,
        keys: &str,
    ) -> Result<Box<dyn RunningCoupler>, perimelt_core::SetupError> {
        let fluid = |setup: &mut Setup<'_>| {
            two_fluids(setup, 0);
            let pressure = setup.consume_if_added(0, &keys::INTERFACE_PRESSURE);
            pressure.expect("free");
            setup.own(0, &keys::TEMPERATURE).expect("free");
        };
        let evaporation: Evaporation = read(keys);
        let heat = |setup: &mut Setup<'_>| {
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
            let pressure = setup.consume_if_added(0, &keys::INTERFACE_PRESSURE);
            pressure.expect("free");
        };
        Ok(prepare_after(world, fluid, evaporation, heat)?.0)
    }

    fn set_layer(world: &mut World, temperature: f64) {
        let place: Vec<f64> = (world.body(0).points.position.iter())
            .map(|x| x.y)
            .collect();
        set(world, &keys::FLUID_FRACTION, |i| {
            1.0 / (1.0 + ((place[i] - 8.0) / 0.75).exp())
        });
        set(world, &keys::TEMPERATURE, |_| temperature);
    }

    /// At the boiling temperature the saturation pressure is one atmosphere; mass and heat per area are those of Knight's formula.
    #[test]
    fn a_flat_surface_loses_the_heat_of_the_mass_that_leaves_it() {
        let mut world = metal_and_gas();
        let mut evaporation = running(&mut world, "").expect("valid");
        for (temperature, saturation) in [
            (3000.0, 101_325.0),
            (
                2700.0,
                101_325.0 * (7e6 * 0.056 / GAS * (1.0 / 3000.0 - 1.0 / 2700.0_f64)).exp(),
            ),
        ] {
            set_layer(&mut world, temperature);
            set(&mut world, &keys::HEAT_SOURCE, |_| 0.0);
            set(&mut world, &keys::INTERFACE_PRESSURE, |_| 0.0);
            // in a step without a change of the temperature
            evaporation
                .apply(&world, Step::new(0.0, 0.0))
                .expect("applies");
            let flux = 0.82 * saturation * (0.056 / (2.0 * PI * GAS * temperature)).sqrt();
            let taken = -total(&world, &keys::HEAT_SOURCE);
            // of six cells of a square metre
            assert!((taken / (6.0 * 7e6 * flux) - 1.0).abs() < 1e-3, "{taken}");
            let pressure = values(&world, &keys::INTERFACE_PRESSURE);
            assert!((pressure[0] / (0.54 * saturation) - 1.0).abs() < 1e-12);
            let reports = evaporation.report();
            let rate = reports.iter().find(|r| r.name == "evaporated.rate");
            assert!((rate.expect("reported").value / (6.0 * flux) - 1.0).abs() < 1e-3);
        }
    }

    /// However long the step, a point does not cool below what an endless decay would leave.
    #[test]
    fn no_step_takes_more_heat_than_there_is() {
        let mut world = metal_and_gas();
        let mut evaporation = running(&mut world, "").expect("valid");
        set_layer(&mut world, 4500.0);
        evaporation
            .apply(&world, Step::new(0.0, 1e3))
            .expect("applies");
        let taken = values(&world, &keys::HEAT_SOURCE);
        let fraction = values(&world, &keys::FLUID_FRACTION);
        for (q, c) in taken.iter().zip(fraction) {
            let capacity = c * 8000.0 * 700.0 + (1.0 - c) * 80.0 * 1000.0;
            assert!(-q * 1e3 / capacity < 4500.0, "{q} {c}");
        }
    }

    /// All that is taken from the heat counts.
    #[test]
    fn each_step_counts() {
        let mut world = metal_and_gas();
        let mut evaporation = running(&mut world, "").expect("valid");
        set_layer(&mut world, 2500.0);
        for (start, size) in [(0.0, 0.0), (0.0, 1e-6), (1e-6, 2e-6)] {
            let step = Step::new(start, size);
            evaporation.apply(&world, step).expect("applies");
        }
        let reports = evaporation.report();
        let value = |name: &str| {
            reports
                .iter()
                .find(|r| r.name == name)
                .expect("reported")
                .value
        };
        let expected = 3e-6 * value("evaporated.rate");
        assert!((value("evaporated.mass") / expected - 1.0).abs() < 1e-6);
        assert!((value("evaporated.energy") / (7e6 * expected) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn keys_switch_recoil_and_heat_off() {
        let mut world = metal_and_gas();
        let mut evaporation = running(&mut world, "recoil = 0\nescape = 0").expect("valid");
        set_layer(&mut world, 3500.0);
        apply(&world, &mut *evaporation, 0.0);
        assert_eq!(total(&world, &keys::HEAT_SOURCE), 0.0);
        assert_eq!(evaporation.report()[4].value, 0.0);
    }

    #[test]
    fn a_body_without_an_interface_and_a_material_without_vapour_are_refused() {
        let evaporation: Evaporation = read("");
        let mut world = World::new(vec![block([3, 3, 1], 2, METAL)]);
        let message = refusal(&mut world, evaporation);
        assert!(
            message.contains("no two fluids flow through body `block`"),
            "{message}"
        );
        for missing in ["boiling_temperature", "vaporisation_heat", "molar_mass"] {
            let keys: Vec<&str> = METAL.lines().filter(|l| !l.contains(missing)).collect();
            let mut world = of_metal(&keys.join("\n"));
            let message = running(&mut world, "").err().expect("refused").to_string();
            let expected = format!("material `steel` evaporates and has no constant `{missing}`");
            assert!(message.contains(&expected), "{message}");
        }
    }
}
