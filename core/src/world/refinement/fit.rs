//! How a window of finer points fits into a body with coarser ones.

use crate::body::{Body, Lattice};
use crate::error::SetupError;
use crate::text::position;

/// Part of the volume of a body whose coordinates may differ from cells by rounding, in cells.
const ROUNDING: f64 = 1e-3;

/// A body of one material that fills its box, and its lattice.
#[derive(Clone, Copy)]
pub(super) struct FullLattice<'a> {
    pub(super) body: &'a Body,
    pub(super) lattice: &'a Lattice,
}

/// The lattice of a body that fills its box and consists of one material; blamed on `key`.
pub(super) fn full_lattice<'a>(body: &'a Body, key: &str) -> Result<FullLattice<'a>, SetupError> {
    let refuse = |message: String, expected: &str| Err(SetupError::value(key, message, expected));
    let lattice = match body.lattice() {
        Some(lattice) if lattice.is_full() => lattice,
        _ => {
            let message = format!("body `{}` is not a full box of one spacing", body.name);
            return refuse(message, "a body with `shape.box` and one `spacing`");
        }
    };
    if body.materials.len() != 1 {
        let message = format!("body `{}` has several materials", body.name);
        return refuse(message, "a body of one material");
    }
    if !body.cuts.is_empty() || body.periodic != [false; 3] {
        let message = format!("body `{}` has cracks or is periodic", body.name);
        return refuse(message, "a body without cracks and `periodic`");
    }
    Ok(FullLattice { body, lattice })
}

/// How a window fits into a plate.
pub(super) struct Fit {
    /// Points of the window along an edge of a cell of the plate.
    pub(super) ratio: usize,
    /// Cells of the plate below the window along each axis.
    pub(super) cells: [usize; 3],
    /// The lowest of these cells.
    pub(super) first: [i64; 3],
}

impl Fit {
    pub(super) fn new(plate: FullLattice<'_>, window: FullLattice<'_>) -> Result<Fit, SetupError> {
        let (coarse, fine) = (plate.lattice, window.lattice);
        let (plate, window) = (plate.body, window.body);
        let refuse =
            |message: String, expected: &str| Err(SetupError::value("fine", message, expected));
        if plate.dimension != window.dimension || plate.thickness != window.thickness {
            let message = format!(
                "bodies `{}` and `{}` differ in their dimension or thickness",
                plate.name, window.name
            );
            return refuse(message, "two bodies of one dimension and thickness");
        }
        if plate.materials != window.materials {
            let message = format!(
                "bodies `{}` and `{}` differ in their material",
                plate.name, window.name
            );
            return refuse(message, "two bodies of the same material");
        }
        let ratio = (coarse.spacing / fine.spacing).round();
        if ratio < 2.0 || (ratio * fine.spacing / coarse.spacing - 1.0).abs() > 1e-9 {
            let message = format!(
                "the spacing {} m of body `{}` is not that of body `{}`, {} m, divided by a whole number of 2 or more",
                fine.spacing, window.name, plate.name, coarse.spacing
            );
            return refuse(
                message,
                "a spacing such as a half or a quarter of the coarser one",
            );
        }
        let ratio = ratio as usize;
        let (mut cells, mut first) = ([1; 3], [0; 3]);
        for axis in 0..plate.dimension {
            let low = (fine.origin[axis] - coarse.origin[axis]) / coarse.spacing;
            let count = fine.cells[axis] as f64 / ratio as f64;
            let is_whole = |x: f64| (x - x.round()).abs() < ROUNDING;
            let end = low.round() + count.round();
            if !is_whole(low)
                || !is_whole(count)
                || low.round() < 0.0
                || end > coarse.cells[axis] as f64
            {
                let message = format!(
                    "body `{}` spans {} to {} m, which are not whole cells of body `{}`",
                    window.name,
                    position(window.bounds().0),
                    position(window.bounds().1),
                    plate.name
                );
                let expected =
                    "a box inside of the coarser body whose faces lie on faces of its cells";
                return refuse(message, expected);
            }
            (cells[axis], first[axis]) = (count.round() as usize, low.round() as i64);
        }
        Ok(Fit {
            ratio,
            cells,
            first,
        })
    }
}
