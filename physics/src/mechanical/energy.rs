//! Energies of an explicit body.

use nalgebra::Vector3;
use perimelt_core::body::Sizes;
use perimelt_core::solver::Reducer;
use perimelt_core::{Report, World};
use serde::{Deserialize, Serialize};

use super::solid::{EnergyKind, Wanted};
use super::step::MechanicalRun;

/// Energies of a body, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Energy {
    pub(super) kinetic: f64,
    /// Energy of the elastic strain: the total strain without eigenstrain and inelastic strain.
    pub(super) elastic: f64,
    /// Potential of the constant body force, `-sum_i V_i b_i . u_i`.
    pub(super) potential: f64,
}

impl Energy {
    /// Kinetic and elastic energy, J.
    pub(super) fn stored(&self) -> f64 {
        self.kinetic + self.elastic
    }

    /// What a body under constant loads keeps, J.
    pub(super) fn total(&self) -> f64 {
        self.stored() + self.potential
    }

    /// For the log.
    pub(super) fn reports(&self) -> [Report; 3] {
        let report = |name: &str, value| Report::new(format!("energy.{name}"), "J", value);
        [
            report("kinetic", self.kinetic),
            report("elastic", self.elastic),
            report("total", self.total()),
        ]
    }
}

impl MechanicalRun {
    /// Energies of an explicit body now; without velocities only the elastic one.
    pub(super) fn energy(&mut self, world: &World) -> Energy {
        self.load_displacement(world);
        self.energy_as_set(world)
    }

    /// Energies at the displacement that the solid has.
    pub(super) fn energy_as_set(&mut self, world: &World) -> Energy {
        let volume = &world.body(self.body).points.volume;
        let wanted = Wanted::energy(EnergyKind::Elastic);
        let elastic = self.solid.evaluate(wanted).energy;
        let points = world.reducer(self.body);
        let [elastic] = points.sum_points(|i| [elastic[i][0] * volume[i]]);
        let kinetic = self.fields.velocity.map_or(0.0, |velocity| {
            let velocity = world.read::<Vector3<f64>>(velocity.into());
            let nodes = self.nodes();
            let of_nodes = nodes.values(&velocity, &self.state.corners.velocity);
            let (velocity, _) = of_nodes.as_chunks::<3>();
            let (density, volume) = (&self.node_density, nodes.volumes(world.body(self.body)));
            let added = self.solid.added_kinetic_energy(of_nodes, volume);
            let square = |i: usize| Vector3::from(velocity[i]).norm_squared();
            let of_node = |i: usize| 0.5 * density[i] * volume[i] * square(i);
            let [sum] = self.node_reducer(world).sum_points(|i| [of_node(i)]);
            sum + added
        });
        Energy {
            kinetic,
            elastic,
            potential: self.potential(world),
        }
    }

    /// Potential energy of the body force in the last force, J; zero before the first step.
    pub(super) fn potential(&self, world: &World) -> f64 {
        if !self.state.has_loads_in_force {
            return 0.0;
        }
        let volume = self.nodes().volumes(world.body(self.body));
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let displacement = self
            .nodes()
            .values(&displacement, &self.state.corners.displacement);
        let nodes = self.node_reducer(world);
        self.with_loads_in_force(world, |loads| {
            -work_of(&nodes, volume, [loads, displacement])
        })
    }
}

/// `sum_i V_i f_i . u_i` of force densities f (N/m³) and displacements u (m), three components for each point, J.
pub(super) fn work_of(nodes: &Reducer, volume: &Sizes, [force, displacement]: [&[f64]; 2]) -> f64 {
    let (force, _) = force.as_chunks::<3>();
    let (displacement, _) = displacement.as_chunks::<3>();
    let of_point = |i: usize| {
        let ([fx, fy, fz], [ux, uy, uz]) = (force[i], displacement[i]);
        [volume[i] * (fx * ux + fy * uy + fz * uz)]
    };
    nodes.sum_points(of_point)[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_that_of_all_components_over_the_volumes() {
        let force = [1.0, 2.0, 3.0, -4.0, 5.0, 6.0];
        let displacement = [0.5, 0.25, 2.0, 1.0, 3.0, -1.0];
        // 7 J/m³ over 2 m³, and 5 J/m³ over 3 m³
        let work = work_of(
            &Reducer::alone(2),
            &vec![2.0, 3.0].into(),
            [&force, &displacement],
        );
        assert_eq!(work, 29.0);
    }

    #[test]
    fn the_total_energy_has_three_parts() {
        let energy = Energy {
            kinetic: 1.0,
            elastic: 2.0,
            potential: -5.0,
        };
        assert_eq!([energy.stored(), energy.total()], [3.0, -2.0]);
        assert_eq!(energy.reports().map(|r| r.value), [1.0, 2.0, -2.0]);
    }
}
