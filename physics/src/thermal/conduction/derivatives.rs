//! Conduction by second derivatives.

use std::sync::Arc;

use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Derivatives, Pddo};
use rayon::prelude::*;

use super::{BondConductivity, Conduction};

/// The form of second derivatives.
#[derive(Debug)]
pub(super) struct SecondDerivatives {
    pub(super) pddo: Arc<Pddo>,
    pub(super) work: Derivatives,
    /// One row for each point: the gradient of the temperature, then its Laplacian.
    pub(super) temperature: Vec<f64>,
    /// One row for each point: the gradient of the conductivity.
    pub(super) conductivity: Vec<f64>,
}

impl Conduction {
    pub(super) fn flow_by_derivatives(&mut self) {
        let Some(derivatives) = &mut self.derivatives else {
            return;
        };
        let SecondDerivatives {
            pddo,
            work,
            temperature,
            conductivity,
        } = derivatives;
        pddo.gradient_and_laplacian(&self.temperature_slots, work, temperature);
        let is_uniform = self.loaded == BondConductivity::Uniform;
        if !is_uniform {
            pddo.gradient(&self.conductivity_slots, work, conductivity);
        }
        let dimension = pddo.dimension();
        let (uniform, field) = (self.uniform, &self.conductivity_field);
        let conductivity = &*conductivity;
        let rows = self.rate.par_iter_mut().enumerate().with_min_len(1024);
        rows.for_all(|(i, [rate])| {
            let row = &temperature[i * (dimension + 1)..][..dimension + 1];
            let own = match uniform {
                Some(k) if is_uniform => k,
                _ => field[i],
            };
            *rate = own * row[dimension];
            if !is_uniform {
                let slope = &conductivity[i * dimension..][..dimension];
                *rate += (0..dimension).map(|a| slope[a] * row[a]).sum::<f64>();
            }
        });
    }
}
