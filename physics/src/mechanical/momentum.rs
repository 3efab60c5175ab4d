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

use std::ops::AddAssign;

use nalgebra::Vector3;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::{Balance, World};
use serde::{Deserialize, Serialize};

use super::step::Run;

/// Sums over a body of momenta or impulses, of their moments about the origin, and of the sizes of both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Momentum {
    /// N s.
    pub(super) linear: [f64; 3],
    /// N m s.
    pub(super) angular: [f64; 3],
    /// Sum of the absolute values, N s.
    pub(super) linear_size: [f64; 3],
    /// Sum of the absolute values of the products of the moments, N m s.
    pub(super) angular_size: [f64; 3],
}

impl AddAssign for Momentum {
    fn add_assign(&mut self, other: Self) {
        for axis in 0..3 {
            self.linear[axis] += other.linear[axis];
            self.angular[axis] += other.angular[axis];
            self.linear_size[axis] += other.linear_size[axis];
            self.angular_size[axis] += other.angular_size[axis];
        }
    }
}

/// The part of one point in the sums of a [`Momentum`].
pub(super) type Part = [f64; 12];

/// The part of a momentum or impulse `p` (N s) at `x` (m).
pub(super) fn part(x: [f64; 3], p: [f64; 3]) -> Part {
    let mut part = [0.0; 12];
    for axis in 0..3 {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let (plus, minus) = (x[b] * p[c], x[c] * p[b]);
        part[axis] = p[axis];
        part[3 + axis] = plus - minus;
        part[6 + axis] = p[axis].abs();
        part[9 + axis] = plus.abs() + minus.abs();
    }
    part
}

impl Momentum {
    /// Sums the parts of all points.
    pub(super) fn sum(points: usize, part: impl Fn(usize) -> Part + Sync) -> Self {
        let sums = sum_points(points, part);
        let group = |first: usize| std::array::from_fn(|axis| sums[first + axis]);
        Momentum {
            linear: group(0),
            angular: group(3),
            linear_size: group(6),
            angular_size: group(9),
        }
    }
}

/// Current position of a point, m.
pub(super) fn place(reference: &Vector3<f64>, displacement: &[f64]) -> [f64; 3] {
    std::array::from_fn(|axis| reference[axis] + displacement[axis])
}

impl Run {
    /// Momentum of the body now; zero without the explicit solver.
    pub(super) fn momentum(&self, world: &World) -> Momentum {
        let Some(velocity) = self.fields.velocity else {
            return Momentum::default();
        };
        let velocity = world.read::<Vector3<f64>>(velocity.into());
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (points, density) = (&world.body(self.body).points, &self.density);
        let (velocity, displacement) = (&*velocity, &*displacement);
        Momentum::sum(points.len(), |i| {
            let x = place(&points.position[i], displacement[i].as_slice());
            let mass = density[i] * points.volume[i];
            part(x, (mass * velocity[i]).into())
        })
    }

    /// Balances of momentum and, under finite kinematics, of angular momentum about the origin.
    pub(super) fn balances(&self, world: &World, is_finite: bool) -> Vec<Balance> {
        let (now, initial) = (self.momentum(world), &self.state.initial);
        let given = &self.state.given;
        let dimension = world.body(self.body).dimension;
        let linear = (0..dimension).map(|a| {
            let name = format!("momentum.{}", ["x", "y", "z"][a]);
            let (initial, given_to) = (initial.linear[a], given.linear[a]);
            Balance::new(&name, "N s", now.linear[a], initial, given_to)
                .of_size(now.linear_size[a] + given.linear_size[a])
        });
        let axes = match (is_finite, dimension) {
            (true, 2) => 2..3,
            (true, 3) => 0..3,
            _ => 0..0,
        };
        let angular = axes.map(|a| {
            let name = format!("angular_momentum.{}", ["x", "y", "z"][a]);
            let (initial, given_to) = (initial.angular[a], given.angular[a]);
            Balance::new(&name, "N m s", now.angular[a], initial, given_to)
                .of_size(now.angular_size[a] + given.angular_size[a])
        });
        linear.chain(angular).collect()
    }
}
