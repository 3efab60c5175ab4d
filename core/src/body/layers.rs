//! Layers of points over one plane grid: the lay-up of a laminate.
//!
//! A ply has one or two layers of points (*stations*). With two at `±h / (2 sqrt 3)` from its middle, each with half of its
//! thickness h, sums over the layers give the exact membrane, coupling and bending stiffness of the laminate: they are
//! the two-point rule of Gauss, which integrates parabolas exactly (docs/theory/laminates.md). With one station a ply has no
//! bending stiffness of its own.
//!
//! All layers have the same grid, a body of two dimensions ([`Layers::plane`]). Points are numbered layer by layer, from below, in the
//! order of that body.

use std::sync::Arc;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, BodyError, Discretisation, Face, Points, Same, Sizes, positive};
use crate::shape::{Bounds, Shape};

/// Largest difference between the thickness of a shape and that of its plies, relative: rounding of decimals.
const ROUNDING: f64 = 1e-6;

/// The plies of a laminate, from below.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Layup {
    /// Angle of the fibres of each ply from x towards y, degrees, from the lowest ply to the highest.
    #[schemars(length(min = 1))]
    pub angles: Vec<f64>,
    /// Thickness of each ply, m; equal plies that fill the shape when left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ply_thickness: Vec<f64>,
    /// Layers of points of each ply.
    #[serde(default)]
    pub stations: Stations,
}

/// Layers of points of a ply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stations {
    /// In the middle of the ply: no bending stiffness of its own.
    One,
    /// Two, by which the stiffness of the laminate is exact.
    #[default]
    Two,
}

/// A ply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ply {
    /// Angle of the fibres from x towards y, rad.
    pub angle: f64,
    /// Position of its lower side along z, m.
    pub low: f64,
    /// m.
    pub thickness: f64,
}

/// A layer of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Position along z, m.
    pub z: f64,
    /// Thickness of the cells of its points, m.
    pub thickness: f64,
    /// Its ply, counted from below.
    pub ply: usize,
}

/// The layers of a laminate, from below.
#[derive(Clone, Debug)]
pub struct Layers {
    plane: Arc<Body>,
    plies: Vec<Ply>,
    layers: Vec<Layer>,
}

/// Mistakes in a lay-up.
#[derive(Debug, thiserror::Error)]
pub enum LayupError {
    /// No ply.
    #[error("the lay-up has no ply")]
    Empty,
    /// A number that is not finite.
    #[error("an angle of the lay-up is {0}")]
    Angle(f64),
    /// Thicknesses of another number of plies.
    #[error("`ply_thickness` has {found} values for {plies} plies")]
    Count {
        /// Number of thicknesses.
        found: usize,
        /// Number of angles.
        plies: usize,
    },
    /// Plies that do not fill the shape.
    #[error("the plies are {plies} m thick together, and the shape is {shape} m thick along z")]
    Thickness {
        /// Of all plies, m.
        plies: f64,
        /// Of the shape, m.
        shape: f64,
    },
}

impl LayupError {
    /// The key of the lay-up to blame.
    pub fn key(&self) -> &'static str {
        match self {
            LayupError::Empty | LayupError::Angle(_) => "angles",
            LayupError::Count { .. } | LayupError::Thickness { .. } => "ply_thickness",
        }
    }

    /// What was expected.
    pub fn expected(&self) -> String {
        match self {
            LayupError::Empty => "one angle or more, degrees".into(),
            LayupError::Angle(_) => "a finite number of degrees".into(),
            LayupError::Count { plies, .. } => format!("{plies}, one for each angle"),
            LayupError::Thickness { shape, .. } => {
                format!("a sum of {shape} m; without `ply_thickness` equal plies fill the shape")
            }
        }
    }
}

impl Layup {
    /// The plies of a shape between two positions along z, m.
    fn plies(&self, low: f64, high: f64) -> Result<Vec<Ply>, LayupError> {
        let plies = self.angles.len();
        if plies == 0 {
            return Err(LayupError::Empty);
        }
        if let Some(angle) = self.angles.iter().find(|angle| !angle.is_finite()) {
            return Err(LayupError::Angle(*angle));
        }
        let shape = high - low;
        let thickness = match self.ply_thickness.len() {
            0 => vec![shape / plies as f64; plies],
            found if found == plies => self.ply_thickness.clone(),
            found => return Err(LayupError::Count { found, plies }),
        };
        let sum: f64 = thickness.iter().sum();
        if !((sum - shape).abs() <= ROUNDING * shape) {
            return Err(LayupError::Thickness { plies: sum, shape });
        }
        let mut below = low;
        let of_angle = |(angle, thickness): (&f64, f64)| {
            let ply = Ply {
                angle: angle.to_radians(),
                low: below,
                thickness,
            };
            below += thickness;
            ply
        };
        Ok(self.angles.iter().zip(thickness).map(of_angle).collect())
    }
}

impl Stations {
    /// The layers of a ply.
    fn of(self, number: usize, ply: &Ply) -> impl Iterator<Item = Layer> + use<> {
        let Ply { low, thickness, .. } = *ply;
        let (offset, count) = match self {
            Stations::One => (0.0, 1),
            Stations::Two => (0.5 / 3f64.sqrt() * thickness, 2),
        };
        let middle = low + 0.5 * thickness;
        (0..count).map(move |station| Layer {
            z: middle + if station == 0 { -offset } else { offset },
            thickness: thickness / count as f64,
            ply: number,
        })
    }
}

impl Layers {
    /// The grid that all layers have: a body of two dimensions and a thickness of 1 m.
    pub fn plane(&self) -> &Body {
        &self.plane
    }

    /// The plies, from below.
    pub fn plies(&self) -> &[Ply] {
        &self.plies
    }

    /// The layers, from below.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Number of points of a layer.
    pub fn points_of_layer(&self) -> usize {
        self.plane.points.len()
    }

    /// Layer of a point, and its number in the layer.
    pub fn place(&self, point: usize) -> (usize, usize) {
        let points = self.points_of_layer();
        (point / points, point % points)
    }

    /// Angle of the fibres at a point, rad.
    pub fn angle(&self, point: usize) -> f64 {
        self.plies[self.layers[self.place(point).0].ply].angle
    }

    /// Width of the cell of a point along an axis, m.
    pub(super) fn width(&self, point: usize, axis: usize) -> f64 {
        match axis {
            2 => self.layers[self.place(point).0].thickness,
            _ => self.plane.finest_spacing(),
        }
    }

    /// Distance of a face of the cell of a point from the point, m. Stations do not lie in the middle of their cells.
    pub(super) fn face_distance(&self, point: usize, face: Face) -> f64 {
        let number = self.place(point).0;
        let layer = &self.layers[number];
        let ply = &self.plies[layer.ply];
        let is_lowest = number == 0 || self.layers[number - 1].ply != layer.ply;
        let low = ply.low + if is_lowest { 0.0 } else { layer.thickness };
        match (face.axis(), face.is_upper()) {
            (2, true) => low + layer.thickness - layer.z,
            (2, false) => layer.z - low,
            _ => 0.5 * self.plane.finest_spacing(),
        }
    }

    pub(super) fn bounds(&self) -> Bounds {
        let (mut low, mut high) = self.plane.bounds();
        let (first, last) = (self.plies[0], self.plies[self.plies.len() - 1]);
        low.z = first.low;
        high.z = last.low + last.thickness;
        (low, high)
    }

    pub(super) fn neighbour(&self, point: usize, face: Face) -> Option<usize> {
        let (layer, number) = self.place(point);
        let points = self.points_of_layer();
        match (face.axis(), face.is_upper()) {
            (2, true) => (layer + 1 < self.layers.len()).then_some(point + points),
            (2, false) => (layer > 0).then(|| point - points),
            _ => {
                let other = self.plane.neighbour(number, face)?;
                Some(layer * points + other)
            }
        }
    }

    pub(super) fn plane_mut(&mut self) -> &mut Body {
        Arc::make_mut(&mut self.plane)
    }

    /// The layers of the ply at a position along z (m) with weights that give a linear field there: within a ply strains are linear,
    /// and stresses jump between plies. `None` outside of the laminate.
    pub fn weights_across(&self, z: f64) -> Option<Vec<(usize, f64)>> {
        let (low, high) = self.bounds();
        let near = ROUNDING * (high.z - low.z);
        if !(z >= low.z - near && z <= high.z + near) {
            return None;
        }
        let above = self.plies.partition_point(|ply| ply.low <= z);
        let ply = above.saturating_sub(1);
        let own = self.layers.iter().enumerate().filter(|(_, l)| l.ply == ply);
        let own: Vec<(usize, f64)> = own.map(|(number, layer)| (number, layer.z)).collect();
        Some(match own[..] {
            [(lower, from), (upper, to)] => {
                let weight = (z - from) / (to - from);
                vec![(lower, 1.0 - weight), (upper, weight)]
            }
            _ => own.into_iter().map(|(number, _)| (number, 1.0)).collect(),
        })
    }
}

impl Body {
    /// Fills a shape of constant cross-section along z with the layers of a lay-up, on grids of edge `spacing` (m).
    ///
    /// # Errors
    /// See [`Body::fill`]; also when the plies do not fill the thickness of the shape.
    pub fn stack(
        name: &str,
        shape: &Shape,
        spacing: f64,
        layup: &Layup,
    ) -> Result<Body, BodyError> {
        positive("spacing", spacing)?;
        for &thickness in &layup.ply_thickness {
            positive("ply_thickness", thickness)?;
        }
        let (min, max) = super::bounded(shape, 3, 1.0)?;
        let plies = layup.plies(min.z, max.z)?;
        let plane = Body::fill(name, shape, 2, spacing, 1.0)?;
        let numbered = plies.iter().enumerate();
        let layers: Vec<Layer> = numbered
            .flat_map(|(number, ply)| layup.stations.of(number, ply))
            .collect();
        let points = plane.points.len() * layers.len();
        let area = spacing * spacing;
        let at = |layer: &Layer| {
            let z = layer.z;
            let places = plane.points.position.each();
            places.map(move |x| Vector3::new(x.x, x.y, z))
        };
        let volume = layers
            .iter()
            .flat_map(|layer| std::iter::repeat_n(area * layer.thickness, plane.points.len()));
        let points = Points {
            position: layers.iter().flat_map(at).collect::<Vec<_>>().into(),
            volume: volume.collect::<Vec<_>>().into(),
            spacing: Sizes::by(Same {
                value: spacing,
                count: points,
            }),
            horizon_factor: Vec::new(),
        };
        let layers = Layers {
            plane: Arc::new(plane),
            plies,
            layers,
        };
        let discretisation = Discretisation::Layers(layers);
        Ok(Body::new(name, 3, 1.0, points, discretisation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::BoxShape;

    fn layup(angles: &[f64], thickness: &[f64], stations: Stations) -> Layup {
        Layup {
            angles: angles.to_vec(),
            ply_thickness: thickness.to_vec(),
            stations,
        }
    }

    fn plate(layup: &Layup) -> Result<Body, BodyError> {
        let shape = Shape::Box(BoxShape {
            min: [0.0, 0.0, 1.0],
            max: [0.3, 0.2, 1.03],
        });
        Body::stack("plate", &shape, 0.1, layup)
    }

    /// Integrals of 1, z, z² and z³ over each ply, which the stiffness of a laminate consists of, by the layers.
    #[test]
    fn two_stations_integrate_cubes_over_each_ply() {
        let layup = layup(&[0.0, 90.0], &[0.01, 0.02], Stations::Two);
        let body = plate(&layup).expect("valid");
        let layers = body.layers().expect("layers");
        for (number, ply) in layers.plies().iter().enumerate() {
            let (low, high) = (ply.low, ply.low + ply.thickness);
            for power in 0..4 {
                let exact = (high.powi(power + 1) - low.powi(power + 1)) / f64::from(power + 1);
                let own = layers.layers().iter().filter(|l| l.ply == number);
                let sum: f64 = own.map(|l| l.thickness * l.z.powi(power)).sum();
                assert!((sum / exact - 1.0).abs() < 1e-14, "{sum} {exact}");
            }
        }
        assert_eq!(body.points.len(), 4 * 6);
        let volume: f64 = body.points.volume.iter().sum();
        assert!((volume - 0.06 * 0.03).abs() < 1e-15);
    }

    #[test]
    fn the_surface_of_a_stack_is_closed_and_has_the_area_of_the_box() {
        let body = plate(&layup(&[0.0, 45.0, 90.0], &[], Stations::One)).expect("valid");
        let surface = body.surface(&Face::ALL);
        let of = |face: Face| -> f64 {
            let own = surface.iter().filter(|s| s.face == face);
            own.map(|s| s.face_area).sum()
        };
        for (face, area) in [
            (Face::XMin, 0.2 * 0.03),
            (Face::YMax, 0.3 * 0.03),
            (Face::ZMin, 0.06),
            (Face::ZMax, 0.06),
        ] {
            assert!((of(face) - area).abs() < 1e-15, "{}", face.name());
        }
        assert_eq!(body.neighbour(0, Face::ZMin), None);
        assert_eq!(body.neighbour(0, Face::ZMax), Some(6));
        assert_eq!(body.neighbour(6, Face::XMax), Some(7));
        assert!(body.fills_box());
    }

    #[test]
    fn cells_of_stations_meet_at_their_faces() {
        for stations in [Stations::One, Stations::Two] {
            let thickness = [0.005, 0.015, 0.01];
            let body = plate(&layup(&[0.0, 45.0, 90.0], &thickness, stations)).expect("valid");
            let (low, high) = body.bounds();
            for (point, x) in body.points.position.iter().enumerate() {
                let [below, above] = [Face::ZMin, Face::ZMax].map(|f| body.face_distance(point, f));
                let width = body.width(point, 2);
                assert!(below > 0.0 && above > 0.0 && (below + above - width).abs() < 1e-15);
                let next = match body.neighbour(point, Face::ZMax) {
                    Some(other) => {
                        let below = body.face_distance(other, Face::ZMin);
                        body.points.position.at(other).z - below
                    }
                    None => high.z,
                };
                assert!((x.z + above - next).abs() < 1e-14, "{stations:?}, {x}");
            }
            let lowest = body.points.position.at(0).z - body.face_distance(0, Face::ZMin);
            assert!((lowest - low.z).abs() < 1e-14);
            assert_eq!(body.face_distance(0, Face::XMin), 0.05);
        }
    }

    #[test]
    fn edges_of_a_round_plate_have_its_circumference() {
        let shape = "cylinder = { start = [0, 0, 0], end = [0, 0, 0.03], radius = 1 }";
        let shape: Shape = toml::from_str(shape).expect("a shape");
        let layup = layup(&[0.0, 90.0], &[], Stations::Two);
        let body = Body::stack("plate", &shape, 0.05, &layup).expect("valid");
        let faces = Face::ALL.into_iter().filter(|f| f.axis() < 2);
        let edges = body.surface(&faces.collect::<Vec<_>>());
        let area: f64 = edges.iter().map(|cell| cell.area).sum();
        let expected = 2.0 * std::f64::consts::PI * 0.03;
        // steps of squares have 4 / pi times as much
        assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
    }

    #[test]
    fn fields_are_linear_within_a_ply_and_do_not_reach_into_the_next() {
        let body = plate(&layup(&[0.0, 90.0], &[], Stations::Two)).expect("valid");
        let layers = body.layers().expect("layers");
        for z in [1.0, 1.004, 1.0149, 1.0151, 1.03] {
            let weights = layers.weights_across(z).expect("inside");
            let own = if z < 1.015 { 0..2 } else { 2..4 };
            assert!(weights.iter().all(|(layer, _)| own.contains(layer)), "{z}");
            let sum: f64 = weights.iter().map(|(l, w)| w * layers.layers()[*l].z).sum();
            assert!((sum - z).abs() < 1e-14);
        }
        assert_eq!(layers.weights_across(1.031), None);
    }

    #[test]
    fn lay_ups_that_do_not_fit_are_refused() {
        let two = Stations::Two;
        for (layup, message) in [
            (layup(&[], &[], two), "no ply"),
            (layup(&[0.0, 90.0], &[0.03], two), "1 values for 2 plies"),
            (
                layup(&[0.0, 90.0], &[0.01, 0.01], two),
                "0.02 m thick together",
            ),
            (
                layup(&[f64::NAN], &[], two),
                "an angle of the lay-up is NaN",
            ),
        ] {
            let error = plate(&layup).expect_err("a mistake").to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
