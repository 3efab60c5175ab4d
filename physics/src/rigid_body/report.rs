//! Balances and reports of a rigid body.

use nalgebra::Vector3;
use perimelt_core::{Balance, Report, World};

use super::RunningRigidBody;
use super::degrees::Turning;
use super::state::Momenta;
use crate::momentum::{AXES, Balanced, Momentum, axes_of_rotation, balances};

impl From<Momenta> for Momentum {
    /// Without sizes.
    fn from(momenta: Momenta) -> Self {
        Momentum {
            linear: momenta.momentum.into(),
            angular: momenta.angular.into(),
            ..Momentum::default()
        }
    }
}

impl RunningRigidBody {
    /// Balances of momentum, and of angular momentum about the origin, of the axes that exist.
    pub(super) fn balances(&self, world: &World) -> Vec<Balance> {
        let (now, state) = (self.dynamics.momenta(&self.state), &self.state);
        let [linear, angular] = self.sizes(world);
        let now = Momentum {
            linear_size: [linear.max(state.exchanged[0]); 3],
            angular_size: [angular.max(state.exchanged[1]); 3],
            ..now.into()
        };
        let balanced = Balanced {
            dimension: self.dynamics.freedoms.dimension,
            angular: true,
        };
        balances(balanced, &now, &state.initial.into(), &state.given.into())
    }

    /// Sums of the sizes of the points' momenta (N s) and angular momenta about the origin (N m s).
    fn sizes(&self, world: &World) -> [f64; 2] {
        let velocity = world.read::<Vector3<f64>>(self.velocity.into());
        let speed: Vec<f64> = velocity.iter().map(|v| v.norm()).collect();
        let distance: Vec<f64> = world
            .positions(self.body)
            .iter()
            .map(|x| x.norm())
            .collect();
        let (mass, reducer) = (&self.properties.point_mass, &self.properties.reducer);
        [
            reducer.sum_of([mass, &speed], |[m, v]| m * v),
            reducer.sum_of([mass, &speed, &distance], |[m, v, x]| m * v * x),
        ]
    }

    pub(super) fn reports(&self) -> Vec<Report> {
        let (body, dynamics, state) = (&self.name, &self.dynamics, &self.state);
        let dimension = dynamics.freedoms.dimension;
        let vector = |name: &str, unit: &str, value: Vector3<f64>, rotation: bool| {
            let axes = match rotation {
                true => axes_of_rotation(dimension),
                false => 0..dimension,
            };
            let component = |axis| {
                let name = format!("{body}.{name}.{}", AXES[axis]);
                Report::new(name, unit, value[axis])
            };
            axes.map(component).collect::<Vec<_>>()
        };
        let rotation = match dynamics.freedoms.turning {
            Turning::About(axis, _) => Vector3::ith(axis, state.angle),
            _ => state.orientation.scaled_axis(),
        };
        let name = format!("{body}.energy.kinetic");
        let energy = Report::new(name, "J", dynamics.kinetic_energy(state));
        [
            vector("centre", "m", dynamics.position(state), false),
            vector("displacement", "m", state.displacement, false),
            vector("velocity", "m/s", dynamics.velocity(state), false),
            vector("rotation", "rad", rotation, true),
            vector(
                "angular_velocity",
                "rad/s",
                dynamics.angular_velocity(state),
                true,
            ),
            vector("force", "N", state.mean.force, false),
            vector("moment", "N m", state.mean.moment, true),
            vec![energy],
        ]
        .concat()
    }
}
