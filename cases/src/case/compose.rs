//! Composes a simulation from a case.

use std::sync::Arc;

use perimelt_core::material::MaterialError;
use perimelt_core::plugin::{FromToml, Registration, registered};
use perimelt_core::simulation::{Culprit, Named, TimeOptions};
use perimelt_core::{Coupler, Physics, Problem, RunError, SetupError, Simulation, World};
use schemars::Schema;
use toml::de::ValueDeserializer;

use super::bodies::suggest;
use super::error::{CaseError, CaseFile};
use super::locate::{self, TomlValue};
use super::reword::{Section, split_help};
use super::sections::ProbeSection;
use super::{Case, Reader, Result, own_keys};
use crate::probe::Probe;
use crate::run::record::REPORTS;

/// Why a composed case cannot start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A mistake in the case file.
    #[error(transparent)]
    Case(Box<CaseError>),
    /// A physics cannot start.
    #[error(transparent)]
    Run(#[from] RunError),
}

/// A `[[physics]]` or `[[couplers]]` table.
pub(super) struct PluginTable<'a> {
    section: &'static str,
    pub(super) kind: String,
    pub(super) value: TomlValue<'a>,
}

impl Case {
    /// Fills bodies, builds and prepares plugins, sets initial fields: everything but the
    /// start of the run. No file is written.
    ///
    /// # Errors
    /// The first mistake.
    pub fn compose(&self) -> Result<Simulation> {
        let couplers = self.plugin_tables("couplers")?;
        let physics = self.plugin_tables("physics")?;
        if physics.is_empty() {
            let error = CaseError::of_file(&self.file, "the case has no physics");
            return Err(
                error.help("add a section `[[physics]]` with a `type`, see `perimelt list`")
            );
        }
        let built_couplers = self.build::<dyn Coupler>(&couplers)?;
        let built_physics = self.build::<dyn Physics>(&physics)?;
        let options = TimeOptions {
            end: self.time.end,
            step: self.time.step,
            stages: self.time.stages.clone(),
            safety: self.time.safety,
            log_interval: self.log_interval(),
            iteration: self.time.iteration,
        };
        let world = World::new(self.fill_bodies()?);
        let prepared =
            Simulation::prepare(world, built_couplers, built_physics, options, &self.folder);
        let mut simulation = prepared.map_err(|(culprit, e)| {
            let table = match culprit {
                Culprit::Physics(i) => &physics[i],
                Culprit::Coupler(i) => &couplers[i],
            };
            self.setup_error(table, &e)
        })?;
        self.set_initial(&mut simulation)?;
        self.check_initial_temperatures(&simulation, &physics)?;
        self.check_temperatures(&simulation)?;
        self.check_logged(&simulation)?;
        self.build_probes(&simulation)?;
        Ok(simulation)
    }

    /// Completes the initial state and refuses fixed steps above the stable ones.
    ///
    /// # Errors
    /// A mistake in the case, or a physics that cannot start.
    pub fn start(&self, simulation: &mut Simulation) -> std::result::Result<(), StartError> {
        simulation.start()?;
        simulation.check_steps().map_err(|(culprit, e)| {
            let (Culprit::Physics(i) | Culprit::Coupler(i)) = culprit;
            match self.plugin_tables("physics") {
                Ok(tables) => StartError::Case(self.setup_error(&tables[i], &e)),
                Err(e) => StartError::Case(e),
            }
        })
    }

    /// The probes of the case.
    ///
    /// # Errors
    /// The first mistake in a `[[probes]]` table.
    pub fn build_probes(&self, simulation: &Simulation) -> Result<Vec<Probe>> {
        let build = |(i, section): (usize, &ProbeSection)| {
            let taken = self.probes[..i].iter().any(|p| p.name == section.name);
            let probe = if taken || section.name == REPORTS {
                let message = format!("the time series `{}` exists already", section.name);
                Err(SetupError::value("name", message, "a different name"))
            } else {
                Probe::new(section, simulation)
            };
            probe.map_err(|e| {
                let number = i.to_string();
                let mut path = vec!["probes", number.as_str()];
                path.extend(e.key.split('.').filter(|k| !k.is_empty()));
                let header = self.place(&path[..2]).unwrap_or(0..0);
                let span = self.place(&path).unwrap_or(header.clone());
                let message = e.to_string();
                split_help(CaseError::new(&self.file, message.as_str(), span), &message)
                    .within(header, format!("in [[probes]] `{}`", section.name))
            })
        };
        self.probes.iter().enumerate().map(build).collect()
    }

    pub(super) fn plugin_tables(&self, section: &'static str) -> Result<Vec<PluginTable<'_>>> {
        let table = self.table();
        let reader = Reader {
            file: &self.file,
            table: &table,
        };
        reader.plugin_tables(section)
    }

    /// Builds the plugins of one kind, with labels that differ.
    fn build<P: ?Sized + 'static>(&self, tables: &[PluginTable<'_>]) -> Result<Vec<Named<P>>>
    where
        Registration<P>: inventory::Collect,
    {
        let known = registered::<P>();
        let mut plugins: Vec<Named<P>> = Vec::new();
        for table in tables {
            let Some(found) = known.iter().find(|r| r.name == table.kind) else {
                return Err(unknown_plugin(&self.file, table));
            };
            let plugin = self.construct(table, found.from_toml, found.schema)?;
            let label = self.label(table, |label| plugins.iter().any(|p| p.label == label))?;
            plugins.push(Named { label, plugin });
        }
        Ok(plugins)
    }

    /// The `name` of a plugin, or its type and body with a number where several are alike.
    fn label(&self, table: &PluginTable<'_>, is_taken: impl Fn(&str) -> bool) -> Result<String> {
        let keys = table.value.get_ref().as_table();
        if let Some(name) = keys.and_then(|t| t.get("name")) {
            let error = |message: String, expected: &str| {
                Err(CaseError::new(&self.file, message, name.span()).expected(expected))
            };
            return match name.get_ref().as_str() {
                Some("") | None => error("`name` is not text".into(), "expected a name in quotes"),
                Some(taken) if is_taken(taken) => {
                    let section = table.section;
                    let message = format!("another of the {section} is called `{taken}`");
                    error(message, "expected a name of its own")
                }
                Some(name) => Ok(name.to_string()),
            };
        }
        let base = match table.body() {
            Some(body) => format!("{} on {body}", table.kind),
            None => table.kind.clone(),
        };
        let mut label = base.clone();
        let mut number = 2;
        while is_taken(&label) {
            label = format!("{base} ({number})");
            number += 1;
        }
        Ok(label)
    }

    fn construct<P: ?Sized>(
        &self,
        table: &PluginTable<'_>,
        from_toml: FromToml<P>,
        schema: fn() -> Schema,
    ) -> Result<Box<P>> {
        from_toml(ValueDeserializer::from(own_keys(&table.value))).map_err(|e| {
            let empty = locate::TomlTable::new();
            let section = Section {
                file: &self.file,
                name: table.title(),
                header: table.value.span(),
                table: table.value.get_ref().as_table().unwrap_or(&empty),
                schema: schema().to_value(),
            };
            section.reword(&e)
        })
    }

    /// A mistake that a plugin found, at its key.
    fn setup_error(&self, table: &PluginTable<'_>, e: &SetupError) -> Box<CaseError> {
        let message = e.to_string();
        if let Some((material, property)) = missing_property(&e.problem)
            && let Some(section) = self.place(&["materials", material])
        {
            let error = CaseError::new(&self.file, message.as_str(), section);
            let error = split_help(error, &message).expected(format!("needs `{property}`"));
            return error.within(table.value.span(), format!("because of {}", table.title()));
        }
        let span = if e.key.is_empty() {
            table.value.span()
        } else {
            table.at(&e.key)
        };
        split_help(CaseError::new(&self.file, message.as_str(), span), &message)
            .within(table.value.span(), format!("in {}", table.title()))
    }

    fn set_initial(&self, simulation: &mut Simulation) -> Result<()> {
        for (b, (name, section)) in self.bodies.iter().enumerate() {
            for (field, initial) in &section.initial {
                let known: Vec<String> = simulation
                    .lasting()
                    .filter(|f| f.body == b)
                    .map(|f| f.name.clone())
                    .collect();
                if !known.contains(field) {
                    let message = format!(
                        "body `{name}` has no field `{field}` that can have an initial value"
                    );
                    let error = self.body_key_error(
                        &[name, "initial", field],
                        message,
                        "no physics or coupler provides it",
                    );
                    return Err(suggest(
                        error,
                        field,
                        &known.iter().map(String::as_str).collect::<Vec<_>>(),
                    ));
                }
                let place = |e: Problem, path: &[&str]| {
                    let message = e.to_string();
                    split_help(self.body_error(path, message.as_str(), ""), &message)
                };
                let points = &simulation.world().body(b).points;
                let count = points.len();
                let positions = initial.varies().then(|| points.position.clone());
                let mut set = |points, position| {
                    simulation
                        .set_initial(b, field, points, &initial.at(position))
                        .map_err(|e| place(e, &[name, "initial", field]))
                };
                match &positions {
                    None => set(0..count, [0.0; 3])?,
                    Some(positions) => {
                        for (point, position) in positions.iter().enumerate() {
                            set(point..point + 1, (*position).into())?;
                        }
                    }
                }
                for (region, value) in initial.regions() {
                    let path = [name.as_str(), "initial", field, "regions", region];
                    let Some(points) = simulation.world().body(b).regions.get(region).cloned()
                    else {
                        return Err(self.unknown_region(&path, region, section));
                    };
                    let points = points.points.iter().map(|&p| p as usize);
                    simulation
                        .set_initial(b, field, points, value.as_slice())
                        .map_err(|e| place(e, &path))?;
                }
            }
        }
        Ok(())
    }

    /// Bodies that heat up start at a temperature.
    fn check_initial_temperatures(
        &self,
        simulation: &Simulation,
        physics: &[PluginTable<'_>],
    ) -> Result<()> {
        let fields = simulation.world().fields();
        for (index, (name, section)) in self.bodies.iter().enumerate() {
            let is_of_body = |table: &PluginTable<'_>| {
                table.kind == "thermal" && table.body().is_none_or(|body| body == name)
            };
            let Some(field) = fields.find(index, "temperature") else {
                continue;
            };
            // a coupler may have set it
            let is_zero = fields.field(field).data().flat().iter().all(|t| *t == 0.0);
            if is_zero
                && !section.initial.contains_key("temperature")
                && physics.iter().any(is_of_body)
            {
                let message = format!("body `{name}` has no initial temperature");
                let error = self.body_error(&[name], message, "needs `initial.temperature`, K");
                return Err(error.help("room temperature is `initial.temperature = 293.15`"));
            }
        }
        Ok(())
    }

    /// Fields to log exist.
    fn check_logged(&self, simulation: &Simulation) -> Result<()> {
        for (i, field) in self.log.fields.iter().flatten().enumerate() {
            let mut known: Vec<&str> = simulation.lasting().map(|f| f.name.as_str()).collect();
            known.dedup();
            if !known.contains(&field.as_str()) {
                let error = self.error_at(
                    &format!("log.fields.{i}"),
                    format!("no body has a field `{field}` that can be logged"),
                    "no physics or coupler provides it",
                );
                return Err(suggest(error, field, &known));
            }
        }
        Ok(())
    }
}

impl<'i> Reader<'_, 'i> {
    /// The tables of a section of plugins.
    pub(super) fn plugin_tables(&self, section: &'static str) -> Result<Vec<PluginTable<'i>>> {
        let check = |value: &TomlValue<'_>| -> Result<()> {
            let table = value.get_ref().as_table();
            match table.and_then(|t| t.get("type")) {
                None => Err(CaseError::new(
                    self.file,
                    format!("key `type` is missing in [[{section}]]"),
                    value.span(),
                )
                .expected("needs `type = \"...\"`")
                .help(format!("known here: {}", plugin_names(section).join(", ")))),
                Some(kind) if !kind.get_ref().is_str() => {
                    Err(CaseError::new(self.file, "`type` is not text", kind.span())
                        .expected("expected a name in quotes"))
                }
                Some(_) => Ok(()),
            }
        };
        let mut tables = Vec::new();
        for value in self.list(section)? {
            check(value)?;
            let table = value.get_ref().as_table();
            let kind = table
                .and_then(|t| t.get("type")?.get_ref().as_str())
                .unwrap_or("");
            tables.push(PluginTable {
                section,
                kind: kind.to_string(),
                value: value.clone(),
            });
        }
        Ok(tables)
    }

    /// Refuses plugins that this program does not have. Their absence has other consequences, such as unknown material
    /// properties, which are no mistakes of the case.
    pub(super) fn check_plugin_names(&self) -> Result<()> {
        for section in ["physics", "couplers"] {
            let known = plugin_names(section);
            let mut tables = self.plugin_tables(section)?.into_iter();
            if let Some(table) = tables.find(|t| !known.contains(&t.kind.as_str())) {
                return Err(unknown_plugin(self.file, &table));
            }
        }
        Ok(())
    }
}

fn unknown_plugin(file: &Arc<CaseFile>, table: &PluginTable<'_>) -> Box<CaseError> {
    let (kind, other) = match table.section {
        "physics" => ("physics", "couplers"),
        _ => ("coupler", "physics"),
    };
    let span = table.at("type");
    let message = format!("no {kind} is called `{}`", table.kind);
    let error = CaseError::new(file, message, span).expected("no such type");
    if plugin_names(other).contains(&table.kind.as_str()) {
        return error.help(format!(
            "`{}` belongs to a section headed `[[{other}]]`",
            table.kind
        ));
    }
    suggest(error, &table.kind, &plugin_names(table.section))
}

impl PluginTable<'_> {
    fn title(&self) -> String {
        format!("[[{}]] `{}`", self.section, self.kind)
    }

    /// Name of its body, where the table gives it.
    pub(super) fn body(&self) -> Option<&str> {
        let keys = self.value.get_ref().as_table()?;
        keys.get("body")?.get_ref().as_str()
    }

    /// Place of a dotted key's value, or of the header when it is not written.
    fn at(&self, key: &str) -> std::ops::Range<usize> {
        let path: Vec<&str> = key.split('.').collect();
        let table = self.value.get_ref().as_table();
        let place = table.and_then(|t| locate::find(t, &path));
        place.map_or(self.value.span(), |p| p.value)
    }
}

/// Material and property of a mistake that belongs to a `[materials]` section.
fn missing_property(problem: &Problem) -> Option<(&str, &str)> {
    match problem {
        Problem::MissingProperty {
            material, property, ..
        } => Some((material, property)),
        Problem::Other(cause) => match cause.downcast_ref() {
            Some(MaterialError::Missing { material, property }) => Some((material, property)),
            _ => None,
        },
        _ => None,
    }
}

/// Registered types of a section.
pub(crate) fn plugin_names(section: &str) -> Vec<&'static str> {
    if section == "physics" {
        registered::<dyn Physics>().iter().map(|r| r.name).collect()
    } else {
        registered::<dyn Coupler>().iter().map(|r| r.name).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(stages: &str) -> Result<Case> {
        let text = format!(
            "[bodies.bar]
            shape.box = {{ min = [0, 0, 0], max = [0.1, 0.01, 0.01] }}
            dimension = 1
            spacing = 0.01
            material = 'steel'
            initial.temperature = 300
            [materials.steel]
            density = 8000
            specific_heat = 500
            conductivity = 40
            [[physics]]
            type = 'thermal'
            horizon = 1
            solver = 'crank_nicolson'
            [time]
            end = 10
            step = 0.5
            stages = {stages}
            [log]
            interval = 10"
        );
        Case::parse("bar.toml", text, Path::new(""))
    }

    #[test]
    fn each_stage_has_its_macro_step_and_starts_with_one() {
        let case = parse("[{ from = 1.2, step = 2 }, { from = 5.2, step = 0.4 }]").expect("valid");
        let mut simulation = case.compose().expect("valid");
        case.start(&mut simulation).expect("it starts");
        let mut times = Vec::new();
        while !simulation.is_finished() {
            simulation.step().expect("a step");
            times.push((simulation.time() * 10.0).round() / 10.0);
        }
        // up to a stage steps are equal and not longer than asked for
        let mut expected = vec![0.4, 0.8, 1.2, 3.2];
        expected.extend((0..=12).map(|n| (52 + 4 * n) as f64 / 10.0));
        assert_eq!(times, expected);
    }

    #[test]
    fn stages_in_disorder_or_outside_of_the_run_are_refused() {
        for stages in [
            "[{ from = 5, step = 1 }, { from = 5, step = 2 }]",
            "[{ from = 0, step = 1 }]",
            "[{ from = 10, step = 1 }]",
            "[{ from = nan, step = 1 }]",
        ] {
            let message = parse(stages).expect_err("out of order").render(false);
            assert!(
                message.contains("a stage of `time.stages` cannot start at"),
                "{message}"
            );
        }
    }
}
