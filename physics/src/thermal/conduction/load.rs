//! Loading of the fields of the conduction kernels.

use perimelt_core::family::{ByRules, Mirrored};
use perimelt_core::material::HeatPotential;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::{BondConductivity, Conduction, Matter};
use crate::thermal::states::PointConductivity;

/// Slots per parallel task.
const SLOTS_PER_TASK: usize = 4096;

impl Conduction {
    /// Fills the slots from a temperature field (K) and evaluates the conductivities.
    pub(in crate::thermal) fn load(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        self.loaded = self.bond_conductivity();
        if let Some(plies) = &mut self.plies {
            return plies.load(matter, temperature);
        }
        let ghosts = ByRules(matter.rules, 0);
        self.temperature_slots
            .load(matter.family, temperature, ghosts);
        for (slot, own) in &self.layers {
            self.temperature_slots[*slot as usize] = *own;
        }
        if self.loaded == BondConductivity::Uniform {
            return;
        }
        if self.loaded != BondConductivity::Potential {
            self.load_conductivity(matter, temperature);
        }
        if [BondConductivity::Potential, BondConductivity::Mixed].contains(&self.loaded) {
            self.load_potential(matter, temperature);
        }
        if let Some(interfaces) = &mut self.interfaces {
            interfaces.load(matter.family);
        }
        if let Some(directions) = &mut self.directions {
            directions.evaluate(temperature, matter.material, matter.curves);
        }
        if let Some(states) = &mut self.states {
            let conductivity = PointConductivity {
                mean: &self.conductivity_field,
                directions: self.directions.as_ref(),
            };
            let broken = self.broken.as_ref();
            states.load(matter, &self.temperature_slots, conductivity, broken);
        }
    }

    pub(super) fn bond_conductivity(&self) -> BondConductivity {
        let has_parts = self.powder.is_some() || self.austenite.is_some() || self.fluids.is_some();
        let by_points = self.derivatives.is_some() || has_parts;
        if self.plies.is_some() {
            return BondConductivity::Plies;
        }
        if self.states.is_some() {
            return BondConductivity::States;
        }
        match self.uniform {
            Some(_) => BondConductivity::Uniform,
            None if by_points => BondConductivity::Ends,
            None if self.is_linear() => BondConductivity::Across,
            None if self.conductivity.len() == 1 => BondConductivity::Potential,
            None => BondConductivity::Mixed,
        }
    }

    /// Evaluates the conductivities of points.
    pub(super) fn find_conductivity(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        let mut field = std::mem::take(&mut self.conductivity_field);
        let points = temperature.par_iter().zip(matter.material).enumerate();
        let values = points.with_min_len(4096).map(|(point, (&t, &m))| {
            let liquid = matter.curves[m as usize].liquid_fraction(t);
            self.calibration * self.conductivity(point, m, t, liquid)
        });
        values.fill(&mut field);
        self.conductivity_field = field;
    }

    fn load_conductivity(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        self.find_conductivity(matter, temperature);
        let field = &self.conductivity_field[..];
        self.conductivity_slots
            .load(matter.family, field, Mirrored::Scalar);
    }

    /// Loads the potential. Behind faces it is mirrored about its value at the mean temperature of both sides.
    fn load_potential(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        if self.potentials.is_empty() {
            let materials = self.conductivity.iter().zip(matter.curves);
            self.potentials = materials.map(|(k, c)| HeatPotential::new(k, c)).collect();
        }
        let (family, potentials) = (matter.family, &self.potentials);
        let calibration = self.calibration;
        let points = temperature.par_iter().zip(matter.material);
        let potential = points.map(|(&t, &m)| calibration * potentials[m as usize].at(t));
        potential.fill(&mut self.potential_field);
        self.potential_slots
            .load(family, &self.potential_field[..], Mirrored::Scalar);
        let several = potentials.len() > 1;
        let mirrored = &mut self.mirrored;
        if several {
            let material = |point: usize| f64::from(matter.material[point]);
            mirrored.material.load(family, material, Mirrored::Scalar);
        }
        if matter.rules.is_empty() {
            return self.load_layers();
        }
        let slots = &mut mirrored.temperature;
        slots.load(family, temperature, Mirrored::Scalar);
        let material = |slot: usize| match several {
            true => mirrored.material[slot] as usize,
            false => 0,
        };
        let behind = self
            .potential_slots
            .par_iter_mut()
            .zip(&self.temperature_slots[..])
            .zip(&mirrored.temperature[..]);
        let behind = behind.enumerate().with_min_len(SLOTS_PER_TASK);
        behind.for_all(|(slot, ((potential, here), mirrored))| {
            if here != mirrored {
                let face = potentials[material(slot)].at(0.5 * (here + mirrored));
                *potential = 2.0 * calibration * face - *potential;
            }
        });
        self.load_layers();
    }

    /// Loads the potential of layer points with prescribed temperatures, in bodies of one material.
    fn load_layers(&mut self) {
        for (slot, temperature) in &self.layers {
            self.potential_slots[*slot as usize] =
                self.calibration * self.potentials[0].at(*temperature);
        }
    }
}
