//! The lattice of a body, on whose cells heat sources deposit their power.

use std::cell::Ref;

use nalgebra::Vector3;
use perimelt_core::activity::is_active;
use perimelt_core::{Body, SetupError};

use crate::source::{CellGrid, HeatedBody};

/// A body with its lattice.
pub(super) struct LatticeBody<'a> {
    pub body: &'a Body,
    pub grid: CellGrid,
    /// Which points have material, where material is deposited.
    pub activity: Option<Ref<'a, [f64]>>,
}

/// The lattice of a body. Missing axes have one cell with the extent of the body: its thickness
/// along z in 2D, a square of its cross-section in 1D.
///
/// # Errors
/// A body that has no lattice.
pub(super) fn grid(body: &Body) -> Result<CellGrid, SetupError> {
    let Some(lattice) = body.lattice() else {
        let message = format!(
            "body `{}` has no lattice, whose cells heat sources need",
            body.name
        );
        let expected = "a body with `spacing`, without `zones`, `jitter` or `points`";
        return Err(SetupError::value("body", message, expected));
    };
    let across = match body.dimension {
        1 => body.thickness.sqrt(),
        _ => body.thickness,
    };
    let missing = |axis: usize| axis >= body.dimension;
    let spacing = |axis| {
        if missing(axis) {
            across
        } else {
            lattice.spacing
        }
    };
    let origin = |axis: usize| {
        if missing(axis) {
            lattice.origin[axis] + 0.5 * (lattice.spacing - across)
        } else {
            lattice.origin[axis]
        }
    };
    Ok(CellGrid {
        origin: Vector3::from_fn(|axis, _| origin(axis)),
        spacing: Vector3::from_fn(|axis, _| spacing(axis)),
        dims: lattice.cells,
        plate: missing(2),
    })
}

impl HeatedBody for LatticeBody<'_> {
    fn grid(&self) -> &CellGrid {
        &self.grid
    }

    fn point(&self, cell: [usize; 3]) -> Option<usize> {
        let point = self.body.lattice()?.point(cell.map(|c| c as i64))?;
        let activity = self.activity.as_ref();
        activity
            .is_none_or(|a| is_active(a[point]))
            .then_some(point)
    }

    fn volume(&self, point: usize) -> f64 {
        self.body.points.volume[point]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::block;

    #[test]
    fn a_cell_of_the_grid_has_the_volume_of_a_point_and_its_position_as_centre() {
        for dimension in 1..=3 {
            let mut body = block([3, 1, 1], dimension, "");
            if dimension < 3 {
                body.thickness = 0.25;
                body.points.volume.fill(0.25);
            }
            let target = LatticeBody {
                body: &body,
                grid: grid(&body).expect("a lattice"),
                activity: None,
            };
            let volume = target.volume(target.point([1, 0, 0]).expect("a full block"));
            assert!((target.grid.spacing.product() - volume).abs() < 1e-15);
            let centre = target.grid.origin + 0.5 * target.grid.spacing;
            assert!((centre - body.points.position[0]).norm() < 1e-15);
        }
    }
}
