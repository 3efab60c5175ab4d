//! Circular path: `x(t) = centre + radius (cos phi, sin phi, 0)`,
//! `phi = start_angle ± speed (t - start_time) / radius`.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{ToolpathError, Track, finite, place, positive, power_of};

/// Part of a circle in a plane normal to z, one circle or several turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    /// Centre (m).
    pub centre: [f64; 3],
    /// Radius (m).
    pub radius: f64,
    /// Speed along the circle (m/s).
    pub speed: f64,
    /// Angle of the first position, from +x towards +y (rad); default 0.
    #[serde(default)]
    pub start_angle: f64,
    /// Number of turns, not necessarily whole; default 1.
    #[serde(default = "one_turn")]
    pub turns: f64,
    /// Whether the source runs clockwise as seen from +z; default no.
    #[serde(default)]
    pub clockwise: bool,
    /// When the source is switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Power (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
}

fn one_turn() -> f64 {
    1.0
}

impl Circle {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, ToolpathError> {
        let centre = place("centre", self.centre)?;
        let radius = positive("radius", self.radius)?;
        let rate = positive("speed", self.speed)? / radius;
        let duration = positive("turns", self.turns)? * TAU / rate;
        let (sin, cos) = finite("start_angle", self.start_angle)?.sin_cos();
        let start = centre + Vector3::new(cos, sin, 0.0) * radius;
        let power = power_of("power", self.power, default_power)?;
        let mut track = TrackBuilder::new(finite("start_time", self.start_time)?, start);
        let rate = if self.clockwise { -rate } else { rate };
        track.turn(centre, rate, duration, power);
        track.finish().ok_or(ToolpathError::NoLength {
            key: "turns".into(),
        })
    }
}
