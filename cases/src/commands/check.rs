//! `perimelt check`: all checks of a case, and an estimate of its duration.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::body::Lattice;
use perimelt_core::{Body, Simulation};

use super::Done;
use crate::case::Case;
use crate::plot::unit;
use crate::run::Failure;
use crate::run::display::{duration, warn};

#[derive(clap::Args, Debug)]
pub struct CheckArgs {
    /// The case file
    case: PathBuf,
}

pub fn run(args: &CheckArgs) -> Done {
    let case = Case::read(&args.case)?;
    let mut simulation = case.compose()?;
    case.start(&mut simulation).map_err(Failure::from)?;
    let mut out = std::io::stdout().lock();
    if !case.case.title.is_empty() {
        writeln!(out, "{}\n", case.case.title)?;
    }
    sizes(&simulation, &mut out)?;
    steps(&simulation, &mut out)?;
    duration_of(&mut simulation, &mut out)?;
    warn(&case.warnings(&simulation)?);
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
                format!("{x} x {y} x {z} cells of {}", unit::length_text(*spacing))
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
                bytes(family.memory)
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
        bytes(total)
    )?;
    Ok(())
}

/// A length (m) that depends on the spacing, from the finest to the coarsest of a body.
fn span(body: &Body, length: impl Fn(f64) -> f64) -> String {
    let (least, most) = (
        length(body.finest_spacing()),
        length(body.coarsest_spacing()),
    );
    let [from, to] = [least, most].map(unit::length_text);
    match least == most {
        true => from,
        false => format!("{from} to {to}"),
    }
}

fn steps(simulation: &Simulation, out: &mut impl Write) -> Done {
    let sub_steps = simulation.sub_steps().iter().zip(simulation.stable_steps());
    for (label, (&step, stable)) in simulation.physics_labels().zip(sub_steps) {
        let stable = stable.map_or("stable at any step".into(), |s| {
            format!("largest stable step {}", unit::time_text(s))
        });
        let step = if step.is_finite() {
            unit::time_text(step)
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
        unit::time_text(macro_step.min(log)),
        (end / log * per_log).ceil(),
        unit::time_text(end)
    )?;
    writeln!(
        out,
        "logged states: {:.0}\n",
        (end / log - 1e-9).ceil() + 1.0
    )?;
    Ok(())
}

/// Measures the wall time of a few steps, whose results are discarded.
fn duration_of(simulation: &mut Simulation, out: &mut impl Write) -> Done {
    const STEPS: usize = 3;
    const ENOUGH_SECONDS: f64 = 2.0;
    // the first step warms caches and threads
    simulation.step()?;
    let (from, started) = (simulation.time(), Instant::now());
    for _ in 0..STEPS {
        if simulation.is_finished() || started.elapsed().as_secs_f64() > ENOUGH_SECONDS {
            break;
        }
        simulation.step()?;
    }
    let simulated = simulation.time() - from;
    if simulated > 0.0 {
        let left = started.elapsed().as_secs_f64() * simulation.options().end / simulated;
        writeln!(
            out,
            "estimated duration: {} on {} threads, without the log",
            duration(left),
            rayon::current_num_threads()
        )?;
    }
    Ok(())
}

fn bytes(count: usize) -> String {
    match count as f64 {
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.2} GB", b / 1e9),
    }
}
