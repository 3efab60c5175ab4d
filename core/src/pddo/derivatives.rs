//! Derivatives of a field as the operator returns them.

use nalgebra::{Matrix3, Vector3};

use super::second;

/// Derivatives of one field at all points.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    pub(super) dimension: usize,
    pub(super) exponents: Vec<[u8; 3]>,
    pub(super) values: Vec<f64>,
}

impl Derivatives {
    /// All derivatives at a point, in the order of `Pddo::exponents`.
    #[inline]
    pub fn at(&self, point: usize) -> &[f64] {
        let number = self.exponents.len();
        &self.values[point * number..][..number]
    }

    /// First derivatives at a point.
    pub fn gradient(&self, point: usize) -> Vector3<f64> {
        let all = self.at(point);
        Vector3::from_fn(|a, _| if a < self.dimension { all[a] } else { 0.0 })
    }

    /// Second derivatives at a point; zero for an operator of first order.
    pub fn second(&self, point: usize) -> Matrix3<f64> {
        let all = self.at(point);
        Matrix3::from_fn(|a, b| match a.max(b) < self.dimension {
            true => all
                .get(second(self.dimension, a, b))
                .copied()
                .unwrap_or(0.0),
            false => 0.0,
        })
    }

    /// Sum of the second derivatives along the axes at a point.
    #[inline]
    pub fn laplacian(&self, point: usize) -> f64 {
        let all = self.at(point);
        let along = |a: usize| all.get(second(self.dimension, a, a)).copied();
        (0..self.dimension).filter_map(along).sum()
    }

    /// Increment of the field by the Taylor series at the distance `xi` (m) from a point.
    pub(super) fn series(&self, point: usize, xi: &Vector3<f64>) -> f64 {
        let term = |(e, derivative): (&[u8; 3], &f64)| {
            let axes = e.iter().zip(xi.iter());
            let power = |(&e, x): (&u8, &f64)| (1..=e).map(|n| x / f64::from(n)).product::<f64>();
            derivative * axes.map(power).product::<f64>()
        };
        self.exponents.iter().zip(self.at(point)).map(term).sum()
    }
}
