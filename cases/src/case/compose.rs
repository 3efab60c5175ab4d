//! Composes a simulation from a case.

use perimelt_core::material::MaterialError;
use perimelt_core::simulation::{Culprit, TimeOptions};
use perimelt_core::transport::Processes;
use perimelt_core::{Problem, RunError, SetupError, Simulation, World, folder};

use super::bodies::suggest;
use super::error::{CaseError, Mistake, Mistakes};
use super::plugins::{PluginTable, Plugins};
use super::reader::Reader;
use super::{Case, Result};
use crate::log_names::REPORTS;
use crate::probe::{Probe, ProbeSection};

/// Why a composed case cannot start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A mistake in the case file.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// A physics cannot start.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl Case {
    /// Fills bodies, builds and prepares plugins, sets initial fields: everything but the
    /// start of the run. No file is written.
    ///
    /// # Errors
    /// The mistakes in the tables of plugins and bodies, else those that plugins find, else those of initial fields, of
    /// the log and of probes.
    pub fn compose(&self) -> Result<Simulation, CaseError> {
        self.compose_shared(Processes::ALONE)
    }

    /// [`Case::compose`] for one of the processes that share the run.
    ///
    /// # Errors
    /// See [`Case::compose`].
    pub fn compose_shared(&self, processes: Processes) -> Result<Simulation, CaseError> {
        let table = self.table();
        let mut reader = Reader::new(&self.file, &table);
        let plugins = folder::within(&self.folder, || reader.plugins());
        let bodies = reader.mistakes.collect(self.fill_bodies());
        let bodies = bodies.unwrap_or_default();
        let (Plugins { couplers, physics }, bodies) = reader.finish((plugins, bodies))?;
        let (couplers, coupler_tables): (_, Vec<_>) = couplers.into_iter().unzip();
        let (physics, physics_tables): (_, Vec<_>) = physics.into_iter().unzip();
        let options = TimeOptions {
            end: self.time.end,
            step: self.time.step,
            stages: self.time.stages.clone(),
            safety: self.time.safety,
            log: self.log_times(),
            iteration: self.time.iteration,
        };
        let world = World::new(bodies).shared_by(processes);
        let prepared = Simulation::prepare(world, couplers, physics, options, &self.folder);
        let mut mistakes = Mistakes::default();
        let mut simulation = match prepared {
            Ok(simulation) => simulation,
            Err(faults) => {
                for (culprit, e) in faults {
                    let table = match culprit {
                        Culprit::Physics(i) => &physics_tables[i],
                        Culprit::Coupler(i) => &coupler_tables[i],
                    };
                    mistakes.add(self.setup_error(table, &e));
                }
                return Err(mistakes.into());
            }
        };
        if mistakes
            .collect(self.set_initial(&mut simulation))
            .is_some()
        {
            mistakes.collect(self.check_initial_temperatures(&simulation, &physics_tables));
            mistakes.collect(self.check_temperatures(&simulation));
            mistakes.collect(self.check_contradictions(&simulation));
        }
        mistakes.collect(self.check_logged(&simulation));
        if simulation.world().processes().rank() == 0 {
            mistakes.collect(self.build_probes(&simulation));
        }
        mistakes.finish(simulation)
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
                Ok(tables) => StartError::Case(self.setup_error(&tables[i], &e).into()),
                Err(e) => StartError::Case(e),
            }
        })
    }

    /// The probes of the case.
    ///
    /// # Errors
    /// The mistakes in `[[probes]]` tables.
    pub fn build_probes(&self, simulation: &Simulation) -> Result<Vec<Probe>, CaseError> {
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
                Mistake::explained(&self.file, e.problem.explain(), span)
                    .within(header, format!("in [[probes]] `{}`", section.name))
            })
        };
        let mut mistakes = Mistakes::default();
        let probes = self.probes.iter().enumerate().map(build);
        let probes = probes.filter_map(|probe| mistakes.collect(probe)).collect();
        mistakes.finish(probes)
    }

    /// A mistake that a plugin found, at its key.
    fn setup_error(&self, table: &PluginTable<'_>, e: &SetupError) -> Box<Mistake> {
        let words = e.problem.explain();
        if let Some((material, property)) = missing_property(&e.problem)
            && let Some(section) = self.place(&["materials", material])
        {
            let error = Mistake::explained(&self.file, words, section);
            let error = error.expected(format!("needs `{property}`"));
            return error.within(table.value.span(), format!("because of {}", table.title()));
        }
        let span = if e.key.is_empty() {
            table.value.span()
        } else {
            table.at(&e.key)
        };
        Mistake::explained(&self.file, words, span)
            .within(table.value.span(), format!("in {}", table.title()))
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
    fn check_logged(&self, simulation: &Simulation) -> Result<(), CaseError> {
        let mut mistakes = Mistakes::default();
        for (i, field) in self.log.fields.iter().flatten().enumerate() {
            let mut known: Vec<&str> = simulation.lasting().map(|f| f.name.as_str()).collect();
            known.dedup();
            if !known.contains(&field.as_str()) {
                let error = self.error_at(
                    &format!("log.fields.{i}"),
                    format!("no body has a field `{field}` that can be logged"),
                    "no physics or coupler provides it",
                );
                mistakes.add(suggest(error, field, &known));
            }
        }
        mistakes.finish(())
    }
}

/// Material and property of a mistake that belongs to a `[materials]` section.
fn missing_property(problem: &Problem) -> Option<(&str, &str)> {
    match problem {
        Problem::MissingProperty {
            material, property, ..
        }
        | Problem::MissingConstant {
            material, property, ..
        } => Some((material, property)),
        Problem::Other(cause) => match cause.downcast_ref() {
            Some(MaterialError::Missing { material, property }) => Some((material, property)),
            _ => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(stages: &str) -> Result<Case, CaseError> {
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
        // steps up to a stage are equal and not longer than the given one
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
        ] {
            let message = parse(stages).expect_err("out of order").render(false);
            assert!(
                message.contains("a stage of `time.stages` cannot start at"),
                "{message}"
            );
        }
    }
}
