//! Tables of places and powers in time: `csv` with linear powers between rows, `events` with powers that hold until the next row.

use super::columns::{Layout, Numbers, Quantity};
use crate::toolpath::track::TrackBuilder;
use crate::toolpath::{Track, WaitUntil};
use perimelt_core::SetupError;

use Quantity::{Time, Wait, X, Y, Z};

/// Rows with linear powers between them.
pub(super) static CSV: Layout = Layout {
    header: "time,x,y,z,power",
    needs_header: true,
    needed: &[Time, X, Y, Z],
    optional: &[Wait],
    needs_power: false,
};

/// Rows whose powers hold until the next row.
pub(super) static EVENTS: Layout = Layout {
    header: "time,x,y,z,power",
    needs_header: false,
    needed: &[Time, X, Y, Z],
    optional: &[],
    needs_power: true,
};

/// Power between two rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    /// Linear.
    Linear,
    /// The power of the earlier row holds.
    Held,
}

/// The path through the rows; rows with a wait begin a pass with `wait`.
pub(super) fn timed(
    numbers: &Numbers<'_>,
    power: Option<f64>,
    wait: Option<&WaitUntil>,
    between: Between,
) -> Result<Track, SetupError> {
    let mut track: Option<TrackBuilder> = None;
    let mut last: Option<(f64, f64)> = None;
    let mut ramps = Ramps::default();
    for row in &numbers.rows {
        let time = numbers.need(row, Time)?;
        let place = numbers.place(row)?;
        let power = numbers.power(row, power)?;
        let track = track.get_or_insert_with(|| TrackBuilder::new(time, place));
        if let Some((before, power_before)) = last {
            if time < before {
                let line = numbers.line(row);
                let message = format!("{line}: time {time} s comes after {before} s");
                return Err(SetupError::value(
                    "file",
                    message,
                    "times that do not decrease",
                ));
            }
            let is_move = track.position() != place;
            ramps.add([power_before, power], time > before && is_move);
            let powers = match between {
                Between::Linear => [power_before, power],
                Between::Held => [power_before; 2],
            };
            track.glide(place, time - before, powers);
        }
        last = Some((time, power));
        if numbers.get(row, Wait)?.is_some_and(|w| w > 0.0) {
            if wait.is_none() {
                let message = format!("{} has a `wait`", numbers.line(row));
                return Err(SetupError::value(
                    "file",
                    message,
                    "`wait_until` in the toolpath",
                ));
            }
            track.begin_pass(wait);
        }
    }
    if let Some(track) = &mut track {
        match (between, last) {
            (Between::Linear, _) if ramps.resemble_switching() => track.warn(format!(
                "in the toolpath table {} the power rises and falls linearly while the source moves between rows; with `format = \
                 \"events\"` the power of a row holds until the next one",
                numbers.path().display()
            )),
            (Between::Held, Some((_, power))) if power > 0.0 => track.warn(format!(
                "the last row of the toolpath table {} has power, which ends there",
                numbers.path().display()
            )),
            _ => {}
        }
    }
    track
        .and_then(TrackBuilder::finish)
        .ok_or_else(|| numbers.too_short())
}

/// Ramps of the power, by which a table with linear powers resembles one whose powers hold until the next row.
#[derive(Default)]
struct Ramps {
    /// First power above 0, W.
    level: Option<f64>,
    /// Whether there is another power above 0.
    has_levels: bool,
    /// Whether the power rises from 0 or falls to 0 during a move.
    has_ramps: bool,
}

impl Ramps {
    fn add(&mut self, [from, to]: [f64; 2], is_move: bool) {
        for power in [from, to].into_iter().filter(|p| *p > 0.0) {
            let level = *self.level.get_or_insert(power);
            self.has_levels |= level != power;
        }
        self.has_ramps |= is_move && (from == 0.0) != (to == 0.0);
    }

    fn resemble_switching(&self) -> bool {
        !self.has_levels && self.has_ramps
    }
}
