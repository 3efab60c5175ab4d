//! Conserved totals of a fluid and the numbers that it reports.

use nalgebra::Vector3;
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::{Balance, Report, World};

use super::interface_report::{InterfaceFlow, InterfaceReport};
use super::run::FluidRun;
use super::walls::Walls;
use crate::momentum::balances;

impl FluidRun {
    /// Mass, and momentum and angular momentum where no face takes any.
    pub(super) fn balances(&self, world: &World) -> Vec<Balance> {
        let mass = Balance::new("mass", "kg", self.mass(world), self.initial_mass, 0.0);
        let mut all = vec![mass.of_size(self.initial_mass)];
        let volume = &world.body(self.body).points.volume;
        let first = self
            .points
            .projection()
            .and_then(|p| p.first_volumes(volume));
        if let Some([now, initial]) = first {
            let balance = Balance::new("first_fluid.volume", "m3", now, initial, 0.0);
            all.push(balance.of_size(initial));
        }
        if let Some(account) = &self.momentum {
            let now = self.momentum_now(world, account.balanced);
            let (initial, given) = (&account.initial, &account.given);
            all.extend(balances(account.balanced, &now, initial, given));
        }
        all
    }

    pub(super) fn reports(&self) -> Vec<Report> {
        let mut all = vec![Report::new("energy.kinetic", "J", self.kinetic_energy)];
        let deviation = |value| Report::new("density.deviation", "1", value);
        all.extend(self.density_deviation.map(deviation));
        all.extend(self.interface.iter().flat_map(InterfaceReport::reports));
        all.extend(self.points.walls().into_iter().flat_map(Walls::reports));
        all
    }

    /// Finds what is reported.
    pub(super) fn find_reports(&mut self, world: &World) {
        if let Some(walls) = self.points.walls_mut() {
            walls.observe(world, self.body);
        }
        let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
        let flow = InterfaceFlow {
            velocity: &velocity,
            pressure: &world.read::<f64>(self.fields.pressure.into()),
        };
        self.interface = self.points.measure_interface(world.body(self.body), flow);
        let density = world.read::<f64>(self.fields.density.into());
        let square: Vec<f64> = velocity.iter().map(Vector3::norm_squared).collect();
        let mass = self.masses(world, &density);
        self.kinetic_energy = sum_of([&square, &mass], |[v2, m]| 0.5 * v2 * m);
        if let Some(largest) = &mut self.density_deviation {
            let points = density.iter().zip(&self.medium.reference_density);
            let deviation = points.map(|(rho, rho0)| (rho / rho0 - 1.0).abs());
            *largest = deviation.fold(0.0, f64::max);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::fluid::tests::{flow, periodic};
    use crate::testing::set;

    #[test]
    fn energy_and_deviation_are_those_of_a_uniform_stream() {
        for keys in [
            "description = 'eulerian'",
            "description = 'total_lagrangian'",
            "description = 'updated_lagrangian'",
            "form = 'conservative'",
        ] {
            let keys = format!("{keys}\nstate.tait = {{ sound_speed = 10, exponent = 1 }}");
            let mut s = flow(periodic(12, "density = 2\nviscosity = 0.1"), &keys, 1.0);
            set(&mut s, "velocity", |_| [0.3, -0.4, 0.0]);
            // below the density at rest by 5 %
            set(&mut s, "pressure", |_| [-0.05 * 2.0 * 100.0]);
            s.start().expect("starts");
            let volume: f64 = s.world().body(0).points.volume.iter().sum();
            let reports = s.reports().remove(0).1;
            for (name, expected) in [
                ("energy.kinetic", 0.5 * 0.95 * 2.0 * volume * 0.25),
                ("density.deviation", 0.05),
            ] {
                let report = reports.iter().find(|r| r.name == name).expect("reported");
                assert!(
                    (report.value / expected - 1.0).abs() < 1e-12,
                    "{keys}: {report:?} {expected}"
                );
            }
        }
    }
}
