//! Display of progress: a bar in a terminal, a line every few seconds elsewhere.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use perimelt_core::Simulation;

use super::outcome::hottest;

use crate::terminal::tell;
use crate::unit::{self, duration};

/// Shows the progress of a run.
pub struct Display {
    bar: Option<ProgressBar>,
    quiet: bool,
    end: f64,
    started: Instant,
    /// Steps that had been made then.
    steps: f64,
    shown: Instant,
}

/// Macro steps and those of all physics within them.
fn steps_so_far(simulation: &Simulation) -> f64 {
    let progress = simulation.progress();
    (progress.macro_steps + progress.sub_steps.iter().sum::<u64>()) as f64
}

/// The bar counts in these parts of the simulated time.
const PARTS: f64 = 1000.0;

impl Display {
    /// A display for a run that continues from the state of `simulation`.
    pub fn new(simulation: &Simulation, until: f64, quiet: bool) -> Display {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {msg}");
            let bar = ProgressBar::new(PARTS as u64);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let now = Instant::now();
        Display {
            bar,
            quiet,
            end: simulation.options().end.min(until),
            started: now,
            steps: steps_so_far(simulation),
            shown: now,
        }
    }

    /// Shows the state after a step, if the last time is long enough ago.
    pub fn update(&mut self, simulation: &Simulation) {
        let pause = if self.bar.is_some() {
            Duration::from_millis(100)
        } else {
            Duration::from_secs(5)
        };
        if self.quiet || self.shown.elapsed() < pause {
            return;
        }
        self.shown = Instant::now();
        let time = simulation.time();
        // a step while a part cools is as long as hundreds of those in which it is welded
        let made = steps_so_far(simulation) - self.steps;
        let ahead = simulation.steps_between(time, self.end);
        let ahead = ahead.macro_steps + ahead.sub_steps.iter().sum::<f64>();
        let left = self.started.elapsed().as_secs_f64() * ahead / made.max(1.0);
        let step = simulation.progress().last_step;
        let peak = hottest(simulation).map(|(_, t)| t).reduce(f64::max);
        let peak = peak.map_or(String::new(), |t| format!("peak {t:.0} K, "));
        let message = format!(
            "t = {} of {}, step {}, {peak}{} left",
            unit::time_text(time),
            unit::time_text(self.end),
            unit::time_text(step),
            duration(left)
        );
        match &self.bar {
            Some(bar) => {
                bar.set_position((PARTS * time / self.end) as u64);
                bar.set_message(message);
            }
            None => tell(&format!("{:5.1} %  {message}", 100.0 * time / self.end)),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
