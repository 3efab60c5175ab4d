//! Hatching: parallel scan lines that fill a rectangle, layer by layer.

use nalgebra::{Rotation3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{Track, WaitUntil, check_moves, no_length, place, power_of};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_at_least, check_finite, check_positive};

/// Parallel scan lines inside a rectangle `length` × `width`; the source is off between them.
///
/// The lines keep their `spacing` and lie in the middle of the width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hatch {
    /// Corner of the rectangle where the first layer starts (m).
    pub corner: [f64; 3],
    /// Length of a scan line (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: f64,
    /// Width of the rectangle (m); 0 for a single line.
    #[schemars(extend("minimum" = 0))]
    pub width: f64,
    /// Distance between scan lines (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: f64,
    /// Angle of the scan lines from +x towards +y (rad); default 0. The width extends to their
    /// left.
    #[serde(default)]
    pub angle: f64,
    /// Scan speed (m/s).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: f64,
    /// Whether every second line runs backwards; default yes.
    #[serde(default = "default_bidirectional")]
    pub bidirectional: bool,
    /// Time from the end of a line to the start of the next, source off (s); default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub turn_time: f64,
    /// Number of layers; default 1.
    #[serde(default = "one")]
    #[schemars(extend("minimum" = 1))]
    pub layers: u32,
    /// Rise in z from layer to layer (m); default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub layer_height: f64,
    /// Turn of the pattern about the middle of the rectangle from layer to layer (rad);
    /// default 0.
    #[serde(default)]
    pub layer_angle: f64,
    /// Time between layers, source off (s); default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub layer_time: f64,
    /// What each layer but the first waits for, after `layer_time`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
    /// When the source is first switched on (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Power on the lines (W); default that of the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
}

fn default_bidirectional() -> bool {
    true
}

fn one() -> u32 {
    1
}

impl Hatch {
    pub(super) fn track(&self, default_power: Option<f64>) -> Result<Track, SetupError> {
        let corner = place("corner", self.corner)?;
        let length = check_positive("length", self.length, "m")?;
        let width = check_at_least("width", self.width, 0.0, "m")?;
        let spacing = check_positive("spacing", self.spacing, "m")?;
        let speed = check_positive("speed", self.speed, "m/s")?;
        let turn_time = check_at_least("turn_time", self.turn_time, 0.0, "s")?;
        let layer_time = check_at_least("layer_time", self.layer_time, 0.0, "s")?;
        let rise = check_finite("layer_height", self.layer_height)?;
        let angle = check_finite("angle", self.angle)?;
        let layer_angle = check_finite("layer_angle", self.layer_angle)?;
        let start_time = check_finite("start_time", self.start_time)?;
        let power = power_of("power", self.power, default_power)?;
        check_positive("layers", f64::from(self.layers), "")?;

        // a width of 3 spacings holds 4 lines even when 0.3 / 0.1 is a little less than 3
        let gaps = (width / spacing + 1e-9).floor();
        let lines = (gaps + 1.0) * f64::from(self.layers);
        check_moves("spacing", lines)?;
        let margin = 0.5 * (width - gaps * spacing);
        let middle = Vector3::new(0.5 * length, 0.5 * width, 0.0);
        let centre = corner + Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * middle;

        let mut track: Option<TrackBuilder> = None;
        for layer in 0..self.layers {
            let turned = angle + layer_angle * f64::from(layer);
            let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turned);
            let centre = centre + Vector3::z() * (rise * f64::from(layer));
            for line in 0..=gaps as u32 {
                let y = margin + spacing * f64::from(line);
                let ends = [Vector3::new(0.0, y, 0.0), Vector3::new(length, y, 0.0)];
                let [mut from, mut to] = ends.map(|end| centre + rotation * (end - middle));
                if self.bidirectional && line % 2 == 1 {
                    std::mem::swap(&mut from, &mut to);
                }
                let track = track.get_or_insert_with(|| TrackBuilder::new(start_time, from));
                let pause = match (layer, line) {
                    (0, 0) => 0.0,
                    (_, 0) => layer_time,
                    _ => turn_time,
                };
                track.glide(from, pause, [0.0; 2]);
                if layer > 0 && line == 0 && self.wait_until.is_some() {
                    track.begin_pass(self.wait_until.as_ref());
                }
                track.go(to, speed, power);
            }
        }
        track
            .and_then(TrackBuilder::finish)
            .ok_or_else(|| no_length("length"))
    }
}
