//! Physics plugins, whose state the scheduler advances in time.
//!
//! | type | owns | consumes |
//! |---|---|---|
//! | `thermal` | `temperature`, `enthalpy` | `heat_source` |
//! | `melt_flow` | `melt_velocity`, `melt_pressure` | |
//! | `thermal_history` | highest temperatures, cooling times, solidification | |
//! | `metallurgy` | fractions of austenite, ferrite, pearlite, bainite and martensite, hardness | |
//! | `replay` | the fields listed in `fields` or `values` | |
//! | `fluid` | `velocity`, `density`, `pressure` | `body_force` |
//! | `rigid_body` | `displacement`, `velocity` | `body_force`, `impulse` |
//! | `mechanical` | `displacement`, `velocity`, `stress`, `conjugate_stress` | `eigenstrain`, `eigenstrain_tensor`, `body_force` |

#![cfg_attr(not(test), warn(unused_crate_dependencies))]
#![deny(unsafe_code)]

mod advection;
mod dependent_keys;
pub mod fluid;
mod heat_content;
pub mod mechanical;
pub mod melt_flow;
pub mod metallurgy;
mod momentum;
mod plies;
pub mod replay;
pub mod rigid_body;
mod shape_tensor;
mod tension;
#[cfg(test)]
mod testing;
pub mod thermal;
pub mod thermal_history;

// for the registration macros
#[doc(hidden)]
pub use perimelt_core;
