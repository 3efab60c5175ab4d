//! Laws of points: the stress of a point as a function of its strain and state.
//!
//! | file | has |
//! |---|---|
//! | `law` | the trait of laws |
//! | `neo_hookean` | a law |
//! | `response` | a law in the stress state and kinematics of a body |
//! | `states` | the points of a body with their law |

mod law;
mod neo_hookean;
mod response;
mod states;

pub use law::{LawPoint, MOST_NUMBERS, Measure, PointLaw};
pub use neo_hookean::NeoHookean;
pub use response::{BodyPoint, PointResponse};
pub(super) use states::{At, LawPoints};
