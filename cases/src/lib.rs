//! Case files, command line and material library of Perimelt.
//!
//! - [`case`]: TOML text -> a composed [`core::Simulation`], with mistakes shown at their lines;
//! - [`run`]: steps a case, logs it, resumes it;
//! - [`probe`]: numbers computed from the fields with every logged state;
//! - [`probe::interpolation`]: fields between points; [`melt_pool`]: extents above an isotherm;
//! - [`library`]: the materials that come with the program;
//! - [`commands`]: the command line; [`plot`], [`view`], [`export`], [`diff`], [`sweep`] and [`verify`] behind it.
//!
//! A binary with additional plugins links their crate and calls [`main`]:
//!
//! ```no_run
//! // use my_plugins as _;
//! fn main() -> std::process::ExitCode {
//!     perimelt::main()
//! }
//! ```

#![cfg_attr(not(test), warn(unused_crate_dependencies))]
mod argument;
mod bench;
pub mod case;
mod cell_grid;
pub mod commands;
mod component;
pub mod diff;
pub mod export;
mod file_names;
mod growing_log;
mod interrupt;
pub mod library;
mod log_file;
mod log_names;
pub mod melt_pool;
mod moment;
pub mod output;
pub mod plot;
pub mod probe;
mod quantity;
pub mod run;
pub mod summary;
pub mod sweep;
pub mod tables;
mod terminal;
mod unit;
pub mod verify;
pub mod view;

pub use commands::main;
pub use perimelt_core as core;
// linking these crates registers their plugins
pub use {perimelt_couplers as couplers, perimelt_physics as physics};
