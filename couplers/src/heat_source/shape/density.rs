//! A power density of any shape: a formula of the case ([`Profile`]), or a shape of another crate.
//!
//! ```text
//! q(x, y, z) = Q f(x, y, z) / integral of f      W/m³, below the heated face
//! ```
//!
//! x runs along the direction of travel, y to its left as seen from outside, and z is the depth below the heated face, or along
//! the axis of the torch. Each cell receives the mean of samples at Gauss points, whose distance follows the shortest
//! length of the density. The samples of all cells that the density reaches, those without material included, together have the power
//! asked for; the part of cells without material is lost. With a torch that is not normal to the face the density is continued evenly above the
//! position of the source, as for the other sources (`tilted.rs`). A 2D plate is heated through its thickness.

use std::fmt::Debug;
use std::rc::Rc;

use nalgebra::Vector3;

use super::sampled::{Sampled, SourceFrame};
use super::{CellGrid, Cells, Deposit, HeatedSurface, check_cells};
use crate::toolpath::Pose;
use perimelt_core::SetupError;
use perimelt_core::numbers::check_positive;

/// Most samples of the density in a step.
const MOST_SAMPLES: f64 = 1e8;

/// Largest relative difference of the integrals over a box and over the cells in it that is an error of the samples.
const SAMPLING: f64 = 0.02;

/// A power density in the frame of the source, of which only the shape counts: it is scaled to the power.
pub trait Density: Debug {
    /// The density, zero or greater, at x along the direction of travel, y to its left as seen from outside, and a depth z >= 0 (m).
    fn at(&self, x: f64, y: f64, z: f64) -> f64;

    /// Distances from the position of the source along x, y and z (m) beyond which the density counts as zero.
    fn reach(&self) -> [f64; 3];

    /// Shortest length over which it changes (m).
    fn finest(&self) -> f64;
}

/// A [`Density`] and the face that it heats.
#[derive(Debug, Clone)]
pub struct DensityOnFace {
    /// The density.
    pub density: Rc<dyn Density>,
    /// The heated face.
    pub surface: HeatedSurface,
}

impl DensityOnFace {
    /// Checks lengths and values of the density.
    pub(super) fn check(&self, grid: &CellGrid) -> Result<(), SetupError> {
        let reach = self.density.reach();
        let finest = check_positive("reach", self.density.finest(), "m")?;
        for length in reach {
            check_positive("reach", length, "m")?;
        }
        let [along, across, depth] = reach;
        let mut largest = 0.0_f64;
        // values on a grid of 21 x 21 x 11 positions in its box
        for (i, j, k) in (0..21 * 21 * 11).map(|n| (n % 21, n / 21 % 21, n / 441)) {
            let part = |n: i32, of: f64| f64::from(n) / of;
            let [x, y, z] = [
                along * (part(i, 10.0) - 1.0),
                across * (part(j, 10.0) - 1.0),
                depth * part(k, 10.0),
            ];
            let value = self.density.at(x, y, z);
            if !(value >= 0.0 && value.is_finite()) {
                let at = [x, y, z];
                let message = format!(
                    "the density of the heat source is {value} at x, y, z = {at:?} m from its centre"
                );
                return Err(SetupError::value(
                    "profile",
                    message,
                    "a number, zero or greater",
                ));
            }
            largest = largest.max(value);
        }
        if largest == 0.0 {
            let message = "the density of the heat source is zero everywhere within its reach";
            return Err(SetupError::value("profile", message, "lengths in metres"));
        }
        let per_axis = |a: usize, reach: f64| {
            let cells = match grid.is_thickness(a) {
                true => 1.0,
                false => 2.0 * reach / grid.spacing[a] + 2.0,
            };
            cells + 2.0 * reach / finest
        };
        let longest = along.max(across).max(depth);
        let samples: f64 = (0..3).map(|a| per_axis(a, longest)).product();
        check_cells("reach", samples, MOST_SAMPLES)
    }

    /// The density at `pose`, along the axis `torch` where it is not normal to the face.
    pub(super) fn sampled(&self, pose: &Pose, torch: Option<Vector3<f64>>) -> Sampled<'_> {
        let face = self.surface.face;
        let mut inward = Vector3::zeros();
        inward[face.axis()] = if face.is_upper() { -1.0 } else { 1.0 };
        let mut origin = pose.position;
        if let Some(level) = self.surface.level {
            origin[face.axis()] = level;
        }
        let density = &*self.density;
        let is_tilted = torch.is_some();
        Sampled {
            frame: SourceFrame::new(origin, torch.unwrap_or(inward), pose.direction),
            reach: density.reach(),
            finest: density.finest(),
            at_centres: false,
            is_even: is_tilted,
            normalise: true,
            // eta points to the right as seen from outside
            density: Box::new(move |x, right, z| density.at(x, -right, z)),
        }
    }

    pub(super) fn add_to_cells(
        &self,
        cells: &Cells<'_>,
        pose: &Pose,
        power: f64,
        values: &mut [f64],
        parts: &mut Vec<(usize, f64)>,
    ) -> Deposit {
        let sampled = self.sampled(pose, None);
        let [low, high] = sampled.bounds();
        let whole = sampled.integral(&cells.grid, [low, high]);
        let in_box = sampled.integral(&cells.grid, cells.bounds);
        parts.clear();
        if whole > 0.0 {
            let part = |point: usize| (point, sampled.integral(&cells.grid, cells.corners(point)));
            parts.extend(
                cells
                    .near(low, high)
                    .map(part)
                    .filter(|(_, part)| *part > 0.0),
            );
        }
        let sum = cells.total(parts);
        // for cells that fill the box of the body both integrals differ by the error of the samples
        let correction = match (sum / in_box - 1.0).abs() < SAMPLING {
            true => in_box / sum,
            false => 1.0,
        };
        parts
            .iter_mut()
            .for_each(|(_, part)| *part *= correction / whole);
        let in_box = if whole > 0.0 { in_box / whole } else { 0.0 };
        cells.deposit(parts, power, in_box, true, values)
    }
}
