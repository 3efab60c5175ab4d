//! Points, families, fields, solvers, scheduler, log and plugin traits of Perimelt.

pub mod log;
pub mod material;
pub mod solver;
