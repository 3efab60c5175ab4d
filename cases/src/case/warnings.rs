//! Warnings about valid cases that may be mistakes: numbers in other units, points that do not fill their box, physics that
//! are not coupled.

use std::ops::Range;

use perimelt_core::fire::FIRE_CURVES;
use perimelt_core::formula::Formula;
use perimelt_core::material::{EXPANSION_KINDS, Expansion, Material, ThermalState};
use perimelt_core::shape::Shape;
use perimelt_core::{Body, Simulation};
use perimelt_physics::mechanical::moduli::{Moduli, Plane};
use toml::de::DeValue;

use super::error::Mistakes;
use super::locate::{TomlTable, TomlValue};
use super::plugins::PluginTable;
use super::units;
use super::volumes;
use super::{Case, CaseError, Mistake, Result, log_intervals};
use crate::unit;

/// Temperatures below this (K) are suspected to be meant in degrees Celsius.
pub(super) const COLD: f64 = 150.0;

/// Bodies larger than this (m) are suspected to be meant in millimetres.
const HUGE: f64 = 10.0;

/// Fraction of the extent of a box that points may leave out or add.
const FILLED: f64 = 0.01;

/// Exponent of the growth of vibrations by late heat from which on a warning is given: smooth motion has some 1e-5 of its
/// amplitude in the modes of the lattice, which grow fastest.
const LATE_HEAT: f64 = 10.0;

/// The value of a dotted key below a table.
pub(super) fn value_at<'t, 'i>(table: &'t TomlValue<'i>, key: &str) -> Option<&'t TomlValue<'i>> {
    let below = |value: &'t TomlValue<'i>, name: &str| value.get_ref().get(name);
    key.split('.').try_fold(table, below)
}

/// Keys of plugins that are temperatures, by type or for all.
const TEMPERATURES: [(Option<&str>, &str); 7] = [
    (None, "ambient"),
    (None, "reference_temperature"),
    (None, "cutoff_temperature"),
    (Some("prescribed_temperature"), "value"),
    (Some("deposit"), "temperature"),
    (Some("mechanical"), "plasticity.annealing_temperature"),
    (Some("mechanical"), "annealing_temperature"),
];

impl Case {
    /// Warnings of the plugins, then of the case as a whole.
    ///
    /// # Errors
    /// A section that cannot be read.
    pub fn warnings(&self, simulation: &Simulation) -> Result<Vec<String>, CaseError> {
        let of_plugins = simulation.warnings().into_iter();
        let mut found: Vec<String> = of_plugins
            .map(|w| format!("{}: {}", w.plugin, w.message))
            .collect();
        let bodies = simulation.observed().bodies();
        let lowest: Vec<Option<f64>> = (0..bodies.len())
            .map(|body| provided_temperature(simulation, body))
            .collect();
        for ((index, body), (_, section)) in bodies.iter().enumerate().zip(&self.bodies) {
            let box_not_filled = not_filled(body, &section.shape);
            if box_not_filled.is_none() {
                let shape = self.loaded(&[&body.name, "shape"], &section.shape)?;
                found.extend(volumes::of_body(body, &shape));
            }
            found.extend(box_not_filled);
            let of_material = units::of_material(body);
            let has_scale = units::are_si(body) || of_material.is_some();
            found.extend(of_material);
            if has_scale {
                found.extend(too_large(body));
                found.extend(units::cold_start(body, lowest[index]));
            }
        }
        if bodies.iter().all(units::are_si) {
            found.extend(self.cold_surroundings(bodies.iter().all(melts))?);
            found.extend(self.tables_in_celsius(&lowest)?);
        }
        found.extend(self.deposited_volumes(simulation)?);
        found.extend(self.touching_bodies(simulation)?);
        found.extend(no_expansion(simulation));
        found.extend(self.waits(simulation, &lowest)?);
        found.extend(self.nothing_cools(simulation, &lowest)?);
        found.extend(self.unused_columns(simulation));
        found.extend(self.late_heat(simulation)?);
        found.extend(log_intervals::at_few_moments_of_pulses(simulation));
        found.extend(log_intervals::with_flow_far_apart(simulation));
        found.extend(units::small_angles(simulation));
        found.extend(self.doubtful_conditions(simulation)?);
        Ok(found)
    }

    /// Refuses temperatures below absolute zero.
    pub(super) fn check_temperatures(&self, simulation: &Simulation) -> Result<(), CaseError> {
        let expected = "kelvins, zero or above";
        let mut mistakes = Mistakes::default();
        for (index, (name, _)) in self.bodies.iter().enumerate() {
            if let Some(lowest) = lowest_temperature(simulation, index).filter(|t| *t < 0.0) {
                let message = format!("the initial temperature is {lowest} K");
                let key = [name.as_str(), "initial", "temperature"];
                mistakes.add(self.body_error(&key, message, expected));
            }
        }
        for given in self.given_temperatures()? {
            if let Some(lowest) = given.numbers.iter().find(|t| **t < 0.0) {
                let message = format!("`{}` of `{}` is {lowest} K", given.key, given.kind);
                let mistake = Mistake::new(&self.file, message, given.span);
                mistakes.add(mistake.expected(expected));
            }
        }
        mistakes.finish(())
    }

    /// Temperatures in the tables of plugins.
    fn given_temperatures(&self) -> Result<Vec<GivenTemperature>, CaseError> {
        let mut given = Vec::new();
        let physics = self.plugin_tables("physics")?.into_iter();
        for table in physics.chain(self.plugin_tables("couplers")?) {
            let of_kind = |(kind, _): &(Option<&str>, _)| kind.is_none_or(|k| k == table.kind);
            for (_, key) in TEMPERATURES.into_iter().filter(of_kind) {
                if let Some(value) = value_at(&table.value, key) {
                    let at_start = temperature_at_start(value.get_ref());
                    let mut numbers = numbers(value.get_ref());
                    numbers.extend(at_start);
                    given.push(GivenTemperature {
                        kind: table.kind.clone(),
                        key,
                        is_rise: at_start.is_some_and(|t| t < COLD) && is_of_fire(value.get_ref()),
                        numbers,
                        span: value.span(),
                    });
                }
            }
        }
        Ok(given)
    }

    /// The lowest temperature (K) of what surrounds bodies.
    pub(super) fn coldest_surroundings(&self) -> Result<Option<f64>, CaseError> {
        let given = self.given_temperatures()?.into_iter();
        let around = given.filter(|g| ["ambient", "value"].contains(&g.key));
        Ok(around.flat_map(|g| g.numbers).reduce(f64::min))
    }

    /// Temperatures below those of anything around; zero is one for metals that melt only, else the start of a rise.
    fn cold_surroundings(&self, all_melt: bool) -> Result<Vec<String>, CaseError> {
        let given = self.given_temperatures()?.into_iter();
        let cold = given.filter_map(|given| {
            let lowest = given.numbers.into_iter().reduce(f64::min)?;
            let (key, kind) = (given.key, given.kind);
            if given.is_rise {
                return Some(format!(
                    "`{key}` of `{kind}` is {} K at the start; {RISE}",
                    unit::number(lowest, 5)
                ));
            }
            (lowest < COLD && (all_melt || lowest >= 1.0)).then(|| {
                format!(
                    "`{key}` of `{kind}` is {} K; {CELSIUS}",
                    unit::number(lowest, 5)
                )
            })
        });
        Ok(cold.collect())
    }
}

/// Whether a plugin provides a field of a body; a field that is only read, where provided, has no values.
pub(crate) fn provides(simulation: &Simulation, body: usize, name: &str) -> bool {
    let mut fields = simulation.lasting();
    fields.any(|field| field.body == body && field.name == name)
}

/// Bodies whose temperature is computed and that deform, of a material that expands, without a coupler that strains them.
fn no_expansion(simulation: &Simulation) -> Option<String> {
    let world = simulation.world();
    let is_silent = |(index, body): &(usize, &Body)| {
        let has = |name| provides(simulation, *index, name);
        let mut materials = body.materials.iter();
        has("temperature")
            && has("displacement")
            && world.fields().find(*index, "eigenstrain").is_none()
            && materials.any(|m| EXPANSION_KINDS.iter().any(|kind| m.get(kind).is_some()))
    };
    let (_, body) = world.bodies().iter().enumerate().find(is_silent)?;
    Some(format!(
        "body `{}` heats up and deforms, and does not expand: there is no coupler `thermal_expansion`",
        body.name
    ))
}

impl Case {
    /// Explicit bodies whose deformation makes heat that is one step late: `u'' = -w^2 u + c w^2 dt u'`, with the ratio c of
    /// adiabatic and isothermal stiffness less one, so that amplitudes grow at the rate `c w^2 dt / 2`.
    fn late_heat(&self, simulation: &Simulation) -> Result<Vec<String>, CaseError> {
        let (options, bodies) = (simulation.options(), simulation.world().bodies());
        let mut found = Vec::new();
        if options.iteration.is_some() {
            return Ok(found);
        }
        let couplers = self.plugin_tables("couplers")?;
        let heats = |body: usize| {
            let mut of_body = couplers
                .iter()
                .filter(|c| c.body_index(bodies) == Some(body));
            of_body.any(|c| c.kind == "deformation_heat")
        };
        let physics = self.plugin_tables("physics")?;
        for (index, plugin) in physics.iter().enumerate() {
            let (Some(damping), Some(body)) = (explicit_damping(plugin), plugin.body_index(bodies))
            else {
                continue;
            };
            let Some(stable) = simulation.stable_steps()[index].filter(|_| heats(body)) else {
                continue;
            };
            let step = simulation.sub_steps()[index].min(simulation.macro_step());
            let temperature = lowest_temperature(simulation, body).unwrap_or(0.0);
            let body = &bodies[body];
            let coupling = adiabatic_stiffening(body, temperature);
            let rate = 2.0 * coupling * step / (stable * stable) - 0.5 * damping;
            let exponent = rate * options.end;
            if exponent > LATE_HEAT {
                found.push(format!(
                    "the heat of `deformation_heat` is one step late and adds energy to vibrations of body `{}`, whose amplitude \
                     may grow by e^{exponent:.0} until the end: set `time.iteration`, `damping` of `solver.explicit`, or a \
                     smaller step",
                    body.name
                ));
            }
        }
        Ok(found)
    }
}

/// Damping rate of a mechanical physics with the explicit solver, 1/s.
fn explicit_damping(plugin: &PluginTable<'_>) -> Option<f64> {
    let table = plugin.value.get_ref().as_table()?;
    let explicit = table.get("solver")?.get_ref().as_table()?.get("explicit")?;
    let damping = explicit.get_ref().as_table()?.get("damping");
    let text = damping.map(|d| match d.get_ref() {
        DeValue::Float(number) => number.as_str().to_string(),
        DeValue::Integer(number) => number.as_str().to_string(),
        _ => String::new(),
    });
    (plugin.kind == "mechanical").then(|| text.map_or(0.0, |t| t.parse().unwrap_or(0.0)))
}

/// The largest `alpha^2 T d^2 K / (rho c_p)` of the materials of a body at a temperature (K), with the bulk modulus K of d
/// dimensions.
fn adiabatic_stiffening(body: &Body, temperature: f64) -> f64 {
    let of_material = |material: &Material| {
        let at = |name: &str| material.get(name).map(|p| p.at(temperature, 0.0));
        let d = body.dimension as f64;
        let ratio = at("poissons_ratio").unwrap_or(0.25);
        let moduli = Moduli::new(at("youngs_modulus")?, ratio, body.dimension, Plane::Stress);
        let capacity = material.reference_density().ok()? * at("specific_heat")?;
        let expansion = Expansion::of(material).ok()??;
        let along = expansion.values().iter();
        let along = along.map(|e| e.instantaneous(ThermalState::solid(temperature)).ok());
        let expansion = along.flatten().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        Some(expansion * expansion * temperature * d * d * moduli.bulk / capacity)
    };
    let materials = body.materials.iter().filter_map(of_material);
    materials.fold(0.0, f64::max)
}

/// A temperature in the table of a coupler.
struct GivenTemperature {
    /// Type of the coupler.
    kind: String,
    key: &'static str,
    /// Temperatures, K.
    numbers: Vec<f64>,
    /// Whether it is the rise of the temperature in a fire without the temperature before.
    is_rise: bool,
    /// Place of the value in the file.
    span: Range<usize>,
}

pub(super) const CELSIUS: &str = "temperatures are in kelvins (20 °C are 293.15 K)";

/// Whether a body is of real materials that melt; numbers without a scale have no such melting points.
pub(super) fn melts(body: &Body) -> bool {
    let solidus = |m: &Material| m.constant("solidus").is_ok_and(|t| t > COLD);
    body.materials.iter().any(solidus)
}

const RISE: &str = "the functions of fires are the rise of the temperature: add the temperature before the fire, such as \
                    \"293.15 + fire_iso_834(t)\"";

/// The temperature (K) at the start of a formula in the time.
fn temperature_at_start(value: &DeValue<'_>) -> Option<f64> {
    let DeValue::String(text) = value else {
        return None;
    };
    let formula = Formula::new(text).ok()?;
    formula.is_of_time().then(|| formula.at([0.0; 3], 0.0))
}

/// Whether a value is a formula with the temperature of a fire.
fn is_of_fire(value: &DeValue<'_>) -> bool {
    matches!(value, DeValue::String(text) if FIRE_CURVES.iter().any(|curve| text.contains(curve.name)))
}

/// All numbers of a value: of a table in time those of `value`.
pub(super) fn numbers(value: &DeValue<'_>) -> Vec<f64> {
    match value {
        DeValue::Float(number) => number
            .as_str()
            .replace('_', "")
            .parse()
            .into_iter()
            .collect(),
        DeValue::Integer(number) => {
            let parsed = i64::from_str_radix(number.as_str(), number.radix());
            parsed.into_iter().map(|n| n as f64).collect()
        }
        DeValue::Array(values) => values.iter().flat_map(|v| numbers(v.get_ref())).collect(),
        DeValue::Table(keys) => of_key(keys, "value"),
        _ => Vec::new(),
    }
}

fn of_key(keys: &TomlTable<'_>, key: &str) -> Vec<f64> {
    keys.get(key).map_or(Vec::new(), |v| numbers(v.get_ref()))
}

fn lowest_temperature(simulation: &Simulation, body: usize) -> Option<f64> {
    let fields = simulation.world().fields();
    let field = fields.field(fields.find(body, "temperature")?);
    let data = field.data();
    data.flat().iter().copied().reduce(f64::min)
}

/// The lowest temperature (K) of a body whose temperature is computed or prescribed.
fn provided_temperature(simulation: &Simulation, body: usize) -> Option<f64> {
    let mut lasting = simulation.lasting();
    let provided = lasting.any(|f| f.body == body && f.name == "temperature");
    provided
        .then(|| lowest_temperature(simulation, body))
        .flatten()
}

fn too_large(body: &Body) -> Option<String> {
    let (min, max) = body.bounds();
    let extent = (0..body.dimension)
        .map(|a| max[a] - min[a])
        .fold(0.0, f64::max);
    (extent > HUGE).then(|| {
        format!(
            "body `{}` is {} m long; lengths are in metres",
            body.name,
            unit::number(extent, 5)
        )
    })
}

/// Boxes whose extents are no multiples of the spacing.
fn not_filled(body: &Body, shape: &Shape) -> Option<String> {
    let Shape::Box(asked) = shape else {
        return None;
    };
    body.lattice()?;
    let (min, max) = body.bounds();
    let axes = 0..body.dimension;
    let lengths: Vec<[f64; 2]> = axes
        .map(|a| [asked.max[a] - asked.min[a], max[a] - min[a]])
        .collect();
    let differs = |[asked, filled]: &[f64; 2]| (filled - asked).abs() > FILLED * asked;
    if !lengths.iter().any(differs) {
        return None;
    }
    let largest = lengths.iter().flatten().copied().fold(0.0, f64::max);
    let length = unit::length(largest);
    let product = |which: usize| {
        let numbers: Vec<String> = lengths
            .iter()
            .map(|l| unit::number(length.factor * l[which], 4))
            .collect();
        format!("{} {}", numbers.join(" x "), length.unit)
    };
    Some(format!(
        "the points of body `{}` fill {} of a box of {}: `spacing` does not divide it",
        body.name,
        product(1),
        product(0)
    ))
}

/// Bodies whose points have another volume than their shape.
#[cfg(test)]
mod tests {
    use super::units::tests::warnings;

    #[test]
    fn logs_at_few_moments_of_pulses_are_told() {
        for (frequency, log, moments) in [
            (20.0, "interval = 0.1", Some("the same moment")),
            (10.0, "interval = 0.1", Some("the same moment")),
            (20.0, "interval = 0.025", Some("the same 2 moments")),
            (
                20.0,
                "stages = [{ until = 0.1, interval = 0.05 }]\ninterval = 0.045",
                Some("the same moment"),
            ),
            (20.0, "interval = 0.045", None),
            (20.0, "interval = 0.01", None),
        ] {
            let pulse = format!("power = 50\npulse = {{ frequency = {frequency}, duty = 0.5 }}");
            let log = format!("end = 0.2\n[log]\n{log}");
            let found = warnings(&[("power = 50", &pulse), ("end = 0.2", &log)]);
            let told = |moments| format!("{moments} of the pulses of `gaussian_source`");
            let expected: Vec<String> = moments.map(told).into_iter().collect();
            assert_eq!(found.len(), expected.len(), "{found:?}");
            let mut told = found.iter().zip(&expected);
            assert!(told.all(|(found, told)| found.contains(told)), "{found:?}");
        }
    }
}
