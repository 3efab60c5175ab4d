//! Depths along a beam, inside the metal that it heats.
//!
//! The depth of a cell of the region above an isotherm counts from the surface that a ray against the beam meets, through metal
//! without a gap. Only rays whose surface is a part of the region count: metal that lies over the region and is not molten at its
//! surface, such as the web beside a fillet, is no depth, and neither is the opposite wall of a pipe. Where no ray has a molten
//! surface, the depth counts from the surface before the hottest point.

use super::cells::CellValues;
use super::directions::dot;
use super::{axis_of, extent, profile};

/// End of the region above an isotherm along the beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Penetration {
    /// largest depth, m
    pub depth: f64,
    /// largest depth over the thickness of the metal there
    pub fraction: f64,
}

/// The region above an isotherm that is connected with a cell.
pub(super) struct Region<'a> {
    pub cells: &'a CellValues<'a>,
    pub isotherm: f64,
    /// whether each cell is in the region
    pub is_inside: Vec<bool>,
}

impl<'a> Region<'a> {
    /// The region around a cell, of the cells `within` only.
    pub fn around(
        cells: &'a CellValues<'a>,
        from: usize,
        isotherm: f64,
        within: impl Fn([f64; 3]) -> bool,
    ) -> Self {
        let mut is_inside = vec![false; cells.values.len()];
        is_inside[from] = true;
        let mut open = vec![from];
        while let Some(index) = open.pop() {
            for beside in cells.neighbours(cells.cell(index)) {
                let Some(next) = cells.index(beside) else {
                    continue;
                };
                let joins = !is_inside[next] && cells.values[next] >= isotherm;
                if joins && within(cells.centre(beside)) {
                    is_inside[next] = true;
                    open.push(next);
                }
            }
        }
        Region {
            cells,
            isotherm,
            is_inside,
        }
    }

    /// All cells above an isotherm, connected or not.
    pub fn above(cells: &'a CellValues<'a>, isotherm: f64) -> Self {
        let is_inside = cells.values.iter().map(|value| *value >= isotherm);
        Region {
            cells,
            isotherm,
            is_inside: is_inside.collect(),
        }
    }

    pub fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.is_inside.iter().enumerate();
        all.filter(|(_, is_inside)| **is_inside)
            .map(|(index, _)| index)
    }

    /// The values of the region and of the colder cells near it; other regions above the isotherm are left out.
    pub fn alone(&self) -> Vec<f64> {
        /// cells around the region that parabolas and interpolation may need
        const NEAR: i64 = 3;
        let mut is_near = self.is_inside.clone();
        for index in self.indices() {
            let cell = self.cells.cell(index);
            let is_border = |c: &[i64; 3]| self.cells.index(*c).is_none_or(|i| !self.is_inside[i]);
            if !self.cells.neighbours(cell).any(|beside| is_border(&beside)) {
                continue;
            }
            let reach = [0, 1, 2].map(|a| {
                if self.cells.grid.cells[a] > 1 {
                    NEAR
                } else {
                    0
                }
            });
            for k in -reach[2]..=reach[2] {
                for j in -reach[1]..=reach[1] {
                    for i in -reach[0]..=reach[0] {
                        let near = [cell[0] + i, cell[1] + j, cell[2] + k];
                        if let Some(near) = self.cells.index(near) {
                            is_near[near] |= self.cells.values[near] < self.isotherm;
                        }
                    }
                }
            }
        }
        let values = self.cells.values.iter().zip(is_near);
        values
            .map(|(value, is_near)| if is_near { *value } else { f64::NAN })
            .collect()
    }

    /// Largest depth along the beam, a unit vector; `hottest` is a cell of the region.
    pub fn penetration(&self, hottest: usize, beam: [f64; 3]) -> Option<Penetration> {
        let mut deepest: Option<Penetration> = None;
        let mut add = |found: Penetration| {
            let is_deeper = deepest.is_none_or(|d| found.depth > d.depth);
            deepest = if is_deeper { Some(found) } else { deepest };
        };
        let spacing = self.cells.grid.spacing;
        for index in self.indices() {
            let (surface, up) = self.cells.ray(index, beam.map(|x| -x));
            if !self.is_inside[surface] {
                continue;
            }
            let (last, down) = self.cells.ray(index, beam);
            // in the last cell the metal ends where the ray leaves the cell
            let below = match self.end_below(index, beam) {
                Some(below) => below.min(down),
                None if last == index => down,
                None => down.min(0.5),
            };
            add(Penetration {
                depth: (up + below) * spacing,
                fraction: (up + below) / (up + down),
            });
        }
        let Some(deepest) = deepest else {
            return self.below_surface(hottest, beam);
        };
        // between the columns it may reach deeper
        let depth = axis_of(beam).and_then(|axis| self.column_depth(axis, beam[axis] > 0.0));
        Some(Penetration {
            depth: depth.map_or(deepest.depth, |depth| depth.max(deepest.depth)),
            ..deepest
        })
    }

    /// Depth of a region whose surface is not molten.
    fn below_surface(&self, hottest: usize, beam: [f64; 3]) -> Option<Penetration> {
        let (_, deepest) = self.cells.extent(hottest, self.isotherm, beam, |cell| {
            self.cells.index(cell).is_some_and(|i| self.is_inside[i])
        })?;
        let spacing = self.cells.grid.spacing;
        let (_, up) = self.cells.ray(hottest, beam.map(|x| -x));
        let (_, down) = self.cells.ray(hottest, beam);
        let at = dot(self.cells.centre(self.cells.cell(hottest)), beam);
        let depth = deepest - at + up * spacing;
        Some(Penetration {
            depth,
            fraction: (depth / ((up + down) * spacing)).min(1.0),
        })
    }

    /// Extent of the region from the centre of one of its cells along the beam, in cells: up to where the value,
    /// linear between this centre and the next ones, falls to the isotherm; `None` where it does not fall below.
    fn end_below(&self, index: usize, beam: [f64; 3]) -> Option<f64> {
        let (cell, value) = (self.cells.cell(index), self.cells.values[index]);
        // change of the value along the beam, from the neighbours before it
        let mut change = 0.0;
        let mut is_last = false;
        for axis in (0..3).filter(|&axis| beam[axis].abs() > 1e-9) {
            let mut next = cell;
            next[axis] += if beam[axis] > 0.0 { 1 } else { -1 };
            let Some(next) = self.cells.value(next) else {
                continue;
            };
            is_last |= next < self.isotherm;
            change += beam[axis].abs() * (value - next);
        }
        is_last.then(|| match change > 0.0 {
            // a neighbour along the beam is a cell away at least
            true => ((value - self.isotherm) / change).min(1.0),
            false => 0.0,
        })
    }

    /// Largest depth (m) along an axis: the columns of cells, moved so that their surfaces are at one level, have a profile like
    /// other extents.
    fn column_depth(&self, axis: usize, is_upward: bool) -> Option<f64> {
        let grid = self.cells.grid;
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let (n, counts) = (grid.cells[axis], [grid.cells[u], grid.cells[v]]);
        let cell_at = |[i, j]: [usize; 2], level: usize| {
            let mut cell = [0_i64; 3];
            (cell[u], cell[v]) = (i as i64, j as i64);
            let along = if is_upward { level } else { n - 1 - level };
            cell[axis] = along as i64;
            cell
        };
        // level of the molten surface of each column
        let surface = |column: [usize; 2]| {
            (0..n).find(|&level| {
                let index = self.cells.index(cell_at(column, level));
                let is_first = level == 0 || self.cells.value(cell_at(column, level - 1)).is_none();
                is_first && index.is_some_and(|i| self.is_inside[i])
            })
        };
        let columns = || (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| [i, j]));
        let surfaces: Vec<Option<usize>> = columns().map(surface).collect();
        let of = |[i, j]: [usize; 2]| surfaces[j * counts[0] + i];
        let mut moved = vec![f64::NAN; counts[0] * counts[1] * n];
        for [i, j] in columns() {
            let beside = [
                Some([i, j]),
                i.checked_sub(1).map(|i| [i, j]),
                j.checked_sub(1).map(|j| [i, j]),
                (i + 1 < counts[0]).then(|| [i + 1, j]),
                (j + 1 < counts[1]).then(|| [i, j + 1]),
            ];
            // the colder columns beside molten ones belong to the parabolas between the columns
            let Some(start) = beside.into_iter().flatten().find_map(of) else {
                continue;
            };
            let values = (start..n).map(|level| {
                let index = self.cells.index(cell_at([i, j], level));
                let is_other =
                    |i: usize| self.cells.values[i] >= self.isotherm && !self.is_inside[i];
                index
                    .filter(|i| !is_other(*i))
                    .map_or(f64::NAN, |i| self.cells.values[i])
            });
            let values = values.take_while(|value| !value.is_nan());
            for (level, value) in values.enumerate() {
                moved[(level * counts[1] + j) * counts[0] + i] = value;
            }
        }
        let shape = [counts[0], counts[1], n];
        let (_, to) = extent(&profile(&moved, shape, 2, 3), self.isotherm)?;
        Some((to + 0.5) * grid.spacing)
    }

    /// Extent (m) across, a unit vector, and along the path of the part of the region on the far side of the metal that the
    /// beam pierces; `None` where it pierces none.
    pub fn root(&self, beam: [f64; 3], across: [f64; 3], travel: [f64; 3]) -> Option<[f64; 2]> {
        let is_pierced = |index: usize| {
            let (surface, _) = self.cells.ray(index, beam.map(|x| -x));
            self.is_inside[index] && self.is_inside[surface]
        };
        let is_far = |index: usize| self.cells.ray(index, beam).0 == index;
        let mut root: Vec<usize> = self
            .indices()
            .filter(|&i| is_far(i) && is_pierced(i))
            .collect();
        let mut ends = [(f64::INFINITY, f64::NEG_INFINITY); 2];
        let mut length = 0.0;
        while let Some(first) = root.last().copied() {
            let part = Region::around(self.cells, first, self.isotherm, |centre| {
                let index = self.cells.index_at(centre);
                index.is_some_and(|i| self.is_inside[i] && is_far(i))
            });
            root.retain(|index| !part.is_inside[*index]);
            let within = |cell: [i64; 3]| self.cells.index(cell).is_some_and(is_far);
            let of = |direction| self.cells.extent(first, self.isotherm, direction, within);
            if let (Some(across), Some(along)) = (of(across), of(travel)) {
                ends[0] = (ends[0].0.min(across.0), ends[0].1.max(across.1));
                length += along.1 - along.0;
            }
        }
        (length > 0.0).then(|| [ends[0].1 - ends[0].0, length])
    }
}
