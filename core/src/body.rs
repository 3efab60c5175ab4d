//! Bodies: a named set of points on a lattice, their materials and regions.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::family::Cut;
use crate::material::Material;
use crate::shape::{Bounds, Shape};

/// Marks a lattice cell without a point.
pub const NO_POINT: u32 = u32::MAX;

/// Uniform grid of cubic cells; points sit at the centres of the cells inside the body.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Lower corner of cell (0, 0, 0), m.
    pub origin: Vector3<f64>,
    /// Edge of a cell, m.
    pub spacing: f64,
    /// Number of cells along x, y, z (1 along axes that the body's dimension leaves out).
    pub cells: [usize; 3],
    /// Point of each cell (x runs fastest), [`NO_POINT`] where there is no material.
    pub point_of_cell: Vec<u32>,
    /// Cell of each point.
    pub cell_of_point: Vec<[u32; 3]>,
}

impl Lattice {
    /// Point in the cell with the given (possibly outside) indices.
    pub fn point(&self, cell: [i64; 3]) -> Option<usize> {
        if (0..3).any(|a| cell[a] < 0 || cell[a] >= self.cells[a] as i64) {
            return None;
        }
        let [i, j, k] = cell.map(|c| c as usize);
        let point = self.point_of_cell[(k * self.cells[1] + j) * self.cells[0] + i];
        (point != NO_POINT).then_some(point as usize)
    }

    /// Whether every cell holds a point.
    pub fn is_full(&self) -> bool {
        self.cell_of_point.len() == self.point_of_cell.len()
    }
}

/// The points of a body.
#[derive(Clone, Debug)]
pub struct Points {
    /// Reference positions, m.
    pub position: Vec<Vector3<f64>>,
    /// Reference volumes, m³ (2D: area times thickness; 1D: length times cross-section).
    pub volume: Vec<f64>,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }
}

/// A named part of a body.
#[derive(Clone, Debug)]
pub struct Region {
    /// Points of the region, ascending.
    pub points: Vec<u32>,
}

/// How a body's families are stored.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Store {
    /// A shared stencil for complete families, rows for the rest: fast, no neighbour list.
    #[default]
    Lattice,
    /// Compressed rows for every point.
    List,
}

/// One of the six faces of a body's lattice.
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

    fn step(self) -> [i64; 3] {
        let mut step = [0; 3];
        step[self.axis()] = if self.is_upper() { 1 } else { -1 };
        step
    }
}

/// An exposed cell face of a surface point.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceCell {
    /// The point.
    pub point: u32,
    /// Direction of the outward normal.
    pub face: Face,
    /// Exposed area, m².
    pub area: f64,
}

/// A named set of points with one discretisation, its materials and regions.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name as in the case file.
    pub name: String,
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Extent across the missing dimensions: thickness in m (2D), cross-section in m² (1D), 1 (3D).
    pub thickness: f64,
    /// The points.
    pub points: Points,
    /// The lattice that the points sit on.
    pub lattice: Lattice,
    /// Materials in use.
    pub materials: Vec<Material>,
    /// Index into `materials` of each point.
    pub material_of_point: Vec<u16>,
    /// Named regions.
    pub regions: BTreeMap<String, Region>,
    /// How families are stored.
    pub store: Store,
    /// Cracks, which no bond crosses.
    pub cuts: Vec<Cut>,
}

/// Mistakes in the description of a body.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// The shape extends to infinity.
    #[error("the shape has no bounds: intersect the half-space with a box")]
    Unbounded,
    /// The shape cannot be.
    #[error("{0}")]
    Shape(String),
    /// A number that must be positive is not.
    #[error("`{key}` = {value} must be positive")]
    NotPositive {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
    /// Not 1, 2 or 3.
    #[error("`dimension` = {0} must be 1, 2 or 3")]
    Dimension(usize),
    /// No cell centre lies inside the shape.
    #[error("no point: the shape is {extent:?} m, smaller than one cell of {spacing} m")]
    NoPoints {
        /// Size of the bounding box, m.
        extent: [f64; 3],
        /// Spacing, m.
        spacing: f64,
    },
    /// More points than the index type holds.
    #[error("{0:.1e} cells are more than fit (4e9): choose a larger `spacing`")]
    TooManyPoints(f64),
}

impl Body {
    /// Fills `shape` with the centres of cubic cells of edge `spacing` (m). The cells are
    /// aligned with the lower corner of the bounding box; a cell belongs to the body when
    /// its centre lies inside. 1D and 2D bodies lie at the middle of the bounding box in
    /// the missing axes, so that `thickness` need not agree with the shape.
    ///
    /// # Errors
    /// [`BodyError`] when there is nothing to fill or a number is out of range.
    pub fn fill(
        name: &str,
        shape: &Shape,
        dimension: usize,
        spacing: f64,
        thickness: f64,
    ) -> Result<Body, BodyError> {
        if !(1..=3).contains(&dimension) {
            return Err(BodyError::Dimension(dimension));
        }
        for (key, value) in [("spacing", spacing), ("thickness", thickness)] {
            if value.is_nan() || value <= 0.0 {
                return Err(BodyError::NotPositive { key, value });
            }
        }
        if let Some(mistake) = shape.mistake() {
            return Err(BodyError::Shape(mistake));
        }
        let (min, max) = shape.bounds().ok_or(BodyError::Unbounded)?;
        let extent: [f64; 3] = (max - min).into();
        let no_points = || BodyError::NoPoints { extent, spacing };
        let mut cells = [1; 3];
        let mut origin = (min + max) / 2.0 - Vector3::repeat(spacing / 2.0);
        for axis in 0..dimension {
            // a cell is kept when its centre is inside; a thousandth covers rounding of the quotient
            let count = (extent[axis] / spacing + 0.5 + 1e-3).floor();
            if count < 1.0 {
                return Err(no_points());
            }
            if count > 4e9 {
                return Err(BodyError::TooManyPoints(count));
            }
            cells[axis] = count as usize;
            origin[axis] = min[axis];
        }
        let total: f64 = cells.iter().map(|&c| c as f64).product();
        if total >= f64::from(NO_POINT) {
            return Err(BodyError::TooManyPoints(total));
        }

        let mut lattice = Lattice {
            origin,
            spacing,
            cells,
            point_of_cell: vec![NO_POINT; total as usize],
            cell_of_point: Vec::new(),
        };
        let mut position = Vec::new();
        let tolerance = 1e-6 * spacing;
        for (index, point) in lattice.point_of_cell.iter_mut().enumerate() {
            let cell = [
                index % cells[0],
                index / cells[0] % cells[1],
                index / (cells[0] * cells[1]),
            ]
            .map(|c| c as u32);
            let centre = origin + Vector3::from(cell.map(|c| (f64::from(c) + 0.5) * spacing));
            if shape.contains(&centre, tolerance) {
                *point = position.len() as u32;
                position.push(centre);
                lattice.cell_of_point.push(cell);
            }
        }
        if position.is_empty() {
            return Err(no_points());
        }
        let volume = vec![
            spacing.powi(dimension as i32)
                * if dimension == 3 { 1.0 } else { thickness };
            position.len()
        ];
        Ok(Body {
            name: name.to_string(),
            dimension,
            thickness: if dimension == 3 { 1.0 } else { thickness },
            material_of_point: vec![0; position.len()],
            points: Points { position, volume },
            lattice,
            materials: Vec::new(),
            regions: BTreeMap::new(),
            store: Store::default(),
            cuts: Vec::new(),
        })
    }

    /// Points whose centres lie inside `shape`, ascending.
    pub fn points_in(&self, shape: &Shape) -> Region {
        let tolerance = 1e-6 * self.lattice.spacing;
        let inside = |p: &(usize, &Vector3<f64>)| shape.contains(p.1, tolerance);
        let points = self
            .points
            .position
            .iter()
            .enumerate()
            .filter(inside)
            .map(|(i, _)| i as u32);
        Region {
            points: points.collect(),
        }
    }

    /// Bounding box of the cells (not of the centres), m.
    pub fn bounds(&self) -> Bounds {
        let l = &self.lattice;
        (
            l.origin,
            l.origin + Vector3::from(l.cells.map(|c| c as f64 * l.spacing)),
        )
    }

    /// Position of a face of the bounding box along its axis, m.
    pub fn face_position(&self, face: Face) -> f64 {
        let (min, max) = self.bounds();
        if face.is_upper() {
            max[face.axis()]
        } else {
            min[face.axis()]
        }
    }

    /// Area of one cell face normal to `axis`, m².
    pub fn cell_area(&self) -> f64 {
        self.points.volume[0] / self.lattice.spacing
    }

    /// Cell faces that border on no material, facing any of `faces`.
    pub fn surface(&self, faces: &[Face]) -> Vec<SurfaceCell> {
        let area = self.cell_area();
        let mut surface = Vec::new();
        for (point, cell) in self.lattice.cell_of_point.iter().enumerate() {
            for &face in faces.iter().filter(|f| f.axis() < self.dimension) {
                let step = face.step();
                let neighbour = std::array::from_fn(|a| i64::from(cell[a]) + step[a]);
                if self.lattice.point(neighbour).is_none() {
                    surface.push(SurfaceCell {
                        point: point as u32,
                        face,
                        area,
                    });
                }
            }
        }
        surface
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Sphere};

    fn block(max: [f64; 3], dimension: usize, spacing: f64, thickness: f64) -> Body {
        let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
        Body::fill("block", &shape, dimension, spacing, thickness).expect("a valid block")
    }

    #[test]
    fn points_are_cell_centred_and_fill_the_volume() {
        for (dimension, thickness, volume) in [(1, 0.5, 1.5), (2, 0.1, 0.6), (3, 1.0, 6.0)] {
            let body = block([3.0, 2.0, 1.0], dimension, 0.25, thickness);
            assert!((body.points.volume.iter().sum::<f64>() - volume).abs() < 1e-12);
            assert_eq!(body.points.position[0].x, 0.125);
        }
    }

    #[test]
    fn rounding_of_the_quotient_loses_no_row() {
        assert_eq!(
            block([0.1, 0.1, 0.01], 3, 4e-4, 1.0).lattice.cells,
            [250, 250, 25]
        );
    }

    #[test]
    fn a_sphere_has_its_volume_and_a_closed_surface() {
        let shape = Shape::Sphere(Sphere {
            centre: [0.0; 3],
            radius: 1.0,
        });
        let ball = Body::fill("ball", &shape, 3, 0.05, 1.0).expect("a valid ball");
        let volume: f64 = ball.points.volume.iter().sum();
        assert!(
            (volume / 4.18879 - 1.0).abs() < 0.01,
            "staircase volume within 1 %: {volume}"
        );
        let net: Vector3<f64> = ball
            .surface(&Face::ALL)
            .iter()
            .map(|s| s.face.normal() * s.area)
            .sum();
        assert!(net.norm() < 1e-12, "the normals of a closed surface cancel");
    }

    #[test]
    fn a_body_thinner_than_half_a_cell_is_refused() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [1.0, 1.0, 0.1],
        });
        assert!(matches!(
            Body::fill("film", &shape, 3, 0.3, 1.0),
            Err(BodyError::NoPoints { .. })
        ));
    }
}
