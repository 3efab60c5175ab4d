//! Deposits a source at a pose as power density on the points of a body.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::beam::Scratch;
use super::{CellGrid, Cells, HeatedBody, PowerDensity, Sampling, SourceShape, no_direction};
use crate::toolpath::Pose;
use perimelt_core::SetupError;
use perimelt_core::numbers::check_fraction;

/// Powers of one deposit (W), for the log.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deposit {
    /// Power asked for: power × efficiency (and × H/h_eff for a surface Gaussian on a plate).
    pub asked: f64,
    /// Power deposited: the sum of density × volume over the points.
    pub deposited: f64,
    /// Power that missed the body: the part of cells without material.
    pub lost: f64,
    /// The surface that a beam meets that is absorbed column by column.
    pub depression: Option<Depression>,
}

/// The surface of an interface or a keyhole below a beam.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Depression {
    /// Largest depth below the heated surface, m.
    pub depth: f64,
    /// Absorptivity over that of the flat surface.
    pub gain: f64,
}

impl Deposit {
    /// The deposit of a part of the power asked for.
    pub(super) fn of(asked: f64, deposited: f64) -> Self {
        Deposit {
            asked,
            deposited,
            lost: asked - deposited,
            depression: None,
        }
    }

    /// The deposit of `scale` (W) times the parts of cells, of `all` of which the ones with the sum `hit` have material.
    pub(super) fn of_parts(asked: f64, scale: f64, hit: f64, all: f64) -> Self {
        // a difference of rounding size is not lost power
        let hit = if all - hit > 1e-12 * all { hit } else { all };
        Deposit {
            asked,
            deposited: scale * hit,
            lost: scale * (all - hit),
            ..Deposit::default()
        }
    }

    /// Power neither deposited nor lost (W): the error of a density that is not normalised.
    pub fn sampling_error(&self) -> f64 {
        self.asked - self.deposited - self.lost
    }
}

/// A checked power density with its work arrays, for one body. Steps do not allocate.
#[derive(Debug, Clone)]
pub struct Depositor {
    density: PowerDensity,
    efficiency: f64,
    /// Axis of the torch, where it is not normal to the heated face.
    axis: Option<Vector3<f64>>,
    scratch: Scratch,
}

impl Depositor {
    /// Checks a shape and prepares its power density for a body on the lattice `grid`.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    pub fn new(shape: &dyn SourceShape, grid: &CellGrid) -> Result<Self, SetupError> {
        let density = shape.power_density(grid)?;
        let axis = match &density {
            PowerDensity::Beam(beam) => {
                beam.check_size(grid)?;
                beam.sampled.heated_surface.axis(grid)?
            }
            PowerDensity::Columns(beam) => {
                beam.check_size(grid)?;
                let surface = &beam.sampled.heated_surface;
                match surface.direction {
                    Some(_) => {
                        return Err(no_direction(
                            "a beam absorbed at an interface or in a keyhole",
                        ));
                    }
                    None => None,
                }
            }
            PowerDensity::Point(_) => None,
            PowerDensity::Sampled(sampled) => {
                sampled.check(grid)?;
                sampled.surface.axis(grid)?
            }
        };
        Ok(Self {
            density,
            efficiency: check_fraction("efficiency", shape.efficiency())?,
            axis,
            scratch: Scratch::default(),
        })
    }

    /// Part of the power that enters the body.
    pub fn efficiency(&self) -> f64 {
        self.efficiency
    }

    /// Refuses what needs a lattice.
    ///
    /// # Errors
    /// Sampling at points, and a direction of the torch, need a lattice.
    pub fn check_cells(&self) -> Result<(), SetupError> {
        match &self.density {
            _ if self.axis.is_some() => Err(no_direction("a body without a lattice")),
            PowerDensity::Beam(beam) if beam.sampled.sampling == Sampling::Point => {
                let message = "`sampling = \"point\"` needs the cells of a lattice";
                let expected = "no `sampling`, or a body with `spacing`";
                Err(SetupError::value("sampling", message, expected))
            }
            PowerDensity::Columns(_) => {
                let message =
                    "a beam that an interface or a keyhole absorbs needs the cells of a lattice";
                let expected = "a body with `spacing`";
                Err(SetupError::value("penetration", message, expected))
            }
            _ => Ok(()),
        }
    }

    /// [`Depositor::add`] for a body without a lattice.
    pub fn add_to_cells(&mut self, cells: &Cells<'_>, pose: &Pose, values: &mut [f64]) -> Deposit {
        let power = pose.power * self.efficiency;
        if power == 0.0 {
            return Deposit::default();
        }
        match &self.density {
            PowerDensity::Point(point) => {
                point.add_to_cells(cells, pose, power, values, &mut self.scratch.parts)
            }
            PowerDensity::Beam(beam) => {
                beam.add_to_cells(cells, pose, power, values, &mut self.scratch)
            }
            // refused at set-up
            PowerDensity::Columns(_) => Deposit::default(),
            PowerDensity::Sampled(density) => {
                density.add_to_cells(cells, pose, power, values, &mut self.scratch.parts)
            }
        }
    }

    /// Adds the power density at `pose` (W/m³) to `values`, one per point.
    ///
    /// `pose` is the pose in the middle of a step: the energy is exact if steps end at the events of the toolpath.
    pub fn add(
        &mut self,
        body: &(impl HeatedBody + ?Sized),
        pose: &Pose,
        values: &mut [f64],
    ) -> Deposit {
        let power = pose.power * self.efficiency;
        if power == 0.0 {
            return Deposit::default();
        }
        let axis = pose.torch.or(self.axis).filter(|_| !body.grid().plate);
        let scratch = &mut self.scratch;
        match (&self.density, axis) {
            (PowerDensity::Point(point), _) => point.add(body, pose, power, values),
            (PowerDensity::Beam(beam), Some(axis)) => {
                let sampled = beam.tilted(pose, axis);
                sampled.add(body, power, values, &mut scratch.lateral)
            }
            (PowerDensity::Columns(beam), _) => beam.add(body, pose, power, values, scratch),
            (PowerDensity::Beam(beam), None) => beam.add(body, pose, power, values, scratch),
            (PowerDensity::Sampled(density), axis) => {
                let sampled = density.sampled(pose, axis);
                sampled.add(body, power, values, &mut scratch.lateral)
            }
        }
    }
}
