//! The true surface behind the steps of the cells of a body.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{Body, Face, Lattice, Points};
use crate::shape::{Facing, Shape, SurfacePart};

/// Cell faces farther than this from the surface of the shape, in spacings, are no part of it: steps within a body on which
/// material is deposited keep their area.
const REACH: f64 = 1.0;

/// Largest number of cells of the finer grid on which the area of a shape is measured.
const MOST_CELLS: f64 = 2e6;

/// Largest number of parts of a cell along each axis on that grid.
const MOST_DIVISIONS: i64 = 12;

/// Corrections beyond these tell of surfaces that the grid does not resolve.
const CORRECTION: [f64; 2] = [0.8, 1.25];

/// The shape that the points of a body fill.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    shape: Shape,
    dimension: usize,
    /// By part of the surface: its area over that of the projected cell faces.
    correction: Vec<f64>,
}

impl Outline {
    /// The outline of a body that fills a shape; `None` where all cell faces have their own area.
    pub fn new(shape: &Shape, body: &Body) -> Option<Outline> {
        if body.dimension == 1 || matches!(shape, Shape::Box(_)) {
            return None;
        }
        let mut outline = Outline {
            shape: shape.clone(),
            dimension: body.dimension,
            correction: vec![1.0; shape.parts()],
        };
        outline.correct(body);
        Some(outline)
    }

    /// The nearest part of the surface of the shape to a position (m) that faces `outward`.
    pub fn near(&self, at: Vector3<f64>, outward: Vector3<f64>) -> Option<SurfacePart> {
        self.shape.facing(&Facing {
            at,
            outward,
            reach: f64::INFINITY,
            dimension: self.dimension,
        })
    }

    /// Area of the true surface over that of a cell face of a point, and its normal if the face is a step of an inclined or curved one.
    pub fn fraction(
        &self,
        points: &Points,
        point: usize,
        face: Face,
    ) -> (f64, Option<Vector3<f64>>) {
        let spacing = points.spacing[point];
        let at = points.position.at(point) + face.normal() * (0.5 * spacing);
        let (fraction, inclined) = self.projected(at, face, spacing);
        let correction = inclined.map_or(1.0, |part| self.correction[part.part]);
        (fraction * correction, inclined.map(|part| part.normal))
    }

    /// The area fraction without the correction, and the part of the surface, where it is inclined.
    fn projected(&self, at: Vector3<f64>, face: Face, spacing: f64) -> (f64, Option<SurfacePart>) {
        let outward = face.normal();
        let facing = Facing {
            at,
            outward,
            reach: REACH * spacing,
            dimension: self.dimension,
        };
        match self.shape.facing(&facing) {
            Some(part) => {
                let cosine = part.normal.dot(&outward).max(0.0);
                // plane faces along the axes keep the areas of their cells
                let inclined = part.curved || cosine < 1.0 - 1e-9;
                (cosine * part.stretch, inclined.then_some(part))
            }
            None => (1.0, None),
        }
    }

    /// Finds the corrections by the areas on a finer grid: the ends of inclined surfaces take up whole cells, an error of
    /// first order.
    fn correct(&mut self, body: &Body) {
        let Some(lattice) = body.lattice() else {
            return;
        };
        let mut coarse = vec![0.0; self.correction.len()];
        let mut near = BTreeSet::new();
        let faces = Face::ALL.into_iter().filter(|f| f.axis() < body.dimension);
        let faces: Vec<Face> = faces.collect();
        for point in 0..body.points.len() {
            let bare = |f: &&Face| body.neighbour(point, **f).is_none();
            for face in faces.iter().filter(bare) {
                let at = body.points.position.at(point) + face.normal() * (0.5 * lattice.spacing);
                let (area, part) = self.projected(at, *face, lattice.spacing);
                if let Some(part) = part {
                    coarse[part.part] += area;
                    let cell = lattice.cell(point).map(i64::from);
                    near.extend(neighbourhood(cell, body.dimension));
                }
            }
        }
        let Some(fine) = self.area_on_finer_grid(lattice, &near) else {
            return;
        };
        let pairs = self.correction.iter_mut().zip(coarse).zip(fine);
        for ((correction, coarse), fine) in pairs {
            if coarse > 0.0 && fine > 0.0 {
                *correction = (fine / coarse).clamp(CORRECTION[0], CORRECTION[1]);
            }
        }
    }

    /// Projected areas by part, in units of the cell faces of `lattice`, on a grid that divides its cells `near` the
    /// surface; `None` where that would take long.
    fn area_on_finer_grid(&self, lattice: &Lattice, near: &BTreeSet<[i64; 3]>) -> Option<Vec<f64>> {
        let dimension = self.dimension;
        let cells = (MOST_CELLS / near.len().max(1) as f64).powf(1.0 / dimension as f64);
        let divisions = (cells as i64 - 2).min(MOST_DIVISIONS);
        if near.is_empty() || divisions < 2 {
            return None;
        }
        let spacing = lattice.spacing / divisions as f64;
        let ends = |axis: usize| {
            if axis < dimension {
                -1..=divisions
            } else {
                0..=0
            }
        };
        let width = divisions + 2;
        let index = |cell: [i64; 3]| {
            let along = |axis: usize| if axis < dimension { cell[axis] + 1 } else { 0 };
            ((along(2) * width + along(1)) * width + along(0)) as usize
        };
        let faces: Vec<Face> = Face::ALL
            .into_iter()
            .filter(|f| f.axis() < dimension)
            .collect();
        let of_cell = |cell: &[i64; 3]| {
            let centre = |part: [i64; 3]| {
                Vector3::from_fn(|axis, _| {
                    let middle = match axis < dimension {
                        true => cell[axis] as f64 + (part[axis] as f64 + 0.5) / divisions as f64,
                        false => 0.5,
                    };
                    lattice.origin[axis] + middle * lattice.spacing
                })
            };
            let mut inside = vec![false; (width * width * width) as usize];
            let parts = || {
                let rows = ends(2).flat_map(|z| ends(1).map(move |y| (y, z)));
                rows.flat_map(|(y, z)| ends(0).map(move |x| [x, y, z]))
            };
            for part in parts() {
                inside[index(part)] = self.shape.contains(&centre(part), 1e-6 * spacing);
            }
            let is_own =
                |part: &[i64; 3]| (0..dimension).all(|a| (0..divisions).contains(&part[a]));
            let mut area = vec![0.0; self.correction.len()];
            for part in parts().filter(|part| is_own(part) && inside[index(*part)]) {
                for face in &faces {
                    let step = face.step();
                    let next = std::array::from_fn(|a| part[a] + step[a]);
                    if !inside[index(next)] {
                        let at = centre(part) + face.normal() * (0.5 * spacing);
                        let (fraction, part) = self.projected(at, *face, spacing);
                        if let Some(part) = part {
                            area[part.part] += fraction;
                        }
                    }
                }
            }
            area
        };
        let cells: Vec<&[i64; 3]> = near.iter().collect();
        let areas: Vec<Vec<f64>> = cells.into_par_iter().map(of_cell).collect();
        let unit = (divisions as f64).powi(1 - dimension as i32);
        let mut sum = vec![0.0; self.correction.len()];
        for area in areas {
            sum.iter_mut().zip(area).for_each(|(s, a)| *s += unit * a);
        }
        Some(sum)
    }
}

/// A cell and its neighbours, also across edges and corners.
fn neighbourhood(cell: [i64; 3], dimension: usize) -> impl Iterator<Item = [i64; 3]> {
    let ends = move |axis: usize| if axis < dimension { -1..=1 } else { 0..=0 };
    let rows = ends(2).flat_map(move |z| ends(1).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| ends(0).map(move |x| [cell[0] + x, cell[1] + y, cell[2] + z]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(shape: &str, dimension: usize, spacing: f64) -> Body {
        let shape: Shape = toml::from_str(shape).expect("a shape");
        Body::fill("body", &shape, dimension, spacing, 1.0).expect("a body")
    }

    fn area(body: &Body) -> f64 {
        body.surface(&Face::ALL).iter().map(|cell| cell.area).sum()
    }

    /// Holes and grooves of a periodic body have all their faces; only what touches across a periodic side has none.
    #[test]
    fn a_periodic_body_has_the_surface_of_its_holes() {
        let plate = "difference = { from = { box = { min = [0, 0, 0], max = [4, 2, 1] } }, \
                     subtract = { cylinder = { start = [2, 1, -1], end = [2, 1, 2], radius = 0.5 } } }";
        let groove = "difference = { from = { box = { min = [0, 0, 0], max = [4, 2, 1] } }, \
                      subtract = { box = { min = [1, 1, -1], max = [2, 3, 2] } } }";
        // per unit of thickness: the whole boundary, less the two sides that touch
        let round = std::f64::consts::PI;
        for (shape, expected) in [(plate, 8.0 + round), (groove, 8.0 + 2.0)] {
            let mut body = body(shape, 2, 0.05);
            let whole = area(&body);
            body.repeat(&[crate::Axis::X]).expect("its sides are full");
            let periodic = area(&body);
            assert!((periodic / expected - 1.0).abs() < 0.01, "{periodic}");
            assert!((whole - periodic - 4.0).abs() < 1e-9, "{whole} {periodic}");
        }
    }

    /// Sums over the whole surface are those of the shape: within 2 % at ten points across, 1 % at twenty.
    #[test]
    fn areas_of_curved_and_inclined_surfaces_are_those_of_the_shape() {
        use std::f64::consts::PI;
        let cylinder = |r: f64, l: f64| 2.0 * PI * r * l + 2.0 * PI * r * r;
        let wedge = "extrusion = { polygon = [[0, 0], [1, 0], [0, 1]], from = 0, to = 1 }";
        let rod = "cylinder = { start = [0, 0, 0], end = [0, 0, 1], radius = 0.5 }";
        let oblique = "cylinder = { start = [0, 0, 0], end = [0.6, 0, 0.8], radius = 0.5 }";
        let ball = "sphere = { centre = [0.1, 0, 0], radius = 0.5 }";
        let tube = "difference = { from = { cylinder = { start = [0, 0, 0], end = [0, 0, 1], radius = 0.75 } }, \
                    subtract = { cylinder = { start = [0, 0, 0], end = [0, 0, 1], radius = 0.35 } } }";
        let ellipse = "elliptical_cylinder = { start = [0, 0, 0], end = [0, 0, 1], semi_axis = [0.8, 0, 0], other = 0.5 }";
        let turned = |angle: f64| {
            format!(
                "rotate = {{ shape.box = {{ min = [0, 0, 0], max = [1, 1, 1] }}, angle = {} }}",
                angle.to_radians()
            )
        };
        // Ramanujan's second formula
        let perimeter = |a: f64, b: f64| {
            let h = ((a - b) / (a + b)).powi(2);
            PI * (a + b) * (1.0 + 3.0 * h / (10.0 + (4.0 - 3.0 * h).sqrt()))
        };
        let mut wrong = Vec::new();
        for (shape, dimension, expected) in [
            (rod.to_string(), 2, PI),
            (rod.to_string(), 3, cylinder(0.5, 1.0)),
            (oblique.to_string(), 3, cylinder(0.5, 1.0)),
            (ball.to_string(), 2, PI),
            (ball.to_string(), 3, PI),
            (tube.to_string(), 2, 2.0 * PI * 1.1),
            (ellipse.to_string(), 2, perimeter(0.8, 0.5)),
            (wedge.to_string(), 2, 2.0 + 2.0_f64.sqrt()),
            (turned(30.0), 2, 4.0),
            (turned(30.0), 3, 6.0),
            (turned(10.0), 2, 4.0),
            (turned(35.0), 2, 4.0),
        ] {
            for (spacing, tolerance) in [(0.1, 0.02), (0.05, 0.01)] {
                let found = area(&body(&shape, dimension, spacing)) / expected;
                if (found - 1.0).abs() >= tolerance {
                    wrong.push(format!("{shape} in {dimension}D at {spacing}: {found}"));
                }
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn plane_faces_along_the_axes_keep_the_areas_of_their_cells() {
        let rod = body(
            "cylinder = { start = [0, 0, 0], end = [0, 0, 1], radius = 0.5 }",
            3,
            0.1,
        );
        for cell in rod.surface(&[Face::ZMin, Face::ZMax]) {
            assert!((cell.area - 0.01).abs() < 1e-15);
        }
        // a quarter cut out of it: both planes of the cut
        let quarter = body(
            "difference = { from = { cylinder = { start = [0, 0, 0], end = [0, 0, 1], radius = 0.5 } }, \
             subtract = { union = [{ half_space = { point = [0, 0, 0], normal = [1, 0, 0] } }, \
             { half_space = { point = [0, 0, 0], normal = [0, 1, 0] } }] } }",
            3,
            0.1,
        );
        let plane: f64 = quarter.surface(&[Face::XMin]).iter().map(|c| c.area).sum();
        assert!((plane - 0.5).abs() < 1e-12, "{plane}");
    }

    /// Areas of cell faces along their normals cancel, whatever the true areas are.
    #[test]
    fn a_pressure_on_a_closed_surface_has_no_resultant() {
        let ball = body("sphere = { centre = [0, 0, 0], radius = 1 }", 3, 0.13);
        let cells = ball.surface(&Face::ALL);
        let sum = cells.iter().map(|c| c.face.normal() * c.face_area);
        assert!(sum.sum::<Vector3<f64>>().norm() < 1e-12);
    }
}
