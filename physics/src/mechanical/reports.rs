//! Stresses of the points, for couplers and the log.

use perimelt_core::World;

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
}
