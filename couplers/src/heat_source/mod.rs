//! Heat sources as couplers: they add power density to the points of a body and report powers and energies.
//!
//! | `type` | shape |
//! |---|---|
//! | `goldak` | [`shape::Goldak`] |
//! | `ellipsoid` | [`shape::SemiEllipsoid`] |
//! | `gaussian_source` | [`shape::Gaussian`] |
//! | `point_source` | [`shape::Point`] |
//! | `super_gaussian` | [`shape::SuperGaussian`] |
//! | `profile_source` | [`shape::Profile`], a formula |
//! | `pulsed_laser` | [`shape::PulsedLaser`], without a toolpath |
//!
//! The keys of the shape stand beside `toolpath`, `body`, and `voltage`, `current` and `pulse`. A crate adds a shape of its own with
//! [`register_source!`](crate::register_source):
//!
//! ```toml
//! [[couplers]]
//! type = "goldak"
//! power = 3200                  # W
//! front_length = 0.5e-3         # m
//! rear_length = 1e-3
//! half_width = 1e-3
//! depth = 1e-3
//! toolpath.line = { start = [0, 0, 0.005], direction = [1, 0, 0], speed = 0.005 }
//! ```
//!
//! On a body without a lattice (zones, displaced points, points of a table) each point receives the integral of the density
//! over its own cell.
//!
//! Sources are sampled at the middle of a step, and steps end at the events of the toolpath, so
//! that the energy is exact. While the source is on, automatic steps are at most the time in
//! which it moves a quarter of its shortest lateral length, or of a cell where that is longer: longer
//! steps would heat a row of spots instead of a line.

mod account;
#[cfg(test)]
mod cloud_tests;
mod coupling;
mod heading;
mod lattice;
mod moving;
#[cfg(test)]
mod profile_tests;
mod pulsed;
pub mod shape;
mod step_positions;

pub(crate) use account::mirror_copies;
pub(crate) use lattice::grid;
pub use moving::MovingSource;
pub use pulsed::PulsedLaserSource;
pub use shape::SourceShape;

/// Goldak's double ellipsoid.
pub type GoldakSource = MovingSource<shape::Goldak>;
/// Semi-ellipsoid.
pub type EllipsoidSource = MovingSource<shape::SemiEllipsoid>;
/// Surface Gaussian with an effective depth.
pub type GaussianSource = MovingSource<shape::Gaussian>;
/// All power in the cells around one lattice vertex.
pub type PointSource = MovingSource<shape::Point>;
/// Super-Gaussian beam.
pub type SuperGaussianSource = MovingSource<shape::SuperGaussian>;
/// A density by formula.
pub type ProfileSource = MovingSource<shape::Profile>;
