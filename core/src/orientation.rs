//! Orientation of the material at a point: a rotation vector, whose direction is the axis of the rotation and whose length is
//! its angle (rad). It turns the axes x, y, z of space to the axes of the material, such as fibres, in the undeformed body.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

use crate::parallel::ParallelLoop;

/// The axes of the material, unit vectors, by columns.
pub fn axes(orientation: &Vector3<f64>) -> Matrix3<f64> {
    Rotation3::from_scaled_axis(*orientation).into_inner()
}

/// The symmetric tensor with these principal values along axes.
#[inline]
pub fn tensor(axes: &Matrix3<f64>, principal: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| {
        (0..3).fold(0.0, |sum, axis| {
            sum + principal[axis] * (axes[(row, axis)] * axes[(column, axis)])
        })
    })
}

/// Axes of the material at the points of a body, which follow the field `orientation`.
#[derive(Clone, Debug)]
pub struct PointAxes {
    orientation: Vec<Vector3<f64>>,
    axes: Vec<Matrix3<f64>>,
}

impl PointAxes {
    /// The axes of space at all points.
    pub fn new(points: usize) -> Self {
        PointAxes {
            orientation: vec![Vector3::zeros(); points],
            axes: vec![Matrix3::identity(); points],
        }
    }

    /// Turns them by rotation vectors, rad.
    pub fn follow(&mut self, orientation: &[Vector3<f64>]) {
        if self.orientation != orientation {
            self.orientation.copy_from_slice(orientation);
            let turned = self.axes.par_iter_mut().zip(orientation);
            turned.for_all(|(own, orientation)| *own = axes(orientation));
        }
    }

    /// The axes of a point, by columns.
    #[inline]
    pub fn of(&self, point: usize) -> &Matrix3<f64> {
        &self.axes[point]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_about_z_turns_x_towards_y() {
        let angle = 30_f64.to_radians();
        let (sin, cos) = angle.sin_cos();
        let found = axes(&Vector3::new(0.0, 0.0, angle));
        assert_eq!(found.column(0), Vector3::new(cos, sin, 0.0));
        assert_eq!(found.column(1), Vector3::new(-sin, cos, 0.0));
        assert_eq!(found.column(2), Vector3::z());
        assert_eq!(axes(&Vector3::zeros()), Matrix3::identity());
    }

    #[test]
    fn tensors_have_their_principal_values_along_the_axes() {
        let mut points = PointAxes::new(2);
        assert_eq!(
            tensor(points.of(1), [1.0, 2.0, 3.0]),
            Matrix3::from_diagonal(&[1.0, 2.0, 3.0].into())
        );
        points.follow(&[Vector3::zeros(), Vector3::new(0.3, -0.7, 0.2)]);
        let axes = points.of(1);
        let found = tensor(axes, [1.0, 2.0, 3.0]);
        assert_eq!(found, found.transpose());
        for (axis, principal) in axes.column_iter().zip([1.0, 2.0, 3.0]) {
            assert!((found * axis - axis * principal).norm() < 1e-15);
        }
    }

    /// A rotation by 120 degrees about the diagonal turns x to y, y to z and z to x.
    #[test]
    fn the_axis_may_have_any_direction() {
        let third = std::f64::consts::TAU / 3.0;
        let found = axes(&(Vector3::repeat(1.0).normalize() * third));
        let expected = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        assert!((found - expected).norm() < 1e-15);
    }
}
