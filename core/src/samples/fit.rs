//! Interpolation between points without a grid.

use nalgebra::{Matrix3, Vector3};

use super::tree::{Near, Tree};

/// Points whose values give the value at a position, by dimension.
const NEIGHBOURS: [usize; 3] = [4, 12, 24];

/// Directions in which the points extend less than this fraction of their extent have no slope.
const FLAT: f64 = 1e-4;

/// Value at a position (m): the mean of the points there, else that of a linear field fitted to the points around with
/// weights `((R - r) / (R r))^2` (Franke and Nielson, Int. J. Numer. Methods Eng. 15 (1980) 1691), which interpolates and is
/// exact for linear fields. Where the field is not linear the fit is limited to the range of their values, so that it does not
/// extrapolate beyond the outermost points.
pub(super) fn value(
    tree: &Tree,
    values: &[f64],
    dimension: usize,
    positions: &[Vector3<f64>],
    at: &Vector3<f64>,
) -> f64 {
    let near = tree.nearest(at, NEIGHBOURS[dimension - 1]);
    let radius = near.last().map_or(0.0, |(d, _)| d.sqrt());
    let is_there = |(distance, _): &&Near| distance.sqrt() <= 1e-9 * radius;
    let there: Vec<f64> = near
        .iter()
        .filter(is_there)
        .map(|(_, p)| values[*p as usize])
        .collect();
    if !there.is_empty() {
        return there.iter().sum::<f64>() / there.len() as f64;
    }
    // the outermost points keep a small weight, so that few points suffice
    let radius = 1.05 * radius;
    let members: Vec<(f64, Vector3<f64>, f64)> = near
        .iter()
        .map(|&(distance, point)| {
            let distance = distance.sqrt();
            let weight = ((radius - distance) / (radius * distance)).powi(2);
            (
                weight,
                positions[point as usize] - at,
                values[point as usize],
            )
        })
        .collect();
    let total: f64 = members.iter().map(|(w, ..)| w).sum();
    let centre: Vector3<f64> = members.iter().map(|(w, x, _)| x * (w / total)).sum();
    let mean: f64 = members.iter().map(|(w, _, f)| w / total * f).sum();
    let (mut moment, mut rise) = (Matrix3::zeros(), Vector3::zeros());
    for (weight, x, f) in &members {
        let x = x - centre;
        moment += *weight * x * x.transpose();
        rise += *weight * (f - mean) * x;
    }
    let slope = pseudo_inverse(moment) * rise;
    let fitted = |x: &Vector3<f64>| mean + slope.dot(&(x - centre));
    let least = members.iter().map(|m| m.2).fold(f64::INFINITY, f64::min);
    let most = members
        .iter()
        .map(|m| m.2)
        .fold(f64::NEG_INFINITY, f64::max);
    let residual = members
        .iter()
        .map(|(_, x, f)| (f - fitted(x)).abs())
        .fold(0.0, f64::max);
    // half of the range where the field is linear, nothing where it is not
    let beyond = (0.5 * (most - least) - 5.0 * residual).max(0.0);
    fitted(&Vector3::zeros()).clamp(least - beyond, most + beyond)
}

/// The inverse in the directions in which points extend.
fn pseudo_inverse(moment: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = moment.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let mut inverse = Matrix3::zeros();
    for (value, direction) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value > FLAT * FLAT * largest {
            inverse += direction * direction.transpose() / *value;
        }
    }
    inverse
}
