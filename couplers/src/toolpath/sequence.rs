//! A weld sequence: passes one after the other, each of which may wait for the interpass temperature.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::wait::WaitUntil;
use super::{Toolpath, ToolpathError, Track, place};

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
    ) -> Result<Track, ToolpathError> {
        let mut track: Option<TrackBuilder> = None;
        for (index, pass) in self.passes.iter().enumerate() {
            let own = pass.toolpath.track(default_power, base_dir);
            let own = own.map_err(|e| ToolpathError::Pass {
                index,
                kind: pass.toolpath.kind(),
                source: Box::new(e),
            })?;
            let key = |name: &str| format!("passes[{index}].{name}");
            if own.start() < 0.0 {
                return Err(ToolpathError::Negative {
                    key: key(&format!("toolpath.{}.start_time", pass.toolpath.kind())),
                    value: own.start(),
                });
            }
            if own.end().is_none() && index + 1 < self.passes.len() {
                return Err(ToolpathError::NoEnd {
                    key: key("toolpath"),
                });
            }
            let usual = self.wait_until.as_ref().filter(|_| index > 0);
            let begin = own.pose(own.start()).position;
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, begin));
            track.begin_pass(pass.wait_until.as_ref().or(usual));
            let axis = |torch: [f64; 3]| {
                let axis = place(&key("torch"), torch)?.try_normalize(0.0);
                axis.ok_or_else(|| ToolpathError::NoLength { key: key("torch") })
            };
            track.follow(&own, pass.torch.map(axis).transpose()?);
        }
        track
            .and_then(TrackBuilder::finish)
            .ok_or(ToolpathError::NoLength {
                key: "passes".into(),
            })
    }
}
