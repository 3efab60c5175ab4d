//! Summary of a run in a few sentences: energies of heat sources and the highest logged temperature.

use perimelt_core::material::Material;
use perimelt_core::{Report, Simulation};

use crate::case::provides;
use crate::tables;
use crate::unit;

/// Fraction of the energy that may miss the body without a warning.
const LOST: f64 = 0.05;

/// No element is condensed above this temperature, K.
const PLASMA: f64 = 1e4;

/// Highest temperature (K) of each body whose temperature is computed or prescribed; other bodies have a field without values.
pub(super) fn hottest(simulation: &Simulation) -> impl Iterator<Item = (usize, f64)> {
    largest_of(simulation, "temperature")
}

/// The largest value of a field, by body.
fn largest_of(simulation: &Simulation, field: &str) -> impl Iterator<Item = (usize, f64)> {
    let fields = simulation.lasting().filter(move |f| f.name == field);
    fields.filter_map(|f| {
        let hottest = f.data().flat().iter().copied().reduce(f64::max)?;
        Some((f.body, hottest))
    })
}

/// Temperatures over a run.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// Time of the first state, s.
    since: f64,
    /// Highest logged temperature of each body, K.
    peaks: Vec<Option<f64>>,
    /// Lowest logged temperature of each body, K.
    lowest: Vec<f64>,
}

impl RunOutcome {
    /// Starts at the state of `simulation`.
    pub fn new(simulation: &Simulation) -> Self {
        let mut outcome = RunOutcome {
            since: simulation.time(),
            peaks: vec![None; simulation.observed().bodies().len()],
            lowest: vec![f64::INFINITY; simulation.observed().bodies().len()],
        };
        outcome.observe(simulation);
        outcome
    }

    /// Updates the extremes by the present state.
    pub fn observe(&mut self, simulation: &Simulation) {
        // the highest temperatures also between the logged states, where they are recorded
        let recorded = largest_of(simulation, "peak_temperature");
        for (body, hottest) in hottest(simulation).chain(recorded) {
            let peak = &mut self.peaks[body];
            *peak = Some(peak.map_or(hottest, |peak| peak.max(hottest)));
        }
        for field in simulation.lasting().filter(|f| f.name == "temperature") {
            // zero means that no temperature is set
            let data = field.data();
            let values = data.flat().iter().copied().filter(|t| *t > 0.0);
            let coldest = values.fold(f64::INFINITY, f64::min);
            let lowest = &mut self.lowest[field.body];
            *lowest = lowest.min(coldest);
        }
    }

    /// Sentences about sources and temperatures, and warnings, also of states outside the validity of models.
    pub fn sentences(&self, simulation: &Simulation) -> (Vec<String>, Vec<String>) {
        let (mut facts, mut warnings) = (Vec::new(), Vec::new());
        source_energies(simulation, &mut facts, &mut warnings);
        let mut messages = simulation.unreached();
        if simulation.is_finished() {
            messages.extend(simulation.unfinished());
        }
        messages.extend(simulation.remarks());
        let messages = messages.into_iter();
        warnings.extend(messages.map(|(label, message)| format!("{label}: {message}")));
        self.temperatures(simulation, &mut facts, &mut warnings);
        (facts, warnings)
    }

    /// Sentences about the highest temperatures.
    fn temperatures(
        &self,
        simulation: &Simulation,
        facts: &mut Vec<String>,
        warnings: &mut Vec<String>,
    ) {
        let evaporates = |r: &Report| r.name == "evaporated.rate";
        let all = simulation.reports();
        let is_evaporation_modelled = all
            .iter()
            .any(|(_, reports)| reports.iter().any(evaporates));
        let bodies = simulation.observed().bodies().iter().enumerate();
        for ((index, body), peak) in bodies.zip(&self.peaks) {
            let Some(peak) = peak else {
                continue;
            };
            let range = [self.lowest[index], *peak];
            let has_field = |name: &str| provides(simulation, index, name);
            let left = tables::left_by(&body.materials, has_field, range);
            let sentence = tables::sentence(&left, range);
            warnings.extend(sentence.map(|s| format!("{}: {s}", body.name)));
            let boiling = |m: &Material| m.constant("boiling_temperature").ok();
            let boiling = body.materials.iter().filter_map(boiling).reduce(f64::min);
            let since = match self.since {
                0.0 => String::new(),
                since => format!(" since {} s", unit::number(since, 5)),
            };
            let kelvins = unit::number(*peak, 5);
            facts.push(format!(
                "{}: highest logged temperature{since} {kelvins} K",
                body.name
            ));
            if boiling.is_none() && *peak > PLASMA {
                warnings.push(format!(
                    "{}: the highest temperature is {kelvins} K, above the boiling point of every metal: the power, the size \
                     of the source, or the units of the material may be wrong",
                    body.name
                ));
            }
            if let Some(boiling) = boiling.filter(|b| peak > b && !is_evaporation_modelled) {
                let boiling = unit::number(boiling, 5);
                warnings.push(format!(
                    "{}: the highest temperature is above that of boiling, {boiling} K, and evaporation is not modelled",
                    body.name
                ));
            }
        }
    }
}

/// Sentences about the energies of the heat sources.
fn source_energies(simulation: &Simulation, facts: &mut Vec<String>, warnings: &mut Vec<String>) {
    for (label, reports) in simulation.reports() {
        let energy = |what: &str| {
            let name = format!("energy.{what}");
            reports.iter().find(|r| r.name == name).map(|r| r.value)
        };
        let (Some(asked), Some(deposited), Some(lost)) =
            (energy("asked"), energy("deposited"), energy("lost"))
        else {
            continue;
        };
        let mirrored = energy("mirrored").unwrap_or(0.0);
        let [a, d, m, l] = [asked, deposited, mirrored, lost].map(|e| unit::number(e, 4));
        let mirrored = match mirrored {
            0.0 => String::new(),
            _ => format!("{m} J in the mirrored part of the body, "),
        };
        facts.push(format!(
            "{label}: {a} J asked for, {d} J deposited, {mirrored}{l} J lost beside the body"
        ));
        if lost > LOST * asked {
            let percent = unit::number(100.0 * lost / asked, 3);
            let until = match simulation.is_finished() {
                true => String::new(),
                false => format!(" until {} s", unit::number(simulation.time(), 4)),
            };
            let is_column = reports.iter().any(|r| r.name == "depth");
            let through = match is_column {
                true => ", or the other side of the body through a keyhole or an interface",
                false => "",
            };
            warnings.push(format!(
                "{label}: {percent} % of the energy was lost beside the body{until}: the source reaches cells without material, \
                 or a surface that curves away from its plane{through}"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::case::Case;

    #[test]
    fn temperatures_that_no_metal_has_are_told() {
        let warnings = |initial: &str, boiling: &str| {
            let text = format!(
                r#"
                [bodies.bar]
                shape.box = {{ min = [0, 0, 0], max = [8, 1, 1] }}
                dimension = 1
                spacing = 1
                material = "m"
                initial.temperature = {initial}

                [materials.m]
                density = 1
                conductivity = 1
                specific_heat = 1
                {boiling}

                [[physics]]
                type = "thermal"

                [time]
                end = 1
                "#
            );
            let case = Case::parse("bar.toml", text, Path::new("")).expect("valid");
            let mut simulation = case.compose().expect("complete");
            simulation.start().expect("starts");
            RunOutcome::new(&simulation)
                .sentences(&simulation)
                .1
                .join("; ")
        };
        assert_eq!(warnings("9999", ""), "");
        assert!(warnings("39e3", "").contains("39000 K, above the boiling point of every metal"));
        let of_boiling = warnings("39e3", "boiling_temperature = 3000");
        assert!(
            of_boiling.contains("above that of boiling, 3000 K")
                && !of_boiling.contains("every metal"),
            "{of_boiling}"
        );
    }

    /// The mechanics read a temperature if there is one; without `thermal` the field has no values.
    #[test]
    fn temperatures_are_told_where_somebody_provides_them() {
        let case = |initial: &str, thermal: &str| {
            let text = format!(
                r#"
                [bodies.bar]
                shape.box = {{ min = [0, 0, 0], max = [8, 1, 1] }}
                dimension = 1
                spacing = 1
                material = "m"
                {initial}

                [materials.m]
                density = 1
                youngs_modulus = 1
                poissons_ratio = 0.25
                conductivity = 1
                specific_heat = 1

                {thermal}

                [[physics]]
                type = "mechanical"
                solver.explicit = {{}}

                [time]
                end = 1
                "#
            );
            let case = Case::parse("bar.toml", text, Path::new("")).expect("valid");
            let mut simulation = case.compose().expect("complete");
            simulation.start().expect("starts");
            let (facts, _) = RunOutcome::new(&simulation).sentences(&simulation);
            (facts, hottest(&simulation).count())
        };
        assert_eq!(case("", ""), (vec![], 0));
        let (facts, bodies) = case(
            "initial.temperature = 300",
            "[[physics]]\ntype = \"thermal\"",
        );
        assert!(
            facts[0].starts_with("bar: highest logged temperature"),
            "{facts:?}"
        );
        assert_eq!(bodies, 1);
    }
}
