//! Derivative of the heat flow by the temperature.

use super::{BondConductivity, Conduction, Matter};
use perimelt_core::family::{ByRules, LayerRule};

impl Conduction {
    /// Takes the conductivities at temperatures (K), which [`Conduction::load_change`] is linear in.
    pub(in crate::thermal) fn linearise(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        if let Some(plies) = &mut self.plies {
            return plies.linearise(matter, temperature);
        }
        if self.bond_conductivity() == BondConductivity::Potential {
            self.find_conductivity(matter, temperature);
        }
    }

    /// Fills the slots so that [`Conduction::flow`] gives the derivative of the flow along a change of the temperature (K) at the
    /// temperatures of [`Conduction::linearise`]: the flow of the potential `k(T) dT`, which continues behind faces by the homogeneous part of their rules.
    /// Returns false, without an effect, where the flow is not that of one potential: between materials, also of plies, in powder, in the
    /// ordinary form and with second derivatives.
    pub(in crate::thermal) fn load_change(&mut self, matter: &Matter<'_>, change: &[f64]) -> bool {
        if let Some(plies) = &mut self.plies {
            self.loaded = BondConductivity::Plies;
            return plies.load_change(matter, change);
        }
        let conductivity = self.bond_conductivity();
        if ![BondConductivity::Uniform, BondConductivity::Potential].contains(&conductivity) {
            return false;
        }
        self.loaded = BondConductivity::Potential;
        let homogeneous = |rule: &LayerRule| LayerRule {
            offset: [0.0; 3],
            values: None,
            ..rule.clone()
        };
        let rules: Vec<LayerRule> = matter.rules.iter().map(homogeneous).collect();
        let (slots, slopes) = (&mut self.potential_slots, &self.conductivity_field);
        let ghosts = ByRules(&rules, 0);
        match self.uniform {
            Some(conductivity) => {
                let slope = self.calibration * conductivity;
                slots.load(matter.family, |point: usize| slope * change[point], ghosts);
            }
            None => {
                let potential = |point: usize| slopes[point] * change[point];
                slots.load(matter.family, potential, ghosts);
            }
        }
        for (slot, _) in &self.layers {
            slots[*slot as usize] = 0.0;
        }
        true
    }
}
