//! Orientation of a rigid body and its free rotation.

use nalgebra::{Matrix3, SymmetricEigen, Unit, UnitQuaternion, Vector3};

/// Rotation by `angle` (rad) about the axis 0, 1 or 2 of space.
pub(super) fn about(axis: usize, angle: f64) -> UnitQuaternion<f64> {
    let axis = Unit::new_unchecked(Vector3::ith(axis, 1.0));
    UnitQuaternion::from_axis_angle(&axis, angle)
}

/// `R - 1` of the rotation matrix R of a unit quaternion (w, v), without the cancellation of small rotations:
///
/// ```text
/// R - 1 = 2 w [v]x + 2 [v]x [v]x
/// ```
pub(super) fn turned_by(orientation: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let cross = orientation.imag().cross_matrix();
    (cross * orientation.w + cross * cross) * 2.0
}

/// Principal moments (kg m²), ascending, and axes of the inertia in the reference configuration.
#[derive(Clone, Debug)]
pub(super) struct PrincipalInertia {
    moments: [f64; 3],
    axes: [Vector3<f64>; 3],
}

impl PrincipalInertia {
    /// Principal moments and axes of a symmetric inertia (kg m²).
    pub(super) fn new(inertia: &Matrix3<f64>) -> Self {
        let eigen = SymmetricEigen::new(*inertia);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        PrincipalInertia {
            moments: order.map(|k| eigen.eigenvalues[k]),
            axes: order.map(|k| eigen.eigenvectors.column(k).into_owned().normalize()),
        }
    }

    /// The least principal moment, kg m².
    pub(super) fn least(&self) -> f64 {
        self.moments[0]
    }

    /// Orientation after the time `step` (s) without a moment; `spin` is the angular momentum about the centre of
    /// mass (N m s) in the axes of space, which is constant.
    ///
    /// The kinetic energy is split into parts whose flows are exact rotations, composed symmetrically (Fassò 2003,
    /// "Comparison of splitting algorithms for the rigid body", J. Comput. Phys. 189):
    ///
    /// ```text
    /// T = |L|^2 / (2 I_2) + sum_(k = 1, 3) (1 / I_k - 1 / I_2) L_k^2 / 2
    /// ```
    ///
    /// The first part turns the body about the fixed L by `h |L| / I_2`; the part k turns it about its own principal
    /// axis k by `h (1 / I_k - 1 / I_2) L_k`. The map is symplectic, so that the error of the energy is of second
    /// order and stays bounded; it is exact for spheres, axisymmetric bodies and rotation about a principal axis.
    pub(super) fn rotate(
        &self,
        orientation: UnitQuaternion<f64>,
        spin: &Vector3<f64>,
        step: f64,
    ) -> UnitQuaternion<f64> {
        let part = |orientation: UnitQuaternion<f64>, k: usize, step: f64| {
            let excess = 1.0 / self.moments[k] - 1.0 / self.moments[1];
            let component = self.axes[k].dot(&orientation.inverse_transform_vector(spin));
            orientation
                * UnitQuaternion::from_scaled_axis(self.axes[k] * (step * excess * component))
        };
        let orientation = part(orientation, 0, 0.5 * step);
        let orientation = part(orientation, 2, step);
        let orientation = part(orientation, 0, 0.5 * step);
        let about_spin = UnitQuaternion::from_scaled_axis(spin * (step / self.moments[1]));
        UnitQuaternion::new_normalize((about_spin * orientation).into_inner())
    }
}
