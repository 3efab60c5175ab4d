//! The cells of a body, on which heat sources deposit their power: those of its lattice, or of a lattice that covers a
//! body without one.

use std::cell::Ref;
use std::ops::Range;

use nalgebra::Vector3;
use perimelt_core::Body;
use perimelt_core::solver::{ExactSum, Reducer};
use perimelt_core::world::activity::is_active;

use super::shape::{CellGrid, GatheredCells, HeatedBody};

/// A body with its lattice.
pub(super) struct LatticeBody<'a> {
    pub body: &'a Body,
    pub grid: CellGrid,
    /// Points with material, where material is deposited.
    pub activity: Option<Ref<'a, [f64]>>,
    pub state: AbsorbingState<'a>,
    /// Which points this process owns: it heats no other ones.
    pub reducer: Reducer,
}

/// The state of the points on which the absorption of a source depends.
pub(super) enum AbsorbingState<'a> {
    None,
    /// Fraction of the first of two fluids, at whose interface a source is absorbed.
    Fraction(Ref<'a, [f64]>),
    /// Enthalpies (J/m³) of the points, and of each material when it boils; size of the step, s.
    Boiling {
        enthalpy: Ref<'a, [f64]>,
        limits: &'a [f64],
        step: f64,
    },
}

/// The lattice of a body, or one of its finest spacing that covers it. Missing axes have one cell with the extent of the
/// body: its thickness along z in 2D, a square of its cross-section in 1D.
pub(crate) fn grid(body: &Body) -> CellGrid {
    let across = match body.dimension {
        1 => body.thickness.sqrt(),
        _ => body.thickness,
    };
    let missing = |axis: usize| axis >= body.dimension;
    let Some(lattice) = body.lattice() else {
        return covering(body, across);
    };
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
    CellGrid {
        origin: Vector3::from_fn(|axis, _| origin(axis)),
        spacing: Vector3::from_fn(|axis, _| spacing(axis)),
        dims: lattice.cells,
        plate: missing(2),
    }
}

/// A lattice that covers a body without one; `across` is the extent along missing axes, m.
fn covering(body: &Body, across: f64) -> CellGrid {
    let (low, high) = body.bounds();
    let finest = body.finest_spacing();
    let is_there = |axis: usize| axis < body.dimension;
    CellGrid {
        origin: Vector3::from_fn(|axis, _| match is_there(axis) {
            true => low[axis],
            false => 0.5 * (low[axis] + high[axis] - across),
        }),
        spacing: Vector3::from_fn(|axis, _| if is_there(axis) { finest } else { across }),
        dims: std::array::from_fn(|axis| match is_there(axis) {
            true => ((high[axis] - low[axis]) / finest).ceil().max(1.0) as usize,
            false => 1,
        }),
        plate: !is_there(2),
    }
}

impl HeatedBody for LatticeBody<'_> {
    fn grid(&self) -> &CellGrid {
        &self.grid
    }

    fn point(&self, cell: [usize; 3]) -> Option<usize> {
        let point = self.body.lattice()?.point(cell.map(|c| c as i64))?;
        let activity = self.activity.as_ref();
        let is_here = point < self.reducer.owned() && activity.is_none_or(|a| is_active(a[point]));
        is_here.then_some(point)
    }

    fn total(&self, own: ExactSum) -> f64 {
        self.reducer.total(own)
    }

    fn gathered(&self, cells: [Range<usize>; 3]) -> Option<GatheredCells> {
        let processes = self.reducer.processes();
        (processes.size() > 1).then(|| GatheredCells::of(self, processes, cells))
    }

    fn volume(&self, point: usize) -> f64 {
        self.body.points.volume[point]
    }

    fn first_fluid(&self, point: usize) -> Option<f64> {
        match &self.state {
            AbsorbingState::Fraction(fraction) => Some(fraction[point]),
            _ => None,
        }
    }

    fn boiling_power(&self, point: usize) -> f64 {
        match &self.state {
            AbsorbingState::Boiling {
                enthalpy,
                limits,
                step,
            } => {
                let limit = limits[usize::from(self.body.material_of_point[point])];
                f64::max(limit - enthalpy[point], 0.0) / step
            }
            _ => f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::block;
    use perimelt_core::World;

    #[test]
    fn a_cell_of_the_grid_has_the_volume_of_a_point_and_its_position_as_centre() {
        for dimension in 1..=3 {
            let mut body = block([3, 1, 1], dimension, "");
            if dimension < 3 {
                body.thickness = 0.25;
                body.points.volume.fill(0.25);
            }
            let target = LatticeBody {
                reducer: World::new(vec![body.clone()]).reducer(0),
                body: &body,
                grid: grid(&body),
                activity: None,
                state: AbsorbingState::None,
            };
            let volume = target.volume(target.point([1, 0, 0]).expect("a full block"));
            assert!((target.grid.spacing.product() - volume).abs() < 1e-15);
            let centre = target.grid.origin + 0.5 * target.grid.spacing;
            assert!((centre - body.points.position.at(0)).norm() < 1e-15);
        }
    }
}
