//! Scan paths of other programs and machines.
//!
//! - Segments (`additivefoam`, `adamantine`, `3dthesis`): rows of a mode, a place, a power or its factor, and a parameter. Mode 0: a
//!   straight move from the place of the row before to this one with the parameter as its speed (m/s). Mode 1: the source rests
//!   at this place for the parameter (s). The power of a row is that of its move or rest. The path begins at time 0; a first row of mode 0 begins
//!   at the origin.
//! - `xypt`: commands of a galvanometer scanner at constant intervals, as published for the AM-Bench builds of NIST. The power of a
//!   row holds until the next one; the place is linear between rows.

use nalgebra::Vector3;

use super::columns::{Layout, Numbers, Quantity};
use crate::toolpath::Track;
use crate::toolpath::track::TrackBuilder;
use perimelt_core::SetupError;

use Quantity::{Mode, Parameter, Trigger, X, Y, Z};

const SEGMENT: &[Quantity] = &[Mode, X, Y, Z, Parameter];

/// The layout of segments with these columns.
const fn of_segments(header: &'static str) -> Layout {
    Layout {
        header,
        needs_header: false,
        needed: SEGMENT,
        optional: &[],
        needs_power: true,
    }
}

/// The scan path of AdditiveFOAM.
pub(super) static ADDITIVEFOAM: Layout = of_segments("Mode X(m) Y(m) Z(m) Power(W) tParam");

/// The scan path with segments of adamantine.
pub(super) static ADAMANTINE: Layout = of_segments("Mode x y z pmod param");

/// The path of 3DThesis.
pub(super) static THESIS: Layout = of_segments("Mode X(mm) Y(mm) Z(mm) Pmod Time(s)");

/// Commands of a scanner.
pub(super) static XYPT: Layout = Layout {
    header: "X(mm) Y(mm) Power(W) Trigger",
    needs_header: false,
    needed: &[X, Y],
    optional: &[Trigger],
    needs_power: true,
};

/// Moves and rests.
pub(super) fn segments(numbers: &Numbers<'_>, power: Option<f64>) -> Result<Track, SetupError> {
    let mut track: Option<TrackBuilder> = None;
    for row in &numbers.rows {
        let place = numbers.place(row)?;
        let power = numbers.power(row, power)?;
        let [mode, parameter] = [Mode, Parameter].map(|q| numbers.need(row, q));
        let (mode, parameter) = (mode?, parameter?);
        if mode == 0.0 {
            if parameter <= 0.0 {
                return Err(numbers.wrong(row, Parameter, parameter, "a speed above 0, m/s"));
            }
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, Vector3::zeros()));
            track.go(place, parameter, power);
        } else if mode == 1.0 {
            if parameter < 0.0 {
                return Err(numbers.wrong(
                    row,
                    Parameter,
                    parameter,
                    "a finite number, zero or greater",
                ));
            }
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, place));
            track.glide(place, 0.0, [power; 2]);
            track.dwell(parameter, power);
        } else {
            return Err(numbers.wrong(row, Mode, mode, "0 (a move) or 1 (a dwell)"));
        }
    }
    track
        .and_then(TrackBuilder::finish)
        .ok_or_else(|| numbers.too_short())
}

/// Commands of a scanner at intervals of `time_step` (s), at the height `z` (m).
pub(super) fn scanner(
    numbers: &Numbers<'_>,
    power: Option<f64>,
    time_step: f64,
    z: f64,
) -> Result<Track, SetupError> {
    let mut track: Option<(TrackBuilder, f64)> = None;
    for row in &numbers.rows {
        let mut place = numbers.place(row)?;
        place.z = z;
        let power = numbers.power(row, power)?;
        match &mut track {
            None => track = Some((TrackBuilder::new(0.0, place), power)),
            Some((track, before)) => {
                track.glide(place, time_step, [*before; 2]);
                *before = power;
            }
        }
    }
    track
        .and_then(|(track, _)| track.finish())
        .ok_or_else(|| numbers.too_short())
}
