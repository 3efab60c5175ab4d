//! `perimelt diff`: compares two logs.

use super::Done;
use crate::diff::{DiffArgs, diff, print};

/// Status of the program when the logs differ.
pub const DIFFERENT: u8 = 1;
/// Status of the program when the logs cannot be compared.
pub const ERROR: u8 = 2;

/// The logs differ, as was printed.
#[derive(Debug, thiserror::Error)]
#[error("the logs differ")]
pub struct Different;

pub fn run(args: &DiffArgs) -> Done {
    let comparison = diff(args)?;
    print(&comparison, args, &mut crate::terminal::output())?;
    if comparison.is_equal(args.tolerance) {
        Ok(())
    } else {
        Err(Different.into())
    }
}
