//! Straight segments one after the other, each with its own speed, power and dwell.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{Track, WaitUntil, no_length, place, power_of};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_at_least, check_finite, check_positive};

/// Straight segments from `start` through each `to`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Polyline {
    /// Position at `start_time` (m).
    pub start: [f64; 3],
    /// When the source is switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Speed of the segments that give none (m/s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: Option<f64>,
    /// Power of the segments that give none (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
    /// The segments in order.
    pub segments: Vec<Segment>,
}

/// One segment of a [`Polyline`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Where the segment ends (m). The place it starts from makes it a pure dwell.
    pub to: [f64; 3],
    /// Speed (m/s); default that of the polyline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: Option<f64>,
    /// Power while moving (W); default that of the polyline. 0 for a move with the source off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
    /// Rest at the end of the segment (s); default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub dwell: f64,
    /// Power while resting (W); default that of the segment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub dwell_power: Option<f64>,
    /// What the torch waits for, switched off, before this segment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
}

impl Polyline {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, SetupError> {
        let start_time = check_finite("start_time", self.start_time)?;
        let mut at = place("start", self.start)?;
        let mut track = TrackBuilder::new(start_time, at);
        for (index, segment) in self.segments.iter().enumerate() {
            let key = |name: &str| format!("segments[{index}].{name}");
            let to = place(&key("to"), segment.to)?;
            let power = power_of(&key("power"), segment.power.or(self.power), default_power)?;
            if segment.wait_until.is_some() {
                track.begin_pass(segment.wait_until.as_ref());
            }
            if to != at {
                let speed = match (segment.speed, self.speed) {
                    (Some(speed), _) => check_positive(&key("speed"), speed, "m/s")?,
                    (None, Some(speed)) => check_positive("speed", speed, "m/s")?,
                    (None, None) => check_positive(&key("speed"), 0.0, "m/s")?,
                };
                track.go(to, speed, power);
            }
            let dwell = check_at_least(&key("dwell"), segment.dwell, 0.0, "s")?;
            let dwell_power = power_of(&key("dwell_power"), segment.dwell_power, Some(power))?;
            track.dwell(dwell, dwell_power);
            at = to;
        }
        track.finish().ok_or_else(|| no_length("segments"))
    }
}
