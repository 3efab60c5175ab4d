//! The description of a run, as far as it is sound: what is damaged of it is replaced by what the states tell.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde_json::Value;

use super::{BodyInfo, FieldInfo, LoggedCloud, RunInfo, scan::Contents};

/// The run and the name of its case file, from the metadata: one JSON text per key. Values that cannot be parsed are noted as
/// damage. Bodies that only have states get a description without a dimension, see [`body`].
///
/// # Errors
/// The bodies of a log that has no states cannot be parsed.
pub(super) fn describe(
    metadata: BTreeMap<String, String>,
    contents: &mut Contents,
) -> Result<(RunInfo, String), serde_json::Error> {
    let mut texts = Texts {
        metadata,
        lost: Vec::new(),
    };
    let mut run = RunInfo {
        version: texts.take("version").unwrap_or_default(),
        threads: texts.take("threads").unwrap_or_default(),
        started: texts.take("started").unwrap_or_default(),
        case_folder: texts.take("case_folder").unwrap_or_default(),
        inputs: texts.take("inputs").unwrap_or_default(),
        bodies: texts.take("bodies").unwrap_or_default(),
        plugins: texts.take::<Value>("plugins").unwrap_or_default(),
    };
    let case_name = texts.take("case_file").unwrap_or_default();
    // without a body there is nothing to use
    if run.bodies.is_empty()
        && contents.channels.bodies().next().is_none()
        && let Some((_, error)) = texts.lost.pop()
    {
        return Err(error);
    }
    for (key, error) in texts.lost {
        let what = format!("`{key}` cannot be parsed: {error}");
        contents.lose("the description of the run", 0, what);
    }
    if contents.case_text.is_none() {
        let what = "the attachment `case.toml` is missing or damaged";
        contents.lose("the case file", 0, what.into());
    }
    let is_known = |name: &&str| run.bodies.iter().any(|body| body.name == *name);
    let mut unknown: Vec<String> = contents
        .channels
        .bodies()
        .filter(|name| !is_known(name))
        .map(String::from)
        .collect();
    unknown.sort();
    for name in unknown {
        let what = format!(
            "the description of body `{name}` is missing, although the log has states of it"
        );
        contents.lose("the description of the run", 0, what);
        run.bodies.push(BodyInfo {
            name,
            ..BodyInfo::default()
        });
    }
    Ok((run, case_name))
}

/// Texts by key, and those that could not be parsed.
struct Texts {
    metadata: BTreeMap<String, String>,
    lost: Vec<(&'static str, serde_json::Error)>,
}

impl Texts {
    fn take<T: DeserializeOwned>(&mut self, key: &'static str) -> Option<T> {
        // entries that older versions did not write are not damage
        let text = match self.metadata.remove(key) {
            None if matches!(key, "case_folder" | "case_file" | "inputs") => return None,
            text => text.unwrap_or_default(),
        };
        match serde_json::from_str(&text) {
            Ok(value) => Some(value),
            Err(error) => {
                self.lost.push((key, error));
                None
            }
        }
    }
}

/// Whether a description is one of a body.
pub(super) fn is_sound(body: &BodyInfo) -> bool {
    let has_spacing = body.spacing.is_finite() && body.spacing > 0.0;
    (1..=3).contains(&body.dimension) && has_spacing && body.thickness.is_finite()
}

/// A body as its points tell: dimension by the axes along which it extends, spacing by the volume of a point.
pub(super) fn body(name: &str, cloud: Option<&LoggedCloud>) -> BodyInfo {
    let positions = cloud.map_or(&[][..], |cloud| &cloud.positions);
    let extent = |axis: usize| {
        let along = positions.iter().map(|x| x[axis]);
        let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        });
        high - low
    };
    let extents = [0, 1, 2].map(extent).into_iter();
    let extents: Vec<f64> = extents.filter(|e| e.is_finite() && *e > 0.0).collect();
    let dimension = extents.len().max(1);
    let volume: f64 = extents.iter().product();
    let spacing = (volume / positions.len().max(1) as f64).powf(1.0 / dimension as f64);
    let spacing = if spacing.is_finite() && spacing > 0.0 {
        spacing
    } else {
        1.0
    };
    let field = |field: &super::CloudField| FieldInfo {
        name: field.name.clone(),
        unit: String::new(),
        components: field.components,
    };
    let fields = cloud.map_or(&[][..], |cloud| &cloud.fields);
    BodyInfo {
        name: name.into(),
        dimension,
        spacing,
        thickness: spacing,
        points: positions.len(),
        symmetry: Vec::new(),
        lattice: None,
        plies: Vec::new(),
        fields: fields.iter().map(field).collect(),
    }
}
