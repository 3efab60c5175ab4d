//! Couplers: what one field does to another, and what the surroundings do to a body.

pub mod source;
pub mod toolpath;
