//! Derivative of the heat flow by the temperature.

use perimelt_core::family::{ByRules, LayerRule};
use rayon::prelude::*;

use super::{BondConductivity, Conduction, Matter};

impl Conduction {
    /// Fills the slots so that [`Conduction::flow`] gives the derivative of the flow along a change of the temperature (K) at a
    /// temperature (K): the flow of the potential `k(T) dT`, which continues behind faces by the homogeneous part of their rules.
    /// Returns false, without an effect, where the flow is not that of one potential: between materials, also of plies, in powder, in the
    /// ordinary form and with second derivatives.
    pub(in crate::thermal) fn load_change(
        &mut self,
        matter: &Matter<'_>,
        temperature: &[f64],
        change: &[f64],
    ) -> bool {
        if let Some(plies) = &mut self.plies {
            self.loaded = BondConductivity::Plies;
            return plies.load_change(matter, temperature, change);
        }
        if ![BondConductivity::Uniform, BondConductivity::Potential]
            .contains(&self.bond_conductivity())
        {
            return false;
        }
        self.loaded = BondConductivity::Potential;
        let mut potential = std::mem::take(&mut self.potential_field);
        let points = temperature.par_iter().zip(change).zip(matter.material);
        let change = points.enumerate().map(|(point, ((&t, change), &m))| {
            let liquid = matter.curves[m as usize].liquid_fraction(t);
            self.calibration * self.conductivity(point, m, t, liquid) * change
        });
        change.collect_into_vec(&mut potential);
        let homogeneous = |rule: &LayerRule| LayerRule {
            offset: [0.0; 3],
            values: None,
            ..rule.clone()
        };
        let rules: Vec<LayerRule> = matter.rules.iter().map(homogeneous).collect();
        let slots = &mut self.potential_slots;
        slots.load(matter.family, &potential[..], ByRules(&rules, 0));
        for (slot, _) in &self.layers {
            slots[*slot as usize] = 0.0;
        }
        self.potential_field = potential;
        true
    }
}
