//! `[[probes]]`: what is measured, and where.

use perimelt_core::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[probes]]`: one or several numbers, logged with every state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeSection {
    /// Name of the time series.
    pub name: String,
    /// Body; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Field, such as "temperature" (a melt pool needs none).
    #[serde(default)]
    pub field: Option<String>,
    /// "x", "y", "z" or "magnitude" of a vector field; "xx", "yx", ..., "von_mises", "hydrostatic",
    /// "principal_1" (the largest), "principal_2" or "principal_3" of a tensor field.
    #[serde(default)]
    pub component: Option<String>,
    /// What is measured, such as `kind.point = [0, 0, 0]`.
    pub kind: ProbeKind,
}

/// What a probe measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbeKind {
    /// The field at a reference position, m, linear between the points around it.
    Point([f64; 3]),
    /// One number for all points of a region.
    Region(RegionProbe),
    /// The field at equally spaced reference positions.
    Line(LineProbe),
    /// Length, width, depth and volume of the region above an isotherm.
    MeltPool(MeltPoolProbe),
}

/// One number for all points of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionProbe {
    /// Region; the whole body when left out.
    #[serde(default)]
    pub name: Option<String>,
    /// Which number.
    pub statistic: Statistic,
    /// Only the points where another field is above a value, such as `where = { field = "damage", above = 0.5 }`.
    #[serde(default, rename = "where", skip_serializing_if = "Option::is_none")]
    pub condition: Option<Above>,
}

/// A scalar field above a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Above {
    /// Scalar field, such as "damage".
    pub field: String,
    /// The value.
    pub above: f64,
}

/// A number computed from many points. It is not a number if one of the values is not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// Largest.
    Max,
    /// Smallest.
    Min,
    /// Mean, weighted by volume.
    Mean,
    /// Sum over the points.
    Sum,
    /// Integral over the volume.
    Integral,
    /// Volume in which the value is above this one: `statistic = { volume_above = 573 }`; m², m in two dimensions and in one.
    VolumeAbove(f64),
    /// Fraction of the volume in which the value is above this one.
    FractionAbove(f64),
}

/// A line of positions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineProbe {
    /// Start, m.
    pub from: [f64; 3],
    /// End, m.
    pub to: [f64; 3],
    /// Number of positions, both ends included.
    #[schemars(range(min = 2, max = 100_000))]
    pub number: usize,
}

/// A melt pool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeltPoolProbe {
    /// Isotherm, K; the solidus of the body's material when left out.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default)]
    pub isotherm: Option<f64>,
    /// Axis of the length; the direction of travel of the nearest heat source when `along` and `down` are left out (x
    /// without a source that moves).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<Axis>,
    /// Axis of the depth; the direction of the beam when `along` and `down` are left out (z without a source that moves). The
    /// width lies along the direction normal to both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub down: Option<Axis>,
}
