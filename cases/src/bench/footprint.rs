//! Memory and set-up of cases with other numbers of points.
//!
//! Each row is measured by a program of its own, since the largest memory of a program does not fall.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use perimelt_core::Simulation;
use serde::{Deserialize, Serialize};

use crate::case::Case;
use crate::case::change::Change;
use crate::run::estimate::estimate;
use crate::run::log_size::LogSize;
use crate::run::{Failure, on_workers};
use crate::unit::bytes;

/// What a case takes.
#[derive(Serialize, Deserialize)]
struct Footprint {
    points: usize,
    /// Time from the file to the first step, s.
    set_up: f64,
    /// Largest memory of a run, bytes; `None` where the operating system does not report it.
    memory: Option<f64>,
}

/// A program that could not measure a case.
#[derive(Debug, thiserror::Error)]
#[error("{case} could not be measured")]
struct NotMeasured {
    case: String,
}

/// Measures a case in this program and prints the result for [`write`].
pub(super) fn measure(
    path: &Path,
    changes: &[Change],
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    let case = Case::read(path)?.changed(changes)?;
    let found = on_workers(|| Footprint::of(&case, |_| ()).map_err(|error| error.to_string()))?;
    writeln!(out, "{}", serde_json::to_string(&found)?)?;
    Ok(())
}

impl Footprint {
    /// Measures a case; `observe` sees it after some steps.
    fn of(case: &Case, observe: impl FnOnce(&Simulation)) -> Result<Footprint, Box<dyn Error>> {
        let start = Instant::now();
        let mut simulation = case.compose()?;
        case.start(&mut simulation).map_err(Failure::from)?;
        let set_up = start.elapsed().as_secs_f64();
        let size = LogSize::new(case, &simulation)?;
        Ok(Footprint {
            points: points(&simulation),
            set_up,
            memory: estimate(case, simulation, &size, observe)?.memory,
        })
    }
}

/// Number of points of all bodies.
fn points(simulation: &Simulation) -> usize {
    let bodies = simulation.world().bodies().iter();
    bodies.map(|body| body.points.len()).sum()
}

/// Prints a row for each case and number of points: about so many, by another spacing of all bodies.
pub(super) fn write(
    cases: &[std::path::PathBuf],
    counts: &[f64],
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    writeln!(
        out,
        "Time from the case file to the first step, on one thread, and largest memory of a run with its log; by `perimelt bench`\n\
         with cases.\n\n\
         | case | points | set-up, us a point | memory | bytes a point |\n|---|---|---|---|---|"
    )?;
    for path in cases {
        let case = Case::read(path)?;
        let shown = case.file_name();
        let as_given = case.compose()?;
        let bodies: Vec<(String, f64, i32)> = (as_given.world().bodies().iter())
            .map(|b| (b.name.clone(), b.coarsest_spacing(), b.dimension as i32))
            .collect();
        let now = points(&as_given);
        drop(as_given);
        let wanted = match counts {
            [] => vec![now as f64],
            counts => counts.to_vec(),
        };
        for wanted in wanted {
            let changes = bodies.iter().filter(|_| wanted != now as f64);
            let changes = changes.map(|(name, spacing, dimension)| {
                let ratio = (now as f64 / wanted).powf(1.0 / f64::from(*dimension));
                format!("bodies.{name}.spacing={:e}", spacing * ratio)
            });
            let Footprint {
                points,
                set_up,
                memory,
            } = apart(path, changes).ok_or_else(|| NotMeasured {
                case: shown.to_string(),
            })?;
            let each = |total: f64| total / points as f64;
            let [memory, per_point] = match memory {
                Some(memory) => [bytes(memory), format!("{:.0}", each(memory))],
                None => ["".into(), "".into()],
            };
            let set_up = each(1e6 * set_up);
            writeln!(
                out,
                "| `{shown}` | {points} | {set_up:.2} | {memory} | {per_point} |"
            )?;
            out.flush()?;
        }
    }
    Ok(())
}

/// Measures a case in another program, on one thread. The program tells mistakes itself.
fn apart(path: &Path, changes: impl Iterator<Item = String>) -> Option<Footprint> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.arg("bench").arg("--alone").arg(path);
    changes.for_each(|change| {
        command.arg("--set").arg(change);
    });
    command
        .env("RAYON_NUM_THREADS", "1")
        .stderr(Stdio::inherit());
    let printed = command.output().ok()?.stdout;
    serde_json::from_slice(&printed).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions and sizes that follow a rule need no list for a run with a log.
    #[test]
    fn points_of_lattices_take_no_memory() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("performance");
        for (name, spacing) in [
            ("heat-block", "0.01"),
            ("block-47-bond", "2.35e-3"),
            ("block-47-ordinary", "2.35e-3"),
        ] {
            let case = Case::read(&folder.join(name).with_extension("toml")).expect("valid");
            let change = |text: String| text.parse::<Change>().expect("a change");
            let changes = [format!("bodies.block.spacing={spacing}")].map(change);
            let case = case.changed(&changes).expect("valid");
            let observe = |simulation: &Simulation| {
                let body = simulation.world().body(0);
                let lattice = body.lattice().expect("a lattice");
                assert_eq!((body.points.memory(), lattice.memory()), (0, 0), "{name}");
            };
            let found = Footprint::of(&case, observe).expect("it runs");
            assert_eq!(found.points, 1000, "{name}");
        }
    }
}
