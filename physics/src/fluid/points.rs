//! The points of a fluid: what they are, with the state that only such points have.

use nalgebra::Vector3;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, FamilyHandle, SlotField, World};
use serde::{Deserialize, Serialize};

use crate::advection::Convection;
use crate::shape_tensor::CompleteFamily;

use super::eulerian::projection::Projection;
use super::eulerian::projection::heat::HeatedFluid;
use super::eulerian::{EulerianPoints, SavedEulerian};
use super::interface_report::{InterfaceFlow, InterfaceReport};
use super::lagrangian::{LagrangianPoints, SavedLagrangian};
use super::pair::{FluidPair, PreparedPair};
use super::rates::{Rates, Stability};
use super::walls::Walls;

/// The points of a fluid.
#[derive(Debug)]
pub(super) enum Points {
    /// They carry their mass.
    Lagrangian(LagrangianPoints),
    /// The fluid flows through them.
    Eulerian(EulerianPoints),
}

/// What points are prepared from.
pub(super) struct Surroundings {
    pub(super) body: BodyIndex,
    pub(super) family: FamilyHandle,
    pub(super) complete: CompleteFamily,
    pub(super) walls: Walls,
    /// The two fluids, where there are two.
    pub(super) pair: Option<PreparedPair>,
    /// Where the fluid gives the heat that it carries.
    pub(super) heat: Option<HeatedFluid>,
}

/// State of the points that is saved with checkpoints.
#[derive(Serialize, Deserialize)]
pub(super) enum SavedPoints {
    Lagrangian(SavedLagrangian),
    Eulerian(SavedEulerian),
}

impl Points {
    pub(super) fn rates(&self) -> &dyn Rates {
        match self {
            Points::Lagrangian(points) => points.rates(),
            Points::Eulerian(points) => points.rates(),
        }
    }

    pub(super) fn rates_mut(&mut self) -> &mut dyn Rates {
        match self {
            Points::Lagrangian(points) => points.rates_mut(),
            Points::Eulerian(points) => points.rates_mut(),
        }
    }

    /// Bodies that are walls, where the form of the equations knows them.
    pub(super) fn walls(&self) -> Option<&Walls> {
        match self {
            Points::Lagrangian(points) => points.walls(),
            Points::Eulerian(points) => points.walls(),
        }
    }

    pub(super) fn walls_mut(&mut self) -> Option<&mut Walls> {
        match self {
            Points::Lagrangian(points) => points.walls_mut(),
            Points::Eulerian(points) => points.walls_mut(),
        }
    }

    /// The flow of a fluid that keeps its volume.
    pub(super) fn projection(&self) -> Option<&Projection> {
        match self {
            Points::Lagrangian(_) => None,
            Points::Eulerian(points) => points.projection(),
        }
    }

    pub(super) fn projection_mut(&mut self) -> Option<&mut Projection> {
        match self {
            Points::Lagrangian(_) => None,
            Points::Eulerian(points) => points.projection_mut(),
        }
    }

    /// The two fluids, where there are two.
    pub(super) fn pair(&self) -> Option<&FluidPair> {
        match self {
            Points::Lagrangian(points) => points.pair(),
            Points::Eulerian(points) => points.projection().and_then(Projection::pair),
        }
    }

    /// Measures the interface of two fluids.
    pub(super) fn measure_interface(
        &mut self,
        body: &Body,
        flow: InterfaceFlow<'_>,
    ) -> Option<InterfaceReport> {
        match self {
            Points::Lagrangian(points) => points.measure(body, flow),
            Points::Eulerian(points) => points.projection_mut()?.measure(body, flow),
        }
    }

    /// Stabilisation of the convective terms; `None` for points that carry their mass.
    pub(super) fn convection(&self) -> Option<Convection> {
        match self {
            Points::Lagrangian(_) => None,
            Points::Eulerian(points) => Some(points.convection),
        }
    }

    /// Takes positions and velocities of the bodies that are walls for the fluid of `body`, and lets points follow them in a
    /// step of `dt` (s).
    pub(super) fn follow_walls(&mut self, world: &World, body: BodyIndex, dt: f64) {
        match self {
            Points::Lagrangian(points) => {
                if let Some(walls) = points.walls_mut() {
                    walls.follow(world, body);
                }
            }
            Points::Eulerian(points) => points.follow_walls(world, body, dt),
        }
    }

    /// Gives the walls the opposite of what they do to the fluid in a time (s), with the velocity by slot as last set.
    pub(super) fn give_impulses(&mut self, world: &World, velocity: &[SlotField], time: f64) {
        match self {
            Points::Lagrangian(points) => points.give_impulses(world, velocity, time),
            Points::Eulerian(points) => points.give_impulses(world, time),
        }
    }

    /// Mass of each point, kg, for densities by point (kg/m³) and reference volumes (m³).
    pub(super) fn masses<'a>(
        &'a self,
        density: &'a [f64],
        reference_volume: &'a [f64],
    ) -> impl Fn(usize) -> f64 + 'a {
        move |point| match self {
            Points::Lagrangian(points) => match points.own_masses() {
                Some(mass) => mass[point],
                None => density[point] * reference_volume[point],
            },
            Points::Eulerian(points) => {
                density[point] * reference_volume[point] * points.fullness(point)
            }
        }
    }

    /// Volume of each point in sums over neighbours, m³.
    pub(super) fn volumes<'a>(&'a self, reference_volume: &'a [f64]) -> &'a [f64] {
        match self {
            Points::Lagrangian(points) => points.current_volumes().unwrap_or(reference_volume),
            Points::Eulerian(_) => reference_volume,
        }
    }

    /// What the largest stable step depends on where the points are now, from what it depends on at their reference positions;
    /// `None` for points that keep their neighbours and places.
    pub(super) fn stability_now(&self, initial: Stability) -> Option<Stability> {
        match self {
            Points::Lagrangian(points) => points.stability_now(initial),
            Points::Eulerian(points) => points.stability_now(initial),
        }
    }

    /// Momentum that other bodies gave to points that move by impulses, and its moment about the origin (N s, N m s).
    pub(super) fn received(&self, world: &World, body: BodyIndex) -> [Vector3<f64>; 2] {
        match self {
            Points::Lagrangian(points) => points.received(world, body),
            Points::Eulerian(_) => Default::default(),
        }
    }

    pub(super) fn save(&self) -> SavedPoints {
        match self {
            Points::Lagrangian(points) => SavedPoints::Lagrangian(points.save()),
            Points::Eulerian(points) => SavedPoints::Eulerian(points.save()),
        }
    }

    pub(super) fn load(&mut self, saved: SavedPoints) -> Result<(), erased_serde::Error> {
        match (self, saved) {
            (Points::Lagrangian(points), SavedPoints::Lagrangian(saved)) => points.load(saved),
            (Points::Eulerian(points), SavedPoints::Eulerian(saved)) => points.load(saved),
            _ => {
                let message = "the points of the saved fluid are of another description";
                Err(serde::de::Error::custom(message))
            }
        }
    }
}
