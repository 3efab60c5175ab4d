//! `perimelt check`: all checks of a case, and estimates of its duration and of the size of its log.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use perimelt_core::body::Lattice;
use perimelt_core::{Body, Simulation};

use super::run::Machine;
use super::{Done, threads};
use crate::case::Case;
use crate::case::change::Change;
use crate::run::estimate::{Estimate, estimate};
use crate::run::log_size::LogSize;
use crate::run::outcome::RunOutcome;
use crate::run::{Failure, log_of};
use crate::terminal::warn;
use crate::unit::bytes;
use crate::unit::duration;
use crate::unit::{length_text, time_text};

#[derive(clap::Args, Debug)]
pub struct CheckArgs {
    /// The case file
    case: PathBuf,
    /// Another value of a key, as TOML, such as `couplers.goldak.power=2000`; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Change>,
    #[command(flatten)]
    machine: Machine,
}

pub fn run(args: &CheckArgs) -> Done {
    args.machine.take()?;
    let case = args
        .machine
        .limited(Case::read(&args.case)?.changed(&args.set)?);
    let mut simulation = case.compose()?;
    case.start(&mut simulation).map_err(Failure::from)?;
    let mut out = crate::terminal::output();
    if !case.case.title.is_empty() {
        writeln!(out, "{}\n", case.case.title)?;
    }
    sizes(&simulation, &mut out)?;
    steps(&simulation, &mut out)?;
    for note in simulation.notes() {
        writeln!(out, "{} {}", note.plugin, note.message)?;
    }
    let size = LogSize::new(&case, &simulation)?;
    log_size(&size, &mut out)?;
    // warnings about the initial state
    let mut warnings = case.warnings(&simulation)?;
    warnings.extend(size.warning(&log_of(&args.case)));
    warn(&warnings);
    let mut outcome = RunOutcome::new(&simulation);
    let mut warnings = Vec::new();
    let observe = |simulation: &Simulation| {
        outcome.observe(simulation);
        warnings = outcome.sentences(simulation).1;
    };
    let estimate = watched(|| estimate(&case, simulation, &size, observe))?;
    duration_of(&estimate, &mut out)?;
    warn(&warnings);
    Ok(())
}

fn sizes(simulation: &Simulation, out: &mut impl Write) -> Done {
    let world = simulation.world();
    let mut total = 0;
    for (index, body) in world.bodies().iter().enumerate() {
        let cells = match body.lattice() {
            Some(Lattice {
                cells: [x, y, z],
                spacing,
                ..
            }) => {
                format!("{x} x {y} x {z} cells of {}", length_text(*spacing))
            }
            None => format!("cells of {}", span(body, |spacing| spacing)),
        };
        writeln!(
            out,
            "body {}: {} points in {cells}, {}D",
            body.name,
            body.points.len(),
            body.dimension
        )?;
        for material in &body.materials {
            writeln!(out, "    material {}", material.name())?;
        }
        for (name, region) in &body.regions {
            writeln!(out, "    region {name}: {} points", region.points.len())?;
        }
        for family in simulation.family_sizes().iter().filter(|f| f.body == index) {
            let length = span(body, |spacing| family.horizon.of(spacing));
            let ratio = |spacing: f64| format!("{:.4}", family.horizon.of(spacing) / spacing);
            let (fine, coarse) = (ratio(body.finest_spacing()), ratio(body.coarsest_spacing()));
            let ratio = if fine == coarse {
                fine
            } else {
                format!("{coarse} to {fine}")
            };
            writeln!(
                out,
                "    family of horizon {length} ({ratio} spacings): {} bonds, {}",
                family.bonds,
                bytes(family.memory as f64)
            )?;
            total += family.memory;
        }
        total += body.points.memory() + body.lattice().map_or(0, Lattice::memory);
        total += size_of_val(&*body.material_of_point);
    }
    total += world
        .fields()
        .iter()
        .map(|f| 8 * f.data().flat().len())
        .sum::<usize>();
    writeln!(
        out,
        "memory of points, fields and families: {}\n",
        bytes(total as f64)
    )?;
    Ok(())
}

/// A length (m) that depends on the spacing, from the finest to the coarsest of a body.
fn span(body: &Body, length: impl Fn(f64) -> f64) -> String {
    let (least, most) = (
        length(body.finest_spacing()),
        length(body.coarsest_spacing()),
    );
    if least == most {
        length_text(least)
    } else {
        format!("{} to {}", length_text(least), length_text(most))
    }
}

fn steps(simulation: &Simulation, out: &mut impl Write) -> Done {
    let sub_steps = simulation.sub_steps().iter().zip(simulation.stable_steps());
    for (label, (&step, stable)) in simulation.physics_labels().zip(sub_steps) {
        let stable = stable.map_or("stable at any step".into(), |s| {
            format!("largest stable step {}", time_text(s))
        });
        let step = if step.is_finite() {
            time_text(step)
        } else {
            "the macro step".into()
        };
        writeln!(out, "physics {label}: {stable}, takes {step}")?;
    }
    let (macro_step, end) = (simulation.macro_step(), simulation.options().end);
    let log = simulation.next_log() - simulation.time();
    let left = simulation.remaining();
    writeln!(
        out,
        "macro steps: up to {}, about {:.0} until {}",
        time_text(macro_step.min(log)),
        left.macro_steps,
        time_text(end)
    )?;
    writeln!(out, "logged states: {:.0}\n", left.logs + 1.0)?;
    Ok(())
}

/// Size of the log before compression.
fn log_size(size: &LogSize, out: &mut impl Write) -> Done {
    writeln!(
        out,
        "log: at most {} before compression: {:.0} states of {}, {:.0} checkpoints of {}",
        bytes(size.total()),
        size.states,
        bytes(size.state as f64),
        size.checkpoints,
        bytes(size.checkpoint as f64)
    )?;
    Ok(())
}

/// Longest time for an estimate, s. A step of a static body may take hours.
const LONGEST_ESTIMATE: f64 = 20.0;

/// Does `work`, or ends the program without an error if that takes too long: a step cannot be interrupted.
fn watched<T>(work: impl FnOnce() -> T) -> T {
    let is_done = Arc::new(AtomicBool::new(false));
    let watched = is_done.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs_f64(LONGEST_ESTIMATE));
        if !watched.load(Ordering::Relaxed) {
            println!(
                "duration: not estimated, since one step takes longer than {LONGEST_ESTIMATE} s"
            );
            std::process::exit(0);
        }
    });
    let result = work();
    is_done.store(true, Ordering::Relaxed);
    result
}

/// Duration and memory of the run, from some of its steps.
fn duration_of(estimate: &Estimate, out: &mut impl Write) -> Done {
    if let Some(memory) = estimate.memory {
        writeln!(out, "memory of the program: {}", bytes(memory))?;
    }
    let threads = threads(rayon::current_num_threads());
    let log = if estimate.with_log {
        "with the log"
    } else {
        "without the log"
    };
    let time = duration(estimate.duration);
    if estimate.is_finished {
        writeln!(out, "duration: {time} on {threads}, {log}")?;
        return Ok(());
    }
    let simulated = time_text(estimate.measured_until);
    writeln!(
        out,
        "estimated duration: {time} on {threads}, {log}, from the steps up to t = {simulated}"
    )?;
    if !estimate.unmeasured.is_empty() {
        let names = estimate.unmeasured.join(", ");
        writeln!(
            out,
            "    without {names}: the first update needs longer than is measured here"
        )?;
    }
    Ok(())
}
