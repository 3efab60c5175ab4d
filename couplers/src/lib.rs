//! Couplers.

pub mod boundary;
pub mod deformation_heat;
pub mod expansion;
pub mod in_time;
pub mod phase_change;
pub mod source;
mod surface;
#[cfg(test)]
mod testing;
pub mod toolpath;

pub use in_time::InTime;
