//! Powers and energies of a heat source: asked for, deposited, deposited in mirror images of the body, and lost.
//!
//! The mirror image of a source on a plane of symmetry is the source itself: the power beyond the plane heats the mirror
//! image of the body. The mirror image of a source beside a plane is a second source, so that the power beyond the plane is
//! lost.

use perimelt_core::{Face, Report};
use serde::{Deserialize, Serialize};

use super::shape::{CellGrid, Deposit, Depression};
use crate::toolpath::Pose;

/// Distance from a plane of symmetry up to which a source lies on it, in cells.
const ON_PLANE: f64 = 1e-3;

/// Fraction of the power asked for below which lost power is rounding.
const ROUNDING: f64 = 1e-9;

/// Number of copies of the body, mirror images included, that a source at `pose` heats: a factor of two for each plane of
/// symmetry on which it lies.
pub(crate) fn mirror_copies(grid: &CellGrid, symmetry: &[Face], pose: &Pose) -> f64 {
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
    /// Powers, W: asked for, deposited in the body, in its mirror images, lost.
    power: [f64; 4],
    /// Energies in the same order, J.
    energy: [f64; 4],
    /// Length of the path with power since the start, m.
    path: f64,
    /// Whether the toolpath had power in the last step; between two pulses it has.
    was_on: bool,
    /// The surface below a beam that is absorbed column by column, in the last step.
    depression: Option<Depression>,
}

impl Account {
    /// Adds a deposit of a source over `duration` (s), with the [`mirror_copies`] that it heats and its speed (m/s), `None` where
    /// the toolpath has no power.
    pub fn book(&mut self, deposit: &Deposit, copies: f64, duration: f64, speed: Option<f64>) {
        self.was_on = speed.is_some();
        self.depression = deposit.depression;
        self.path += speed.unwrap_or(0.0) * duration;
        let mirrored = (copies - 1.0) * deposit.deposited;
        let lost = deposit.lost - mirrored;
        let is_lost = mirrored == 0.0 || lost > ROUNDING * deposit.asked;
        let lost = if is_lost { lost } else { 0.0 };
        self.power = [deposit.asked, deposit.deposited, mirrored, lost];
        for (energy, power) in self.energy.iter_mut().zip(self.power) {
            *energy += power * duration;
        }
    }

    /// The surface below the beam in the last step; a flat one without power.
    pub fn depression(&self) -> Depression {
        let flat = Depression {
            depth: 0.0,
            gain: 1.0,
        };
        self.depression.unwrap_or(flat)
    }

    pub fn report(&self) -> Vec<Report> {
        let named = |what: &'static str, unit: &'static str, values: [f64; 4]| {
            let names = ["asked", "deposited", "mirrored", "lost"];
            let values = names.into_iter().zip(values);
            values.map(move |(name, value)| Report::new(format!("{what}.{name}"), unit, value))
        };
        let powers = named("power", "W", self.power);
        let rest = [
            Report::new("path", "m", self.path),
            Report::new("on", "1", f64::from(u8::from(self.was_on))),
        ];
        let energies = named("energy", "J", self.energy);
        powers.chain(energies).chain(rest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// Powers asked for, deposited, mirrored and lost, and energies and path, over 2 s at 3 m/s.
    #[test]
    fn mirror_images_receive_what_would_be_lost() {
        for ([asked, deposited, lost], copies, mirrored, left, path) in [
            ([100.0, 100.0, 0.0], 1.0, 0.0, 0.0, 6.0),
            ([100.0, 70.0, 30.0], 1.0, 0.0, 30.0, 6.0),
            // without mirror images a difference of rounding size stays what it is
            ([100.0, 100.0, 1e-9], 1.0, 0.0, 1e-9, 6.0),
            ([100.0, 50.0, 50.0], 2.0, 50.0, 0.0, 6.0),
            (
                [100.0, 50.0 - 1e-9, 50.0 + 1e-9],
                2.0,
                50.0 - 1e-9,
                0.0,
                6.0,
            ),
            ([100.0, 20.0, 80.0], 4.0, 60.0, 20.0, 6.0),
            ([0.0, 0.0, 0.0], 1.0, 0.0, 0.0, 0.0),
        ] {
            let mut account = Account::default();
            let deposit = Deposit {
                asked,
                deposited,
                lost,
                ..Deposit::default()
            };
            let speed = (asked > 0.0).then_some(3.0);
            account.book(&deposit, copies, 2.0, speed);
            let power = [asked, deposited, mirrored, left];
            assert_eq!(account.power, power);
            assert_eq!(account.energy, power.map(|p| 2.0 * p));
            assert_eq!(account.path, path);
            account.book(&deposit, copies, 0.5, speed);
            assert_eq!(account.energy, power.map(|p| 2.0 * p + 0.5 * p));
            let reports: Vec<f64> = account.report().iter().map(|r| r.value).collect();
            assert_eq!(reports[..4], power);
            assert_eq!(reports[4..8], account.energy);
            assert_eq!(
                reports[8..],
                [1.25 * path, f64::from(u8::from(asked > 0.0))]
            );
        }
    }

    /// Planes of symmetry at x = 0 and y = 6 of a lattice of 8 by 6 cells of half a metre by a metre.
    #[test]
    fn a_source_on_planes_of_symmetry_heats_two_parts_for_each() {
        let grid = CellGrid {
            origin: Vector3::zeros(),
            spacing: Vector3::new(0.5, 1.0, 1.0),
            dims: [8, 6, 1],
            plate: true,
        };
        let planes = [Face::XMin, Face::YMax];
        for (x, y, copies) in [
            (0.0, 3.0, 2.0),
            (0.4e-3, 3.0, 2.0),
            (0.6e-3, 3.0, 1.0),
            (-0.4e-3, 6.0, 4.0),
            (1.0, 6.0 - 0.9e-3, 2.0),
            (1.0, 6.0 - 1.1e-3, 1.0),
            (4.0, 0.0, 1.0),
        ] {
            let pose = Pose {
                position: Vector3::new(x, y, 0.0),
                direction: Vector3::x(),
                power: 1.0,
                speed: 0.0,
                torch: None,
            };
            assert_eq!(mirror_copies(&grid, &planes, &pose), copies, "{x} {y}");
        }
    }
}
