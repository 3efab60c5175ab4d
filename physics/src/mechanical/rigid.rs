//! Rigid modes of a body, which its stiffness does not resist.

use nalgebra::Vector3;
use perimelt_core::solver::{NullSpace, Reducer, SolverError};

use super::residual::Residual;
use super::solid::Stiffness;

/// Translations and infinitesimal rotations of points, three components each.
pub(super) fn rigid_modes(
    position: &[Vector3<f64>],
    points: &Reducer,
    dimension: usize,
) -> Vec<Vec<f64>> {
    let [x, y, z, count] = points.sum_points(|i| {
        let x = &position[i];
        [x[0], x[1], x[2], 1.0]
    });
    let centre = Vector3::new(x, y, z) / count;
    let distances = position.iter().map(|x| (x - centre).norm());
    let size = points.max(distances.fold(0.0, f64::max));
    let mode = |motion: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
        position
            .iter()
            .flat_map(|x| <[f64; 3]>::from(motion((x - centre) / size)))
            .collect()
    };
    let axis = |a: usize| Vector3::ith_axis(a).into_inner();
    let mut modes: Vec<Vec<f64>> = (0..dimension).map(|a| mode(&|_| axis(a))).collect();
    let rotations = match dimension {
        1 => 0..0,
        2 => 2..3,
        _ => 0..3,
    };
    modes.extend(rotations.map(|a| mode(&|x| axis(a).cross(&x))));
    modes
}

/// The modes that neither bonds, layers nor held points resist.
pub(super) fn free_rigid_modes(
    residual: &mut Residual<'_>,
    modes: Vec<Vec<f64>>,
) -> Result<NullSpace, SolverError> {
    let mut free = Vec::new();
    let points = &residual.points;
    let mut resistance = vec![0.0; modes[0].len()];
    let stiffness = residual.solid.blocks().iter().map(|b| b[0]);
    let stiffness = points.max(stiffness.fold(0.0, f64::max));
    for mode in modes {
        let held = mode
            .iter()
            .zip(residual.constraint)
            .any(|(m, c)| *c > 0.0 && *m != 0.0);
        let held = points.any(held);
        residual
            .solid
            .set_displacement(&mode, &residual.homogeneous);
        residual
            .solid
            .stiffness(Stiffness::Elastic, &mut resistance);
        // rounding of a sum of a few hundred terms is smaller, one resisted point among millions is larger
        if !held && points.norm(&resistance) <= 1e-10 * stiffness * points.norm(&mode) {
            free.push(mode);
        }
    }
    Ok(NullSpace::new(free, points))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a rectangle of 6 by 8 m, at 5 m from its centre: rotations are scaled by that distance.
    #[test]
    fn rigid_modes_are_translations_and_rotations_about_the_centre() {
        let corner = |x: f64, y: f64| Vector3::new(1.0 + x, 2.0 + y, 7.0);
        let positions = [
            corner(-3.0, -4.0),
            corner(3.0, -4.0),
            corner(3.0, 4.0),
            corner(-3.0, 4.0),
        ];
        let along = |axis: usize| -> Vec<f64> {
            let mut mode = vec![0.0; 12];
            mode.iter_mut().skip(axis).step_by(3).for_each(|m| *m = 1.0);
            mode
        };
        let about_z = vec![
            0.8, -0.6, 0.0, 0.8, 0.6, 0.0, -0.8, 0.6, 0.0, -0.8, -0.6, 0.0,
        ];
        // about x: (0, -z, y), about y: (z, 0, -x)
        let about_x = vec![0.0, 0.0, -0.8, 0.0, 0.0, -0.8, 0.0, 0.0, 0.8, 0.0, 0.0, 0.8];
        let about_y = vec![0.0, 0.0, 0.6, 0.0, 0.0, -0.6, 0.0, 0.0, -0.6, 0.0, 0.0, 0.6];
        for (dimension, expected) in [
            (1, vec![along(0)]),
            (2, vec![along(0), along(1), about_z.clone()]),
            (
                3,
                vec![along(0), along(1), along(2), about_x, about_y, about_z],
            ),
        ] {
            let found = rigid_modes(&positions, &Reducer::alone(4), dimension);
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                assert!((found - expected).abs() < 1e-15, "{dimension}D");
            }
        }
    }
}
