//! Waits of a toolpath, until a temperature has fallen below a value or risen above it.

use nalgebra::Vector3;
use perimelt_core::numbers::check_positive;
use perimelt_core::text::position;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::activity::is_active;
use perimelt_core::{Body, Read, Setup, SetupError, World};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a toolpath waits for, such as the interpass temperature: `wait_until = { temperature = 423, region = "weld" }`.
///
/// The torch is off meanwhile. The wait ends at the first step whose start meets the condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaitUntil {
    /// Temperature (K).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub temperature: f64,
    /// Whether the path goes on below this temperature (interpass temperature) or above it (preheating); default `below`.
    #[serde(default)]
    pub when: Side,
    /// Region of the heated body whose temperature counts: the highest one for `below`, the lowest one for `above`. Default
    /// the whole body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// Place of a thermocouple (m), instead of `region`: the nearest point of the body that has material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
}

/// Which side of a temperature a toolpath waits for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Until it is colder.
    #[default]
    Below,
    /// Until it is hotter.
    Above,
}

impl WaitUntil {
    /// Whether the path may go on at this temperature, K.
    pub(super) fn is_over(&self, temperature: f64) -> bool {
        match self.when {
            Side::Below => temperature <= self.temperature,
            Side::Above => temperature >= self.temperature,
        }
    }

    /// Checks the condition and finds its points.
    pub(super) fn gauge(
        &self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Gauge, SetupError> {
        let refuse =
            |message: String, expected: &str| Err(SetupError::value("toolpath", message, expected));
        let in_toolpath = |e: SetupError| SetupError {
            key: "toolpath".into(),
            ..e
        };
        check_positive("wait_until.temperature", self.temperature, "K").map_err(in_toolpath)?;
        let points = match (&self.region, self.at) {
            (Some(_), Some(_)) => {
                let message = "`wait_until` has both `region` and `at`".into();
                return refuse(message, "one of them, or neither for the whole body");
            }
            (Some(region), None) => Points::Region(setup.region(body, "toolpath", region)?.points),
            (None, Some(at)) => {
                let at = Vector3::from(at);
                let owned = setup.world().reducer(body).owned();
                let body = setup.body(body);
                let (min, max) = body.bounds();
                let margin = body.finest_spacing();
                let outside = |axis: usize| {
                    !(at[axis] >= min[axis] - margin && at[axis] <= max[axis] + margin)
                };
                if (0..body.dimension).any(outside) {
                    let message = format!(
                        "`wait_until.at` is {} m, but body `{}` spans {} to {} m",
                        position(at),
                        body.name,
                        position(min),
                        position(max),
                    );
                    return refuse(message, "a place on the body");
                }
                let nearest = nearest(body, &at, |point| point < owned).unwrap_or(0);
                Points::Place { at, nearest }
            }
            (None, None) => Points::All,
        };
        Ok(Gauge {
            points,
            when: self.when,
        })
    }

    /// The condition, as a phrase.
    pub(super) fn phrase(&self) -> String {
        let side = match self.when {
            Side::Below => "at most",
            Side::Above => "at least",
        };
        let place = match (&self.region, self.at) {
            (Some(region), _) => format!(" in region `{region}`"),
            (None, Some(at)) => format!(" at {at:?} m"),
            (None, None) => String::new(),
        };
        format!("{side} {} K{place}", self.temperature)
    }
}

/// Points at which a temperature is measured.
#[derive(Debug)]
pub(super) struct Gauge {
    points: Points,
    when: Side,
}

#[derive(Debug)]
enum Points {
    All,
    Region(Vec<u32>),
    /// A position (m) and the nearest point that this process owns.
    Place {
        at: Vector3<f64>,
        nearest: usize,
    },
}

impl Gauge {
    /// The measured temperature, K; `None` where there is no material. Collective.
    pub(super) fn measure(
        &self,
        world: &World,
        body: BodyIndex,
        temperature: Read<f64>,
    ) -> Option<f64> {
        let values = world.read(temperature);
        let activity = world.activity(body);
        let is_there = |point: usize| activity.as_ref().is_none_or(|a| is_active(a[point]));
        let reducer = world.reducer(body);
        let extreme = |points: &mut dyn Iterator<Item = usize>| {
            let points = points.filter(|p| *p < reducer.owned() && is_there(*p));
            let values = points.map(|p| values[p]);
            let extreme = match self.when {
                Side::Below => reducer.max(values.fold(f64::NEG_INFINITY, f64::max)),
                Side::Above => reducer.min(values.fold(f64::INFINITY, f64::min)),
            };
            extreme.is_finite().then_some(extreme)
        };
        match &self.points {
            Points::All => extreme(&mut (0..values.len())),
            Points::Region(points) => extreme(&mut points.iter().map(|p| *p as usize)),
            Points::Place { at, nearest: known } => {
                let this = world.body(body);
                let own = match is_there(*known) {
                    true => Some(*known),
                    false => nearest(this, at, |p| p < reducer.owned() && is_there(p)),
                };
                let or_none = |number: Option<f64>| number.unwrap_or(f64::INFINITY);
                let distance = own.map(|point| square_distance(this, point, at));
                let least = reducer.min(or_none(distance));
                let own = own.filter(|_| distance == Some(least));
                let number = own.map(|point| f64::from(reducer.number(point)));
                let first = reducer.min(or_none(number));
                let own = own.filter(|_| number == Some(first));
                let value = reducer.min(or_none(own.map(|point| values[point])));
                value.is_finite().then_some(value)
            }
        }
    }
}

/// The point nearest to a position (m) among those that pass a test.
fn nearest(body: &Body, at: &Vector3<f64>, test: impl Fn(usize) -> bool) -> Option<usize> {
    let distance = |point: &usize| square_distance(body, *point, at);
    let points = (0..body.points.len()).filter(|point| test(*point));
    points.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Square of the distance of a point from a position (m) along the axes of the body, m².
fn square_distance(body: &Body, point: usize, at: &Vector3<f64>) -> f64 {
    let apart = body.points.position.at(point) - at;
    let along = (0..body.dimension).map(|axis| apart[axis] * apart[axis]);
    along.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, set};
    use perimelt_core::keys;

    #[test]
    fn a_thermocouple_reads_the_nearest_point_that_is_there() {
        let mut world = World::new(vec![block([5, 1, 1], 1, STEEL)]);
        let wait: WaitUntil = toml::from_str("temperature = 400\nat = [3.6, 0, 0]").expect("keys");
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("the torch");
        let temperature = setup.read(0, &keys::TEMPERATURE).expect("a field");
        let gauge = wait.gauge(&mut setup, 0).expect("a place on the body");
        setup.next_plugin("the physics");
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup
            .change_material(0, perimelt_core::Change::Births, &[])
            .expect("free");
        setup.finish().expect("valid");
        set(&mut world, &keys::TEMPERATURE, |point| 100.0 * point as f64);
        for (there, expected) in [
            ([1.0, 1.0, 1.0, 1.0, 1.0], Some(300.0)),
            ([1.0, 1.0, 1.0, 0.0, 1.0], Some(400.0)),
            ([1.0, 1.0, 1.0, 0.0, 0.0], Some(200.0)),
            ([1.0, 0.0, 0.0, 0.0, 0.0], Some(0.0)),
            ([0.0; 5], None),
        ] {
            set(&mut world, &keys::ACTIVE, |point| there[point]);
            assert_eq!(gauge.measure(&world, 0, temperature), expected);
        }
    }
}
