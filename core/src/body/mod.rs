//! Bodies: a named set of points, their discretisation, materials and regions.
//!
//! The points of a body are the centres of the cells of one uniform [`Lattice`] ([`Body::fill`]),
//! a [`Cloud`]: cells of several sizes ([`Body::fill_zones`]), displaced at random
//! ([`Body::jittered`]), or read from a table ([`Body::from_table`]), or the [`Layers`] of a laminate ([`Body::stack`]).

mod cloud;
mod cut;
mod face;
mod horizon;
mod horizons;
mod images;
mod interpolate;
mod lattice;
mod layers;
mod outline;
mod overlap;
mod part;
pub(crate) mod partition;
mod points;
mod surface;
mod table;
mod zones;

pub(crate) use cloud::Curve;
pub use cloud::{Cloud, Jitter};
pub use cut::{Cut, severed};
pub use face::Face;
pub use horizon::{Horizon, HorizonError};
pub use horizons::Horizons;
pub use images::{BoxImage, BoxImages};
pub use interpolate::weights_among;
pub use lattice::{Lattice, NO_POINT};
pub use layers::{Layer, Layers, Layup, LayupError, Ply, Stations};
pub use part::Part;
pub use points::{PointRule, PointValues, Points, Positions, Same, Sizes};
pub use surface::{SurfaceCell, SurfacePoints};
pub use table::{POINT_COLUMNS, PointTableError};
pub use zones::{Zone, ZoneError};

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::material::Material;
use crate::shape::{Bounds, Shape};
use crate::text::{number, position};

use outline::Outline;

/// A named part of a body.
#[derive(Clone, Debug)]
pub struct Region {
    /// Points of the region, ascending.
    pub points: Vec<u32>,
}

/// How the points of a body are laid out.
#[derive(Clone, Debug)]
pub enum Discretisation {
    /// Centres of the cells of one uniform grid.
    Lattice(Arc<Lattice>),
    /// Points with individual spacings.
    Cloud(Box<Cloud>),
    /// Layers of points over one plane grid.
    Layers(Layers),
}

/// How the families of a body on a lattice are stored; a cloud always has rows.
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
    /// How the points are laid out.
    pub discretisation: Discretisation,
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
    /// Axes along which the body is periodic; it must then fill its box ([`Body::repeat`]).
    pub periodic: [bool; 3],
    /// Box whose faces bound the motion of the body, m; the bounding box when left out
    /// ([`Body::enclose`]).
    pub tank: Option<Bounds>,
    /// The true surface, where the points fill a shape.
    outline: Option<Outline>,
}

/// Mistakes in the description of a body.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// The shape extends to infinity.
    #[error("the shape has no bounds: intersect the half-space with a box")]
    Unbounded,
    /// The shape is invalid.
    #[error("{0}")]
    Shape(String),
    /// A number that is not positive, or infinite.
    #[error("`{key}` = {value} must be positive and finite")]
    NotPositive {
        /// The key.
        key: &'static str,
        /// Value of the key.
        value: f64,
    },
    /// Not 1, 2 or 3.
    #[error("`dimension` = {0} must be 1, 2 or 3")]
    Dimension(usize),
    /// No cell centre lies inside the shape.
    #[error("the body has no points: its shape of {} m is smaller than one cell of {} m", position(*extent), number(*spacing, 5))]
    NoPoints {
        /// Size of the bounding box, m.
        extent: [f64; 3],
        /// Spacing, m.
        spacing: f64,
    },
    /// A zone that is invalid.
    #[error("zone {}: {mistake}", number + 1)]
    Zone {
        /// Number of the zone, from 0.
        number: usize,
        /// What is wrong with it.
        mistake: ZoneError,
    },
    /// Zones that leave out a part of the shape.
    #[error("no zone covers the part of the shape around {} m", position(*at))]
    NotCovered {
        /// A position there, m.
        at: [f64; 3],
    },
    /// Points displaced out of their cells.
    #[error("`jitter.amplitude` = {0} must be at least 0 and below 0.5")]
    Jitter(f64),
    /// An axis that is named twice.
    #[error("the axis {} is named twice", ["x", "y", "z"][axis.index()])]
    RepeatedTwice {
        /// The axis.
        axis: Axis,
    },
    /// A body that cannot be periodic.
    #[error("a {dimension}D body cannot be periodic along {}: it must have that axis and cover both faces across it", ["x", "y", "z"][axis.index()])]
    Repeated {
        /// The axis.
        axis: Axis,
        /// Dimension of the body.
        dimension: usize,
    },
    /// A tank that does not contain the body.
    #[error("the tank does not contain the body, which reaches from {} m to {} m", position(*low), position(*high))]
    Tank {
        /// Lower corner of the body, m.
        low: [f64; 3],
        /// Upper corner of the body, m.
        high: [f64; 3],
    },
    /// A table of points that cannot be read.
    #[error(transparent)]
    Table(#[from] PointTableError),
    /// Plies that do not fit.
    #[error(transparent)]
    Layup(#[from] LayupError),
    /// More points than the index type holds.
    #[error("the body has {0:.1e} cells, but at most 4e9 are supported: choose a larger `spacing`")]
    TooManyPoints(f64),
}

impl Body {
    /// A body of the given points, without materials.
    fn new(
        name: &str,
        dimension: usize,
        thickness: f64,
        points: Points,
        discretisation: Discretisation,
    ) -> Body {
        Body {
            name: name.to_string(),
            dimension,
            thickness: if dimension == 3 { 1.0 } else { thickness },
            material_of_point: vec![0; points.len()],
            points,
            discretisation,
            materials: Vec::new(),
            regions: BTreeMap::new(),
            store: Store::default(),
            cuts: Vec::new(),
            periodic: [false; 3],
            tank: None,
            outline: None,
        }
    }

    /// Sets the shape that the points fill.
    fn outlined(mut self, shape: &Shape) -> Body {
        self.outline = Outline::new(shape, &self);
        self
    }

    /// Makes the body periodic along these axes.
    ///
    /// # Errors
    /// When the body has no such axis or does not cover both faces across it.
    pub fn repeat(&mut self, axes: &[Axis]) -> Result<(), BodyError> {
        if let Discretisation::Layers(layers) = &mut self.discretisation {
            layers.plane_mut().repeat(axes)?;
        }
        for (number, &axis) in axes.iter().enumerate() {
            if axes[..number].contains(&axis) {
                return Err(BodyError::RepeatedTwice { axis });
            }
            if axis.index() >= self.dimension || !self.fills_faces(axis.index()) {
                let dimension = self.dimension;
                return Err(BodyError::Repeated { axis, dimension });
            }
            self.periodic[axis.index()] = true;
        }
        Ok(())
    }

    /// Sets the tank: the faces of the box from `min` to `max` (m), instead of those of the bounding box, bound the
    /// motion of the points.
    ///
    /// # Errors
    /// When the box does not contain the body.
    pub fn enclose(&mut self, min: Vector3<f64>, max: Vector3<f64>) -> Result<(), BodyError> {
        let (low, high) = self.bounds();
        // rounding
        let near = 1e-6 * self.finest_spacing();
        let outside = |a: &usize| min[*a] > low[*a] + near || max[*a] < high[*a] - near;
        if (0..self.dimension).any(|a| outside(&a)) {
            return Err(BodyError::Tank {
                low: low.into(),
                high: high.into(),
            });
        }
        self.tank = Some((min, max));
        Ok(())
    }

    /// The lattice; `None` for a cloud and for layers.
    pub fn lattice(&self) -> Option<&Lattice> {
        match &self.discretisation {
            Discretisation::Lattice(lattice) => Some(lattice),
            Discretisation::Cloud(_) | Discretisation::Layers(_) => None,
        }
    }

    /// The layers of a laminate.
    pub fn layers(&self) -> Option<&Layers> {
        match &self.discretisation {
            Discretisation::Layers(layers) => Some(layers),
            Discretisation::Lattice(_) | Discretisation::Cloud(_) => None,
        }
    }

    /// Width of the cell of a point along an axis, m.
    pub fn width(&self, point: usize, axis: usize) -> f64 {
        match &self.discretisation {
            Discretisation::Layers(layers) => layers.width(point, axis),
            Discretisation::Lattice(_) | Discretisation::Cloud(_) => self.points.spacing[point],
        }
    }

    /// Distance of a face of the cell of a point from the point, m.
    pub fn face_distance(&self, point: usize, face: Face) -> f64 {
        match &self.discretisation {
            Discretisation::Layers(layers) => layers.face_distance(point, face),
            Discretisation::Lattice(_) | Discretisation::Cloud(_) => {
                0.5 * self.points.spacing[point]
            }
        }
    }

    /// Smallest spacing of a point, m; in several processes that of the whole body.
    pub fn finest_spacing(&self) -> f64 {
        self.spacings()[0]
    }

    /// Largest spacing of a point, m; in several processes that of the whole body.
    pub fn coarsest_spacing(&self) -> f64 {
        self.spacings()[1]
    }

    fn spacings(&self) -> [f64; 2] {
        match &self.discretisation {
            Discretisation::Lattice(lattice) => [lattice.spacing; 2],
            Discretisation::Cloud(cloud) if let Some(whole) = cloud.whole => whole.spacings,
            _ => {
                let each = self.points.spacing.each();
                [
                    each.clone().fold(f64::INFINITY, f64::min),
                    each.fold(0.0, f64::max),
                ]
            }
        }
    }

    /// Points whose centres lie inside `shape`, ascending.
    pub fn points_in(&self, shape: &Shape) -> Region {
        let tolerance = 1e-6 * self.finest_spacing();
        let inside = |p: &(u32, Vector3<f64>)| shape.contains(&p.1, tolerance);
        let points = (0..).zip(self.points.position.each());
        let points = points.filter(inside).map(|(point, _)| point);
        Region {
            points: points.collect(),
        }
    }

    /// Bounding box of the cells (not of the centres), m.
    pub fn bounds(&self) -> Bounds {
        match &self.discretisation {
            Discretisation::Lattice(lattice) => lattice.bounds(),
            Discretisation::Cloud(cloud) => cloud.bounds(),
            Discretisation::Layers(layers) => layers.bounds(),
        }
    }

    /// Whether the cells of the points fill the bounding box.
    pub fn fills_box(&self) -> bool {
        match &self.discretisation {
            Discretisation::Lattice(lattice) => lattice.is_full(),
            Discretisation::Layers(layers) => layers.plane().fills_box(),
            Discretisation::Cloud(cloud) => {
                if let Some(whole) = cloud.whole {
                    return whole.fills_box;
                }
                let (min, max) = self.bounds();
                let box_volume: f64 = (0..self.dimension).map(|a| max[a] - min[a]).product();
                let volume: f64 = self.points.volume.each().sum();
                // rounding of sums and of spacings given in decimals
                volume > (1.0 - 1e-6) * box_volume * self.thickness
            }
        }
    }

    /// Whether cells of points cover both faces of the bounding box across an axis.
    fn fills_faces(&self, axis: usize) -> bool {
        if let Some(layers) = self.layers() {
            return axis < 2 && layers.plane().fills_faces(axis);
        }
        if self.lattice().is_none() {
            return self.fills_box();
        }
        let (min, max) = self.bounds();
        let cells = |a: usize| ((max[a] - min[a]) / self.finest_spacing()).round();
        let across = (0..self.dimension).filter(|a| *a != axis);
        let expected: f64 = across.map(cells).product();
        [min[axis], max[axis]].into_iter().all(|face| {
            let at_face = |x: &Vector3<f64>| (x[axis] - face).abs() < self.finest_spacing();
            self.points.position.each().filter(at_face).count() as f64 == expected
        })
    }

    /// Position of a face of the tank, or else of the bounding box, along its axis, m.
    pub fn face_position(&self, face: Face) -> f64 {
        let (min, max) = self.tank.unwrap_or_else(|| self.bounds());
        if face.is_upper() {
            max[face.axis()]
        } else {
            min[face.axis()]
        }
    }

    /// Distance of the two faces of an axis ([`Body::face_position`]), m.
    pub fn extent(&self, axis: usize) -> f64 {
        self.face_position(Face::ALL[2 * axis + 1]) - self.face_position(Face::ALL[2 * axis])
    }

    /// The point whose cell touches the middle of a face of the cell of `point`, on a lattice also across periodic sides.
    pub fn neighbour(&self, point: usize, face: Face) -> Option<usize> {
        match &self.discretisation {
            Discretisation::Lattice(lattice) => lattice.neighbour(point, face, self.periodic),
            Discretisation::Cloud(cloud) => {
                cloud.behind(&self.points.spacing, point, face, [0.0; 3])
            }
            Discretisation::Layers(layers) => layers.neighbour(point, face),
        }
    }
}

/// Bounds of the shape, m, after the checks that all discretisations need.
fn bounded(shape: &Shape, dimension: usize, thickness: f64) -> Result<Bounds, BodyError> {
    if !(1..=3).contains(&dimension) {
        return Err(BodyError::Dimension(dimension));
    }
    positive("thickness", thickness)?;
    if let Some(mistake) = shape.mistake() {
        return Err(BodyError::Shape(mistake));
    }
    shape.bounds().ok_or(BodyError::Unbounded)
}

fn positive(key: &'static str, value: f64) -> Result<(), BodyError> {
    if !(value > 0.0 && value.is_finite()) {
        return Err(BodyError::NotPositive { key, value });
    }
    Ok(())
}
