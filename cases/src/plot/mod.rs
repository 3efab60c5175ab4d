//! x
pub(crate) mod grid;
