//! Quantities of the logged state of a body: scalars, reference positions, isotherms.

pub(crate) mod isotherm;
pub(crate) mod scalar;
pub(crate) mod survey;
