//! The sections of a case file except those of plugins and materials, which are defined elsewhere.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use perimelt_core::Axis;
use perimelt_core::StepSize;
use perimelt_core::body::{Jitter, Layup, Store, Zone};
use perimelt_core::log::Precision;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::{Iteration, LogStage, Stage};
use schemars::JsonSchema;
use serde::de::{self, Deserializer, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::initial::Initial;

/// `[case]`: title and description.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseSection {
    /// Title, one line.
    #[serde(default)]
    pub title: String,
    /// The simulated problem and its source.
    #[serde(default)]
    pub description: String,
}

/// `[bodies.<name>]`: a body, filled with points.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodySection {
    /// Shape, in m, such as `shape.box = { min = [0, 0, 0], max = [0.1, 0.05, 0.01] }`.
    pub shape: Shape,
    /// 1 (bar), 2 (plate) or 3 (block).
    #[serde(default = "three")]
    #[schemars(range(min = 1, max = 3))]
    pub dimension: usize,
    /// Distance between neighbouring points, m; or give `zones` or `points`.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: Option<f64>,
    /// Boxes with individual spacings that together cover the shape, such as
    /// `zones = [{ min = [0, 0, 0], max = [0.1, 0.1, 0], spacing = 0.005 }, ...]`.
    #[serde(default)]
    pub zones: Vec<Zone>,
    /// Table of points: a CSV file with columns `x`, `y`, `z` (m) and `volume` (m³) or `spacing`
    /// (m), relative to the case file. Points outside the shape are left out.
    #[serde(default)]
    pub points: Option<PathBuf>,
    /// Displaces the points at random, without a change of volumes: `jitter = { amplitude = 0.1 }`.
    #[serde(default)]
    pub jitter: Option<Jitter>,
    /// Plies of a laminate, from below, such as `layup = { angles = [0, 90] }` with degrees from x towards y: layers of points at
    /// `spacing`, stacked along z.
    #[serde(default)]
    pub layup: Option<Layup>,
    /// Thickness of a 2D body, m.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub thickness: f64,
    /// Cross-section of a 1D body, m².
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cross_section: f64,
    /// Name of the material: a `[materials]` section or a library entry.
    pub material: String,
    /// Other materials by region: `materials = { insert = "IN625" }`.
    #[serde(default)]
    pub materials: BTreeMap<String, String>,
    /// Axes along which the body is periodic, such as `["x"]`; it must cover both faces across them.
    #[serde(default)]
    pub periodic: Vec<Axis>,
    /// Box of the walls around a fluid with a free surface, where it is larger than that of the body:
    /// `tank = { min = [0, 0, 0], max = [0.6, 0.4, 0] }`.
    #[serde(default)]
    pub tank: Option<BoxShape>,
    /// How neighbours are stored; both give the same results. Without effect on bodies of zones,
    /// with jitter or from a table.
    #[serde(default)]
    pub store: Store,
    /// Named parts of the body: the points inside a shape, in m.
    #[serde(default)]
    pub regions: BTreeMap<String, Shape>,
    /// Fields at the start, in SI units; those not given are zero.
    #[serde(default)]
    pub initial: BTreeMap<String, Initial>,
}

fn three() -> usize {
    3
}

fn one() -> f64 {
    1.0
}

/// One value of a field: a number or a list of components.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(untagged)]
#[serde(untagged)]
pub enum Components {
    /// Value of a scalar field.
    Scalar(f64),
    /// Components of a vector (3) or tensor (9, column by column) field.
    List(Vec<f64>),
}

impl Components {
    /// The components.
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Components::Scalar(value) => std::slice::from_ref(value),
            Components::List(values) => values,
        }
    }
}

pub(super) struct ComponentsVisitor;

impl<'de> Visitor<'de> for ComponentsVisitor {
    type Value = Components;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or [x, y, z]")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Components, E> {
        Ok(Components::Scalar(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Components, E> {
        Ok(Components::Scalar(value as f64))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Components, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element()? {
            values.push(value);
        }
        Ok(Components::List(values))
    }
}

impl<'de> Deserialize<'de> for Components {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ComponentsVisitor)
    }
}

/// `[time]`: end time and step sizes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeSection {
    /// End of the simulated time, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// Macro step, s, or "auto".
    #[serde(default)]
    pub step: StepSize,
    /// Macro steps from later times on, in the order of time, such as
    /// `[{ from = 12, step = 0.1 }, { from = 60, step = 2 }]`: small steps while a torch welds, long ones while the part
    /// cools.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// Factor of automatic steps to the largest stable step, 0 to 1.
    #[serde(default = "default_safety")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub safety: f64,
    /// Repeats each macro step until the physics agree (strong coupling).
    #[serde(default)]
    pub iteration: Option<Iteration>,
}

fn default_safety() -> f64 {
    0.9
}

/// `[log]`: contents and intervals of the log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogSection {
    /// Simulated time between logged states, s; a hundredth of the run when left out.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Other intervals in the first parts of the run, in the order of time, such as
    /// `stages = [{ until = 10, interval = 0.1 }, { until = 100, interval = 5 }]`: many states while a torch welds, few while
    /// the part cools. `interval` applies after the last one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<LogStage>,
    /// Fields in the point clouds; all but the enthalpy when left out.
    #[serde(default)]
    pub fields: Option<Vec<String>>,
    /// Precision of the point clouds (checkpoints are always exact).
    #[serde(default)]
    pub precision: Precision,
    /// Simulated time between checkpoints, s; a tenth of the run when left out.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub checkpoint: Option<f64>,
}
