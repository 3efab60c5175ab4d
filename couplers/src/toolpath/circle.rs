//! Circular path: `x(t) = centre + radius (u cos phi + v sin phi)`,
//! `phi = start_angle ± speed (t - start_time) / radius`, with unit vectors u and `v = axis x u` normal to the axis.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::{Facing, TrackBuilder, Turn};
use super::{Track, no_length, place, power_of};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_finite, check_positive};

/// Part of a circle about an axis, one circle or several turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    /// Centre (m).
    pub centre: [f64; 3],
    /// Radius (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Speed along the circle (m/s).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: f64,
    /// Direction of the axis, of any length; default z.
    #[serde(default = "upward")]
    pub axis: [f64; 3],
    /// Angle of the first position (rad), right-handed about the axis; for the axis z from +x towards +y. It counts from
    /// the direction normal to the axis that is nearest to +x, for an axis along x from +y. Default 0.
    #[serde(default)]
    pub start_angle: f64,
    /// Number of turns, not necessarily whole; default 1.
    #[serde(default = "one_turn")]
    pub turns: f64,
    /// Whether the source runs clockwise as seen from the end of the axis, such as +z; default no.
    #[serde(default)]
    pub clockwise: bool,
    /// Which way the torch points: `inward` to the centre, as around a pipe, or `outward`, as inside of it. Default that of
    /// the source (`heated_surface`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torch: Option<CircleTorch>,
    /// When the source is switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Power (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
}

/// Which way a torch on a circle points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CircleTorch {
    /// To the centre.
    Inward,
    /// Away from the centre.
    Outward,
}

fn upward() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn one_turn() -> f64 {
    1.0
}

impl Circle {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, SetupError> {
        let centre = place("centre", self.centre)?;
        let radius = check_positive("radius", self.radius, "m")?;
        let rate = check_positive("speed", self.speed, "m/s")? / radius;
        let duration = check_positive("turns", self.turns, "")? * TAU / rate;
        let (sin, cos) = check_finite("start_angle", self.start_angle)?.sin_cos();
        let axis = place("axis", self.axis)?
            .try_normalize(0.0)
            .ok_or_else(|| no_length("axis"))?;
        let across = |v: Vector3<f64>| (v - axis * v.dot(&axis)).try_normalize(1e-9);
        let u = across(Vector3::x()).unwrap_or_else(Vector3::y);
        let v = axis.cross(&u);
        let start = centre + u * (cos * radius) + v * (sin * radius);
        let power = power_of("power", self.power, default_power)?;
        let mut track = TrackBuilder::new(check_finite("start_time", self.start_time)?, start);
        let rate = if self.clockwise { -rate } else { rate };
        let facing = match self.torch {
            None => Facing::Fixed,
            Some(CircleTorch::Inward) => Facing::Inward,
            Some(CircleTorch::Outward) => Facing::Outward,
        };
        let turn = Turn {
            centre,
            plane: [u, v],
            rate,
            facing,
        };
        track.turn_in(turn, duration, power);
        track.finish().ok_or_else(|| no_length("turns"))
    }
}
