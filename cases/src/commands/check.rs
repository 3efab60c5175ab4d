//! `perimelt check`: all checks of a case, and estimates of its duration and of the size of its log.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use perimelt_core::body::Lattice;
use perimelt_core::{Body, Simulation};

use super::run::Machine;
use super::{Done, threads};
use crate::case::Case;
use crate::case::change::Change;
use crate::plot::unit::{length_text, time_text};
use crate::run::display::{duration, warn};
use crate::run::log_size::{LogSize, bytes};
use crate::run::outcome::Outcome;
use crate::run::{Failure, log_of};

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
    args.machine.set_threads()?;
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
    // of the initial state
    let mut warnings = case.warnings(&simulation)?;
    warnings.extend(size.warning(&log_of(&args.case)));
    warn(&warnings);
    let mut outcome = Outcome::new(&simulation);
    watched(|| duration_of(&mut simulation, &mut out))?;
    outcome.observe(&simulation);
    warn(&outcome.sentences(&simulation).1);
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
        // position and volume
        total += 32 * body.points.len();
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
    let log = simulation.options().log_interval;
    let per_log = (log / macro_step).ceil().max(1.0);
    writeln!(
        out,
        "macro steps: up to {}, about {:.0} until {}",
        time_text(macro_step.min(log)),
        (end / log * per_log).ceil(),
        time_text(end)
    )?;
    writeln!(
        out,
        "logged states: {:.0}\n",
        (end / log - 1e-9).ceil() + 1.0
    )?;
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

/// Does `work`, or ends the program in peace if that takes too long: a step cannot be interrupted.
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

/// Wall time in which steps are measured, s.
const MEASURED_SECONDS: f64 = 4.0;

/// Runs the case for some seconds, or to its end, and discards the results. The cost of a step grows while a body heats up and
/// yields, so that the first steps say little: the remaining time is that of the steps in the last third of the
/// measured time.
fn duration_of(simulation: &mut Simulation, out: &mut impl Write) -> Done {
    let started = Instant::now();
    let elapsed = || started.elapsed().as_secs_f64();
    // simulated time and wall time
    let mut steps = vec![(simulation.time(), 0.0)];
    while !simulation.is_finished() && elapsed() < MEASURED_SECONDS {
        simulation.step()?;
        steps.push((simulation.time(), elapsed()));
    }
    let end = simulation.options().end;
    let total = estimate(&steps, end);
    let simulated = time_text(simulation.time());
    let threads = threads(rayon::current_num_threads());
    match total {
        Some(total) if simulation.is_finished() => writeln!(
            out,
            "duration: {} on {threads}, without the log",
            duration(total)
        )?,
        Some(total) => writeln!(
            out,
            "estimated duration: {} on {threads}, without the log, from the steps up to t = {simulated}",
            duration(total)
        )?,
        None => {}
    }
    Ok(())
}

/// Wall time (s) of a run up to the simulated time `end` (s), from simulated and wall times (s) of its first steps.
fn estimate(steps: &[(f64, f64)], end: f64) -> Option<f64> {
    let &(time, wall) = steps.last()?;
    let is_late = |step: &&(f64, f64)| step.1 >= 2.0 / 3.0 * wall;
    // one step may take longer than all others
    let index = steps.iter().position(|step| is_late(&step))?;
    let (early_time, early_wall) = steps[index.min(steps.len().checked_sub(2)?)];
    let rate = (wall - early_wall) / (time - early_time);
    Some(wall + rate * (end - time)).filter(|total| total.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_steps_tell_the_duration() {
        // steps of 1 s take 0.1 s, later 0.5 s
        let steps = [(0.0, 0.0), (1.0, 0.1), (2.0, 0.6), (3.0, 1.1), (4.0, 1.6)];
        let total = estimate(&steps, 10.0).expect("an estimate");
        assert!((total - 4.6).abs() < 1e-12, "{total}");
        // finished
        assert_eq!(estimate(&steps, 4.0), Some(1.6));
        assert_eq!(estimate(&[(0.0, 0.0), (1.0, 9.0)], 10.0), Some(90.0));
        assert_eq!(estimate(&[(0.0, 0.0)], 10.0), None);
    }
}
