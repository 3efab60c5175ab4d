//! Conditions of a case that contradict each other: two values for the same points, heat through an insulated face, a fluid
//! that is too fast for its speed of sound.

use std::collections::BTreeSet;
use std::ops::Range;

use perimelt_core::Simulation;
use toml::de::DeValue;

use super::error::Mistakes;
use super::locate::TomlValue;
use super::plugins::PluginTable;
use super::warnings::{numbers, value_at};
use super::{Case, CaseError, Mistake};
use crate::unit;

/// Largest Mach number of a weakly compressible fluid.
const FASTEST: f64 = 0.3;

/// A boundary condition that prescribes a value in a region.
struct FixedValue {
    /// Number of the body.
    body: usize,
    /// The field, with its component.
    what: &'static str,
    region: String,
    /// The value as it is written.
    value: String,
    /// Whether it ends during the run.
    ends: bool,
    title: String,
    /// Place of the value, and of the table.
    span: Range<usize>,
    table: Range<usize>,
}

/// A value as it is written, with numbers in one form.
fn written(file: &str, value: &TomlValue<'_>) -> String {
    match numbers(value.get_ref())[..] {
        [number] if !value.get_ref().is_table() => number.to_string(),
        _ => file[value.span()].to_string(),
    }
}

/// The texts of a list.
fn texts(value: Option<&TomlValue<'_>>) -> Option<Vec<String>> {
    let list = value?.get_ref().as_array()?;
    Some(
        list.iter()
            .filter_map(|v| v.get_ref().as_str().map(String::from))
            .collect(),
    )
}

impl Case {
    /// Refuses contradictory conditions.
    pub(super) fn check_contradictions(&self, simulation: &Simulation) -> Result<(), CaseError> {
        let mut mistakes = Mistakes::default();
        let couplers = self.plugin_tables("couplers")?;
        let holds = self.holds(&couplers, simulation);
        for (index, second) in holds.iter().enumerate() {
            for first in &holds[..index] {
                if let Some(mistake) = self.conflict(first, second, simulation, true) {
                    mistakes.add(mistake);
                }
            }
        }
        mistakes.collect(self.check_insulated(&couplers, simulation));
        mistakes.finish(())
    }

    /// Sentences about conditions that contradict each other at some points or for some time.
    pub(super) fn doubtful_conditions(
        &self,
        simulation: &Simulation,
    ) -> Result<Vec<String>, CaseError> {
        let couplers = self.plugin_tables("couplers")?;
        let holds = self.holds(&couplers, simulation);
        let mut found = Vec::new();
        for (index, second) in holds.iter().enumerate() {
            let conflicts = holds[..index]
                .iter()
                .filter_map(|first| self.conflict(first, second, simulation, false));
            found.extend(conflicts.map(|mistake| mistake.message.clone()));
        }
        found.extend(self.fast_fluids(simulation)?);
        Ok(found)
    }

    fn holds(&self, couplers: &[PluginTable<'_>], simulation: &Simulation) -> Vec<FixedValue> {
        let bodies = simulation.world().bodies();
        let mut holds = Vec::new();
        for table in couplers {
            let values: Vec<(&'static str, String, Range<usize>)> = match table.kind.as_str() {
                "prescribed_temperature" => {
                    let value = table.value.get_ref().get("value");
                    let held = |v: &TomlValue<'_>| {
                        ("the temperature", written(&self.file.text, v), v.span())
                    };
                    value.map(held).into_iter().collect()
                }
                "prescribed_displacement" => {
                    let held = |(key, what): (&'static str, &'static str)| {
                        let value: &TomlValue<'_> = table.value.get_ref().get(key)?;
                        Some((what, written(&self.file.text, value), value.span()))
                    };
                    DISPLACEMENTS.into_iter().filter_map(held).collect()
                }
                "clamp" => {
                    let components = texts(table.value.get_ref().get("components"));
                    let is_held = |key: &str| {
                        components
                            .as_ref()
                            .is_none_or(|c| c.iter().any(|c| c == key))
                    };
                    let held = DISPLACEMENTS.into_iter().filter(|(key, _)| is_held(key));
                    held.map(|(_, what)| (what, "0".to_string(), table.at("region")))
                        .collect()
                }
                _ => continue,
            };
            let body = table.body_index(bodies);
            let (Some(body), Some(region)) = (body, table.text("region")) else {
                continue;
            };
            holds.extend(values.into_iter().map(|(what, value, span)| FixedValue {
                body,
                what,
                region: region.to_string(),
                value,
                ends: table.value.get_ref().get("until").is_some(),
                title: table.title(),
                span,
                table: table.value.span(),
            }));
        }
        holds
    }

    /// Two holds of different values: of the same points (`all`), or of some of them or for some time.
    fn conflict(
        &self,
        first: &FixedValue,
        second: &FixedValue,
        simulation: &Simulation,
        all: bool,
    ) -> Option<Box<Mistake>> {
        if first.body != second.body || first.what != second.what || first.value == second.value {
            return None;
        }
        let body = simulation.world().body(first.body);
        let points = |hold: &FixedValue| -> Option<BTreeSet<u32>> {
            Some(
                body.regions
                    .get(&hold.region)?
                    .points
                    .iter()
                    .copied()
                    .collect(),
            )
        };
        let (own, others) = (points(second)?, points(first)?);
        let shared = own.intersection(&others).count();
        let is_whole = shared == own.len().min(others.len()) && !first.ends && !second.ends;
        if shared == 0 || is_whole != all {
            return None;
        }
        let line = 1 + self.file.text[..first.span.start].matches('\n').count();
        let message = format!(
            "{} of {shared} points of region `{}` of body `{}` is {} here and {} in {} (line {line}): such points take the mean of the two",
            second.what, second.region, body.name, second.value, first.value, first.title
        );
        let mistake = Mistake::new(&self.file, message, second.span.clone());
        Some(
            mistake
                .expected("expected one value")
                .within(second.table.clone(), format!("in {}", second.title))
                .help("give the regions no common points, or leave one of the two out"),
        )
    }

    /// Refuses exchange of heat through a face that is insulated.
    fn check_insulated(
        &self,
        couplers: &[PluginTable<'_>],
        simulation: &Simulation,
    ) -> Result<(), CaseError> {
        let mut mistakes = Mistakes::default();
        let of_kind = |kinds: &'static [&str]| {
            couplers
                .iter()
                .filter(move |c| kinds.contains(&c.kind.as_str()))
        };
        let only = &simulation.world().bodies()[0].name;
        for insulated in of_kind(&["insulated"]) {
            let field = insulated.text("field");
            let Some(faces) = texts(insulated.value.get_ref().get("faces"))
                .filter(|_| field.is_none_or(|f| f == "temperature"))
            else {
                continue;
            };
            for exchange in of_kind(&["convection", "radiation", "heat_flux", "water_jet"]) {
                let same_body = exchange.body().unwrap_or(only) == insulated.body().unwrap_or(only);
                let exchanged = texts(exchange.value.get_ref().get("faces")).unwrap_or_default();
                let Some(face) = exchanged.iter().find(|f| same_body && faces.contains(f)) else {
                    continue;
                };
                let line = 1 + self.file.text[..insulated.value.span().start]
                    .matches('\n')
                    .count();
                let message = format!(
                    "the face `{face}` exchanges heat here and is insulated in {} (line {line})",
                    insulated.title()
                );
                let mistake = Mistake::new(&self.file, message, exchange.at("faces"));
                mistakes.add(
                    mistake
                        .expected("expected a face that is not insulated")
                        .within(exchange.value.span(), format!("in {}", exchange.title())),
                );
            }
        }
        mistakes.finish(())
    }

    /// Fluids that start faster than a fraction of their speed of sound.
    fn fast_fluids(&self, simulation: &Simulation) -> Result<Vec<String>, CaseError> {
        let world = simulation.world();
        let mut found = Vec::new();
        for table in self
            .plugin_tables("physics")?
            .iter()
            .filter(|p| p.kind == "fluid")
        {
            let sound =
                value_at(&table.value, "state.tait.sound_speed").map(|v| numbers(v.get_ref()));
            let body = table.body_index(world.bodies());
            let (Some([sound]), Some(body)) = (sound.as_deref(), body) else {
                continue;
            };
            let Some(field) = world.fields().find(body, "velocity") else {
                continue;
            };
            let field = world.fields().field(field);
            let data = field.data();
            let speed = |v: &[f64]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
            let fastest = data
                .flat()
                .chunks(data.components())
                .map(speed)
                .fold(0.0, f64::max);
            if fastest > FASTEST * sound {
                found.push(format!(
                    "the fluid `{}` starts with {} m/s, {} times its `sound_speed` of {} m/s: the equation of state holds for small \
                     changes of density, so that the speed of sound must be ten times the largest velocity",
                    world.body(body).name,
                    unit::number(fastest, 3),
                    unit::number(fastest / sound, 3),
                    unit::number(*sound, 3)
                ));
            }
        }
        Ok(found)
    }
}

/// Keys and names of the components of the displacement.
const DISPLACEMENTS: [(&str, &str); 3] = [
    ("x", "the displacement along x"),
    ("y", "the displacement along y"),
    ("z", "the displacement along z"),
];

/// Numbers of a case that no quantity in SI units has: not finite, or beyond these magnitudes. Squares and cubes of
/// others are finite.
const MAGNITUDES: Range<f64> = 1e-100..1e100;

/// A number that no quantity has.
pub(super) struct WrongNumber {
    /// Keys that lead to it.
    pub(super) path: String,
    pub(super) number: f64,
    /// Place in the text.
    pub(super) span: Range<usize>,
}

/// Refuses numbers that are not finite or that no quantity has, with the keys that lead to them.
pub(super) fn wrong_numbers(
    value: &DeValue<'_>,
    path: &str,
    span: Range<usize>,
    found: &mut Vec<WrongNumber>,
) {
    match value {
        DeValue::Float(_) => {
            let number = numbers(value).first().copied().unwrap_or(f64::NAN);
            if !(number == 0.0 || MAGNITUDES.contains(&number.abs())) {
                found.push(WrongNumber {
                    path: path.into(),
                    number,
                    span,
                });
            }
        }
        DeValue::Array(list) => list
            .iter()
            .for_each(|v| wrong_numbers(v.get_ref(), path, v.span(), found)),
        DeValue::Table(table) => {
            for (key, value) in table.iter() {
                let dot = if path.is_empty() { "" } else { "." };
                wrong_numbers(
                    value.get_ref(),
                    &format!("{path}{dot}{}", key.get_ref()),
                    value.span(),
                    found,
                );
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn case(couplers: &str) -> Result<Vec<String>, String> {
        let text = format!(
            r#"
            [bodies.b]
            shape.box = {{ min = [0, 0, 0], max = [0.02, 0.02, 0.02] }}
            spacing = 4e-3
            initial.temperature = 300
            regions.r.box = {{ min = [0, 0, 0], max = [0.008, 0.02, 0.02] }}
            regions.part.box = {{ min = [0.004, 0, 0], max = [0.012, 0.02, 0.02] }}
            regions.inside.box = {{ min = [0, 0, 0], max = [0.004, 0.02, 0.02] }}
            material = "m"
            [materials.m]
            density = 7800
            specific_heat = 500
            conductivity = 30
            youngs_modulus = 2e11
            poissons_ratio = 0.3
            [[physics]]
            type = "thermal"
            [[physics]]
            type = "mechanical"
            {couplers}
            [time]
            end = 1
            "#
        );
        let case = Case::parse("b.toml", text, Path::new("")).map_err(|e| e.render(false))?;
        let simulation = case.compose().map_err(|e| e.render(false))?;
        case.doubtful_conditions(&simulation)
            .map_err(|e| e.render(false))
    }

    fn temperature(region: &str, value: &str) -> String {
        format!(
            "[[couplers]]\ntype = 'prescribed_temperature'\nregion = '{region}'\nvalue = {value}\n"
        )
    }

    #[test]
    fn two_values_of_the_same_points_are_refused_with_both_places() {
        let clamp = "[[couplers]]\ntype = 'clamp'\nregion = 'r'\n";
        let displaced = "[[couplers]]\ntype = 'prescribed_displacement'\nregion = 'r'\nz = 1e-3\n";
        for (couplers, words) in [
            (
                temperature("r", "300") + &temperature("r", "900"),
                ["is 900 here and 300", "prescribed_temperature"],
            ),
            (
                temperature("r", "300") + &temperature("inside", "'300 + t'"),
                ["300 + t", "(line 23)"],
            ),
            (
                format!("{clamp}{displaced}"),
                [
                    "the displacement along z of 50 points",
                    "in [[couplers]] `clamp`",
                ],
            ),
        ] {
            let error = case(&couplers).expect_err("a contradiction");
            words
                .iter()
                .for_each(|word| assert!(error.contains(word), "{word}: {error}"));
        }
        let along_x = "[[couplers]]\ntype = 'clamp'\nregion = 'r'\ncomponents = ['x']\n";
        for couplers in [
            temperature("r", "300") + &temperature("r", "300.0"),
            format!("{along_x}{displaced}"),
            format!("{clamp}{}", displaced.replace("1e-3", "0")),
            temperature("inside", "300") + &temperature("part", "900"),
        ] {
            assert_eq!(case(&couplers), Ok(Vec::new()), "{couplers}");
        }
    }

    #[test]
    fn two_values_of_some_points_or_for_some_time_are_told() {
        let overlapping = temperature("r", "300") + &temperature("part", "900");
        let released = "[[couplers]]\ntype = 'clamp'\nregion = 'r'\nuntil = 0.5\n[[couplers]]\ntype = 'prescribed_displacement'\nregion = 'r'\nz = 1e-3\n";
        for couplers in [&overlapping, released] {
            let told = case(couplers).expect("allowed");
            assert!(told[0].contains("take the mean"), "{told:?}");
        }
    }

    #[test]
    fn heat_through_an_insulated_face_is_refused() {
        let insulated = "[[couplers]]\ntype = 'insulated'\nfaces = ['x-']\n";
        let convection = "[[couplers]]\ntype = 'convection'\nfaces = ['x-', 'y+']\ncoefficient = 10\nambient = 300\n";
        let error = case(&format!("{insulated}{convection}")).expect_err("a contradiction");
        assert!(
            error.contains("the face `x-` exchanges heat here and is insulated"),
            "{error}"
        );
        let other = convection.replace("'x-', ", "");
        assert_eq!(case(&format!("{insulated}{other}")), Ok(Vec::new()));
    }
}
