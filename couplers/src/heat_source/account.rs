//! Powers and energies of a heat source: asked for, deposited, deposited in mirror images of the body, and lost.
//!
//! A source on a plane of symmetry of the body is its own mirror image, and the part of its power beyond the plane heats
//! the mirrored half as the rest heats the body. Next to a plane, the mirror image is a second source, which does not
//! heat the body that is simulated: the part beyond the plane is lost.

use perimelt_core::{Face, Report};
use serde::{Deserialize, Serialize};

use crate::source::{CellGrid, Deposit};
use crate::toolpath::Pose;

/// Largest distance of a source on a plane of symmetry from it, in cells.
const ON_PLANE: f64 = 1e-3;

/// Smaller parts of the power are rounding.
const ROUNDING: f64 = 1e-9;

/// Number of equal parts, the body included, that a source at `pose` heats of a body with these planes of symmetry: two
/// for each plane on which it is.
pub(super) fn mirror_copies(grid: &CellGrid, symmetry: &[Face], pose: &Pose) -> f64 {
    let is_on = |face: &&Face| {
        let axis = face.axis();
        let cells = if face.is_upper() { grid.dims[axis] } else { 0 };
        let plane = grid.origin[axis] + cells as f64 * grid.spacing[axis];
        (pose.position[axis] - plane).abs() < ON_PLANE * grid.spacing[axis]
    };
    symmetry.iter().filter(is_on).map(|_| 2.0).product()
}

/// Powers of the last step and energies since the start; saved, so that energies continue after a resume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Account {
    /// W: asked for, deposited in the body, in its mirror images, lost.
    power: [f64; 4],
    /// J: as the powers.
    energy: [f64; 4],
    /// Length of the path with power since the start, m.
    path: f64,
    /// Whether the source has power between now and the next event.
    pub is_on: bool,
}

impl Account {
    /// Adds a deposit of the length `duration` (s) by a source that moves at a speed (m/s), with the [`mirror_copies`] that
    /// it heats.
    pub fn book(&mut self, deposit: &Deposit, copies: f64, duration: f64, speed: f64) {
        if deposit.asked > 0.0 {
            self.path += speed * duration;
        }
        let mirrored = (copies - 1.0) * deposit.deposited;
        let lost = deposit.lost - mirrored;
        let is_lost = mirrored == 0.0 || lost > ROUNDING * deposit.asked;
        let lost = if is_lost { lost } else { 0.0 };
        self.power = [deposit.asked, deposit.deposited, mirrored, lost];
        for (energy, power) in self.energy.iter_mut().zip(self.power) {
            *energy += power * duration;
        }
    }

    pub fn report(&self) -> Vec<Report> {
        let named = |what: &'static str, unit: &'static str, values: [f64; 4]| {
            let names = ["asked", "deposited", "mirrored", "lost"];
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
