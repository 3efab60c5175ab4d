//! Directions of a moving source in its reports, along which a melt pool is measured.

use nalgebra::Vector3;
use perimelt_core::Report;

use crate::toolpath::{Pose, TimedPath};

/// Directions of a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heading {
    /// Unit vector of travel; while the source rests or jumps, that of the last move with power; zero for a source that never
    /// moves.
    travel: Vector3<f64>,
    /// Unit vector along the axis of the torch or beam, into the material.
    beam: Vector3<f64>,
}

impl Heading {
    /// Directions of a source on a path at `pose`; `moves`: whether the path has a length.
    pub fn new(path: &TimedPath, pose: &Pose, moves: bool) -> Self {
        Heading {
            travel: if moves {
                pose.direction
            } else {
                Vector3::zeros()
            },
            beam: path.spot(pose).1,
        }
    }

    /// The components of both directions.
    pub fn report(&self) -> impl Iterator<Item = Report> {
        let of = |what: &'static str, direction: Vector3<f64>| {
            let axes = ["x", "y", "z"].into_iter().enumerate();
            axes.map(move |(axis, name)| {
                Report::new(format!("{what}.{name}"), "1", direction[axis])
            })
        };
        of("travel", self.travel).chain(of("beam", self.beam))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Vector3;

    use crate::toolpath::Toolpath;

    #[test]
    fn a_jump_without_power_keeps_the_direction_of_the_last_move_with_power() {
        // a jump before the first track, two tracks in opposite directions, and a jump between them
        let path = "polyline = { start = [0, 1, 0], speed = 1, segments = [
            { to = [0, 0, 0], power = 0 },
            { to = [2, 0, 0] },
            { to = [2, 3, 0], power = 0 },
            { to = [0, 3, 0] },
            { to = [0, 3, 0], dwell = 1, dwell_power = 0 } ] }";
        let path: Toolpath = toml::from_str(path).expect("well formed");
        let track = path.track(Some(100.0), Path::new("")).expect("valid");
        for (time, direction) in [
            (0.5, [0.0, -1.0, 0.0]),
            (2.0, [1.0, 0.0, 0.0]),
            (4.5, [1.0, 0.0, 0.0]),
            (7.0, [-1.0, 0.0, 0.0]),
            (8.5, [-1.0, 0.0, 0.0]),
            (20.0, [-1.0, 0.0, 0.0]),
        ] {
            let found = track.last_pose_with_power(time).direction;
            assert!(
                (found - Vector3::from(direction)).norm() < 1e-12,
                "{time}: {found}"
            );
        }
        // where the source is does not change
        assert!((track.pose(4.5).position - Vector3::new(2.0, 1.5, 0.0)).norm() < 1e-12);
    }
}
