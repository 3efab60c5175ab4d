//! Point source: all power in the cells around the lattice vertex nearest the source.
//!
//! `h = Q / (n V)` on n cells of volume V: the 2 × 2 around the vertex on the heated face, or the
//! 2 × 2 × 2 around a vertex inside the body (Wang (2025), eq. 7.27). The source hops from vertex
//! to vertex. The dwell is centred, vertex `i = floor(v t / dx + 1/2)`: hopping on arrival (eq.
//! 7.19) lags by half a spacing and costs 9 to 11 % ahead of the source (spec 02, section 1.7).
//!
//! Not for temperatures within a horizon of the source: the peak depends on the phase of the hop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Deposit, Grid, HeatedSurface, SourceError, Target, whole, within};
use crate::toolpath::Pose;

/// A point source that hops from lattice vertex to lattice vertex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Power where the toolpath gives none [W].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// Part of the power that enters the body, 0 to 1; default 1.
    #[serde(default = "whole")]
    pub efficiency: f64,
    /// When the source hops to the next vertex; default `centred`.
    #[serde(default)]
    pub dwell: Dwell,
    /// The heated face, which bounds the cells from above; default z_max at the height of the
    /// toolpath. Give its level to move the source inside the body.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

/// When a point source hops to the next vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dwell {
    /// Half way between two vertices.
    #[default]
    Centred,
    /// On arrival at the next vertex.
    OnArrival,
}

impl Point {
    pub(super) fn checked(&self) -> Result<Self, SourceError> {
        within("efficiency", self.efficiency, 0.0, 1.0)?;
        Ok(self.clone())
    }

    pub(super) fn add(
        &self,
        target: &(impl Target + ?Sized),
        pose: &Pose,
        asked: f64,
        values: &mut [f64],
    ) -> Deposit {
        let grid = target.grid();
        let [xs, ys, zs] = [0, 1, 2].map(|axis| self.cells(grid, pose, axis));
        let number = [&xs, &ys, &zs].map(|[first, last]| last - first + 1);
        let share = asked / number.iter().product::<i64>() as f64;
        let mut deposit = Deposit {
            asked,
            ..Deposit::default()
        };
        for z in zs[0]..=zs[1] {
            for y in ys[0]..=ys[1] {
                for x in xs[0]..=xs[1] {
                    match point_at(target, [x, y, z]) {
                        Some(point) => {
                            values[point] += share / target.volume(point);
                            deposit.deposited += share;
                        }
                        None => deposit.lost += share,
                    }
                }
            }
        }
        deposit
    }

    /// First and last cell along an axis.
    fn cells(&self, grid: &Grid, pose: &Pose, axis: usize) -> [i64; 2] {
        if grid.is_thickness(axis) {
            return [0, 0];
        }
        let vertex = nearest_vertex(grid, pose, axis, self.dwell);
        let face = self.heated_surface.face;
        if axis != face.axis() {
            return [vertex - 1, vertex];
        }
        let vertex = nearest_vertex(grid, pose, axis, Dwell::Centred);
        let level = match self.heated_surface.level {
            Some(level) => grid.in_cells(axis, level).round() as i64,
            None => vertex,
        };
        if face.is_max() {
            let top = level - 1;
            [(vertex - 1).min(top), vertex.min(top)]
        } else {
            [(vertex - 1).max(level), vertex.max(level)]
        }
    }
}

/// Index of the plane between cells where the source dwells.
fn nearest_vertex(grid: &Grid, pose: &Pose, axis: usize, dwell: Dwell) -> i64 {
    let at = grid.in_cells(axis, pose.position[axis]);
    let travel = pose.direction[axis];
    let vertex = match dwell {
        Dwell::OnArrival if travel > 1e-9 => at.floor(),
        Dwell::OnArrival if travel < -1e-9 => at.ceil(),
        // a tie, the source on a line of cell centres, goes up whatever the rounding
        Dwell::OnArrival | Dwell::Centred => (at + 0.5 + 1e-9).floor(),
    };
    vertex as i64
}

fn point_at(target: &(impl Target + ?Sized), cell: [i64; 3]) -> Option<usize> {
    let mut inside = [0; 3];
    for axis in 0..3 {
        inside[axis] = usize::try_from(cell[axis])
            .ok()
            .filter(|&index| index < target.grid().dims[axis])?;
    }
    target.point(inside)
}
