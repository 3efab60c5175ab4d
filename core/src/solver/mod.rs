//! Solvers.
pub mod reduce;
