//! Faces of the box around a body, and the bare cell faces of its points.

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
        self.points.position[point] + face.normal() * self.face_distance(point, face)
    }

    /// Whether a cell face of a point lies in that face of the box around the body, and is no step or wall of a hole.
    pub(crate) fn lies_in_face(&self, point: usize, face: Face) -> bool {
        let axis = face.axis();
        let apart = self.face_centre(point, face)[axis] - self.face_position(face);
        apart.abs() < 0.25 * self.width(point, axis)
    }
}

/// An exposed cell face of a surface point.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceCell {
    /// The point.
    pub point: u32,
    /// Direction of the outward normal.
    pub face: Face,
    /// Exposed area of the cell face, m²: times the normal it sums up to the resultant of a pressure.
    pub face_area: f64,
    /// Area of the true surface that the cell face stands for, m²: sums are those of the shape.
    pub area: f64,
    /// Whether it is a step of an inclined or curved surface, which lies up to half a spacing beside it.
    pub is_step: bool,
}

/// Least cosine of the angle between a step and its surface that counts in [`SurfaceCell::contact_distance`].
const LEAST_COSINE: f64 = 0.25;

impl SurfaceCell {
    /// Area of the true surface over that of the cell face, which is also the distance of the surface from the point over that along
    /// the axis of the face: one, and less at steps.
    pub fn cosine(&self) -> f64 {
        self.area / self.face_area
    }

    /// Largest distance (m) along the axis at which a cell face lies against one of another body, with these spacings (m): half of
    /// the smaller one. Where both are steps of an inclined or curved surface they lie beside it by up to half of both spacings, across
    /// the surface.
    pub fn contact_distance(&self, spacings: [f64; 2], other_is_step: bool) -> f64 {
        let [a, b] = spacings;
        let distance = match self.is_step && other_is_step {
            true => (a + b) / self.cosine().max(LEAST_COSINE),
            false => a.min(b),
        };
        // rounding
        0.5 * (1.0 + 1e-9) * distance
    }
}
