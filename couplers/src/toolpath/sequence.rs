//! A weld sequence: passes one after the other, each of which may wait for the interpass temperature.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::wait::WaitUntil;
use super::{Toolpath, Track, no_length, place};
use perimelt_core::SetupError;
use perimelt_core::numbers::check_at_least;

/// Passes one after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// What each pass but the first waits for, unless it has a `wait_until` of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
    /// The passes in order.
    pub passes: Vec<SequencePass>,
}

/// One pass of a [`Sequence`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SequencePass {
    /// Its toolpath. Times in it count from the end of the pass before and of the wait: `start_time` is a pause.
    pub toolpath: Toolpath,
    /// What this pass waits for; default that of the sequence, and nothing for the first pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
    /// Direction of the torch's axis in this pass, into the material, of any length; default that of the source
    /// (`heated_surface.direction`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torch: Option<[f64; 3]>,
}

impl Sequence {
    pub(super) fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, SetupError> {
        let mut track: Option<TrackBuilder> = None;
        for (index, pass) in self.passes.iter().enumerate() {
            let own = pass.toolpath.track(default_power, base_dir);
            let key = |name: &str| format!("passes[{index}].{name}");
            let table = key(&format!("toolpath.{}", pass.toolpath.kind()));
            let own = own.map_err(|e| e.below(&table))?;
            check_at_least("start_time", own.start(), 0.0, "s").map_err(|e| e.below(&table))?;
            if own.end().is_none() && index + 1 < self.passes.len() {
                let message = format!("pass {} has no end, but another one follows", index + 1);
                return Err(SetupError::value(
                    key("toolpath"),
                    message,
                    "`end` or `end_time`",
                ));
            }
            let usual = self.wait_until.as_ref().filter(|_| index > 0);
            let begin = own.pose(own.start()).position;
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, begin));
            track.begin_pass(pass.wait_until.as_ref().or(usual));
            let axis = |torch: [f64; 3]| {
                let axis = place(&key("torch"), torch)?.try_normalize(0.0);
                axis.ok_or_else(|| no_length(&key("torch")))
            };
            track.follow(&own, pass.torch.map(axis).transpose()?);
        }
        track
            .and_then(TrackBuilder::finish)
            .ok_or_else(|| no_length("passes"))
    }
}
