//! Interpolation of fields between the points of a cloud.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::{Cloud, Points};

/// Radius of the fit in spacings, and the factor by which it grows if it contains too few points.
const RADIUS: f64 = 2.0;
const GROWTH: f64 = 1.4;
const ATTEMPTS: i32 = 4;

impl Cloud {
    /// Points and weights that give a field at a position (m) by a moving least-squares fit of a
    /// linear field to the points around: exact for linear fields, also beyond the outermost
    /// points. `None` outside of all cells.
    pub fn weights(
        &self,
        points: &Points,
        dimension: usize,
        at: &Vector3<f64>,
    ) -> Option<Vec<(usize, f64)>> {
        // coordinates along missing axes are ignored
        let mut at = *at;
        let plane = points.position.at(0);
        (dimension..3).for_each(|a| at[a] = plane[a]);
        let own = self.point_at(&points.spacing, &at, None)?;
        // points are displaced from the centres in the list by up to half a spacing
        let size = points.spacing[own];
        let near = |radius: f64, visit: &mut dyn FnMut(usize)| {
            self.list.visit_near(&at, radius + 0.9 * size, visit);
        };
        let fit = fitted(near, &points.position, dimension, &at, size);
        Some(fit.unwrap_or_else(|| vec![(own, 1.0)]))
    }
}

/// Points and weights of a field at a position (m) by the fit of [`Cloud::weights`], for points at `positions` (m) with
/// spacings of about `size` (m). `None` if too few points are near.
pub fn weights_among(
    positions: &[Vector3<f64>],
    dimension: usize,
    at: &Vector3<f64>,
    size: f64,
) -> Option<Vec<(usize, f64)>> {
    let mut at = *at;
    (dimension..3).for_each(|a| at[a] = positions[0][a]);
    let all = |_: f64, visit: &mut dyn FnMut(usize)| (0..positions.len()).for_each(visit);
    fitted(all, positions, dimension, &at, size)
}

/// The fit; `near` visits all points that can lie within a radius (m).
fn fitted(
    near: impl Fn(f64, &mut dyn FnMut(usize)),
    positions: &[Vector3<f64>],
    dimension: usize,
    at: &Vector3<f64>,
    size: f64,
) -> Option<Vec<(usize, f64)>> {
    for attempt in 0..ATTEMPTS {
        let radius = RADIUS * size * GROWTH.powi(attempt);
        let mut members: Vec<(usize, f64)> = Vec::new();
        near(radius, &mut |p| {
            let ratio = (positions[p] - at).norm() / radius;
            if ratio < 1.0 {
                members.push((p, (1.0_f64 - ratio * ratio).powi(2)));
            }
        });
        members.sort_by_key(|(p, _)| *p);
        if let Some(&(own, _)) = members
            .iter()
            .find(|(p, _)| (positions[*p] - at).norm() < 1e-6 * size)
        {
            return Some(vec![(own, 1.0)]);
        }
        let basis = |p: usize| {
            let offset = (positions[p] - at) / radius;
            Vector4::new(1.0, offset.x, offset.y, offset.z)
        };
        let mut moment = Matrix4::zeros();
        for &(p, weight) in &members {
            moment += weight * basis(p) * basis(p).transpose();
        }
        let total = moment[(0, 0)];
        (dimension..3).for_each(|a| moment[(a + 1, a + 1)] = total);
        // a determinant near zero: the points lie on a line or plane
        if moment.determinant().abs() <= 1e-6 * total.powi(4) {
            continue;
        }
        let fit = moment.try_inverse()? * Vector4::x();
        members
            .iter_mut()
            .for_each(|(p, weight)| *weight *= basis(*p).dot(&fit));
        return Some(members);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Discretisation, Jitter};
    use crate::shape::{BoxShape, Shape};

    #[test]
    fn linear_fields_are_exact_up_to_the_faces() {
        for dimension in 1..=3 {
            let shape = Shape::Box(BoxShape {
                min: [0.0; 3],
                max: [2.0, 1.0, 1.0],
            });
            let body = Body::fill("block", &shape, dimension, 0.125, 0.1).expect("valid");
            let jitter = Jitter {
                amplitude: 0.3,
                seed: 4,
            };
            let body = body.jittered(jitter).expect("valid");
            let Discretisation::Cloud(cloud) = &body.discretisation else {
                panic!("a cloud");
            };
            let linear =
                |x: &Vector3<f64>| (0..dimension).fold(1.0, |sum, a| sum + (a as f64 + 2.0) * x[a]);
            for at in [[0.0, 0.0, 0.0], [0.71, 0.33, 0.52], [2.0, 0.4, 0.6]] {
                let at = Vector3::from(at);
                let weights = cloud.weights(&body.points, dimension, &at).expect("inside");
                let value: f64 = weights
                    .iter()
                    .map(|&(p, w)| w * linear(&body.points.position.at(p)))
                    .sum();
                // rounding of a few dozen terms of order one
                assert!((value - linear(&at)).abs() < 1e-12, "{dimension}D at {at}");
            }
            let off = Vector3::new(2.1, 0.5, 0.5);
            assert!(cloud.weights(&body.points, dimension, &off).is_none());
        }
    }
}
