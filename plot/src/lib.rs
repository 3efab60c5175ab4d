//! Pictures of numbers: charts of curves, coloured sections of bodies with contour lines, films of them.
//!
//! Everything is given as plain data: values, texts with their units, isotherms, sections. The crate knows neither logs nor cases and
//! depends on no other crate of Perimelt.
//!
//! - [`Chart`]: curves over one axis, in panels one above the other;
//! - [`Snapshot`]: [`View`]s of a body, each with the values of its cells on a [`Raster`], coloured by a [`ColourScale`];
//! - [`Picture`]: what both draw, encoded as PNG or SVG;
//! - [`Film`]: pictures of one size one after the other, encoded as GIF or animated PNG.

#![cfg_attr(not(test), warn(unused_crate_dependencies))]
mod axes;
mod colour;
mod contour;
mod curves;
mod film;
mod heading;
mod layout;
mod palette;
mod picture;
mod scale;
mod section;
mod smooth;
mod snapshot;

pub use axes::ChartAxis;
pub use colour::{Colour, ColourMap, LINES};
pub use curves::{Chart, Panel};
pub use film::{Film, FilmFormat, FilmSettings};
pub use picture::{DENSITY, Picture, PictureError};
pub use scale::{ColourScale, range};
pub use section::{AXES, Cells, Cut, Outside, Raster, View, views};
pub use snapshot::{Isoline, Snapshot};
