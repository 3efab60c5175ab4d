//! Physics plugins: things with a state that the scheduler steps.
//!
//! | type | owns | consumes |
//! |---|---|---|
//! | `thermal` | `temperature`, `enthalpy` | `heat_source` |

pub mod thermal;
