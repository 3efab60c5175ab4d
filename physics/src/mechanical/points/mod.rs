//! Laws of points: the stress of a point as a function of its strain and state.
//!
//! | file | has |
//! |---|---|
//! | `law` | the trait of laws |
//! | `neo_hookean` | a law |
//! | `orthotropic` | another one |
//! | `umat` | a law in a shared library, by the interface of UMAT |
//! | `response` | a law in the stress state and kinematics of a body |
//! | `states` | the points of a body with their law |

mod law;
mod neo_hookean;
mod orthotropic;
mod response;
mod scratch;
mod states;
mod umat;

pub use law::{LawPoint, Measure, PointLaw, StepStates};
pub use neo_hookean::NeoHookean;
pub use orthotropic::Orthotropic;
pub use response::{BodyPoint, FreeStrain, PointResponse};
pub(super) use states::{At, LawPoints};
pub use umat::Umat;
