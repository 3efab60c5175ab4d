//! Directions of a moving source, which its reports give beside its position: a melt pool is measured along them.

use nalgebra::Vector3;
use perimelt_core::Report;

use crate::source::{Depositor, HeatedSurface};
use crate::toolpath::Pose;

/// Directions of a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heading {
    /// Unit vector of travel, that of the last move while the source rests; zero for a source that never moves.
    travel: Vector3<f64>,
    /// Unit vector along the axis of the torch or beam, into the material.
    beam: Vector3<f64>,
}

impl Heading {
    /// Of a source at `pose`; `moves`: whether its path has a length.
    pub fn new(depositor: &Depositor, surface: HeatedSurface, pose: &Pose, moves: bool) -> Self {
        let mut inward = Vector3::zeros();
        inward[surface.face.axis()] = if surface.face.is_upper() { -1.0 } else { 1.0 };
        Heading {
            travel: if moves {
                pose.direction
            } else {
                Vector3::zeros()
            },
            beam: pose.torch.or(depositor.axis()).unwrap_or(inward),
        }
    }

    /// The components of both directions.
    pub fn report(&self) -> impl Iterator<Item = Report> {
        let of = |what: &'static str, direction: Vector3<f64>| {
            let axes = ["x", "y", "z"].into_iter().enumerate();
            axes.map(move |(axis, name)| Report {
                name: format!("{what}.{name}"),
                unit: "1".into(),
                value: direction[axis],
            })
        };
        of("travel", self.travel).chain(of("beam", self.beam))
    }
}
