//! Point source: all power in the cells around the lattice vertex nearest the source.
//!
//! `h = Q / (n V)` on n cells of volume V: the 2 × 2 around the vertex on the heated face, or the
//! 2 × 2 × 2 around a vertex inside the body (Wang (2025), eq. 7.27). The source hops from vertex
//! to vertex. The dwell is centred, vertex `i = floor(v t / dx + 1/2)`: hopping on arrival (eq.
//! 7.19) lags by half a spacing and costs 9 to 11 % ahead of the source (`cases/references/point_source_pd.py`).
//!
//! Not for temperatures within a horizon of the source: the peak depends on the phase of the hop.

use perimelt_core::SetupError;
use perimelt_core::solver::ExactSum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use nalgebra::Vector3;

use super::{
    CellGrid, Cells, Deposit, HeatedBody, HeatedSurface, PowerDensity, SourceShape,
    default_efficiency, no_direction,
};
use crate::toolpath::Pose;

/// A point source that hops from lattice vertex to lattice vertex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Power where the toolpath gives none (W).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub power: Option<f64>,
    /// Part of the power that enters the body, 0 to 1; default 1.
    #[serde(default = "default_efficiency")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub efficiency: f64,
    /// When the source hops to the next vertex; default `centred`.
    #[serde(default)]
    pub dwell: Dwell,
    /// The heated face, which bounds the cells from above; default z+ at the height of the
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

impl SourceShape for Point {
    fn power(&self) -> Option<f64> {
        self.power
    }

    fn efficiency(&self) -> f64 {
        self.efficiency
    }

    fn length(&self) -> f64 {
        0.0
    }

    fn surface(&self) -> HeatedSurface {
        self.heated_surface
    }

    fn power_density(&self, _: &CellGrid) -> Result<PowerDensity, SetupError> {
        if self.heated_surface.direction.is_some() {
            return Err(no_direction("a point source"));
        }
        Ok(PowerDensity::Point(self.clone()))
    }
}

impl Point {
    pub(super) fn add(
        &self,
        body: &(impl HeatedBody + ?Sized),
        pose: &Pose,
        asked: f64,
        values: &mut [f64],
    ) -> Deposit {
        let grid = body.grid();
        let [xs, ys, zs] = [0, 1, 2].map(|axis| self.cells(grid, pose, axis));
        let number = [&xs, &ys, &zs].map(|[first, last]| last - first + 1);
        let cell_power = asked / number.iter().product::<i64>() as f64;
        let mut hit = ExactSum::default();
        for z in zs[0]..=zs[1] {
            for y in ys[0]..=ys[1] {
                for x in xs[0]..=xs[1] {
                    if let Some(point) = point_at(body, [x, y, z]) {
                        values[point] += cell_power / body.volume(point);
                        hit.add(1.0);
                    }
                }
            }
        }
        let all = number.iter().product::<i64>() as f64;
        Deposit::of_parts(asked, cell_power, body.total(hit), all)
    }

    /// [`Point::add`] for a body without a lattice: equal parts at the positions half a cell before and behind the source
    /// along each axis, so that the source hops as on a lattice of that spacing.
    pub(super) fn add_to_cells(
        &self,
        cells: &Cells<'_>,
        pose: &Pose,
        asked: f64,
        values: &mut [f64],
        parts: &mut Vec<(usize, f64)>,
    ) -> Deposit {
        let face = self.heated_surface.face;
        let mut source = pose.position;
        if let Some(level) = self.heated_surface.level {
            let at = &mut source[face.axis()];
            *at = if face.is_upper() {
                at.min(level)
            } else {
                at.max(level)
            };
        }
        let inward = -1e-3 * face.normal();
        let size = [source, source + inward * cells.grid.spacing[face.axis()]]
            .iter()
            .find_map(|at| cells.cell_at(at))
            .map_or(cells.grid.spacing[0], |cell| cell.size);
        let is_at_face = match self.heated_surface.level {
            Some(level) => (source[face.axis()] - level).abs() < 0.5 * size,
            None => true,
        };
        let offsets =
            |axis: usize| match (axis < cells.dimension, axis == face.axis() && is_at_face) {
                (false, _) => ([0.0; 2], 1),
                (true, true) => ([0.5 * size * inward[axis].signum(); 2], 1),
                (true, false) => ([-0.5 * size, 0.5 * size], 2),
            };
        let [xs, ys, zs] = [0, 1, 2].map(offsets);
        let fraction = 1.0 / (xs.1 * ys.1 * zs.1) as f64;
        parts.clear();
        let mut hits = 0;
        for z in &zs.0[..zs.1] {
            for y in &ys.0[..ys.1] {
                for x in &xs.0[..xs.1] {
                    let at = source + Vector3::new(*x, *y, *z);
                    if let Some(cell) = cells.cell_for(&at, size) {
                        hits += 1;
                        parts.extend(cell.point.map(|point| (point, fraction)));
                    }
                }
            }
        }
        cells.deposit(parts, asked, fraction * f64::from(hits), true, values)
    }

    /// First and last cell along an axis.
    fn cells(&self, grid: &CellGrid, pose: &Pose, axis: usize) -> [i64; 2] {
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
        if face.is_upper() {
            let top = level - 1;
            [(vertex - 1).min(top), vertex.min(top)]
        } else {
            [(vertex - 1).max(level), vertex.max(level)]
        }
    }
}

/// Index of the plane between cells where the source dwells.
fn nearest_vertex(grid: &CellGrid, pose: &Pose, axis: usize, dwell: Dwell) -> i64 {
    let at = grid.in_cells(axis, pose.position[axis]);
    let travel = pose.direction[axis];
    let vertex = match dwell {
        Dwell::OnArrival if travel > 1e-9 => at.floor(),
        Dwell::OnArrival if travel < -1e-9 => at.ceil(),
        // a source on a line of cell centres belongs to the upper vertex, independent of rounding
        Dwell::OnArrival | Dwell::Centred => (at + 0.5 + 1e-9).floor(),
    };
    vertex as i64
}

fn point_at(body: &(impl HeatedBody + ?Sized), cell: [i64; 3]) -> Option<usize> {
    let mut inside = [0; 3];
    for axis in 0..3 {
        inside[axis] = usize::try_from(cell[axis])
            .ok()
            .filter(|&index| index < body.grid().dims[axis])?;
    }
    body.point(inside)
}

#[cfg(test)]
mod tests {
    use super::super::heated_body::lattice::TestLattice;
    use super::super::tests::{agree, block, depositor, pose};

    #[test]
    fn point_source_hops_half_way_between_vertices() {
        // [Wang2025] 7.5.3: dx = 0.4 mm, 5 mm/s, so 0.08 s per vertex
        let lattice = TestLattice::plate(4e-4, 0.01, 250);
        let columns = |dwell: &str, time: f64, direction: f64| {
            let mut depositor = depositor(&format!("point = {{ dwell = '{dwell}' }}"), &lattice);
            let mut values = lattice.zeros();
            let at = pose([direction * 0.005 * time, 0.0, 0.0], [direction, 0.0, 0.0]);
            depositor.add(&lattice, &at, &mut values);
            // h = Q / (4 dx² H)
            let density = 1000.0 / (4.0 * 1.6e-7 * 0.01);
            let hot: Vec<usize> = (0..values.len())
                .filter(|&point| values[point] != 0.0)
                .collect();
            assert!(hot.iter().all(|&point| agree(values[point], density)));
            assert_eq!(
                hot.iter().map(|point| point / 250).collect::<Vec<_>>(),
                [124, 124, 125, 125]
            );
            [hot[0] % 250, hot[1] % 250]
        };
        for (time, vertex) in [(0.0, 0), (0.0399, 0), (0.0401, 1), (0.08, 1), (4.0, 50)] {
            assert_eq!(
                columns("centred", time, 1.0),
                [124 + vertex, 125 + vertex],
                "at {time} s"
            );
            assert_eq!(
                columns("centred", time, -1.0),
                [124 - vertex, 125 - vertex],
                "at {time} s"
            );
        }
        for (time, vertex) in [(0.0, 0), (0.0401, 0), (0.0799, 0), (0.08, 1), (4.0, 50)] {
            assert_eq!(
                columns("on_arrival", time, 1.0),
                [124 + vertex, 125 + vertex],
                "at {time} s"
            );
            assert_eq!(
                columns("on_arrival", time, -1.0),
                [124 - vertex, 125 - vertex],
                "at {time} s"
            );
        }
    }

    #[test]
    fn point_source_fills_four_cells_on_the_face_and_eight_inside() {
        let lattice = block([4e-4; 3]);
        for (surface, z, cells) in [
            ("", 0.0, 4),
            (", heated_surface = { level = 0.0 }", 0.0, 4),
            (", heated_surface = { level = 0.0 }", 1.0, 4),
            (", heated_surface = { level = 0.0 }", -4e-4, 8),
        ] {
            let mut values = lattice.zeros();
            let at = pose([0.0, 0.0, z], [1.0, 0.0, 0.0]);
            let toml = format!("point = {{ power = 1{surface} }}");
            let deposit = depositor(&toml, &lattice).add(&lattice, &at, &mut values);
            assert_eq!(
                values.iter().filter(|&&value| value > 0.0).count(),
                cells,
                "{surface} {z}"
            );
            assert!(agree(lattice.power(&values), 1000.0) && deposit.lost == 0.0);
        }
    }
}
