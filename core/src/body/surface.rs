//! The surface of a body: the bare cell faces of its points and the true surface behind them.

use nalgebra::Vector3;

use super::{Body, Discretisation, Face};
use crate::shape::SurfacePart;

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
    /// Outward unit normal of the inclined or curved surface of which the cell face is a step; the surface lies up to half a spacing
    /// beside it.
    pub step_of: Option<Vector3<f64>>,
}

/// Least cosine of the angle between a step and its surface that counts in [`SurfaceCell::contact_distance`].
const LEAST_COSINE: f64 = 0.25;

impl SurfaceCell {
    /// Whether it is a step of an inclined or curved surface.
    pub fn is_step(&self) -> bool {
        self.step_of.is_some()
    }

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
        let distance = match self.is_step() && other_is_step {
            true => (a + b) / self.cosine().max(LEAST_COSINE),
            false => a.min(b),
        };
        // rounding
        0.5 * (1.0 + 1e-9) * distance
    }
}

impl Body {
    /// The nearest part of the surface of the shape that the points fill to a position (m), among those that face `outward`; `None` for a body
    /// whose surface is that of its cells, such as a box.
    pub fn surface_near(&self, at: Vector3<f64>, outward: Vector3<f64>) -> Option<SurfacePart> {
        self.outline.as_ref()?.near(at, outward)
    }

    /// Whether the cell of a point has a bare face in a direction that is a step of an inclined or curved surface.
    pub(crate) fn is_step(&self, point: usize, face: Face) -> bool {
        self.neighbour(point, face).is_none() && self.true_surface(point, face).1.is_some()
    }

    /// Whether some bare cell face is a step of an inclined or curved surface.
    pub fn has_steps(&self) -> bool {
        let is_outlined = self.outline.is_some() || self.layers().is_some();
        let faces = || Face::ALL.into_iter().filter(|f| f.axis() < self.dimension);
        is_outlined && (0..self.points.len()).any(|p| faces().any(|face| self.is_step(p, face)))
    }

    /// Area of the true surface over that of a bare face of a cell, and its normal if the face is a step of it.
    fn true_surface(&self, point: usize, face: Face) -> (f64, Option<Vector3<f64>>) {
        match &self.discretisation {
            // edges of plies are those of the plane
            Discretisation::Layers(layers) if face.axis() < 2 => {
                layers.plane().true_surface(layers.place(point).1, face)
            }
            _ => {
                let outline = self.outline.as_ref();
                outline.map_or((1.0, None), |o| o.fraction(&self.points, point, face))
            }
        }
    }

    /// Bare cell faces with a normal among `faces`; for a cloud, with the bare part of their area.
    pub fn surface(&self, faces: &[Face]) -> Vec<SurfaceCell> {
        self.surface_of(0..self.points.len(), faces, |_| true)
    }

    /// [`Body::surface`] of some points of a body that consists of the points with material only; on a cloud all points
    /// have material.
    pub fn surface_of(
        &self,
        points: impl Iterator<Item = usize>,
        faces: &[Face],
        has_material: impl Fn(usize) -> bool,
    ) -> Vec<SurfaceCell> {
        let faces = faces.iter().filter(|f| f.axis() < self.dimension);
        let mut surface = Vec::new();
        for point in points.filter(|&p| has_material(p)) {
            for &face in faces.clone() {
                let whole = self.points.volume[point] / self.width(point, face.axis());
                let bare = match &self.discretisation {
                    Discretisation::Lattice(_) | Discretisation::Layers(_) => {
                        let covers = self.neighbour(point, face);
                        f64::from(u8::from(!covers.is_some_and(&has_material)))
                    }
                    // it fills its box
                    Discretisation::Cloud(_) if self.periodic[face.axis()] => 0.0,
                    Discretisation::Cloud(cloud) => {
                        cloud.bare_fraction(self.dimension, &self.points.spacing, point, face)
                    }
                };
                if bare > 0.0 {
                    let face_area = bare * whole;
                    let (fraction, step_of) = self.true_surface(point, face);
                    surface.push(SurfaceCell {
                        point: point as u32,
                        face,
                        face_area,
                        area: fraction * face_area,
                        step_of,
                    });
                }
            }
        }
        surface
    }
}

/// Points of a body whose cells others may lie against, the same in all processes that share it.
#[derive(Clone, Debug, Default)]
pub struct SurfacePoints {
    /// Numbers in the whole body, ascending.
    pub number: Vec<u32>,
    /// Reference positions, m.
    pub position: Vec<Vector3<f64>>,
    /// m³.
    pub volume: Vec<f64>,
    /// Edges of the cells, m.
    pub width: Vec<[f64; 3]>,
    /// Distance of each face ([`Face::ALL`]) of a cell from the point, m.
    pub(crate) distance: Vec<[f64; 6]>,
    /// Whether each face of a cell is a step of an inclined or curved surface.
    pub(crate) is_step: Vec<[bool; 6]>,
    /// Bare cell faces, by the places of their points in these lists.
    pub cells: Vec<SurfaceCell>,
}

impl SurfacePoints {
    /// Those of a whole body with bare cell faces; all points where any may become bare.
    pub(crate) fn of(body: &Body, may_any: bool) -> SurfacePoints {
        let mut cells = body.surface(&Face::ALL);
        let mut number: Vec<u32> = match may_any {
            true => (0..body.points.len() as u32).collect(),
            false => cells.iter().map(|cell| cell.point).collect(),
        };
        number.dedup();
        for cell in &mut cells {
            let place = number.partition_point(|number| *number < cell.point);
            cell.point = place as u32;
        }
        let mut points = SurfacePoints::default();
        for point in number.iter().map(|number| *number as usize) {
            points.position.push(body.points.position.at(point));
            points.volume.push(body.points.volume[point]);
            points
                .width
                .push([0, 1, 2].map(|axis| body.width(point, axis)));
            let distance = |face| body.face_distance(point, face);
            points.distance.push(Face::ALL.map(distance));
            points
                .is_step
                .push(Face::ALL.map(|face| body.is_step(point, face)));
        }
        SurfacePoints {
            number,
            cells,
            ..points
        }
    }
}
