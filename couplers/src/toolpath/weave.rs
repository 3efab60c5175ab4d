//! Weaving: a straight seam with a sideways oscillation,
//! `x(t) = start + e v t + n A w(v t / wavelength)`, with e the seam direction, n = z × e and
//! w a wave of period 1 and height 1, `sin(2 pi s)` or the triangle wave with the same zeros.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{Track, check_moves, no_length, place, power_of};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_at_least, check_finite, check_positive};

/// A straight seam with a sideways oscillation in the plane normal to z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Weave {
    /// Start of the seam, position at `start_time` (m).
    pub start: [f64; 3],
    /// End of the seam (m).
    pub end: [f64; 3],
    /// Speed along the seam (m/s); the source itself is faster by its sideways motion.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: f64,
    /// Largest distance from the seam (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub amplitude: f64,
    /// Distance along the seam of one full oscillation (m); frequency = speed / wavelength.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wavelength: f64,
    /// Shape of the oscillation; default `sine`.
    #[serde(default)]
    pub shape: WeaveShape,
    /// When the source is switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Power (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
}

/// Shape of a weave.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WeaveShape {
    /// Sine wave.
    #[default]
    Sine,
    /// Straight legs between the turning points.
    Zigzag,
}

impl Weave {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, SetupError> {
        let start = place("start", self.start)?;
        let end = place("end", self.end)?;
        let speed = check_positive("speed", self.speed, "m/s")?;
        let amplitude = check_at_least("amplitude", self.amplitude, 0.0, "m")?;
        let wavelength = check_positive("wavelength", self.wavelength, "m")?;
        let power = power_of("power", self.power, default_power)?;
        let length = (end - start).norm();
        let no_length = || no_length("end");
        let seam = (end - start).try_normalize(0.0).ok_or_else(no_length)?;
        // a seam along z has no sideways direction in the plane normal to z
        let sideways = Vector3::z()
            .cross(&seam)
            .try_normalize(1e-12)
            .ok_or_else(no_length)?;
        let mut track = TrackBuilder::new(check_finite("start_time", self.start_time)?, start);
        match self.shape {
            WeaveShape::Sine => {
                let rate = TAU * speed / wavelength;
                track.swing(end, speed, sideways * amplitude, rate, power);
            }
            WeaveShape::Zigzag => {
                let legs = 2.0 * length / wavelength;
                check_moves("wavelength", legs)?;
                let mut from = 0.0;
                for leg in 0_u32.. {
                    // turning points at 1/4, 3/4, 5/4 ... of the wavelength
                    let turn = (0.5 * f64::from(leg) + 0.25) * wavelength;
                    let to = turn.min(length);
                    let aside = amplitude * triangle(to / wavelength);
                    let tip = start + seam * to + sideways * aside;
                    track.glide(tip, (to - from) / speed, [power; 2]);
                    from = to;
                    if turn >= length {
                        break;
                    }
                }
            }
        }
        track.facing(seam).finish().ok_or_else(no_length)
    }
}

/// Triangle wave of period 1 with the zeros, signs and height of `sin(2 pi s)`.
fn triangle(s: f64) -> f64 {
    let shifted = s + 0.25;
    1.0 - 4.0 * (shifted - shifted.floor() - 0.5).abs()
}
