//! How far the surface of a body lies from its outermost points.

use super::Fact;
use crate::body::{Body, Face};

/// Distance of the surface of a body from its outermost points, in spacings, as the sums over families make it for the field that is
/// exchanged through the surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceDepths {
    /// Where no points are mirrored behind the surface.
    pub bare: f64,
    /// Where points are, at faces of the box around the body.
    pub mirrored: f64,
    /// Whether points are mirrored behind each face ([`Face::ALL`]).
    pub is_mirrored: [bool; 6],
}

impl Default for SurfaceDepths {
    fn default() -> Self {
        SurfaceDepths {
            bare: 0.5,
            mirrored: 0.5,
            is_mirrored: [false; 6],
        }
    }
}

impl SurfaceDepths {
    /// At a cell face of a point. Behind a step or the wall of a hole nothing is mirrored, whichever way it faces.
    pub fn at(&self, body: &Body, point: usize, face: Face) -> f64 {
        match self.is_mirrored[face as usize] && body.lies_in_face(point, face) {
            true => self.mirrored,
            false => self.bare,
        }
    }
}

impl Fact for SurfaceDepths {}
