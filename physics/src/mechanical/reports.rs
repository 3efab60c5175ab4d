//! Stresses of the points, for couplers and the log.

use perimelt_core::World;

use super::classical;
use super::solid::{PointStates, StressKind, Wanted};
use super::step::MechanicalRun;

impl MechanicalRun {
    pub(super) fn provide_stress(&mut self, world: &World) {
        if let Some(eigenstrain) = self.fields.eigenstrain {
            let eigenstrain = world.read(eigenstrain);
            self.solid.set_points(PointStates {
                eigenstrain: Some(&eigenstrain),
                ..PointStates::default()
            });
        }
        self.set_stress_free(world);
        self.load_displacement(world);
        let mut stress = world.write(self.fields.stress);
        let wanted = Wanted::stress(StressKind::Spatial);
        let found = self.solid.evaluate(wanted).stress;
        for (sigma, components) in stress.iter_mut().zip(found) {
            *sigma = classical::symmetric(components);
        }
        if let Some(extrapolation) = &self.extrapolation {
            extrapolation.apply(&mut stress);
        }
    }

    pub(super) fn provide_conjugate_stress(&mut self, world: &World) {
        self.load_displacement(world);
        let field = self.fields.conjugate_stress;
        let energies = self.energies_after_step(world);
        for (p, [_, conjugate_stress]) in world.write(field).iter_mut().zip(energies) {
            *p = *conjugate_stress;
        }
    }

    /// Provides the conjugate stress as a tensor where a coupler reads it.
    pub(super) fn provide_conjugate_tensor(&mut self, world: &World) {
        let Some(field) = self.fields.conjugate_stress_tensor else {
            return;
        };
        self.load_displacement(world);
        let wanted = Wanted::stress(StressKind::Conjugate);
        let found = self.solid.evaluate(wanted).stress;
        for (tensor, components) in world.write(field).iter_mut().zip(found) {
            *tensor = classical::symmetric(components);
        }
    }
}
