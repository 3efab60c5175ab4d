//! The change of the flow of heat with the temperature.

use perimelt_core::family::{ByRules, LayerRule};
use rayon::prelude::*;

use super::{Conduction, Loaded, Matter};

impl Conduction {
    /// Fills the slots so that [`Conduction::flow`] gives the derivative of the flow along a change of the temperature (K) at a
    /// temperature (K): what flows by the potential `k(T) dT`, behind faces by the homogeneous part of their rules. Returns
    /// false, without an effect, where bonds conduct by more than their temperatures or one potential: between materials, in
    /// powder, in the ordinary form and that of second derivatives.
    pub(in crate::thermal) fn load_change(
        &mut self,
        matter: &Matter<'_>,
        (temperature, change): (&[f64], &[f64]),
    ) -> bool {
        if ![Loaded::Uniform, Loaded::Potential].contains(&self.what_to_load()) {
            return false;
        }
        self.loaded = Loaded::Potential;
        let mut potential = std::mem::take(&mut self.potential_field);
        let points = temperature.par_iter().zip(change).zip(matter.material);
        let change = points.enumerate().map(|(point, ((&t, change), &m))| {
            let liquid = matter.curves[m as usize].liquid_fraction(t);
            self.calibration * self.conductivity((point, m), t, liquid) * change
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
