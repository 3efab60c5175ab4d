//! Transformations of steel in the solid state: austenite on heating; ferrite, pearlite, bainite and martensite on
//! cooling.
//!
//! The physics stands after the one that owns the temperature and reads it at the end of every macro step; between two of
//! them the temperature is taken as linear in time.
//!
//! | constituent | law |
//! |---|---|
//! | austenite | Leblond and Devaux: `da/dt = (a_eq(T) - a) / time` above `Ac1` |
//! | ferrite, pearlite, bainite | by composition ([`composition`], Li et al. 1998), or by times of 1 % and 99 % at constant temperature (Johnson, Mehl, Avrami and Kolmogorov), along any path by Scheil's rule |
//! | martensite | Koistinen and Marburger: the fraction `exp(-rate (Ms - T))` of the austenite remains |
//!
//! The composition (mass %) is given by the material properties `carbon`, `manganese`, `silicon`, `nickel`, `chromium`, `molybdenum`,
//! `vanadium`. Keys of the case file replace single laws.
//!
//! Stress from transformation needs the coupler `phase_expansion` in place of `thermal_expansion`; latent heat the coupler
//! `transformation_heat`; yield stresses by constituent the coupler `phase_strength`. Transformation plasticity
//! (Greenwood and Johnson 1965; Leblond, Devaux and Devaux 1989)
//!
//! ```text
//! d(strain) = 3/2 s K d(g(z)),   g(z) = z (2 - z)
//! ```
//!
//! with s the stress deviator and z the fraction that is not austenite is added to the plastic strain of a `mechanical` with
//! `plasticity`.
//!
//! Not modelled: tempering, growth of austenite grains, carbon that diffuses from ferrite to austenite.

pub mod composition;
pub mod kinetics;
#[cfg(test)]
mod tests;
pub mod transformation;

use perimelt_core::material::{Table, ValueRange};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{
    Key, LoadError, Physics, PhysicsReport, Prepared, Read, Report, RunError, RunningPhysics,
    SavedState, Setup, SetupError, Step, Work, World, Write, keys, register_property,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use composition::Composition;
use kinetics::{IsothermalCurves, Kinetics};
use transformation::{Austenitisation, CONSTITUENTS, MartensiteLaw, Microstructure, Steel};

register_property! { "carbon", "mass %", "content of carbon", ValueRange::Between(0.0, 2.0) }
register_property! { "manganese", "mass %", "content of manganese", ValueRange::Between(0.0, 30.0) }
register_property! { "silicon", "mass %", "content of silicon", ValueRange::Between(0.0, 10.0) }
register_property! { "nickel", "mass %", "content of nickel", ValueRange::Between(0.0, 40.0) }
register_property! { "chromium", "mass %", "content of chromium", ValueRange::Between(0.0, 40.0) }
register_property! { "molybdenum", "mass %", "content of molybdenum", ValueRange::Between(0.0, 10.0) }
register_property! { "austenite_conductivity", "W/(m K)", "thermal conductivity of austenite, where `metallurgy` tells its fraction (`thermal` with bonds); `conductivity` is then that of the other constituents", ValueRange::Positive }
register_property! { "vanadium", "mass %", "content of vanadium", ValueRange::Between(0.0, 5.0) }

/// Fields of the fractions, in the order of [`transformation::Constituent`].
const FRACTIONS: [Key<f64>; CONSTITUENTS] = [
    keys::AUSTENITE,
    keys::FERRITE,
    keys::PEARLITE,
    keys::BAINITE,
    keys::MARTENSITE,
];

/// Shares of austenite, ferrite, pearlite, bainite and martensite, and hardness.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Metallurgy {
    /// Body; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Shares at the start, with sum 1; ferrite and pearlite by the lever rule when left out.
    #[serde(default)]
    pub initial: Option<InitialShares>,
    /// Grain size number of the austenite (ASTM E112); larger numbers are finer and transform sooner.
    #[serde(default = "usual_grain_size")]
    pub grain_size: f64,
    /// How austenite forms; by the composition when left out, with a time constant of 0.1 s.
    #[serde(default)]
    pub austenite: Option<AustenitisationSection>,
    /// Isothermal times of ferrite in place of those by the composition.
    #[serde(default)]
    pub ferrite: Option<CurveSection>,
    /// Isothermal times of pearlite in place of those by the composition.
    #[serde(default)]
    pub pearlite: Option<CurveSection>,
    /// Isothermal times of bainite in place of those by the composition.
    #[serde(default)]
    pub bainite: Option<CurveSection>,
    /// How martensite forms; by the composition when left out, with a rate of 0.011 per K.
    #[serde(default)]
    pub martensite: Option<MartensiteSection>,
    /// K of the transformation plasticity, 1/Pa; near 1e-10 for low-alloy steels.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub transformation_plasticity: f64,
    /// Rate of cooling (K/s at 700 °C) at which the constituents of the start formed, for their hardness.
    #[serde(default = "usual_cooling_rate")]
    pub initial_cooling_rate: f64,
}

fn usual_grain_size() -> f64 {
    8.0
}

fn usual_cooling_rate() -> f64 {
    1.0
}

/// Shares of the constituents.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialShares {
    /// Share of austenite.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub austenite: f64,
    /// Share of ferrite.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub ferrite: f64,
    /// Share of pearlite.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub pearlite: f64,
    /// Share of bainite.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub bainite: f64,
    /// Share of martensite.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub martensite: f64,
}

/// How austenite forms.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AustenitisationSection {
    /// `Ac1`: temperature at which it begins, K.
    pub start: f64,
    /// `Ac3`: temperature at which the last of the others is gone, K.
    pub end: f64,
    /// Time constant, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default = "usual_time")]
    pub time: f64,
}

fn usual_time() -> f64 {
    0.1
}

/// How martensite forms.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MartensiteSection {
    /// `Ms`: temperature at which it begins, K.
    pub start: f64,
    /// Rate of Koistinen and Marburger, 1/K.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default = "usual_rate")]
    pub rate: f64,
}

/// Koistinen and Marburger (1959).
fn usual_rate() -> f64 {
    0.011
}

/// Times at which 1 % and 99 % are transformed at constant temperature. Between two rows their logarithms are linear;
/// outside of the rows nothing transforms.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveSection {
    /// Temperatures, increasing, K.
    pub temperature: Vec<f64>,
    /// Times of 1 %, s.
    pub start: Vec<f64>,
    /// Times of 99 %, s.
    pub end: Vec<f64>,
}

#[derive(Debug)]
struct RunningMetallurgy {
    body: usize,
    transformation_plasticity: f64,
    temperature: Read<f64>,
    fractions: [Write<f64>; CONSTITUENTS],
    hardness: Write<f64>,
    compliance: Write<f64>,
    /// Laws by material.
    steels: Vec<Steel>,
    points: Vec<Microstructure>,
    /// In the last observed state.
    largest_share: f64,
}

impl CurveSection {
    fn kinetics(&self, key: &str) -> Result<Kinetics, SetupError> {
        let expected =
            "as many times above zero as increasing temperatures, each `end` after its `start`";
        let times = self.start.iter().zip(&self.end);
        let in_order = times
            .clone()
            .all(|(start, end)| *start > 0.0 && end > start);
        let counts = [self.start.len(), self.end.len()];
        if !in_order || counts != [self.temperature.len(); 2] {
            let message = format!("the times of `{key}` are not those of a transformation");
            return Err(SetupError::value(key, message, expected));
        }
        let table = |times: &[f64]| {
            let logarithms = times.iter().map(|t| t.ln()).collect();
            Table::new(self.temperature.clone(), logarithms).map_err(|e| SetupError::other(key, e))
        };
        let curves = IsothermalCurves::new(table(&self.start)?, table(&self.end)?);
        Ok(Kinetics::Isothermal(curves))
    }
}

impl Metallurgy {
    fn check(&self) -> Result<(), SetupError> {
        let wrong = |key: &str, value: f64, expected: &str| {
            let message = format!("`{key}` is {value}");
            Err(SetupError::value(key, message, expected))
        };
        if !(-5.0..=20.0).contains(&self.grain_size) {
            return wrong(
                "grain_size",
                self.grain_size,
                "an ASTM number from -5 to 20",
            );
        }
        let k = self.transformation_plasticity;
        if !(0.0..1e-6).contains(&k) {
            let expected = "zero, or a number near 1e-10 per Pa";
            return wrong("transformation_plasticity", k, expected);
        }
        if self.initial_cooling_rate.is_nan() || self.initial_cooling_rate <= 0.0 {
            let rate = self.initial_cooling_rate;
            return wrong("initial_cooling_rate", rate, "a number above zero, K/s");
        }
        if let Some(law) = &self.austenite {
            if !(law.start > 0.0 && law.end > law.start && law.end.is_finite()) {
                return wrong("austenite.end", law.end, "kelvins above `austenite.start`");
            }
            if law.time.is_nan() || law.time <= 0.0 {
                return wrong("austenite.time", law.time, "seconds above zero");
            }
        }
        if let Some(law) = &self.martensite {
            if law.start.is_nan() || law.start <= 0.0 {
                return wrong("martensite.start", law.start, "kelvins above zero");
            }
            if law.rate.is_nan() || law.rate <= 0.0 {
                return wrong("martensite.rate", law.rate, "a number above zero, 1/K");
            }
        }
        Ok(())
    }

    /// Laws of a material, by its composition or by keys of the case file.
    fn steel(&self, composition: Option<Composition>) -> Result<Steel, SetupError> {
        let given = [
            ("ferrite", &self.ferrite),
            ("pearlite", &self.pearlite),
            ("bainite", &self.bainite),
        ];
        let mut reactions = match &composition {
            Some(c) => c.kinetics(self.grain_size).map(Some),
            None => [const { None }; 3],
        };
        for (reaction, (key, section)) in reactions.iter_mut().zip(given) {
            if let Some(section) = section {
                *reaction = Some(section.kinetics(key)?);
            }
        }
        let austenite = self.austenite.map(|law| Austenitisation {
            start: law.start,
            end: law.end,
            time: law.time,
        });
        let martensite = self.martensite.map(|law| MartensiteLaw {
            start: law.start,
            rate: law.rate,
        });
        Ok(Steel {
            austenite: austenite.or(composition.map(|c| Austenitisation {
                start: c.ac1(),
                end: c.ac3(),
                time: usual_time(),
            })),
            reactions,
            martensite: martensite.or(composition.map(|c| MartensiteLaw {
                start: c.martensite_start(),
                rate: usual_rate(),
            })),
            composition,
        })
    }

    /// Initial fractions of a material.
    fn initial(&self, steel: &Steel) -> Result<[f64; CONSTITUENTS], SetupError> {
        if let Some(given) = &self.initial {
            let shares = [
                given.austenite,
                given.ferrite,
                given.pearlite,
                given.bainite,
                given.martensite,
            ];
            let sum: f64 = shares.iter().sum();
            if shares.iter().any(|s| !(0.0..=1.0).contains(s)) || (sum - 1.0).abs() > 1e-9 {
                let message = format!("the shares at the start have the sum {sum}");
                return Err(SetupError::value(
                    "initial",
                    message,
                    "shares from 0 to 1 with the sum 1",
                ));
            }
            return Ok(shares);
        }
        let pearlite = match &steel.composition {
            Some(c) => c.equilibrium_austenite(c.ac1()),
            None => 0.0,
        };
        Ok([0.0, 1.0 - pearlite, pearlite, 0.0, 0.0])
    }
}

#[typetag::serialize(name = "metallurgy")]
impl Physics for Metallurgy {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        Ok(Box::new(self.prepare_steels(setup)?))
    }
}

impl Metallurgy {
    fn prepare_steels(&self, setup: &mut Setup<'_>) -> Result<RunningMetallurgy, SetupError> {
        self.check()?;
        let body = setup.find_body(self.body.as_deref())?;
        let mut steels = Vec::new();
        let mut initial = Vec::new();
        for material in &setup.body(body).materials {
            let composition =
                Composition::of(material).map_err(|e| SetupError::other("body", e))?;
            let steel = self.steel(composition)?;
            let laws = steel.reactions.iter().flatten().count();
            if laws == 0 && steel.austenite.is_none() && steel.martensite.is_none() {
                let message = format!("material `{}` has no `carbon`", material.name());
                let expected = "its composition in mass % as properties of the material, or laws of its constituents";
                return Err(SetupError::value("body", message, expected));
            }
            initial.push(self.initial(&steel)?);
            steels.push(steel);
        }
        let temperature = setup.read(body, &keys::TEMPERATURE)?;
        let [a, f, p, b, m] = FRACTIONS;
        let fractions = [
            setup.own_derived(body, &a)?,
            setup.own_derived(body, &f)?,
            setup.own_derived(body, &p)?,
            setup.own_derived(body, &b)?,
            setup.own_derived(body, &m)?,
        ];
        let material = &setup.body(body).material_of_point;
        let rate = self.initial_cooling_rate;
        let point = |m: &u16| Microstructure::new(initial[*m as usize], 0.0, rate);
        let points = material.iter().map(point).collect();
        Ok(RunningMetallurgy {
            body,
            transformation_plasticity: self.transformation_plasticity,
            temperature,
            fractions,
            hardness: setup.own_derived(body, &keys::HARDNESS)?,
            compliance: setup.own_derived(body, &keys::TRANSFORMATION_COMPLIANCE)?,
            steels,
            points,
            largest_share: 0.0,
        })
    }
}

impl RunningPhysics for RunningMetallurgy {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let temperature = world.read(self.temperature);
        for (point, temperature) in self.points.iter_mut().zip(&*temperature) {
            *point = Microstructure::new(point.fractions, *temperature, point.cooling_rate);
        }
        drop(temperature);
        self.publish(world);
        Ok(())
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let factor = self.transformation_plasticity;
        let material = &world.body(self.body).material_of_point;
        let temperature = world.read(self.temperature);
        let mut compliance = world.write(self.compliance);
        let steels = &self.steels;
        let points = self.points.par_iter_mut().zip(&mut *compliance);
        let points = points.zip(&temperature[..]).zip(material);
        points.for_all(|(((point, compliance), temperature), material)| {
            let before = transformed(point);
            steels[*material as usize].follow(point, *temperature, step.size);
            *compliance += factor * (transformed(point) - before).max(0.0);
        });
        drop((temperature, compliance));
        self.publish(world);
        Ok(Work::default())
    }

    fn observe(&mut self, world: &World, _time: f64) -> Result<(), RunError> {
        let material = &world.body(self.body).material_of_point;
        let mut hardness = world.write(self.hardness);
        for ((hardness, point), material) in hardness.iter_mut().zip(&self.points).zip(material) {
            *hardness = self.steels[*material as usize]
                .hardness(point)
                .unwrap_or(0.0);
        }
        let points = world.reducer(self.body);
        let own = self.points[..points.owned()].iter();
        self.largest_share = points.max(own.map(|p| p.fractions[0]).fold(0.0, f64::max));
        Ok(())
    }

    fn report(&self, _world: &World) -> PhysicsReport {
        let share = Report::new("largest share of austenite", "1", self.largest_share);
        vec![share].into()
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(world.whole_of(self.body, &self.points))
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.points = world.load_points(self.body, state)?;
        Ok(())
    }
}

perimelt_core::register_physics!(
    "metallurgy",
    Metallurgy,
    // a point without material keeps its temperature, at which nothing transforms
    supports: [Motion, Births, Cuts, Division]
);

/// `g(z) = z (2 - z)` of the fraction z that is not austenite.
fn transformed(point: &Microstructure) -> f64 {
    let austenite = point.fractions[0];
    1.0 - austenite * austenite
}

impl RunningMetallurgy {
    fn publish(&self, world: &World) {
        for (index, field) in self.fractions.iter().enumerate() {
            let mut field = world.write(*field);
            let points = field.iter_mut().zip(&self.points);
            points.for_each(|(fraction, point)| *fraction = point.fractions[index]);
        }
    }
}
