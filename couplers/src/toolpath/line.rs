//! One straight pass: `x(t) = start + direction speed (t - start_time)`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{Track, no_length, place, power_of};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_finite, check_positive};

/// A straight pass at constant speed, to an end point or in a direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Position at `start_time` (m).
    pub start: [f64; 3],
    /// Where the pass ends (m); give this or `direction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<[f64; 3]>,
    /// Direction of travel, of any length; give this or `end`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Speed (m/s).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: f64,
    /// When the source is switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// When it is switched off (s), with `direction` only; default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_time: Option<f64>,
    /// Power (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
}

impl Line {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, SetupError> {
        let start = place("start", self.start)?;
        let speed = check_positive("speed", self.speed, "m/s")?;
        let start_time = check_finite("start_time", self.start_time)?;
        let power = power_of("power", self.power, default_power)?;
        let mut track = TrackBuilder::new(start_time, start);
        let key = match (self.end, self.direction, self.end_time) {
            (Some(end), None, None) => {
                track.go(place("end", end)?, speed, power);
                "end"
            }
            (None, Some(direction), end_time) => {
                let direction = place("direction", direction)?
                    .try_normalize(0.0)
                    .ok_or_else(|| no_length("direction"))?;
                let end = match end_time {
                    Some(end) => start_time + check_positive("end_time", end - start_time, "s")?,
                    None => f64::INFINITY,
                };
                track.go_on(direction, speed, end, power);
                "direction"
            }
            (None, None, _) => return Err(no_goal("start")),
            (Some(_), Some(_), _) => return Err(no_goal("direction")),
            (Some(_), None, Some(_)) => return Err(no_goal("end_time")),
        };
        track.finish().ok_or_else(|| no_length(key))
    }
}

/// `end` and `direction` are both given or both missing.
fn no_goal(key: &str) -> SetupError {
    let message = "a line needs one of `end` and `direction`, and `end_time` only with `direction`";
    let expected = "either `end`, or `direction` with an optional `end_time`";
    SetupError::value(key, message, expected)
}
