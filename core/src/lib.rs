//! Points, families, fields, solvers, scheduler, log and plugin traits of Perimelt.
//!
//! A tour, in the order in which a case comes to life:
//!
//! 1. [`shape`] and [`body`]: shapes are filled with points, on a lattice or of several spacings.
//! 2. [`material`]: properties, constant, by temperature or by phase.
//! 3. [`plugin`]: the two traits, [`Physics`] and [`Coupler`], that carry everything else.
//! 4. [`Setup`]: plugins declare [`field`]s and obtain [`family`]s.
//! 5. [`Simulation`]: [`schedule`] derives the order, then time goes on.
//! 6. [`pddo`]: derivatives of fields as sums over families.
//! 7. [`solver`]: time integration and equations for any physics.
//! 8. [`log`]: the run as an MCAP file, and back.

#![cfg_attr(not(test), warn(unused_crate_dependencies))]
#![deny(unsafe_code)]

pub mod arithmetic;
mod axis;
pub mod body;
pub mod cell_list;
pub mod device;
pub mod error;
mod explanation;
pub mod family;
pub mod field;
pub mod fire;
pub mod flattened;
pub mod folder;
pub mod formula;
pub mod in_space;
pub mod in_time;
pub mod input;
pub mod instructions;
pub mod law;
pub mod log;
pub mod material;
pub mod named;
mod neighbours;
pub mod numbers;
pub mod orientation;
pub mod pair_list;
pub mod parallel;
pub mod pddo;
pub mod plugin;
mod point_rows;
pub mod programme;
pub mod samples;
pub mod schedule;
pub mod setup;
pub mod shape;
pub mod simulation;
pub mod solver;
pub mod stepping;
pub mod surface_tension;
pub mod text;
pub mod transport;
pub mod world;

pub use arithmetic::Number;
pub use axis::Axis;
pub use body::{Body, Cut, Face, Horizon, Region};
pub use error::{Explanation, Problem, RunError, SetupError};
pub use family::{
    Bond, BondKernel, BrokenBonds, Correction, Family, FamilySpec, Image, Influence, Operator,
    PartialVolume, SlotField,
};
pub use field::{Key, Read, ReadIfProvided, Write, keys};
pub use formula::Formula;
pub use in_space::{InSpace, Placed};
pub use in_time::InTime;
pub use pair_list::PairList;
pub use pddo::{Derivatives, Pddo, PddoError};
pub use plugin::{
    Balance, Coupler, LoadError, Physics, PhysicsReport, Prepared, Report, RunningCoupler,
    RunningPhysics, SavedState,
};
pub use point_rows::PointRows;
pub use programme::Programme;
pub use setup::{Access, ClaimedLayers, ExpectedGift, GivenValue, LayerRole, Setup, Warning};
pub use simulation::Simulation;
pub use stepping::{Step, StepLimits, StepSize, Stepping, Update, Work};
pub use surface_tension::{SurfaceTension, TensionLaw};
pub use world::activity::ActivityChanges;
pub use world::changes::{Change, Changes};
pub use world::configuration::{Configuration, Description, PointMover};
pub use world::facts::{Fact, FactRule};
pub use world::families::{FamilyHandle, FamilySize};
pub use world::{Wall, World};

// for the registration macros
#[doc(hidden)]
pub use {erased_serde, inventory, schemars, serde};
