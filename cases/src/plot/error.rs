//! What can go wrong with a plot.

use std::path::PathBuf;

use perimelt_core::log::LogError;

use crate::moment::MomentError;

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
    #[error("the run has no body `{body}`; its bodies are: {}", known.join(", "))]
    UnknownBody {
        /// the requested name
        body: String,
        /// the known names
        known: Vec<String>,
    },
    /// No such field in any of the bodies.
    #[error(
        "the log has no field `{field}`; it has: {} (of vectors and tensors also components, such \
         as `displacement.x`)",
        known.join(", ")
    )]
    UnknownField {
        /// the requested name
        field: String,
        /// the known names
        known: Vec<String>,
    },
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
    /// A picture cannot be encoded.
    #[error("cannot write {}: {source}", path.display())]
    Png {
        /// where
        path: PathBuf,
        /// why not
        source: png::EncodingError,
    },
    /// A picture cannot be drawn.
    #[error("cannot draw {}: {what}", path.display())]
    Drawing {
        /// where
        path: PathBuf,
        /// why not
        what: String,
    },
}
