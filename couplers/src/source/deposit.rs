//! From a source at a pose to W/m³ on the points of a body.

use super::beam::{Beam, Scratch};
use super::{Grid, Point, Source, SourceError, Target};
use crate::toolpath::Pose;

/// Powers of one deposit (W), for the log.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deposit {
    /// What should arrive: power × efficiency (and H/h_eff for a surface Gaussian on a plate).
    pub asked: f64,
    /// What arrived: the sum of density × volume over the points.
    pub deposited: f64,
    /// What missed the body: fell on cells without material.
    pub lost: f64,
}

impl Deposit {
    /// What is neither deposited nor lost (W): the error of a density that is not normalised.
    pub fn sampling_error(&self) -> f64 {
        self.asked - self.deposited - self.lost
    }
}

/// A source made ready for a body. Keeps its work space, so that steps allocate nothing.
#[derive(Debug, Clone)]
pub struct Depositor {
    shape: Shape,
    efficiency: f64,
    scratch: Scratch,
}

#[derive(Debug, Clone)]
enum Shape {
    Point(Point),
    Beam(Beam),
}

impl Depositor {
    /// Checks a source and prepares it for a body on the lattice `grid`.
    ///
    /// # Errors
    /// [`SourceError`], naming the key at fault.
    pub fn new(source: &Source, grid: &Grid) -> Result<Self, SourceError> {
        let shape = match source {
            Source::Point(point) => Shape::Point(point.checked()?),
            Source::Gaussian(source) => Shape::Beam(source.beam(grid)?),
            Source::SemiEllipsoid(source) => Shape::Beam(source.beam()?),
            Source::Goldak(source) => Shape::Beam(source.beam()?),
            Source::SuperGaussian(source) => Shape::Beam(source.beam()?),
        };
        if let Shape::Beam(beam) = &shape {
            beam.check_size(grid)?;
        }
        Ok(Self {
            shape,
            efficiency: source.efficiency(),
            scratch: Scratch::default(),
        })
    }

    /// Adds the power density at `pose` (W/m³) to `values`, one per point.
    ///
    /// Sample a step at its middle: with steps that end at the events of the toolpath the energy
    /// is then exact.
    pub fn add(
        &mut self,
        target: &(impl Target + ?Sized),
        pose: &Pose,
        values: &mut [f64],
    ) -> Deposit {
        let power = pose.power * self.efficiency;
        if power == 0.0 {
            return Deposit::default();
        }
        match &self.shape {
            Shape::Point(point) => point.add(target, pose, power, values),
            Shape::Beam(beam) => beam.add(target, pose, power, values, &mut self.scratch),
        }
    }
}
