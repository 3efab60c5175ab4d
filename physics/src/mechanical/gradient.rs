//! Displacement gradient by the shape tensor: exact for affine displacements on any family.
//!
//! ```text
//! H = [sum_j w (u_j - u_i) (x) xi] K^-1,   K = sum_j w xi (x) xi       Wang (2025), eqs. 3.15, 3.19
//! ```

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::{Body, Bond, BondKernel, Family};
use rayon::prelude::*;

use super::classical::symmetric;

/// `sum_j w (u_j - u_i) (x) xi` by rows, m.
struct Moment<const D: usize>;

impl<const D: usize, const Q: usize> BondKernel<3, Q> for Moment<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; Q] {
        std::array::from_fn(|q| bond.weight * (other[q / D] - own[q / D]) * bond.xi[q % D])
    }
}

/// `K` as xx, yy, zz, xy, yz, zx, m.
struct ShapeTensor;

impl BondKernel<3, 6> for ShapeTensor {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 3], _: [f64; 3]) -> [f64; 6] {
        let [x, y, z] = bond.xi;
        [x * x, y * y, z * z, x * y, y * z, z * x].map(|c| bond.weight * c)
    }
}

/// Displacement gradients of the points of a body.
#[derive(Debug)]
pub(super) struct Gradient {
    family: Arc<Family>,
    dimension: usize,
    /// `K^-1`, 1/m; zero in the components that the dimension leaves out.
    pub(super) inverse_shape: Vec<Matrix3<f64>>,
    /// H as last evaluated.
    pub(super) values: Vec<Matrix3<f64>>,
    sums: Vec<f64>,
    /// Stands for inputs that there are not.
    pub(super) zeros: Vec<f64>,
}

impl Gradient {
    /// Inverts the shape tensors.
    ///
    /// # Errors
    /// A point whose bonds do not span the dimensions.
    pub(super) fn new(body: &Body, family: Arc<Family>) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let mut tensors = vec![[0.0; 6]; points];
        let zeros = vec![0.0; family.slots()];
        family.sum(&ShapeTensor, [&zeros[..]; 3], &mut tensors);
        let mut inverse_shape = Vec::with_capacity(points);
        for (point, tensor) in tensors.iter().enumerate() {
            let mut shape = symmetric(tensor);
            let size: f64 = shape.trace();
            (dimension..3).for_each(|a| shape[(a, a)] = size);
            let flat = || FlatFamily {
                at: body.points.position[point].into(),
            };
            // relative to a full family, whose eigenvalues are equal
            if shape.symmetric_eigenvalues().min() < 1e-6 * size {
                return Err(flat());
            }
            let mut inverse = shape.try_inverse().ok_or_else(flat)?;
            (dimension..3).for_each(|a| inverse[(a, a)] = 0.0);
            inverse_shape.push(inverse);
        }
        Ok(Gradient {
            dimension,
            inverse_shape,
            values: vec![Matrix3::zeros(); points],
            sums: vec![0.0; points * if dimension == 3 { 9 } else { 4 }],
            zeros,
            family,
        })
    }

    /// Evaluates H from displacement components in slot space; those that the dimension leaves out
    /// may be empty.
    pub(super) fn evaluate(&mut self, displacement: [&[f64]; 3]) {
        match self.dimension {
            1 | 2 => self.evaluate_in::<2, 4>(displacement),
            _ => self.evaluate_in::<3, 9>(displacement),
        }
    }

    fn evaluate_in<const D: usize, const Q: usize>(&mut self, displacement: [&[f64]; 3]) {
        let inputs = std::array::from_fn(|a| match a < self.dimension {
            true => displacement[a],
            false => &self.zeros[..],
        });
        let sums = bytemuck::cast_slice_mut(&mut self.sums);
        self.family.sum::<3, Q>(&Moment::<D>, inputs, sums);
        let sums = self.sums.par_chunks_exact(Q);
        let points = self
            .values
            .par_iter_mut()
            .zip(sums)
            .zip(&self.inverse_shape);
        points.for_each(|((value, sum), inverse)| {
            let entry = |r: usize, c: usize| match r < D && c < D {
                true => sum[r * D + c],
                false => 0.0,
            };
            *value = Matrix3::from_fn(entry) * inverse;
        });
    }
}

/// A point whose bonds lie in a plane or on a line.
#[derive(Debug, thiserror::Error)]
#[error(
    "the bonds of the point at ({}, {}, {}) m do not span all directions, so it has no strain tensor, which `correspondence` and `plasticity` need: give the body two points or more along each axis",
    at[0], at[1], at[2]
)]
pub struct FlatFamily {
    at: [f64; 3],
}
