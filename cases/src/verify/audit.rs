//! Audits of every run: balances, and convergence of repeated passes.
//!
//! They need no key of the case file. A check of a balance in the case file replaces the audit of that quantity.

use std::collections::BTreeMap;

use perimelt_core::Simulation;

use super::table::Outcome;
use crate::log_names::BALANCE_LIMIT;
use crate::probe::largest;

/// Times at which balances are audited in a run: a sum over all points costs less than a step.
const AUDITS: f64 = 100.0;

/// Worst relative errors of the balances of a run.
#[derive(Debug, Default)]
pub(super) struct Audit {
    /// Errors by label of the physics and quantity.
    worst: BTreeMap<(String, String), f64>,
    done: u32,
    /// Macro steps whose passes did not converge, where passes are repeated.
    unconverged: Option<u64>,
}

impl Audit {
    /// Updates the errors after a step: the first one after each hundredth of the run, and the last one.
    pub(super) fn observe(&mut self, simulation: &Simulation) {
        let due = f64::from(self.done + 1) / AUDITS * simulation.options().end;
        if simulation.time() < due && !simulation.is_finished() {
            return;
        }
        self.done = (simulation.time() / simulation.options().end * AUDITS) as u32;
        let progress = simulation.progress();
        let repeated = simulation.options().iteration;
        self.unconverged = repeated.map(|_| progress.unconverged);
        for (label, balances) in simulation.balances() {
            for balance in balances {
                let key = (label.to_string(), balance.quantity.clone());
                let worst = self.worst.entry(key).or_default();
                *worst = largest([*worst, balance.relative_error()].into_iter());
            }
        }
    }

    /// Outcomes for a case, without the balances that `is_checked` by the case itself.
    pub(super) fn outcomes(&self, case: &str, is_checked: impl Fn(&str) -> bool) -> Vec<Outcome> {
        let balances = self.worst.iter().filter(|((_, q), _)| !is_checked(q));
        let balances = balances.map(|((label, quantity), worst)| {
            let name = format!("audit of {quantity}, {label}");
            Outcome::audit(case, name, *worst, BALANCE_LIMIT)
        });
        let passes = self.unconverged.map(|steps| {
            let name = "audit of passes: steps without convergence".to_string();
            Outcome::audit(case, name, steps as f64, 0.0)
        });
        balances.chain(passes).collect()
    }
}
