//! Case files, command line and material library.

pub mod export;
pub mod melt_pool;
pub mod plot;
