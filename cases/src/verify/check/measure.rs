//! Measurements of `[[verify]]` with their keys.

use perimelt_core::{Formula, flattened, shared_keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::probe::interpolation::Interpolation;
use crate::probe::{Above, Statistic};

/// A measurement in the running simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// A field at positions.
    Field(FieldMeasure),
    /// A field at fixed positions in space, among the current positions of points.
    Passing(PassingMeasure),
    /// Largest coordinate of a body now in a direction, m.
    Reach(ReachMeasure),
    /// Smallest distance of two points now, in spacings; at most one.
    Nearest(NearestMeasure),
    /// A field at a position, in all logged states but the first.
    History(HistoryMeasure),
    /// The time at which a field first crosses a value, s.
    Crossing(CrossingMeasure),
    /// The time at which a field first exceeds a value anywhere in a region, s.
    Onset(OnsetMeasure),
    /// Reference position, m, of the farthest point along a direction at which a field exceeds a value, such
    /// as the tip of a crack.
    Tip(TipMeasure),
    /// One number for all points of a region.
    Statistic(StatisticMeasure),
    /// Reference position, m, of the largest or smallest value in a region.
    Place(PlaceMeasure),
    /// Deviation of a field from a formula.
    Deviation(DeviationMeasure),
    /// How far a field alternates from row to row of a lattice.
    Alternation(AlternationMeasure),
    /// Extent of the region above an isotherm, m.
    MeltPool(MeltPoolMeasure),
    /// The largest relative error of a balance over all logged states.
    Balance(BalanceMeasure),
    /// A number that plugins report, summed over them.
    Report(ReportMeasure),
    /// Mean number of passes of a macro step since the start; more than one with `time.iteration`.
    Passes,
}

/// One value from those of several states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OverTime {
    /// Value of the last state.
    Last,
    /// Largest.
    Max,
    /// Smallest.
    Min,
    /// Mean.
    Mean,
    /// Change from the first to the last one over the time between them, per s.
    Rate,
}

shared_keys! {
    /// A field of a body.
    #[derive(Clone, Debug, PartialEq)]
    pub struct FieldKeys {
        /// Body; may be left out when there is only one. Measurements of current positions need its displacement.
        #[serde(default)]
        pub body: Option<String>,
        /// Field, such as "temperature".
        pub field: String,
        /// "x", "y", "z" or "magnitude" of a vector field; "xx", "yx", ..., "von_mises", "hydrostatic",
        /// "principal_1" (the largest), "principal_2" or "principal_3" of a tensor field.
        #[serde(default)]
        pub component: Option<String>,
    }
}

shared_keys! {
    /// A scalar field of a body.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ScalarKeys {
        /// Body; may be left out when there is only one.
        #[serde(default)]
        pub body: Option<String>,
        /// Field, such as "damage"; the magnitude of a vector field.
        pub field: String,
    }
}

shared_keys! {
    /// The logged states that count.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Times {
        /// Which of the values of all logged states from `since` to `time`, of each measured number; "mean" with `since`, "last"
        /// without.
        #[serde(default)]
        pub over_time: Option<OverTime>,
        /// First logged state, s; the first one after the start when left out.
        #[serde(default)]
        pub since: Option<f64>,
        /// When, s: a multiple of the log interval; the end when left out.
        #[serde(default)]
        pub time: Option<f64>,
    }
}

flattened! {
    /// A field at positions.
    #[derive(Clone, Debug, PartialEq)]
    pub struct FieldMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Reference positions, m.
        pub at: Vec<[f64; 3]>,
        /// Reference position whose value is subtracted from all, m, such as the other lip of a crack.
        #[serde(default)]
        pub from: Option<[f64; 3]>,
        /// Added to the value: -273.15 turns kelvin into degrees celsius.
        #[serde(default)]
        pub offset: f64,
        /// Interpolation between the points.
        #[serde(default)]
        pub interpolation: Interpolation,
    }
}

flattened! {
    /// A field at fixed positions in space: a linear fit to the points that are near them now.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PassingMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Positions, m.
        pub at: Vec<[f64; 3]>,
    }
}

flattened! {
    /// Largest coordinate of the cells of a body now in a direction, m.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ReachMeasure {
        ..times: Times,
        /// Body, which must have a displacement; may be left out when there is only one.
        #[serde(default)]
        pub body: Option<String>,
        /// The direction.
        pub along: [f64; 3],
    }
}

flattened! {
    /// Smallest distance of two points now.
    #[derive(Clone, Debug, PartialEq)]
    pub struct NearestMeasure {
        ..times: Times,
        /// Body, which must have a displacement; may be left out when there is only one.
        #[serde(default)]
        pub body: Option<String>,
    }
}

flattened! {
    /// A field at a position over time.
    #[derive(Clone, Debug, PartialEq)]
    pub struct HistoryMeasure {
        ..target: FieldKeys,
        /// Reference position, m.
        pub at: [f64; 3],
        /// Logged states up to this time, s; the end when left out.
        #[serde(default)]
        pub until: Option<f64>,
        /// Interpolation between the points.
        #[serde(default)]
        pub interpolation: Interpolation,
    }
}

flattened! {
    /// The time at which a field first crosses a value.
    #[derive(Clone, Debug, PartialEq)]
    pub struct CrossingMeasure {
        ..target: FieldKeys,
        /// Reference position, m.
        pub at: [f64; 3],
        /// The value.
        pub value: f64,
        /// Crossings up to this time do not count, s.
        #[serde(default)]
        pub after: f64,
    }
}

flattened! {
    /// The time at which a field first exceeds a value.
    #[derive(Clone, Debug, PartialEq)]
    pub struct OnsetMeasure {
        ..target: ScalarKeys,
        /// Region; the whole body when left out.
        #[serde(default)]
        pub region: Option<String>,
        /// The value.
        pub above: f64,
    }
}

flattened! {
    /// The farthest point at which a field exceeds a value. Over time, states without such a point do not count.
    #[derive(Clone, Debug, PartialEq)]
    pub struct TipMeasure {
        ..target: ScalarKeys,
        ..times: Times,
        /// The value.
        pub above: f64,
        /// Direction in which the farthest point is taken.
        pub along: [f64; 3],
        /// Where a crack starts, m: gives the angle of the line from there to the tip from x towards y, degrees, in place of the position.
        #[serde(default)]
        pub angle_from: Option<[f64; 2]>,
    }
}

flattened! {
    /// One number for all points of a region.
    #[derive(Clone, Debug, PartialEq)]
    pub struct StatisticMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Region; the whole body when left out.
        #[serde(default)]
        pub region: Option<String>,
        /// Which number.
        pub statistic: Statistic,
        /// Only the points where another field is above a value.
        #[serde(default, rename = "where", skip_serializing_if = "Option::is_none")]
        pub condition: Option<Above>,
        /// Added to the number.
        #[serde(default)]
        pub offset: f64,
    }
}

flattened! {
    /// Position of the largest or smallest value in a region.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PlaceMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Region; the whole body when left out.
        #[serde(default)]
        pub region: Option<String>,
        /// Which value.
        pub of: Extreme,
    }
}

/// One end of a range of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Extreme {
    /// Largest.
    Max,
    /// Smallest.
    Min,
}

flattened! {
    /// Deviation of a field from a formula: its norm over that of the formula.
    #[derive(Clone, Debug, PartialEq)]
    pub struct DeviationMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Expected value, in the reference position x, y, z (m) and the time t (s).
        pub expected: Formula,
        /// Region; the whole body when left out.
        #[serde(default)]
        pub region: Option<String>,
        /// Norm over the points.
        #[serde(default)]
        pub norm: Norm,
    }
}

flattened! {
    /// Alternation of a field from row to row: a quarter of its second difference `f(-h) - 2 f(0) + f(h)` along each axis, at all
    /// points of a region between two others with material.
    #[derive(Clone, Debug, PartialEq)]
    pub struct AlternationMeasure {
        ..target: FieldKeys,
        ..times: Times,
        /// Region; the whole body when left out.
        #[serde(default)]
        pub region: Option<String>,
        /// Norm over points and axes.
        #[serde(default)]
        pub norm: Norm,
    }
}

/// Norm over many points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Norm {
    /// Root of the mean square.
    #[default]
    L2,
    /// Largest by size.
    Largest,
}

flattened! {
    /// Extent of the region above an isotherm. Over time, states without such a region do not count.
    #[derive(Clone, Debug, PartialEq)]
    pub struct MeltPoolMeasure {
        ..times: Times,
        /// Body; may be left out when there is only one.
        #[serde(default)]
        pub body: Option<String>,
        /// Isotherm, K.
        pub isotherm: f64,
        /// Which of its extents, with the directions of the nearest heat source; without one it travels along x.
        pub extent: Extent,
    }
}

/// An extent of a melt pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Extent {
    /// Smallest coordinate along the direction of travel.
    Rear,
    /// Largest coordinate along the direction of travel.
    Front,
    /// Front less rear.
    Length,
    /// Across travel and beam; of both halves where the pool reaches a plane of symmetry (coupler `symmetry`), half of it where
    /// half of a body is simulated without that coupler.
    Width,
    /// Along the beam from the surface before the hottest point.
    Depth,
}

/// The largest relative error of a balance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BalanceMeasure {
    /// Its quantity, such as "heat".
    pub quantity: String,
}

flattened! {
    /// A number that plugins report.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ReportMeasure {
        ..times: Times,
        /// Its name, such as "energy.deposited".
        pub name: String,
        /// Name of another number, which divides it.
        #[serde(default)]
        pub of: Option<String>,
    }
}
