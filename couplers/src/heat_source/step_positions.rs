//! Positions of the points of a fluid in the middle of a step, at which a source is sampled.
//!
//! The physics that moves the points has advanced them to the end of the macro step when the source is applied, if it comes
//! before `thermal` in the case file. Positions between are interpolated, so that a trail is centred at steps of any length.

use nalgebra::Vector3;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, World};

/// Positions of points that move during a macro step; empty for a body at rest.
#[derive(Debug, Default)]
pub(super) struct StepPositions {
    /// Positions at the start of the macro step, m.
    start: Vec<Vector3<f64>>,
    /// Start of the macro step, s.
    start_time: f64,
    /// Interpolated positions, m.
    now: Vec<Vector3<f64>>,
    /// Speed of the fastest point in the last step, m/s; part of a checkpoint.
    pub speed: f64,
}

impl StepPositions {
    /// Stores the positions at the start of a macro step, at `time` (s).
    pub fn begin_step(&mut self, world: &World, body: BodyIndex, time: f64) {
        if let Some(now) = world.moving_points(body) {
            self.start.clear();
            self.start.extend_from_slice(now.positions());
            self.start_time = time;
        }
    }

    /// Positions at `time` (s) of this macro step, m; `None` where points rest.
    pub fn at(&mut self, world: &World, body: BodyIndex, time: f64) -> Option<&[Vector3<f64>]> {
        let now = world.moving_points(body)?;
        self.now.clear();
        self.now.extend_from_slice(now.positions());
        let duration = world.time_of_points(body) - self.start_time;
        if self.start.len() == self.now.len() && duration > 0.0 {
            let fraction = (time - self.start_time) / duration;
            let farthest = interpolate(world.body(body), &self.start, fraction, &mut self.now);
            self.speed = farthest / duration;
        }
        Some(&self.now)
    }
}

/// Replaces positions at the end of a step by those after a fraction of it; returns the largest displacement, m. Points may
/// cross periodic sides.
fn interpolate(
    body: &Body,
    start: &[Vector3<f64>],
    fraction: f64,
    end: &mut [Vector3<f64>],
) -> f64 {
    let (low, high) = body.bounds();
    let mut farthest: f64 = 0.0;
    for (start, end) in start.iter().zip(end) {
        let mut way = *end - start;
        for axis in (0..body.dimension).filter(|a| body.periodic[*a]) {
            let period = high[axis] - low[axis];
            way[axis] -= period * (way[axis] / period).round();
        }
        *end = start + fraction * way;
        for axis in (0..body.dimension).filter(|a| body.periodic[*a]) {
            let period = high[axis] - low[axis];
            end[axis] -= period * ((end[axis] - low[axis]) / period).floor();
        }
        farthest = farthest.max(way.norm());
    }
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block};
    use perimelt_core::Axis;

    #[test]
    fn ways_lead_through_periodic_sides() {
        let mut body = block([10, 4, 1], 2, STEEL);
        body.repeat(&[Axis::X]).expect("it fills its box");
        let place = |x: f64, y: f64| Vector3::new(x, y, 0.5);
        let start = [place(9.5, 1.0), place(2.0, 1.0), place(0.25, 1.0)];
        let mut end = [place(0.5, 1.0), place(3.0, 3.0), place(9.25, 1.0)];
        let farthest = interpolate(&body, &start, 0.75, &mut end);
        let expected = [place(0.25, 1.0), place(2.75, 2.5), place(9.5, 1.0)];
        for (end, expected) in end.iter().zip(expected) {
            assert!((end - expected).norm() < 1e-14, "{end} {expected}");
        }
        assert!((farthest - 5.0f64.sqrt()).abs() < 1e-14);
    }
}
