//! Rigid modes of a body, which its stiffness does not resist.

use nalgebra::Vector3;
use perimelt_core::solver::reduce::norm;
use perimelt_core::solver::{NullSpace, SolverError};

use super::residual::Residual;

/// Translations and infinitesimal rotations of the points, three components each.
pub(super) fn rigid_modes(position: &[Vector3<f64>], dimension: usize) -> Vec<Vec<f64>> {
    let centre = position.iter().sum::<Vector3<f64>>() / position.len() as f64;
    let size = position
        .iter()
        .map(|x| (x - centre).norm())
        .fold(0.0, f64::max);
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

/// Those of `modes` that neither bonds, layers nor held points resist.
pub(super) fn free_rigid_modes(
    residual: &mut Residual<'_>,
    modes: Vec<Vec<f64>>,
) -> Result<NullSpace, SolverError> {
    let mut free = Vec::new();
    let mut resistance = vec![0.0; modes[0].len()];
    let stiffness = residual
        .solid
        .blocks()
        .iter()
        .map(|b| b[0])
        .fold(0.0, f64::max);
    for mode in modes {
        let held = mode
            .iter()
            .zip(residual.constraint)
            .any(|(m, c)| *c > 0.0 && *m != 0.0);
        residual
            .solid
            .set_displacement(&mode, &residual.homogeneous);
        residual.solid.stiffness(&mut resistance);
        // rounding of a sum of a few hundred terms is smaller, one resisted point among millions is larger
        if !held && norm(&resistance) <= 1e-10 * stiffness * norm(&mode) {
            free.push(mode);
        }
    }
    Ok(NullSpace::new(free))
}
