//! How far the displacement of a solid deforms it: what looks for implausible states asks for it.

use nalgebra::Matrix3;

use super::base::SolidBase;
use super::classical::Point;
use super::stretch::{find_overstretched, relative_displacement_beyond};

/// The deformation by the displacement that was set.
#[derive(Clone, Copy, Debug)]
pub enum Deformation<'a> {
    /// Of a solid with bonds: the displacement along each axis by slot, m.
    Bonds(&'a SolidBase, [&'a [f64]; 3]),
    /// Of a solid without: the gradient of the displacement of each point.
    Gradients(&'a SolidBase, &'a [Matrix3<f64>]),
}

impl Deformation<'_> {
    /// The point about which the body is stretched most, if a stretch is beyond `limit`.
    pub(super) fn find_overstretched(self, limit: f64) -> Option<usize> {
        let (base, gradients) = match self {
            Deformation::Bonds(base, displacement) => {
                return find_overstretched(base, displacement, limit);
            }
            Deformation::Gradients(base, gradients) => (base, gradients),
        };
        let finite = base.is_finite();
        let (point, strain) = largest(gradients, |h| Point::strain(h, finite).norm())?;
        // the norm of Green's strain under uniaxial stretch
        let limit = if finite {
            limit * (1.0 + 0.5 * limit)
        } else {
            limit
        };
        (strain > limit).then_some(point)
    }

    /// Largest displacement of neighbours relative to each other, over their distance; `None` if it is not beyond `limit`.
    pub(super) fn relative_displacement_beyond(self, limit: f64) -> Option<f64> {
        let gradients = match self {
            Deformation::Bonds(base, displacement) => {
                return relative_displacement_beyond(base.bonds(), displacement, limit);
            }
            Deformation::Gradients(_, gradients) => gradients,
        };
        let (_, largest) = largest(gradients, Matrix3::norm)?;
        (largest > limit).then_some(largest)
    }
}

/// The point with the largest measure of its gradient; `None` without numbers.
fn largest(
    gradients: &[Matrix3<f64>],
    measure: impl Fn(&Matrix3<f64>) -> f64,
) -> Option<(usize, f64)> {
    let measures = gradients.iter().map(measure).enumerate();
    measures.max_by(|a, b| a.1.total_cmp(&b.1))
}
