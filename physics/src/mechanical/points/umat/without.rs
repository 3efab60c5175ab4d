//! The place of subroutines in a program that cannot call them.

use perimelt_core::SetupError;

use super::Umat;
use super::arguments::Arguments;

/// A subroutine, of which there are none.
#[derive(Debug)]
pub(super) enum Subroutine {}

impl Subroutine {
    /// Refuses the law.
    ///
    /// # Errors
    /// Always.
    pub(super) fn load(keys: &Umat) -> Result<Self, SetupError> {
        let library = keys.library.place.display();
        let message = format!("this program cannot call `{}` of {library}", keys.symbol);
        let expected = "a program from `cargo build --release --features umat`, or another law";
        Err(SetupError::value("library", message, expected))
    }

    /// Is never called.
    pub(super) fn call(&self, _: &mut Arguments, _: &mut [f64]) {
        match *self {}
    }
}
