//! Heat that the melt carries between its cells.
//!
//! ```text
//! dh_i = ds sum_j [ -U_ij (e_i + e_j)/2 + 2 b k_ij (T_j - T_i) ]
//! ```
//!
//! with the enthalpy `e` of the *liquid* at the temperature of each cell, not the mean enthalpy of a cell that melts: what flows is
//! liquid. `e` counts from the liquidus, as a constant is carried by no flow that keeps volumes. `k` is the conductivity that a
//! turbulent flow adds. Both terms are opposite at the two ends of a bond. Values in the middle of the sub-step make it of second
//! order.

use super::melt::Melt;
use super::pool::{Pool, set_cells};

/// Heat of the cells during a step of conduction.
#[derive(Debug, Default)]
pub(super) struct Heat {
    /// Enthalpy at the start of the step, J/m³.
    pub(super) start: Vec<f64>,
    /// What the cells got since, J/m³.
    pub(super) carried: Vec<f64>,
    /// Enthalpy now, J/m³.
    pub(super) enthalpy: Vec<f64>,
    /// K.
    pub(super) temperature: Vec<f64>,
    /// Enthalpy of the liquid, J/m³.
    liquid: Vec<f64>,
    /// Rate of change, W/m³.
    rate: Vec<f64>,
}

impl Heat {
    pub(super) fn resize(&mut self, cells: usize) {
        let Heat {
            start,
            carried,
            enthalpy,
            temperature,
            liquid,
            rate,
        } = self;
        for values in [start, carried, enthalpy, temperature, liquid, rate] {
            values.resize(cells, 0.0);
        }
    }

    /// Starts a step with the enthalpies of the cells in `start`.
    pub(super) fn start(&mut self, melt: &Melt) {
        self.carried.fill(0.0);
        self.derive(melt, 0.0);
    }

    /// Finds enthalpies and temperatures from what was carried, `ds` (s) after that by the rates.
    fn derive(&mut self, melt: &Melt, ds: f64) {
        let (start, carried, rate) = (&self.start, &self.carried, &self.rate);
        set_cells(&mut self.enthalpy, |i| {
            start[i] + (carried[i] + ds * rate[i])
        });
        let enthalpy = &self.enthalpy;
        set_cells(&mut self.temperature, |i| {
            melt.curve.temperature(enthalpy[i])
        });
        let temperature = &self.temperature;
        set_cells(&mut self.liquid, |i| {
            melt.curve.liquid_enthalpy(temperature[i])
        });
    }

    /// Carries heat for `ds` (s) with the fluxes of volume of the bonds, 1/s.
    pub(super) fn advance(&mut self, melt: &Melt, pool: &Pool, flux: &[f64], ds: f64) {
        self.find_rates(melt, pool, flux);
        self.derive(melt, 0.5 * ds);
        self.find_rates(melt, pool, flux);
        let rates = self.carried.iter_mut().zip(&self.rate);
        rates.for_each(|(carried, rate)| *carried += ds * rate);
        self.derive(melt, 0.0);
    }

    fn find_rates(&mut self, melt: &Melt, pool: &Pool, flux: &[f64]) {
        let (liquid, temperature) = (&self.liquid, &self.temperature);
        let bonds = &pool.stencil.bonds;
        set_cells(&mut self.rate, |i| {
            let own = liquid[i];
            let flux = &flux[i * bonds.len()..(i + 1) * bonds.len()];
            let mut rate = 0.0;
            for (n, flux) in pool.neighbours(i).iter().zip(flux) {
                rate -= 0.5 * flux * (own + liquid[n.cell as usize]);
            }
            let Some(added) = melt.added_conductivity(temperature[i]) else {
                return rate;
            };
            for (n, bond) in pool.neighbours(i).iter().zip(bonds) {
                let other = temperature[n.cell as usize];
                let both = added + melt.added_conductivity(other).unwrap_or(added);
                rate += bond.weight * both * (other - temperature[i]);
            }
            rate
        });
    }
}
