//! Powers and energies of a heat source: asked for, deposited and lost.

use perimelt_core::Report;
use serde::{Deserialize, Serialize};

use crate::source::Deposit;

/// Powers of the last step and energies since the start; saved, so that energies continue after a resume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Account {
    /// W: asked for, deposited, lost.
    power: [f64; 3],
    /// J: asked for, deposited, lost.
    energy: [f64; 3],
    /// Length of the path with power since the start, m.
    path: f64,
    /// Whether the source has power between now and the next event.
    pub is_on: bool,
}

impl Account {
    /// Adds a deposit of the length `duration` (s) by a source that moves at a speed (m/s).
    pub fn book(&mut self, deposit: &Deposit, duration: f64, speed: f64) {
        if deposit.asked > 0.0 {
            self.path += speed * duration;
        }
        self.power = [deposit.asked, deposit.deposited, deposit.lost];
        for (energy, power) in self.energy.iter_mut().zip(self.power) {
            *energy += power * duration;
        }
    }

    pub fn report(&self) -> Vec<Report> {
        let named = |what: &'static str, unit: &'static str, values: [f64; 3]| {
            let names = ["asked", "deposited", "lost"];
            names
                .into_iter()
                .zip(values)
                .map(move |(name, value)| Report {
                    name: format!("{what}.{name}"),
                    unit: unit.into(),
                    value,
                })
        };
        let powers = named("power", "W", self.power);
        let mut all: Vec<_> = powers.chain(named("energy", "J", self.energy)).collect();
        all.push(Report {
            name: "path".into(),
            unit: "m".into(),
            value: self.path,
        });
        all
    }
}
