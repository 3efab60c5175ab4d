//! Faces of the box around a body.

use nalgebra::Vector3;

use super::Body;

/// One of the six faces of a body's box.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
pub enum Face {
    /// The face with the smallest x.
    #[serde(rename = "x-")]
    XMin,
    /// The face with the largest x.
    #[serde(rename = "x+")]
    XMax,
    /// The face with the smallest y.
    #[serde(rename = "y-")]
    YMin,
    /// The face with the largest y.
    #[serde(rename = "y+")]
    YMax,
    /// The face with the smallest z.
    #[serde(rename = "z-")]
    ZMin,
    /// The face with the largest z.
    #[serde(rename = "z+")]
    ZMax,
}

impl Face {
    /// All faces.
    pub const ALL: [Face; 6] = [
        Face::XMin,
        Face::XMax,
        Face::YMin,
        Face::YMax,
        Face::ZMin,
        Face::ZMax,
    ];

    /// Axis of the normal: 0, 1, 2 for x, y, z.
    pub fn axis(self) -> usize {
        self as usize / 2
    }

    /// Whether the outward normal points along the positive axis.
    pub fn is_upper(self) -> bool {
        self as usize % 2 == 1
    }

    /// The bit of the face in a set of faces.
    pub(crate) fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Name as in case files.
    pub fn name(self) -> &'static str {
        ["x-", "x+", "y-", "y+", "z-", "z+"][self as usize]
    }

    /// Outward unit normal.
    pub fn normal(self) -> Vector3<f64> {
        let mut normal = Vector3::zeros();
        normal[self.axis()] = if self.is_upper() { 1.0 } else { -1.0 };
        normal
    }

    /// The face across the box.
    pub fn opposite(self) -> Face {
        Face::ALL[self as usize ^ 1]
    }

    pub(super) fn step(self) -> [i64; 3] {
        let mut step = [0; 3];
        step[self.axis()] = if self.is_upper() { 1 } else { -1 };
        step
    }
}

impl Body {
    /// Centre of a cell face of a point, m.
    pub(crate) fn face_centre(&self, point: usize, face: Face) -> Vector3<f64> {
        self.points.position.at(point) + face.normal() * self.face_distance(point, face)
    }

    /// Whether a cell face of a point lies in that face of the box around the body, and is no step or wall of a hole.
    pub(crate) fn lies_in_face(&self, point: usize, face: Face) -> bool {
        let axis = face.axis();
        let apart = self.face_centre(point, face)[axis] - self.face_position(face);
        apart.abs() < 0.25 * self.width(point, axis)
    }
}
