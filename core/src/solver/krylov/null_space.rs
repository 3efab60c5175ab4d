//! The null space of a singular matrix, and the projection onto its complement.

use crate::solver::reducer::Reducer;
use crate::solver::vector::update;

/// Orthonormal vectors that a symmetric matrix maps to zero.
///
/// Typical: the constant (heat conduction without prescribed temperature) and the rigid
/// translations and linearised rotations of a free body.
#[derive(Debug, Clone, Default)]
pub struct NullSpace {
    points: Reducer,
    basis: Vec<Vec<f64>>,
}

impl NullSpace {
    /// Orthonormalises the given vectors by modified Gram-Schmidt, done twice because once
    /// loses orthogonality for nearly parallel vectors. Vectors that depend on earlier ones
    /// are dropped: a straight chain has no rotation about its own axis.
    ///
    /// `points`: those to which the entries belong. Collective, as the projection is.
    ///
    /// Panics if the vectors have different lengths.
    pub fn new(vectors: Vec<Vec<f64>>, points: &Reducer) -> Self {
        let mut null_space = NullSpace {
            points: points.clone(),
            basis: Vec::new(),
        };
        for mut vector in vectors {
            let length = points.norm(&vector);
            null_space.project(&mut vector);
            null_space.project(&mut vector);
            let rest = points.norm(&vector);
            // the rest of a dependent vector is rounding
            if rest > 1e-10 * length {
                update(&mut vector, [], |value, []| value / rest);
                null_space.basis.push(vector);
            }
        }
        null_space
    }

    /// The constant vector of `n` entries.
    pub fn constant(n: usize, points: &Reducer) -> Self {
        Self::new(vec![vec![1.0; n]], points)
    }

    /// Length of the vectors, `None` if the space is empty.
    pub fn dimension(&self) -> Option<usize> {
        self.basis.first().map(Vec::len)
    }

    /// Removes the components along the null space: `v -= sum_k (n_k . v) n_k`.
    ///
    /// Panics if the length of `vector` is not [`Self::dimension`].
    pub fn project(&self, vector: &mut [f64]) {
        for mode in &self.basis {
            let component = self.points.dot(mode, vector);
            update(vector, [mode], |value, [mode]| value - component * mode);
        }
    }
}
