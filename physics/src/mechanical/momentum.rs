//! Momentum and angular momentum of an explicit body, and what its surroundings give to it.
//!
//! The impulses of body forces, damping, layers and held components are summed at the positions where they act:
//! half a kick of velocity Verlet at the old positions, half at the new ones. The balance of momentum then closes
//! to rounding in every formulation, because the forces of a bond on its two ends cancel.
//!
//! Angular momentum is taken about the origin at current positions. Under finite kinematics its balance closes to
//! rounding, too: the forces of bond-based and ordinary solids act along the current bonds, and those of
//! correspondence solids have no moment in sum over a family, because the Cauchy stress is symmetric and the
//! deviations `z` of the stabilisation are orthogonal to the bonds of the family. Under linear kinematics forces
//! act along reference bonds and have a moment about current positions in the order of the strain: angular
//! momentum is not kept, and has no balance.

use nalgebra::Vector3;
use perimelt_core::solver::Reducer;
use perimelt_core::{Balance, World};

use super::step::MechanicalRun;
use crate::momentum;
pub(super) use crate::momentum::{Balanced, Momentum};

/// A momentum or impulse (N s), behind the position where it is (m).
pub(super) type Located = [[f64; 3]; 2];

/// Two parts of the moment of a momentum about an axis; their difference is the moment.
#[inline(always)]
fn moments([x, p]: Located, axis: usize) -> [f64; 2] {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    [x[b] * p[c], x[c] * p[b]]
}

/// Components `0..A` of the momentum, and their sizes behind them.
#[inline(always)]
fn linear<const A: usize, const N: usize>(located: Located) -> [f64; N] {
    let mut sums = [0.0; N];
    for axis in 0..A {
        let p = located[1][axis];
        (sums[axis], sums[A + axis]) = (p, p.abs());
    }
    sums
}

/// The sums of [`linear`], then the moments about `axes` and their sizes.
#[inline(always)]
fn linear_and_angular<const A: usize, const N: usize>(
    located: Located,
    axes: std::ops::Range<usize>,
) -> [f64; N] {
    let mut sums = linear::<A, N>(located);
    let (first, count) = (2 * A, axes.len());
    for (n, axis) in axes.enumerate() {
        let [plus, minus] = moments(located, axis);
        (sums[first + n], sums[first + count + n]) = (plus - minus, plus.abs() + minus.abs());
    }
    sums
}

impl Momentum {
    /// Sums what the points have.
    pub(super) fn sum(
        balanced: Balanced,
        nodes: &Reducer,
        of: impl Fn(usize) -> Located + Sync,
    ) -> Self {
        let mut all = Momentum::default();
        match (balanced.dimension, balanced.angular) {
            (3, false) => {
                let s = nodes.sum_points(|i| linear::<3, 6>(of(i)));
                all.linear = [s[0], s[1], s[2]];
                all.linear_size = [s[3], s[4], s[5]];
            }
            (3, true) => {
                let s = nodes.sum_points(|i| linear_and_angular::<3, 12>(of(i), 0..3));
                let group = |first: usize| std::array::from_fn(|axis| s[first + axis]);
                (all.linear, all.linear_size) = (group(0), group(3));
                (all.angular, all.angular_size) = (group(6), group(9));
            }
            (_, false) => {
                let [x, y, x_size, y_size] = nodes.sum_points(|i| linear::<2, 4>(of(i)));
                (all.linear, all.linear_size) = ([x, y, 0.0], [x_size, y_size, 0.0]);
            }
            (_, true) => {
                let sum = nodes.sum_points(|i| linear_and_angular::<2, 6>(of(i), 2..3));
                let [x, y, x_size, y_size, moment, moment_size] = sum;
                (all.linear, all.linear_size) = ([x, y, 0.0], [x_size, y_size, 0.0]);
                (all.angular[2], all.angular_size[2]) = (moment, moment_size);
            }
        }
        all
    }

    /// What a force gives in a time (s).
    pub(super) fn times(self, time: f64) -> Self {
        let times = |vector: [f64; 3]| vector.map(|v| v * time);
        Momentum {
            linear: times(self.linear),
            angular: times(self.angular),
            linear_size: times(self.linear_size),
            angular_size: times(self.angular_size),
        }
    }

    /// With the sizes of another momentum: those of a negative one are positive.
    pub(super) fn with_size_of(self, other: &Momentum) -> Self {
        Momentum {
            linear_size: other.linear_size,
            angular_size: other.angular_size,
            ..self
        }
    }

    /// Without the linear part: what an unchanged momentum that moves adds.
    pub(super) fn only_angular(self) -> Self {
        Momentum {
            linear: [0.0; 3],
            linear_size: [0.0; 3],
            ..self
        }
    }
}

/// Current position of a point, m.
#[inline(always)]
pub(super) fn place(reference: &Vector3<f64>, displacement: &[f64]) -> [f64; 3] {
    by_axis(|axis| reference[axis] + displacement[axis])
}

/// Three components. In sums over points `std::array::from_fn` is a call, which takes longer than the rest.
#[inline(always)]
pub(super) fn by_axis(f: impl Fn(usize) -> f64) -> [f64; 3] {
    [f(0), f(1), f(2)]
}

impl MechanicalRun {
    /// Momentum of the body now; zero without the explicit solver.
    pub(super) fn momentum(&self, world: &World) -> Momentum {
        self.momentum_with(world, |i| self.node_density[i])
    }

    /// Momentum with other densities (kg/m³) of the nodes.
    pub(super) fn momentum_with(
        &self,
        world: &World,
        density: impl Fn(usize) -> f64 + Sync,
    ) -> Momentum {
        let Some(velocity) = self.fields.velocity else {
            return Momentum::default();
        };
        let velocity = world.read::<Vector3<f64>>(velocity.into());
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (nodes, corners) = (self.nodes(), &self.state.corners);
        let velocity = nodes.values(&velocity, &corners.velocity);
        let displacement = nodes.values(&displacement, &corners.displacement);
        let body = world.body(self.body);
        let (positions, volumes) = (nodes.positions(body), nodes.volumes(body));
        Momentum::sum(self.balanced, &self.node_reducer(world), |i| {
            let x = place(&positions.at(i), &displacement[3 * i..3 * i + 3]);
            let mass = density(i) * volumes[i];
            [x, by_axis(|axis| mass * velocity[3 * i + axis])]
        })
    }

    /// Balances of momentum and, under finite kinematics, of angular momentum about the origin.
    pub(super) fn balances(&self, world: &World) -> Vec<Balance> {
        let (now, state) = (self.momentum(world), &self.state);
        momentum::balances(self.balanced, &now, &state.initial, &state.given)
    }
}
