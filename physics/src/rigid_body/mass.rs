//! Mass, centre of mass and inertia of a rigid body, and resultants of fields over its points.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use perimelt_core::body::Points;
use perimelt_core::solver::Reducer;

/// Weights of the sums for the total and the first moment of a field.
#[derive(Debug)]
pub(super) struct PointWeights {
    weight: Vec<f64>,
    /// Weight times each component of the arm; empty along z in 2D.
    arm_weight: [Vec<f64>; 3],
    reducer: Reducer,
}

/// `sum_i w_i v_i`.
fn weighted_sum(vectors: &[Vector3<f64>], weights: &[f64], reducer: &Reducer) -> Vector3<f64> {
    Vector3::from(reducer.sum_points(|i| (weights[i] * vectors[i]).into()))
}

/// Total and first moment of a vector field over the points of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Resultant {
    /// `sum_i w_i f_i`.
    pub total: Vector3<f64>,
    /// `sum_i w_i f_i a_i^T`, with the arms `a` from the centre of mass in the reference configuration.
    pub first: Matrix3<f64>,
}

impl PointWeights {
    /// Weights of all points with their arms.
    pub(super) fn new(
        dimension: usize,
        weight: Vec<f64>,
        arms: &[Vector3<f64>],
        reducer: Reducer,
    ) -> Self {
        let arm_weight = std::array::from_fn(|axis| match axis < dimension {
            true => weight.iter().zip(arms).map(|(w, a)| w * a[axis]).collect(),
            false => Vec::new(),
        });
        PointWeights {
            weight,
            arm_weight,
            reducer,
        }
    }

    /// Total and first moment of `field`.
    pub(super) fn resultant(&self, field: &[Vector3<f64>]) -> Resultant {
        let weighted = |weights: &Vec<f64>| match weights.is_empty() {
            true => Vector3::zeros(),
            false => weighted_sum(field, weights, &self.reducer),
        };
        Resultant {
            total: weighted(&self.weight),
            first: Matrix3::from_columns(&self.arm_weight.each_ref().map(weighted)),
        }
    }
}

impl Resultant {
    /// Moment about the centre of mass of the body turned by `rotation` R: `sum_i w_i (R a_i) x f_i`.
    pub(super) fn moment(&self, rotation: &Matrix3<f64>) -> Vector3<f64> {
        // entry (l, k) is the sum of w_i f_l (R a)_k
        let m = self.first * rotation.transpose();
        Vector3::new(
            m[(2, 1)] - m[(1, 2)],
            m[(0, 2)] - m[(2, 0)],
            m[(1, 0)] - m[(0, 1)],
        )
    }
}

/// Mass, centre of mass and inertia in the reference configuration.
#[derive(Debug)]
pub(super) struct MassProperties {
    /// kg.
    pub mass: f64,
    /// Mass of each point, kg.
    pub point_mass: Vec<f64>,
    /// Centre of mass, m.
    pub centre: Vector3<f64>,
    /// Arm of each point from the centre of mass, m; without a z component in 2D.
    pub arms: Vec<Vector3<f64>>,
    /// Inertia about the centre of mass, kg m².
    pub inertia: Matrix3<f64>,
    /// Inertia of the points without their cells, kg m², with which a velocity of the points is fitted.
    pub point_inertia: Matrix3<f64>,
    pub reducer: Reducer,
}

impl MassProperties {
    /// Properties of points with the given densities (kg/m³), scaled to the total `mass` (kg) if it is given.
    ///
    /// ```text
    /// I = sum_i m_i ((a_i . a_i) 1 - a_i a_i^T + s_i^2 / 6)
    /// ```
    ///
    /// The last term is the inertia of the cubic (2D: square) cell with edge `s` of each point: with it a block of
    /// cells has the exact inertia of the block.
    pub(super) fn of_points(
        dimension: usize,
        points: &Points,
        density: &[f64],
        mass: Option<f64>,
        reducer: Reducer,
    ) -> Self {
        let mut point_mass: Vec<f64> = points
            .volume
            .iter()
            .zip(density)
            .map(|(v, rho)| v * rho)
            .collect();
        if let Some(mass) = mass {
            let scale = mass / reducer.sum(&point_mass);
            point_mass.iter_mut().for_each(|m| *m *= scale);
        }
        let mass = mass.unwrap_or_else(|| reducer.sum(&point_mass));
        let centre = weighted_sum(&points.position, &point_mass, &reducer) / mass;
        let arm = |x: &Vector3<f64>| {
            let mut arm = x - centre;
            arm.as_mut_slice()[dimension..].fill(0.0);
            arm
        };
        let arms: Vec<_> = points.position.iter().map(arm).collect();
        let weights = PointWeights::new(dimension, point_mass.clone(), &arms, reducer.clone());
        let second = weights.resultant(&arms);
        let point_inertia = Matrix3::identity() * second.first.trace() - second.first;
        let inertia_of_cell = |[m, s]: [f64; 2]| m * s * s;
        let cell_inertia = reducer.sum_of([&point_mass, &points.spacing], inertia_of_cell) / 6.0;
        MassProperties {
            mass,
            point_mass,
            centre,
            arms,
            inertia: point_inertia + Matrix3::identity() * cell_inertia,
            point_inertia,
            reducer,
        }
    }

    /// Velocity of the centre of mass (m/s) and angular velocity (rad/s) of the rigid motion that has the momentum and
    /// the angular momentum of points with the given velocities, in a body turned by `rotation`.
    pub(super) fn fit_velocity(
        &self,
        rotation: &Matrix3<f64>,
        velocity: &[Vector3<f64>],
    ) -> (Vector3<f64>, Vector3<f64>) {
        let mass = self.point_mass.clone();
        let weights = PointWeights::new(3, mass, &self.arms, self.reducer.clone());
        let momentum = weights.resultant(velocity);
        let inertia = rotation * self.point_inertia * rotation.transpose();
        let spin = momentum.moment(rotation);
        (momentum.total / self.mass, solve_symmetric(&inertia, &spin))
    }

    /// Mean displacement of the points, m.
    pub(super) fn mean(&self, displacement: &[Vector3<f64>]) -> Vector3<f64> {
        weighted_sum(displacement, &self.point_mass, &self.reducer) / self.mass
    }

    /// Angle (rad) about `axis` that turns the arms closest to `arm_i + u_i - mean`:
    /// `atan2(sum m n . (a x b), sum m (a . b - a_n b_n))`.
    pub(super) fn fit_angle(&self, axis: usize, displacement: &[Vector3<f64>]) -> f64 {
        let mean = self.mean(displacement);
        let terms = |of: fn(f64, f64, f64, f64) -> f64| {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let value = |(a, u): (&Vector3<f64>, &Vector3<f64>)| {
                let b = a + u - mean;
                of(a[j], a[k], b[j], b[k])
            };
            let values: Vec<f64> = self.arms.iter().zip(displacement).map(value).collect();
            self.reducer.dot(&values, &self.point_mass)
        };
        let sine = terms(|aj, ak, bj, bk| aj * bk - ak * bj);
        let cosine = terms(|aj, ak, bj, bk| aj * bj + ak * bk);
        sine.atan2(cosine)
    }
}

/// Least solution of `matrix x = right` for a symmetric matrix that may be singular, as the inertia of points on a
/// line is.
fn solve_symmetric(matrix: &Matrix3<f64>, right: &Vector3<f64>) -> Vector3<f64> {
    let eigen = SymmetricEigen::new(*matrix);
    // rounding of the sums, far below any real moment of inertia
    let least = 1e-12 * eigen.eigenvalues.amax();
    let terms = (0..3).filter(|&k| eigen.eigenvalues[k] > least).map(|k| {
        let axis = eigen.eigenvectors.column(k);
        axis * (axis.dot(right) / eigen.eigenvalues[k])
    });
    terms.fold(Vector3::zeros(), |sum, term| sum + term)
}
