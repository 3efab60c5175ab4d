//! Errors of plots.

use std::path::PathBuf;

use perimelt_core::log::LogError;
use perimelt_plot::{AXES, Outside, PictureError};

use super::args::{PictureKind, name};
use crate::argument::UnknownBody;
use crate::moment::MomentError;
use crate::quantity::scalar::ScalarError;

/// Why pictures could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// No logged state at a time.
    #[error(transparent)]
    Moment(#[from] MomentError),
    /// No such body.
    #[error(transparent)]
    UnknownBody(#[from] UnknownBody),
    /// No such field in any of the bodies.
    #[error(transparent)]
    Scalar(#[from] ScalarError),
    /// The points are too scattered for a picture.
    #[error(
        "body `{body}` cannot be drawn at {time} s: its points are not finite, or scattered much \
         wider than their spacing"
    )]
    Scattered {
        /// the body
        body: String,
        /// simulated time, s
        time: f64,
    },
    /// A section beside a body.
    #[error(
        "`--section {axis}={at}` does not cut body `{body}`, which extends from {axis} = {} to {} m",
        crate::unit::number(outside.extent[0], 6), crate::unit::number(outside.extent[1], 6),
        axis = AXES[outside.cut.axis], at = outside.cut.at
    )]
    SectionOutside {
        /// the body
        body: String,
        /// section and extent of the body
        outside: Outside,
    },
    /// A section of plies.
    #[error(
        "`--section` does not cut body `{body}`, whose points lie in the layers of a `layup`: `--ply` chooses plies"
    )]
    SectionOfLayers {
        /// the body
        body: String,
    },
    /// A ply that a body does not have.
    #[error("`--ply {ply}`: body `{body}` has the plies 1 to {plies}")]
    NoPly {
        /// the body
        body: String,
        /// the ply
        ply: usize,
        /// number of its plies
        plies: usize,
    },
    /// Too few pixels for the letters.
    #[error(
        "`--width {width}` is too narrow for letters of `--dpi {dpi}`: expected at least {least} pixels"
    )]
    Narrow {
        /// requested width, pixels
        width: u32,
        /// requested resolution, pixels per inch
        dpi: u32,
        /// the least width at this resolution, pixels
        least: u32,
    },
    /// No picture of the requested kinds.
    #[error(
        "`--only {}`: the log has nothing of this kind to draw",
        kinds.iter().map(name).collect::<Vec<_>>().join(",")
    )]
    NoneOfKind {
        /// the requested kinds
        kinds: Vec<PictureKind>,
    },
    /// A film of an unknown format.
    #[error("`--film {}`: expected a file that ends in `.gif`, `.png` or `.apng`", path.display())]
    FilmFormat {
        /// the file
        path: PathBuf,
    },
    /// Nothing that a film could show.
    #[error("there is nothing to film: no body of two or three dimensions has a logged field")]
    NoFilm,
    /// A file or folder cannot be written.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// what was tried
        action: &'static str,
        /// where
        path: PathBuf,
        /// why not
        source: std::io::Error,
    },
    /// A picture cannot be drawn.
    #[error("cannot draw {}: {source}", path.display())]
    Drawing {
        /// where
        path: PathBuf,
        /// why not
        source: PictureError,
    },
}
