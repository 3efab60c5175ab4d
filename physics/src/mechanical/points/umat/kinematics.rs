//! Strain and rotation of a point in a step, from the deformations at its start and its end.
//!
//! ```text
//! small displacements   DSTRAN = e1 - e0,  DROT = 1
//! finite ones           F1 F0^-1 = V R,  DSTRAN = ln V,  DROT = R
//! ```

use nalgebra::Matrix3;

/// A deformation in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Increment {
    finite: bool,
    /// Deformation gradients at the start and at the end; one where displacements are small.
    pub(super) gradients: [Matrix3<f64>; 2],
    /// Displacement gradients, or small strains, at the start and at the end.
    ends: [Matrix3<f64>; 2],
    /// Strain in the step.
    pub(super) strain: Matrix3<f64>,
    /// Rotation in the step.
    pub(super) rotation: Matrix3<f64>,
}

const NOT_FINITE: Matrix3<f64> = Matrix3::new(
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
    f64::NAN,
);

/// A rate of deformation with its spin.
pub(super) struct Rate {
    pub(super) strain: Matrix3<f64>,
    spin: Matrix3<f64>,
}

impl Increment {
    /// The step from a displacement gradient, or small strain, to a deformation gradient, or small strain.
    pub(super) fn new(finite: bool, start: &Matrix3<f64>, end: &Matrix3<f64>) -> Self {
        let one = Matrix3::identity();
        if !finite {
            return Increment {
                finite,
                gradients: [one; 2],
                ends: [*start, *end],
                strain: end - start,
                rotation: one,
            };
        }
        let gradient = one + start;
        let (strain, rotation) = match gradient.try_inverse() {
            Some(_) if gradient == *end => (Matrix3::zeros(), one),
            Some(inverse) => log_and_rotation(&(end * inverse)),
            None => (NOT_FINITE, NOT_FINITE),
        };
        Increment {
            finite,
            gradients: [gradient, *end],
            ends: [*start, end - one],
            strain,
            rotation,
        }
    }

    /// Displacement gradient, or small strain, at the end.
    pub(super) fn end(&self) -> &Matrix3<f64> {
        &self.ends[1]
    }

    /// Strain at the start, with the rotation of the end: logarithmic, or small.
    pub(super) fn total(&self) -> Matrix3<f64> {
        match self.finite {
            true => self.turned(&log_and_rotation(&self.gradients[0]).0),
            false => self.ends[0],
        }
    }

    /// A tensor at the start with the rotation of the end.
    pub(super) fn turned(&self, tensor: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation * tensor * self.rotation.transpose()
    }

    /// Volume at the end over that of the undeformed body.
    pub(super) fn volume_ratio(&self) -> f64 {
        self.gradients[1].determinant()
    }

    /// `J s F^-T`: the first stress of Piola and Kirchhoff at the end.
    pub(super) fn nominal(&self, stress: &Matrix3<f64>) -> Matrix3<f64> {
        stress * self.end_inverse().transpose() * self.volume_ratio()
    }

    fn end_inverse(&self) -> Matrix3<f64> {
        let inverse = self.gradients[1].try_inverse();
        inverse.unwrap_or(NOT_FINITE)
    }

    /// The rate of deformation with a change of the deformation gradient, or of the small strain.
    pub(super) fn rate(&self, change: &Matrix3<f64>) -> Rate {
        let velocity = change * self.end_inverse();
        Rate {
            strain: 0.5 * (velocity + velocity.transpose()),
            spin: 0.5 * (velocity - velocity.transpose()),
        }
    }

    /// Change of the first stress of Piola and Kirchhoff with a change d of the stress, that of Jaumann of the stress of Kirchhoff
    /// over J in finite kinematics: `J (d + W s - s W - s L^T) F^-T`, with `L^T = D - W`.
    pub(super) fn nominal_rate(
        &self,
        change: &Matrix3<f64>,
        stress: &Matrix3<f64>,
        rate: &Rate,
    ) -> Matrix3<f64> {
        match self.finite {
            true => self.nominal(&(change + rate.spin * stress - stress * rate.strain)),
            false => *change,
        }
    }
}

/// `ln V` and R of `F = V R`.
fn log_and_rotation(gradient: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let square = (gradient * gradient.transpose()).symmetric_eigen();
    let of = |value: fn(f64) -> f64| {
        let values = square.eigenvalues.map(value);
        square.eigenvectors * Matrix3::from_diagonal(&values) * square.eigenvectors.transpose()
    };
    (of(|v| 0.5 * v.ln()), of(|v| 1.0 / v.sqrt()) * gradient)
}
