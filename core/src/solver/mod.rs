//! Solvers over flat vectors, for any physics; they do not depend on fields or plugins.
//!
//! Which solver for which problem:
//!
//! | problem | solver | when |
//! |---|---|---|
//! | `y' = f(t, y)`, diffusion | [`Rkl2`] | steps of up to 1000 times that of forward Euler: no systems to solve, second order |
//! | | [`Implicit::euler`] | larger steps still, strong nonlinearity |
//! | | [`Implicit::crank_nicolson`] | large steps over smooth data, second order |
//! | `f(t, y) = 0` | [`steady_state`] | the steady state of the above, without its history |
//! | `F(u) = 0`, statics | [`Newton`] | smooth models; linear ones in one linear solve |
//! | | [`Relaxation`] | softening, fracture, contact |
//! | `M u'' = F(t, u)` | [`Verlet`] | waves, impact, fracture dynamics |
//! | `A x = b` | [`Krylov`] | the linear solve itself, matrix-free |
//!
//! A model is an [`Rhs`] (or a closure, see [`rhs()`]); a failure of the model passes through
//! as [`SolverError::Model`]. Solvers own their work vectors and allocate at first use only.
//!
//! All sums go through [`reduce`], whose results depend neither on the number of threads nor on how points are divided among them:
//! same binary, same case, same bits.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod error;
mod exact;
mod implicit;
mod krylov;
mod newton;
pub mod reduce;
mod reducer;
mod relaxation;
mod rhs;
mod rkl2;
mod spectrum;
mod steady;
#[cfg(test)]
mod test_problems;
mod vector;
mod verlet;

pub use error::SolverError;
pub use exact::ExactSum;
pub use implicit::Implicit;
pub use krylov::{
    CoarseGrid, CoarseSpace, Hints, Krylov, KrylovMethod, KrylovOptions, KrylovReport, NullSpace,
    Spring,
};
pub use newton::{Newton, NewtonOptions, NewtonReport};
pub(crate) use reducer::Shared;
pub use reducer::{Reducer, SharedNodes};
pub use relaxation::{Relaxation, RelaxationOptions, RelaxationReport, fictitious_mass};
pub use rhs::{At, Rhs, rhs};
pub use rkl2::Rkl2;
pub use spectrum::largest_eigenvalue;
pub use steady::steady_state;
pub use verlet::{Dynamics, HalfKick, Verlet, VerletState};
