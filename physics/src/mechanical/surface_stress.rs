//! Stress of points near bare surfaces, extrapolated from the interior.
//!
//! On a lattice a curved surface is a staircase: the stress of points whose family is truncated there depends on the steps,
//! at any spacing, and so does that of the points with such neighbours. The stress of both is replaced by the value at the
//! point of a linear field, fitted by least squares to the points further inside: an error of second order in the depth of
//! the zone.

use nalgebra::{SMatrix, SVector};
use perimelt_core::cell_list::CellList;
use perimelt_core::{Body, Family, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the stress of points near bare surfaces comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceStress {
    /// Their own bonds: off by up to a third where a curved surface is a staircase.
    #[default]
    Direct,
    /// A linear field through the points in the interior nearby.
    Extrapolated,
}

/// Distance from a point with a truncated family, in horizons, up to which the stress depends on the steps of the surface.
const DISTURBED: f64 = 1.5;

/// How far beyond the depth of the replaced zone a fit reaches, in spacings.
const BEYOND: f64 = 3.5;

/// Value, and slopes along three axes.
type Terms = SVector<f64, 4>;

/// Weights of the interior points for each point near a surface.
#[derive(Debug, Default)]
pub(super) struct Extrapolation {
    points: Vec<u32>,
    /// Where the terms of each point begin.
    start: Vec<usize>,
    terms: Vec<(u32, f64)>,
}

impl Extrapolation {
    /// Fits for all points of a body with truncated families, and their neighbours; a point without enough of the interior
    /// nearby, as in a thin wall, keeps its own stress.
    ///
    /// # Errors
    /// A cloud, or a body with cuts.
    pub(super) fn new(body: &Body, family: &Family) -> Result<Self, SetupError> {
        if body.lattice().is_none() || !body.cuts.is_empty() {
            let message = "stress is extrapolated on one regular grid without cracks";
            let expected = "\"direct\" for this body";
            return Err(SetupError::value("surface_stress", message, expected));
        }
        let count = body.points.len();
        let whole = (0..count).map(|p| family.bonds_of(p)).max().unwrap_or(0);
        let spacing = body.finest_spacing();
        let horizon = family.spec().horizon.of(spacing);
        let disturbed = DISTURBED * horizon;
        let reach = horizon + disturbed + BEYOND * spacing;
        let positions = &body.points.position;
        let list = CellList::new(positions, &vec![disturbed; count]);
        let mut is_interior = vec![true; count];
        for point in (0..count).filter(|p| family.bonds_of(*p) < whole) {
            let at = &positions[point];
            list.visit_near(at, disturbed, |other| {
                let distance = (positions[other] - at).norm();
                is_interior[other] &= distance > disturbed * (1.0 + 1e-9);
            });
        }
        let mut found = Extrapolation::default();
        for point in (0..count).filter(|p| !is_interior[*p]) {
            let at = &positions[point];
            let mut near = Vec::new();
            let mut moment = SMatrix::<f64, 4, 4>::zeros();
            list.visit_near(at, reach, |other| {
                let mut xi = (positions[other] - at) / spacing;
                (body.dimension..3).for_each(|axis| xi[axis] = 0.0);
                if is_interior[other] && xi.norm() * spacing <= reach {
                    let terms = Terms::new(1.0, xi.x, xi.y, xi.z);
                    moment += terms * terms.transpose();
                    near.push((other as u32, terms));
                }
            });
            // slopes along axes that the body does not have
            (body.dimension..3).for_each(|axis| moment[(axis + 1, axis + 1)] = 1.0);
            let Some(factor) = moment
                .cholesky()
                .filter(|_| near.len() > 2 * body.dimension)
            else {
                continue;
            };
            let of_value = factor.solve(&Terms::new(1.0, 0.0, 0.0, 0.0));
            // few points that hardly determine the slope amplify errors
            let weights = near
                .iter()
                .map(|(other, terms)| (*other, of_value.dot(terms)));
            let weights: Vec<(u32, f64)> = weights.collect();
            let amplification: f64 = weights.iter().map(|(_, w)| w.abs()).sum();
            if amplification < 10.0 {
                found.points.push(point as u32);
                found.start.push(found.terms.len());
                found.terms.extend(weights);
            }
        }
        Ok(found)
    }

    /// Replaces the stress of the points near a surface.
    pub(super) fn apply<T>(&self, stress: &mut [T])
    where
        T: Copy + std::ops::Mul<f64, Output = T> + std::iter::Sum<T>,
    {
        let ends = self.start.iter().copied().skip(1).chain([self.terms.len()]);
        for ((point, start), end) in self.points.iter().zip(&self.start).zip(ends) {
            let terms = self.terms[*start..end].iter();
            stress[*point as usize] = terms.map(|(other, w)| stress[*other as usize] * *w).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::block;
    use perimelt_core::body::Store;
    use perimelt_core::{Correction, FamilySpec};

    /// A wall of squares of 0.1 m with horizons of two.
    fn wall(cells: [usize; 3]) -> (Body, Extrapolation) {
        let body = block(cells, 2, 0.1, Store::Lattice, "density = 1");
        let spec = FamilySpec {
            correction: Correction::None,
            ..FamilySpec::new(0.2)
        };
        let family = Family::build(&body, &spec).expect("valid");
        let extrapolation = Extrapolation::new(&body, &family).expect("a lattice");
        (body, extrapolation)
    }

    /// Linear fields are continued to a surface from points that lie more than 1.5 horizons from all points with truncated
    /// families, whatever the values near the surface are.
    #[test]
    fn linear_fields_are_continued_to_the_surface() {
        let (body, extrapolation) = wall([20, 20, 1]);
        let linear = |x: &nalgebra::Vector3<f64>| 3.0 + 2.0 * x.x - 5.0 * x.y;
        // families within 2 spacings of a side are truncated, and what is within 3 spacings of these is replaced
        let is_near = |x: &nalgebra::Vector3<f64>| [x.x, x.y].iter().any(|c| c.min(2.0 - c) < 0.5);
        let positions = &body.points.position;
        let value = |x: &nalgebra::Vector3<f64>| if is_near(x) { 1e3 } else { linear(x) };
        let mut field: Vec<f64> = positions.iter().map(value).collect();
        extrapolation.apply(&mut field);
        // a corner has too few points of the interior nearby
        let is_corner =
            |x: &nalgebra::Vector3<f64>| [x.x, x.y].iter().all(|c| c.min(2.0 - c) < 0.5);
        for (x, found) in positions.iter().zip(&field).filter(|(x, _)| !is_corner(x)) {
            assert!((found - linear(x)).abs() < 1e-9, "{x}: {found}");
        }
    }

    /// A wall too thin for points in the interior keeps the stress of its own bonds.
    #[test]
    fn thin_walls_keep_their_stress() {
        let (body, extrapolation) = wall([20, 6, 1]);
        let mut field: Vec<f64> = (0..body.points.len()).map(|i| i as f64).collect();
        let before = field.clone();
        extrapolation.apply(&mut field);
        assert_eq!(field, before);
    }
}
