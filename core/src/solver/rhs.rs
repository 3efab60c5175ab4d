//! The function that a solver integrates or brings to zero.

use super::error::SolverError;
use super::reducer::Reducer;

/// A vector function `f(t, y)`: the rate of a state, or the residual force of a body.
///
/// [`Rhs::rate`] is enough for every method of this module; the tangent and its diagonal make the implicit ones
/// faster. [`rhs`] makes one of a closure.
pub trait Rhs {
    /// Writes `f(time, state)` into `rate`, which holds unspecified numbers on entry.
    ///
    /// # Errors
    /// Errors of the model; wrap them with [`SolverError::model`].
    fn rate(&mut self, time: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError>;

    /// Writes `df/dy(at) . direction` into `out` and returns true, or returns false if the
    /// model has no tangent: then a difference of two rates over a distance by [`Rhs::scale`] replaces it.
    ///
    /// # Errors
    /// Errors of the model.
    fn tangent(
        &mut self,
        _at: At,
        _direction: &[f64],
        _out: &mut [f64],
    ) -> Result<bool, SolverError> {
        Ok(false)
    }

    /// Writes the diagonal of `df/dy(at)` into `out` and returns true, or returns false:
    /// then there is no preconditioner. An estimate will do, but for conjugate gradients
    /// all entries must be negative.
    ///
    /// # Errors
    /// Errors of the model.
    fn tangent_diagonal(&mut self, _at: At, _out: &mut [f64]) -> Result<bool, SolverError> {
        Ok(false)
    }

    /// Norm of a state of usual size, in its unit: differences of rates that stand in for the tangent change the
    /// state by `sqrt(eps)` of this and of the norm of the state together. The default suits states whose numbers
    /// are about 1 or larger; a model in other units gives its own.
    fn scale(&self) -> f64 {
        1.0
    }

    /// Norm of the rounding error of `f(at)`, in the unit of the rate and with the [`Rhs::weights`]. [`Newton`] accepts a
    /// residual of this size, since no state has a smaller one: a stiff model amplifies the rounding of its state, by
    /// up to the sum of the coefficients of a row. Zero by default: then the tolerances of the solver must be above it.
    ///
    /// [`Newton`]: super::Newton
    fn rounding(&self, _at: At) -> f64 {
        0.0
    }

    /// The unknowns by which [`Implicit`] finds the new state, from a state: the state itself by default. A model whose
    /// stiff part is nearly linear in other numbers gives these.
    ///
    /// [`Implicit`]: super::Implicit
    fn unknowns(&self, state: &[f64], unknowns: &mut [f64]) {
        unknowns.copy_from_slice(state);
    }

    /// The state that belongs to [`Rhs::unknowns`], and the derivative of each of its entries by its unknown, positive.
    fn state(&self, unknowns: &[f64], state: &mut [f64], slope: &mut [f64]) {
        state.copy_from_slice(unknowns);
        slope.fill(1.0);
    }

    /// Whether the rate is a force on the state, so that rate times change of the state is a work (with the
    /// [`Rhs::weights`]). [`Newton`] then also accepts a step that brings the work along its direction down.
    ///
    /// [`Newton`]: super::Newton
    fn is_force(&self) -> bool {
        false
    }

    /// Positive weights `w` for which `diag(w) df/dy` is symmetric, as the volumes of points of
    /// several sizes are; `None` where `df/dy` is symmetric itself or symmetry is not needed. Norms of
    /// residuals include them.
    fn weights(&self) -> Option<&[f64]> {
        None
    }

    /// The points to which the entries of the state belong: a process alone by default. Where several share them, the entries of points that
    /// other processes own and bonds reach are right in a state or direction; those that [`Rhs::rate`], [`Rhs::tangent`] and
    /// [`Rhs::tangent_diagonal`] write are replaced.
    fn points(&self) -> Reducer {
        Reducer::default()
    }
}

/// Time and state at which a tangent is evaluated.
#[derive(Debug, Clone, Copy)]
pub struct At<'a> {
    /// Time (s), or a load factor.
    pub time: f64,
    /// State.
    pub state: &'a [f64],
    /// Fraction of the tangent at rest in the tangent, which a model with a tangent that may be singular mixes in: steps
    /// along directions that nothing resists become shorter. Zero: the tangent itself.
    pub damping: f64,
}

/// Makes an [`Rhs`] of a closure `|time, state, rate| { ...; Ok(()) }`.
pub fn rhs<F>(function: F) -> impl Rhs
where
    F: FnMut(f64, &[f64], &mut [f64]) -> Result<(), SolverError>,
{
    Closure(function)
}

struct Closure<F>(F);

impl<F: FnMut(f64, &[f64], &mut [f64]) -> Result<(), SolverError>> Rhs for Closure<F> {
    fn rate(&mut self, time: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        (self.0)(time, state, rate)
    }
}
