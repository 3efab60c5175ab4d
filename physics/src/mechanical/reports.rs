//! Stresses for the log, and the balances of an explicit body.

use nalgebra::Vector3;
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::{Balance, World};

use super::classical;
use super::step::Run;

impl Run {
    pub(super) fn provide_stress(&mut self, world: &World) {
        if let Some(eigenstrain) = self.fields.eigenstrain {
            self.solid.set_eigenstrain(&world.read(eigenstrain));
        }
        self.load_displacement(world);
        let stress = self.solid.stress();
        for (sigma, components) in world.write(self.fields.stress).iter_mut().zip(stress) {
            *sigma = classical::symmetric(components);
        }
    }

    pub(super) fn provide_conjugate_stress(&mut self, world: &World) {
        self.load_displacement(world);
        let energy = self.solid.energy();
        for (p, [_, conjugate_stress]) in world
            .write(self.fields.conjugate_stress)
            .iter_mut()
            .zip(energy)
        {
            *p = *conjugate_stress;
        }
    }

    pub(super) fn momentum(&self, world: &World) -> [f64; 3] {
        let Some(velocity) = self.fields.velocity else {
            return [0.0; 3];
        };
        let velocity = world.read::<Vector3<f64>>(velocity.into());
        let volume = &world.body(self.body).points.volume;
        std::array::from_fn(|axis| {
            let component: Vec<f64> = velocity.iter().map(|v| v[axis]).collect();
            sum_of([&component, &self.density, volume], |[v, rho, volume]| {
                v * rho * volume
            })
        })
    }

    /// Balances of the momentum of an explicit body.
    pub(super) fn balances(&self, world: &World) -> Vec<Balance> {
        let momentum = self.momentum(world);
        let axes = 0..world.body(self.body).dimension;
        axes.map(|axis| {
            let name = format!("momentum.{}", ["x", "y", "z"][axis]);
            let (initial, impulse) = (self.state.initial_momentum[axis], self.state.impulse[axis]);
            Balance::new(&name, "N s", momentum[axis], initial, impulse)
        })
        .collect()
    }
}
