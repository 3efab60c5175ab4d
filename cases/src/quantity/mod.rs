//! What is read off the logged state of a body: scalars, reference positions, isotherms.

pub(crate) mod isotherm;
pub(crate) mod scalar;
pub(crate) mod survey;
