//! Fields between the points of a body: Lagrange interpolation on a lattice, a linear fit on a
//! cloud; in a lay-up interpolation in the plane of the layers, and lines through the layers of a ply. Probes and checks read fields at positions in this way only.
//!
//! Beyond the outermost points the field continues as its mirror image at the face, so that the
//! value on a face is `(9 T1 - T2) / 8` from the two outermost points (cubic) or `T1` (linear). Where the value `Ts` on the
//! face is known, by a boundary or from the heat that flows through it, the field at the distance `d` behind the face is
//! `T(d) + 2 (Ts - T1) d / d1` with the distance `d1` of the outermost point: linear fields are exact up to the face.

use nalgebra::Vector3;
use perimelt_core::body::{Discretisation, Lattice, Layers};
use perimelt_core::world::activity::is_active;
use perimelt_core::{Body, Face, SetupError, World, text};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::component::Component;

/// How a field is read between points. Beyond the outermost points, up to the face, it continues
/// as its mirror image, as it does at an insulated face or a plane of symmetry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Through four points along each axis.
    #[default]
    Cubic,
    /// Through two.
    Linear,
}

/// Points and their weights; the weighted sum of a field over them is its value at a position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    points: Vec<(usize, f64)>,
    /// Factors on the difference between the value on the face of a point and that of the point.
    faces: Vec<(usize, Face, f64)>,
}

/// A cell along an axis.
#[derive(Clone, Copy, Debug)]
struct AxisNode {
    cell: i64,
    weight: f64,
    /// For the mirror image of a cell behind a face: the face, the cell in front of it, and the factor on the
    /// difference between the values on the face and in that cell.
    behind: Option<(Face, i64, f64)>,
}

impl Weights {
    /// The weights at `position` (m) in the reference configuration. Mistakes are reported at
    /// `key`.
    ///
    /// Linear interpolation leaves out cells of a lattice that have no point, as beside a curved
    /// surface, and scales the other weights up.
    ///
    /// # Errors
    /// The position lies off the body, or cubic interpolation is requested where there is no
    /// complete lattice around it.
    pub fn at(
        body: &Body,
        position: [f64; 3],
        interpolation: Interpolation,
        key: &str,
    ) -> Result<Weights, SetupError> {
        let found = match &body.discretisation {
            Discretisation::Lattice(lattice) => {
                on_lattice(lattice, body.dimension, position, interpolation)
            }
            Discretisation::Layers(layers) => in_layers(layers, position, interpolation),
            Discretisation::Cloud(_) if interpolation == Interpolation::Cubic => {
                let message = format!(
                    "the points of body `{}` do not form a lattice, which cubic interpolation needs",
                    body.name
                );
                return Err(SetupError::value(
                    key,
                    message,
                    "`interpolation = \"linear\"`",
                ));
            }
            Discretisation::Cloud(_) if !is_within(body, position) => None,
            Discretisation::Cloud(cloud) => cloud
                .weights(&body.points, body.dimension, &position.into())
                .map(Weights::of_points),
        };
        found.ok_or_else(|| off_body(body, position, key))
    }

    /// A weighted sum over points.
    pub(crate) fn of_points(points: Vec<(usize, f64)>) -> Weights {
        Weights {
            points,
            faces: Vec::new(),
        }
    }

    /// Turns the value at a position into the difference to that at another one.
    pub(crate) fn subtract(&mut self, other: &Weights) {
        self.points
            .extend(other.points.iter().map(|(p, w)| (*p, -w)));
        self.faces
            .extend(other.faces.iter().map(|(p, face, w)| (*p, *face, -w)));
    }

    /// The value of a field at the position. Points without material are left out and the other weights scaled up; NaN
    /// where these have less than half of the weight.
    pub(crate) fn value(&self, component: Component, world: &World) -> f64 {
        let activity = component.activity(world);
        let is_there = |point: usize| activity.as_ref().is_none_or(|a| is_active(a[point]));
        let there = self.points.iter().filter(|(p, _)| is_there(*p));
        let mut total = 1.0;
        if there.clone().count() < self.points.len() {
            total = there.clone().map(|(_, weight)| weight).sum();
            if total < 0.5 {
                return f64::NAN;
            }
        }
        let sum: f64 = there
            .map(|&(point, weight)| weight * component.at(world, point))
            .sum();
        let to_face = |&(point, face, factor): &(usize, Face, f64)| {
            let on_face = component.on_face(world, point, face)?;
            Some(factor * (on_face - component.at(world, point)))
        };
        let faces = self.faces.iter().filter(|(p, ..)| is_there(*p));
        (sum + faces.filter_map(to_face).sum::<f64>()) / total
    }
}

/// Weights among the layers of a ply; `None` where there are not enough points.
fn in_layers(layers: &Layers, position: [f64; 3], interpolation: Interpolation) -> Option<Weights> {
    let plane = on_lattice(layers.plane().lattice()?, 2, position, interpolation)?;
    let mut weights = Weights::default();
    for (layer, across) in layers.weights_across(position[2])? {
        let first = layer * layers.points_of_layer();
        let points = plane.points.iter();
        (weights.points).extend(points.map(|(point, weight)| (first + point, across * weight)));
        let faces = plane.faces.iter();
        let faces = faces.map(|(point, face, factor)| (first + point, *face, across * factor));
        weights.faces.extend(faces);
    }
    Some(weights)
}

/// Weights on a lattice; `None` where there are not enough points.
fn on_lattice(
    lattice: &Lattice,
    dimension: usize,
    position: [f64; 3],
    interpolation: Interpolation,
) -> Option<Weights> {
    let relative = (Vector3::from(position) - lattice.origin) / lattice.spacing;
    let alone = AxisNode {
        cell: 0,
        weight: 1.0,
        behind: None,
    };
    let mut axes: [Vec<AxisNode>; 3] = std::array::from_fn(|_| vec![alone]);
    for axis in 0..dimension {
        axes[axis] = along(
            relative[axis] - 0.5,
            axis,
            lattice.cells[axis],
            interpolation,
        )?;
    }
    let [xs, ys, zs] = &axes;
    let mut weights = Weights::default();
    let mut left_out = false;
    for z in zs {
        for y in ys {
            for x in xs {
                let nodes = [x, y, z];
                let cell = nodes.map(|n| n.cell);
                let weight = nodes.iter().map(|n| n.weight).product::<f64>();
                match lattice.point(cell) {
                    Some(point) => weights.points.push((point, weight)),
                    None if interpolation == Interpolation::Linear => {
                        left_out = true;
                        weights.face_missing(lattice, &axes, cell, weight);
                    }
                    None => return None,
                }
                for (axis, node) in nodes.iter().enumerate() {
                    let Some((face, cell_in_front, factor)) = node.behind else {
                        continue;
                    };
                    let mut in_front = cell;
                    in_front[axis] = cell_in_front;
                    let point = lattice.point(in_front);
                    weights
                        .faces
                        .extend(point.map(|point| (point, face, weight * factor)));
                }
            }
        }
    }
    if left_out {
        let total: f64 = weights.points.iter().map(|(_, weight)| weight).sum();
        // also where there is no point at all
        if total < 1e-6 {
            return None;
        }
        let points = weights.points.iter_mut();
        points.for_each(|(_, weight)| *weight /= total);
    }
    Some(weights)
}

impl Weights {
    /// Takes a cell without a point for one behind the faces of its neighbours along the axes.
    fn face_missing(
        &mut self,
        lattice: &Lattice,
        axes: &[Vec<AxisNode>; 3],
        cell: [i64; 3],
        weight: f64,
    ) {
        let mut in_front = Vec::new();
        for (axis, nodes) in axes.iter().enumerate() {
            let others = nodes.iter().map(|n| n.cell).filter(|c| *c != cell[axis]);
            for other in others {
                let mut neighbour = cell;
                neighbour[axis] = other;
                let face = Face::ALL[2 * axis + usize::from(other < cell[axis])];
                in_front.extend(lattice.point(neighbour).map(|point| (point, face)));
            }
        }
        let factor = 2.0 * weight / in_front.len() as f64;
        let faces = in_front.iter().map(|&(point, face)| (point, face, factor));
        self.faces.extend(faces);
    }
}

/// Cells and weights along an axis; `at` counts cells from the first centre.
fn along(
    at: f64,
    axis: usize,
    cells: usize,
    interpolation: Interpolation,
) -> Option<Vec<AxisNode>> {
    let last = cells as i64 - 1;
    if !(at > -0.5 - 1e-6 && at < last as f64 + 0.5 + 1e-6) {
        return None;
    }
    // a position on a cell centre, but for rounding, is that point alone
    if (at - at.round()).abs() < 1e-6 {
        return Some(vec![AxisNode {
            cell: at.round() as i64,
            weight: 1.0,
            behind: None,
        }]);
    }
    let low = at.floor();
    let t = at - low;
    let nodes: Vec<(i64, f64)> = match interpolation {
        Interpolation::Linear => vec![(0, 1.0 - t), (1, t)],
        Interpolation::Cubic => vec![
            (-1, -t * (t - 1.0) * (t - 2.0) / 6.0),
            (0, (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0),
            (1, -(t + 1.0) * t * (t - 2.0) / 2.0),
            (2, (t + 1.0) * t * (t - 1.0) / 6.0),
        ],
    };
    let mirrored = |cell: i64| {
        let period = 2 * (last + 1);
        let folded = cell.rem_euclid(period);
        folded.min(period - 1 - folded)
    };
    let behind = |cell: i64| {
        // by cells behind the face: 1, 3, ... half cells
        let odd = |steps: i64| 2.0 * (2 * steps + 1) as f64;
        match cell {
            ..0 => Some((Face::ALL[2 * axis], 0, odd(-1 - cell))),
            _ if cell > last => Some((Face::ALL[2 * axis + 1], last, odd(cell - last - 1))),
            _ => None,
        }
    };
    let node = |(step, weight): (i64, f64)| {
        let cell = low as i64 + step;
        AxisNode {
            cell: mirrored(cell),
            weight,
            behind: behind(cell),
        }
    };
    Some(nodes.into_iter().map(node).collect())
}

/// Whether a position (m) lies within the bounding box of the cells, but for rounding.
fn is_within(body: &Body, position: [f64; 3]) -> bool {
    let near = 1e-6 * body.finest_spacing();
    let (min, max) = body.bounds();
    (0..body.dimension).all(|a| position[a] >= min[a] - near && position[a] <= max[a] + near)
}

fn off_body(body: &Body, position: [f64; 3], key: &str) -> SetupError {
    let (min, max) = body.bounds();
    let message = format!(
        "no point of body `{}` is near {}",
        body.name,
        text::position(position)
    );
    let expected = format!(
        "a position on the body, within {} and {} m",
        text::position(min),
        text::position(max)
    );
    SetupError::value(key, message, expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::shape::{BoxShape, Shape};

    fn block() -> Body {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 3.0, 2.0],
        });
        Body::fill("block", &shape, 3, 0.25, 1.0).expect("a valid block")
    }

    fn value(
        body: &Body,
        position: [f64; 3],
        kind: Interpolation,
        field: impl Fn(&Vector3<f64>) -> f64,
    ) -> f64 {
        let weights = Weights::at(body, position, kind, "key").expect("on the body");
        weights
            .points
            .iter()
            .map(|&(p, w)| w * field(&body.points.position.at(p)))
            .sum()
    }

    #[test]
    fn a_cubic_field_is_exact_away_from_the_faces() {
        let body = block();
        let field = |p: &Vector3<f64>| p.x.powi(3) - 2.0 * p.x * p.y * p.y + p.z;
        for position in [[1.1, 1.3, 0.9], [2.0, 1.5, 1.0]] {
            let exact = field(&position.into());
            // rounding of 64 terms of order one
            assert!((value(&body, position, Interpolation::Cubic, field) - exact).abs() < 1e-12);
        }
    }

    #[test]
    fn linear_interpolation_leaves_out_missing_points_and_cubic_refuses_them() {
        let ball = Shape::Sphere(perimelt_core::shape::Sphere {
            centre: [0.0; 3],
            radius: 1.0,
        });
        let body = Body::fill("ball", &ball, 3, 0.25, 1.0).expect("a valid ball");
        // the cell centre at (0.625, 0.625, 0.625) lies outside, its neighbours along x, y, z inside
        let position = [0.55, 0.5, 0.5];
        let linear = value(&body, position, Interpolation::Linear, |_| 7.0);
        // rounding of seven terms
        assert!((linear - 7.0).abs() < 1e-14, "{linear}");
        assert!(Weights::at(&body, position, Interpolation::Cubic, "key").is_err());
    }

    #[test]
    fn an_even_field_is_extrapolated_to_the_face() {
        let body = block();
        let field = |p: &Vector3<f64>| 1.0 + p.x * p.x;
        let on_face = value(&body, [0.0, 1.125, 1.125], Interpolation::Cubic, field);
        assert!(
            (on_face - 1.0).abs() < 1e-14,
            "parabola with its top on the face: {on_face}"
        );
        let linear = value(&body, [0.0, 1.125, 1.125], Interpolation::Linear, field);
        assert_eq!(linear, 1.0 + 0.125 * 0.125, "the outermost point");
    }

    /// The outermost point and the difference to the value on its face give that value; of a linear field also in between.
    #[test]
    fn known_values_on_faces_make_linear_fields_exact() {
        let body = block();
        let field = |p: &Vector3<f64>| 3.0 - 2.0 * p.x;
        for kind in [Interpolation::Linear, Interpolation::Cubic] {
            for x in [0.0, 0.05, 0.2, 3.97, 4.0] {
                let position = [x, 1.125, 1.125];
                let weights = Weights::at(&body, position, kind, "key").expect("on the body");
                let to_faces = weights.faces.iter().map(|&(point, face, factor)| {
                    let half_cell = 0.125 * face.normal();
                    let place = body.points.position.at(point);
                    factor * (field(&(place + half_cell)) - field(&place))
                });
                let found = value(&body, position, kind, field) + to_faces.sum::<f64>();
                // rounding of some ten terms
                let expected = field(&position.into());
                assert!((found - expected).abs() < 1e-13, "{kind:?} at {x}: {found}");
            }
        }
    }

    #[test]
    fn a_cell_centre_is_that_point_and_a_position_outside_is_refused() {
        let body = block();
        for kind in [Interpolation::Cubic, Interpolation::Linear] {
            let centre = Weights::at(&body, [0.125; 3], kind, "key").expect("on the body");
            assert_eq!(centre, Weights::of_points(vec![(0, 1.0)]));
            for outside in [-0.01, f64::NAN] {
                let error = Weights::at(&body, [outside, 1.0, 1.0], kind, "key");
                assert_eq!(error.expect_err("off the body").key, "key");
            }
        }
    }

    #[test]
    fn a_single_row_of_cells_is_its_own_mirror_image() {
        let nodes = along(0.3, 0, 1, Interpolation::Linear).expect("within the cell");
        let weights: Vec<_> = nodes.iter().map(|n| (n.cell, n.weight)).collect();
        assert_eq!(weights, [(0, 0.7), (0, 0.3)]);
    }
}
