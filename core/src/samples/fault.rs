//! What can be wrong with a file with values by place or by time.

use std::path::PathBuf;

use super::{NotANumber, VtkError};

/// A mistake in a file with values by place.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct SamplesError {
    /// The file.
    pub path: PathBuf,
    /// The mistake.
    #[source]
    pub fault: SamplesFault,
}

/// What is wrong with a file with values by place.
#[derive(Debug, thiserror::Error)]
pub enum SamplesFault {
    /// It cannot be read.
    #[error("the file cannot be read: {0}")]
    Read(#[from] crate::input::InputError),
    /// A file of VTK.
    #[error(transparent)]
    Vtk(#[from] VtkError),
    /// A cell of a table.
    #[error(transparent)]
    Number(#[from] NotANumber),
    /// No times.
    #[error("the table has no column `time` (s); it has {}", list(.0))]
    NoTime(Vec<String>),
    /// No coordinates.
    #[error("the table has none of the columns `x`, `y` and `z`; it has {}", list(.0))]
    NoPositions(Vec<String>),
    /// No column for the values.
    #[error("it has no column `{name}`; it has {}", list(known))]
    NoColumn {
        /// Name that was looked for.
        name: String,
        /// The columns with values.
        known: Vec<String>,
    },
    /// Several columns, none of them with the name of the field.
    #[error(
        "none of its columns {} is called `{name}`; name one of them by `column`",
        list(known)
    )]
    Choice {
        /// Name of the field.
        name: String,
        /// The columns with values.
        known: Vec<String>,
    },
    /// A header with another unit.
    #[error("the column `{column}` is in {unit}; expected SI units, with temperatures in K")]
    Unit {
        /// The header.
        column: String,
        /// In brackets behind the name.
        unit: String,
    },
    /// Rows in time.
    #[error(transparent)]
    Rows(#[from] crate::material::TableError),
    /// No line of values.
    #[error("it has no point")]
    Empty,
    /// A value that is not finite.
    #[error("the value of the array `{column}` at point {point} is {value}")]
    NotFinite {
        /// The array.
        column: String,
        /// From 0.
        point: usize,
        /// The value.
        value: f64,
    },
    /// Times of a series that do not increase.
    #[error("the times of the files must increase, but {next} s follows {time} s")]
    Times {
        /// Time, s.
        time: f64,
        /// The following time, s.
        next: f64,
    },
    /// Other numbers of times and files.
    #[error("{times} times are given for {files} files")]
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of files.
        files: usize,
    },
    /// No point of the body near.
    #[error(
        "its points lie from {} to {} m, those asked for from {} to {} m: lengths are in metres, in the coordinates of the case",
        crate::text::position(file[0]), crate::text::position(file[1]), crate::text::position(body[0]), crate::text::position(body[1])
    )]
    Elsewhere {
        /// Corners of the box around the points of the file, m.
        file: [[f64; 3]; 2],
        /// Corners of the box around the points of the body, m.
        body: [[f64; 3]; 2],
    },
}

fn list(names: &[String]) -> String {
    match names {
        [] => "no other".into(),
        names => format!("`{}`", names.join("`, `")),
    }
}
