//! Physics plugins: things with a state that the scheduler steps.
//!
//! | type | owns | consumes |
//! |---|---|---|
//! | `thermal` | `temperature`, `enthalpy` | `heat_source` |
//! | `replay` | the fields it is told to read from a log | |
//! | `fluid` | `velocity`, `density`, `pressure` and, with energy, `temperature`, `enthalpy` | `body_force`, `heat_source` |
//! | `mechanical` | `displacement`, `velocity`, `stress`, `conjugate_stress` | `eigenstrain`, `body_force` |

pub mod fluid;
pub mod mechanical;
pub mod replay;
#[cfg(test)]
mod testing;
pub mod thermal;
