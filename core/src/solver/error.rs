//! Errors of the solvers.

use std::error::Error;

/// Failure of a solver, or of the model function that it called.
#[derive(Debug, thiserror::Error)]
pub enum SolverError {
    /// Two vectors that must describe the same unknowns differ in length.
    #[error(
        "{what} has {found} entries, but the state has {expected}; both must describe the same unknowns"
    )]
    Length {
        /// Which vector.
        what: &'static str,
        /// Length of the state.
        expected: usize,
        /// Length found.
        found: usize,
    },

    /// A setting or an input is outside its range.
    #[error("{what} is {value:e}, but it must be {range}")]
    OutOfRange {
        /// Which setting, with its unit.
        what: &'static str,
        /// Value found.
        value: f64,
        /// Allowed range, in words.
        range: &'static str,
    },

    /// An iteration reached its limit.
    #[error(
        "{method} stopped after {iterations} iterations at a residual of {residual:e}, above the tolerance {tolerance:e}; {advice}"
    )]
    NotConverged {
        /// Name of the method.
        method: &'static str,
        /// Iterations spent.
        iterations: usize,
        /// Residual norm reached, in the unit of the residual.
        residual: f64,
        /// Residual norm asked for, same unit.
        tolerance: f64,
        /// What to try.
        advice: &'static str,
    },

    /// The conjugate gradient method met a direction of zero or negative curvature.
    #[error(
        "the matrix or its preconditioner is not positive definite: iteration {iteration} of the conjugate gradient method met the curvature {curvature:e}; a matrix that is not symmetric needs another method; a solid must be held against rigid motion, and a load that is too large for one step, or an unstable state (buckling), needs smaller steps"
    )]
    NotPositiveDefinite {
        /// Iteration that met it.
        iteration: usize,
        /// `p.A p` (or `r.M r`) found, which must be positive.
        curvature: f64,
    },

    /// A number stopped being finite.
    #[error(
        "{what} is not finite in iteration {iteration}; the step is too large or the model function returned a value that is not a number"
    )]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// Iteration that met it.
        iteration: usize,
    },

    /// The model function (rate, force, residual) failed.
    #[error(transparent)]
    Model(Box<dyn Error + Send + Sync>),
}

impl SolverError {
    /// Wraps an error of the model function, to be used as `.map_err(SolverError::model)?`.
    pub fn model(error: impl Error + Send + Sync + 'static) -> Self {
        Self::Model(Box::new(error))
    }
}

/// Returns an error for a vector whose length is not that of the state.
pub(crate) fn same_length(
    what: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), SolverError> {
    if found == expected {
        Ok(())
    } else {
        Err(SolverError::Length {
            what,
            expected,
            found,
        })
    }
}

/// Returns an error for a time step that is not positive and finite.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<(), SolverError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(SolverError::OutOfRange {
            what,
            value,
            range: "positive and finite",
        })
    }
}
