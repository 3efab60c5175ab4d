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
    start: f64,
    end: f64,
    started: Instant,
    shown: Instant,
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
            start: simulation.time(),
            end: simulation.options().end.min(until),
            started: now,
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
        let elapsed = self.started.elapsed().as_secs_f64();
        let left = elapsed * ((self.end - time) / (time - self.start)).max(0.0);
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
