//! One account of momentum for all physics that move bodies: mechanical and rigid bodies, and fluids.

use std::ops::AddAssign;

use nalgebra::Vector3;
use perimelt_core::Balance;
use serde::{Deserialize, Serialize};

/// Names of the axes in balances and reports.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// Sums over a body of momenta or impulses, of their moments about the origin, and of the sizes of both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Momentum {
    /// N s.
    pub(crate) linear: [f64; 3],
    /// N m s.
    pub(crate) angular: [f64; 3],
    /// Sum of the absolute values, N s.
    pub(crate) linear_size: [f64; 3],
    /// Sum of the absolute values of the products of the moments, N m s.
    pub(crate) angular_size: [f64; 3],
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

impl Momentum {
    /// One impulse (N s) and its moment about the origin (N m s), with their sizes.
    pub(crate) fn of_impulse(linear: Vector3<f64>, angular: Vector3<f64>) -> Self {
        Momentum {
            linear: linear.into(),
            angular: angular.into(),
            linear_size: linear.abs().into(),
            angular_size: angular.abs().into(),
        }
    }
}

/// Which momenta of a body are balanced: no others are summed.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Balanced {
    /// Dimension of the body.
    pub(crate) dimension: usize,
    /// Whether angular momentum is balanced, too.
    pub(crate) angular: bool,
}

/// The axes about which a body turns: all in space, the one across a plane, none along a line.
pub(crate) fn axes_of_rotation(dimension: usize) -> std::ops::Range<usize> {
    match dimension {
        1 => 0..0,
        2 => 2..3,
        _ => 0..3,
    }
}

/// Balances of the momentum and of the angular momentum about the origin, with what was given since the start. Errors are
/// relative to the sizes of what the body has and what it was given.
pub(crate) fn balances(
    balanced: Balanced,
    now: &Momentum,
    initial: &Momentum,
    given: &Momentum,
) -> Vec<Balance> {
    let linear = (0..balanced.dimension).map(|a| {
        let name = format!("momentum.{}", AXES[a]);
        let (now_linear, initial, given_linear) =
            (now.linear[a], initial.linear[a], given.linear[a]);
        Balance::new(&name, "N s", now_linear, initial, given_linear)
            .of_size(now.linear_size[a] + given.linear_size[a])
    });
    let axes = match balanced.angular {
        true => axes_of_rotation(balanced.dimension),
        false => 0..0,
    };
    let angular = axes.map(|a| {
        let name = format!("angular_momentum.{}", AXES[a]);
        let (now_angular, initial) = (now.angular[a], initial.angular[a]);
        Balance::new(&name, "N m s", now_angular, initial, given.angular[a])
            .of_size(now.angular_size[a] + given.angular_size[a])
    });
    linear.chain(angular).collect()
}
