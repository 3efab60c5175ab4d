//! The sections of a case file, but for plugins and materials, which define their own.

use std::collections::BTreeMap;
use std::fmt;

use perimelt_core::StepSize;
use perimelt_core::body::Store;
use perimelt_core::log::Precision;
use perimelt_core::shape::Shape;
use perimelt_core::simulation::Iteration;
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

/// `[case]`: what the case is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseSection {
    /// Title, one line.
    #[serde(default)]
    pub title: String,
    /// What is simulated, and where it comes from.
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
    pub dimension: usize,
    /// Distance between neighbouring points, m.
    pub spacing: f64,
    /// Thickness of a 2D body, m.
    #[serde(default = "one")]
    pub thickness: f64,
    /// Cross-section of a 1D body, m².
    #[serde(default = "one")]
    pub cross_section: f64,
    /// Name of the material: a `[materials]` section or a library entry.
    pub material: String,
    /// Other materials by region: `materials = { insert = "IN625" }`.
    #[serde(default)]
    pub materials: BTreeMap<String, String>,
    /// How neighbours are stored; both give the same results.
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

/// A field at the start: one value, one with others in some regions, or one that grows with the
/// position.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(untagged)]
#[serde(untagged)]
pub enum Initial {
    /// The same everywhere.
    Uniform(Components),
    /// With exceptions.
    ByRegion {
        /// Where no region says otherwise.
        value: Components,
        /// By region.
        regions: BTreeMap<String, Components>,
    },
    /// `value + gradient (x - origin)`.
    Linear(Linear),
}

/// A field that grows with the position: `value + gradient (x - origin)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// At the origin; zero when left out.
    #[serde(default)]
    pub value: Option<Components>,
    /// Derivatives along x, y and z, one row for each component, per m.
    pub gradient: Vec<[f64; 3]>,
    /// Reference position, m.
    #[serde(default)]
    pub origin: [f64; 3],
}

impl Linear {
    /// The components at a reference position, m.
    pub fn at(&self, position: [f64; 3]) -> Vec<f64> {
        let value = self.value.as_ref().map_or(&[][..], Components::as_slice);
        let row = |(i, row): (usize, &[f64; 3])| {
            let slopes = row.iter().zip(position.iter().zip(self.origin));
            let growth: f64 = slopes.map(|(g, (x, origin))| g * (x - origin)).sum();
            value.get(i).copied().unwrap_or(0.0) + growth
        };
        self.gradient.iter().enumerate().map(row).collect()
    }
}

impl Initial {
    /// The components outside of all regions at a reference position, m.
    pub fn at(&self, position: [f64; 3]) -> Vec<f64> {
        match self {
            Initial::Uniform(value) | Initial::ByRegion { value, .. } => value.as_slice().to_vec(),
            Initial::Linear(linear) => linear.at(position),
        }
    }

    /// The exceptions.
    pub fn regions(&self) -> impl Iterator<Item = (&String, &Components)> {
        let regions = match self {
            Initial::ByRegion { regions, .. } => Some(regions),
            _ => None,
        };
        regions.into_iter().flatten()
    }
}

/// One value of a field: a number or a list of components.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(untagged)]
#[serde(untagged)]
pub enum Components {
    /// Of a scalar field.
    Scalar(f64),
    /// Of a vector (3) or tensor (9, column by column) field.
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

struct ComponentsVisitor;

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

struct InitialVisitor;

impl<'de> Visitor<'de> for InitialVisitor {
    type Value = Initial;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or [x, y, z], or { value = ..., regions = { <region> = ... } }, or { gradient = [...] }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Initial, E> {
        ComponentsVisitor.visit_f64(value).map(Initial::Uniform)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Initial, E> {
        ComponentsVisitor.visit_i64(value).map(Initial::Uniform)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Initial, A::Error> {
        ComponentsVisitor.visit_seq(list).map(Initial::Uniform)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Initial, A::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            value: Option<Components>,
            regions: Option<BTreeMap<String, Components>>,
            gradient: Option<Vec<[f64; 3]>>,
            #[serde(default)]
            origin: [f64; 3],
        }
        let table = Table::deserialize(de::value::MapAccessDeserializer::new(map))?;
        match (table.value, table.regions, table.gradient) {
            (Some(value), Some(regions), None) => Ok(Initial::ByRegion { value, regions }),
            (value, None, Some(gradient)) => Ok(Initial::Linear(Linear {
                value,
                gradient,
                origin: table.origin,
            })),
            (_, Some(_), Some(_)) => Err(de::Error::custom(
                "a field grows or differs by region, not both",
            )),
            (None, ..) => Err(de::Error::missing_field("value")),
            _ => Err(de::Error::missing_field("regions")),
        }
    }
}

impl<'de> Deserialize<'de> for Initial {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InitialVisitor)
    }
}

/// `[time]`: how long and in which steps.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeSection {
    /// End of the simulated time, s.
    pub end: f64,
    /// Macro step, s, or "auto".
    #[serde(default)]
    pub step: StepSize,
    /// Automatic steps are this share of the largest stable one, 0 to 1.
    #[serde(default = "default_safety")]
    pub safety: f64,
    /// Repeats each macro step until the physics agree (strong coupling).
    #[serde(default)]
    pub iteration: Option<Iteration>,
}

fn default_safety() -> f64 {
    0.9
}

/// `[log]`: what is written, and how often.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogSection {
    /// Simulated time between logged states, s; a hundredth of the run when left out.
    #[serde(default)]
    pub interval: Option<f64>,
    /// Fields in the point clouds; all but the enthalpy when left out.
    #[serde(default)]
    pub fields: Option<Vec<String>>,
    /// Precision of the point clouds (checkpoints are always exact).
    #[serde(default)]
    pub precision: Precision,
    /// Simulated time between checkpoints, s; a tenth of the run when left out.
    #[serde(default)]
    pub checkpoint: Option<f64>,
}

/// `[[probes]]`: a number, or a few, logged with every state.
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
    /// "x", "y", "z" or "magnitude" of a vector field, "xx", "yx", ... or "von_mises" of a
    /// tensor field.
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
    /// Length, width, depth and volume of what is hotter than an isotherm.
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
}

/// A number for many points.
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
    pub number: usize,
}

/// A melt pool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeltPoolProbe {
    /// Isotherm, K; the solidus of the body's material when left out.
    #[serde(default)]
    pub isotherm: Option<f64>,
    /// Axis of the length.
    #[serde(default = "axis_x")]
    pub along: Axis,
    /// Axis of the depth; the width lies along the third.
    #[serde(default = "axis_z")]
    pub down: Axis,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The x axis.
    X,
    /// The y axis.
    Y,
    /// The z axis.
    Z,
}

fn axis_x() -> Axis {
    Axis::X
}

fn axis_z() -> Axis {
    Axis::Z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Table {
        initial: Initial,
    }

    fn read(initial: &str) -> Result<Initial, toml::de::Error> {
        toml::from_str::<Table>(&format!("initial = {initial}")).map(|t| t.initial)
    }

    #[test]
    fn an_initial_field_may_grow_with_the_position() {
        let plain = read("{ gradient = [[2, 0, 0], [0, 0, 1], [0, 0, 0]], origin = [1, 0, 0] }");
        assert_eq!(plain.expect("valid").at([3.0, 5.0, 7.0]), [4.0, 7.0, 0.0]);
        let lifted = read("{ value = 300, gradient = [[0, 10, 0]] }").expect("valid");
        assert_eq!(lifted.at([1.0, 2.0, 3.0]), [320.0]);
        assert_eq!(
            read("[1, 2, 3]").expect("valid").at([9.0; 3]),
            [1.0, 2.0, 3.0]
        );
    }

    #[test]
    fn a_field_grows_or_differs_by_region() {
        let both = read("{ value = 1, regions = { left = 2 }, gradient = [[1, 0, 0]] }");
        assert!(both.expect_err("both").message().contains("not both"));
        assert!(read("{ value = 1 }").is_err(), "neither");
    }
}
