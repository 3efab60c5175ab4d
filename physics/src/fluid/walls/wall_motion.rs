//! How fast the points of a wall move, as a fluid sees it.

use nalgebra::Vector3;
use perimelt_core::Body;
use serde::{Deserialize, Serialize};

/// How the points of a wall move: their mean velocities over the last step of the wall.
///
/// The volume that a wall displaces in the fluid is then that of its displacement. The velocity at the end of a step
/// would not do: the fluid would give energy to a wall that yields, in proportion to the step. A wall of sub-steps shorter
/// than those of the fluid vibrates between two impulses, and what it has at the end of each step is the rebound from
/// the pressure. For a wall without forces of its own both are the same.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct WallMotion {
    /// Time at which the points were where they are, s.
    time: f64,
    /// m.
    position: Vec<Vector3<f64>>,
    /// m/s.
    pub(crate) velocity: Vec<Vector3<f64>>,
}

impl WallMotion {
    /// Takes the positions (m) of `body` at a time (s); `velocity` (m/s) counts before the first step.
    pub(crate) fn follow(
        &mut self,
        body: &Body,
        time: f64,
        positions: &[Vector3<f64>],
        velocity: &[Vector3<f64>],
    ) {
        if self.position.len() != positions.len() {
            self.velocity = velocity.to_vec();
        } else if time > self.time {
            let size = time - self.time;
            let ways = positions.iter().zip(&self.position);
            let mean = |(x, from): (&Vector3<f64>, _)| shortest(body, x - from) / size;
            self.velocity.clear();
            self.velocity.extend(ways.map(mean));
        } else {
            return;
        }
        self.time = time;
        self.position.clear();
        self.position.extend_from_slice(positions);
    }
}

/// A way (m) without the extents of a periodic body that a point has been moved by.
pub(crate) fn shortest(body: &Body, mut way: Vector3<f64>) -> Vector3<f64> {
    for axis in (0..body.dimension).filter(|axis| body.periodic[*axis]) {
        let extent = body.extent(axis);
        way[axis] -= extent * (way[axis] / extent).round();
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::Axis;
    use perimelt_core::shape::{BoxShape, Shape};

    #[test]
    fn a_wall_moves_with_its_mean_velocity_over_its_own_steps() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 1.0, 1.0],
        });
        let mut body = Body::fill("wall", &shape, 2, 1.0, 1.0).expect("valid");
        body.repeat(&[Axis::X]).expect("it covers both faces");
        let at = |x: f64| vec![Vector3::new(x, 0.0, 0.0)];
        let mut motion = WallMotion::default();
        motion.follow(&body, 0.0, &at(1.0), &at(7.0));
        assert_eq!(motion.velocity, at(7.0), "no step yet");
        motion.follow(&body, 0.5, &at(2.0), &at(-7.0));
        assert_eq!(motion.velocity, at(2.0));
        // the fluid takes several sub-steps in one of the wall
        motion.follow(&body, 0.5, &at(2.0), &at(-7.0));
        assert_eq!(motion.velocity, at(2.0));
        // through the periodic face
        motion.follow(&body, 1.0, &at(-1.0), &at(-7.0));
        assert_eq!(motion.velocity, at(2.0));
    }
}
