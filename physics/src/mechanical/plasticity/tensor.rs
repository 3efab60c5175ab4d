//! Symmetric tensors as xx, yy, zz, xy, yz, zx.

use nalgebra::{Matrix6, Vector6};

/// Mean of the normal components.
#[inline(always)]
pub(super) fn mean(tensor: &[f64; 6]) -> f64 {
    (tensor[0] + tensor[1] + tensor[2]) / 3.0
}

/// The tensor without its mean.
#[inline(always)]
pub(super) fn deviator(tensor: &[f64; 6]) -> [f64; 6] {
    let mean = mean(tensor);
    let [xx, yy, zz, xy, yz, zx] = *tensor;
    [xx - mean, yy - mean, zz - mean, xy, yz, zx]
}

/// `a : b`.
#[inline(always)]
pub(super) fn contract(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    let normal = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    normal + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// `column (x) row` as it acts on a tensor: shear components of the row count twice.
pub(super) fn dyad(column: &[f64; 6], row: &[f64; 6]) -> Matrix6<f64> {
    let twice = Vector6::new(1.0, 1.0, 1.0, 2.0, 2.0, 2.0);
    Vector6::from(*column) * Vector6::from(*row).component_mul(&twice).transpose()
}

/// The projection on deviators.
pub(super) fn deviatoric() -> Matrix6<f64> {
    let mut projection = Matrix6::identity();
    let mut normal = projection.fixed_view_mut::<3, 3>(0, 0);
    normal.add_scalar_mut(-1.0 / 3.0);
    projection
}
