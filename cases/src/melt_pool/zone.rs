//! The zone that a heat source leaves behind: where the highest temperatures reach an isotherm.
//!
//! The area of a section is the sum over the cells of the area of the plane within the cell times the fraction of the cell
//! above the isotherm, the same fraction as for volumes.
//!
//! Where all logged directions of the source are within 10 degrees, the extents are those of a melt pool, and the area is that
//! of the largest section normal to the direction of travel.
//!
//! On a path that turns, no single direction is the one across. Sections are taken normal to the direction of travel of the
//! source in each logged state, through its position, and only the part of the section that is connected with the place
//! of the source counts. A section that reaches a corner, or a part of the path with another direction, is left out: it cuts
//! that part lengthwise. There is no length. The resolution is that of the logged states.

use super::cells::{CellValues, area_within_cell};
use super::directions::{SourceState, dot};
use super::steady::STRAIGHT;
use super::{Aim, Directions, MeltPoolGauge, axis_of};

/// Cosine of the largest angle between directions of travel or of beams that count as one, 10 degrees.
const ONE_DIRECTION: f64 = 0.985;

/// Most sections across a path that turns; more states than these are thinned.
const MOST_SECTIONS: usize = 500;

/// The region in which the highest temperatures reach an isotherm.
#[derive(Clone, Debug)]
pub(crate) struct Zone {
    /// extent along the direction of travel, m; `None` on a path that turns
    pub length: Option<f64>,
    /// as for a melt pool, m
    pub depth: Option<f64>,
    /// the largest section, or those of the logged states on a path that turns; `None` for one that is left out
    sections: Vec<Option<Section>>,
}

/// A section normal to the direction of travel.
#[derive(Clone, Copy, Debug)]
struct Section {
    /// smallest and largest coordinate across, m; `None` if the body does not have that direction
    sides: Option<[f64; 2]>,
    /// extent across, m, with its mirror image behind a plane of symmetry
    width: Option<f64>,
    /// m², with its mirror images; `None` for a body that is not three-dimensional
    area: Option<f64>,
}

impl Zone {
    /// Whether the path turns, so that there is no length.
    pub(crate) fn turns(&self) -> bool {
        self.length.is_none()
    }

    /// Largest width of the sections, m.
    pub(crate) fn width(&self) -> Option<f64> {
        self.largest(|section| section.width)
    }

    /// Largest area of the sections, m².
    pub(crate) fn area(&self) -> Option<f64> {
        self.largest(|section| section.area)
    }

    fn largest(&self, size: impl Fn(&Section) -> Option<f64>) -> Option<f64> {
        let sizes = self.sections.iter().flatten().filter_map(size);
        sizes.max_by(f64::total_cmp)
    }

    /// Largest distance (m) across the path from the border of an inner zone to that of this one, of both sides.
    pub(crate) fn width_beside(&self, inner: &Zone) -> Option<f64> {
        let both = self.sections.iter().zip(&inner.sections);
        let beside = both.filter_map(|(outer, inner)| {
            let (outer, inner) = (outer.as_ref()?.sides?, inner.as_ref()?.sides?);
            Some((inner[0] - outer[0]).max(outer[1] - inner[1]))
        });
        beside.max_by(f64::total_cmp)
    }
}

impl MeltPoolGauge {
    /// The zone in which the highest temperatures (K), one per point, reach the isotherm; `None` if there is none. The
    /// sources of `aim` are all states of the path.
    pub(crate) fn zone(&self, highest: &[f64], aim: Aim<'_>) -> Option<Zone> {
        let pool = self.measure(highest, aim)?;
        let values = self.grid.by_cell(highest);
        let cells = CellValues {
            grid: &self.grid,
            values: &values,
        };
        let fractions = cells.fractions_above(self.isotherm);
        let fractions = fractions.filter(|(_, fraction)| *fraction > 0.0).collect();
        let cut = Cut {
            gauge: self,
            cells,
            fractions,
            halves: self.halves(&values),
        };
        if !turns(aim.sources) || pool.peak.is_nan() {
            let area = || match pool.peak.is_nan() {
                true => f64::NAN,
                false => cut.largest_area(pool.travel),
            };
            let section = Section {
                sides: pool.sides,
                width: pool.width,
                area: (self.dimension == 3).then(area),
            };
            return Some(Zone {
                length: Some(pool.length()),
                depth: pool.depth,
                sections: vec![Some(section)],
            });
        }
        let thinned = aim.sources.len().div_ceil(MOST_SECTIONS).max(1);
        let states = (0..aim.sources.len()).step_by(thinned);
        let sections = states.map(|state| {
            let directions = aim.sources[state].directions(aim.otherwise);
            cut.across(aim.sources, state, directions)
        });
        Some(Zone {
            length: None,
            depth: pool.depth,
            sections: sections.collect(),
        })
    }
}

/// A region above an isotherm that is cut by planes.
struct Cut<'a> {
    gauge: &'a MeltPoolGauge,
    cells: CellValues<'a>,
    /// of the cells that are not below the isotherm as a whole
    fractions: Vec<(usize, f64)>,
    /// by axis, 2 where a plane of symmetry normal to it cuts the region
    halves: [f64; 3],
}

impl Cut<'_> {
    fn along(&self, cell: usize, direction: [f64; 3]) -> f64 {
        dot(self.cells.centre(self.cells.cell(cell)), direction)
    }

    /// Area (m²) of the largest of the sections normal to `travel` that are one spacing apart.
    fn largest_area(&self, travel: [f64; 3]) -> f64 {
        let spacing = self.cells.grid.spacing;
        let start = dot(self.cells.grid.origin, travel);
        let mut areas = std::collections::BTreeMap::<i64, f64>::new();
        for &(cell, fraction) in &self.fractions {
            // a plane lies less than a spacing from the centre of a cell that it cuts
            let at = (self.along(cell, travel) - start) / spacing;
            let nearest = at.round() as i64;
            for plane in nearest - 1..=nearest + 1 {
                let area = area_within_cell(plane as f64 - at, travel);
                *areas.entry(plane).or_default() += fraction * area;
            }
        }
        let largest = areas.into_values().fold(0.0, f64::max);
        self.mirrored(travel, None) * largest * spacing.powi(2)
    }

    /// Number of equal parts of a section normal to `travel`, which planes of symmetry cut, but those normal to an axis.
    fn mirrored(&self, travel: [f64; 3], without: Option<usize>) -> f64 {
        let is_cut = |&axis: &usize| travel[axis].abs() < 1e-6 && Some(axis) != without;
        let cut = (0..3).filter(is_cut);
        cut.map(|axis| self.halves[axis]).product()
    }

    /// The section through the source in a state of its path; `None` if nothing lies there, or if it reaches a corner or a
    /// part of the path with another direction.
    fn across(&self, path: &[SourceState], state: usize, d: Directions) -> Option<Section> {
        let (cells, spacing) = (&self.cells, self.cells.grid.spacing);
        let (travel, across) = (d.travel, d.across());
        let position = path[state].position;
        if !self.gauge.has(across) {
            return None;
        }
        let at = dot(position, travel);
        let half = 0.5 * spacing * travel.iter().map(|x| x.abs()).sum::<f64>();
        // the cells that the plane cuts, which have faces in common
        let within = |centre: [f64; 3]| (dot(centre, travel) - at).abs() <= half * (1.0 + 1e-9);
        let above = self
            .fractions
            .iter()
            .map(|(cell, _)| *cell)
            .filter(|&cell| {
                let centre = cells.centre(cells.cell(cell));
                cells.values[cell] >= self.gauge.isotherm && within(centre)
            });
        let away = |cell: usize| distance(cells.centre(cells.cell(cell)), position);
        let nearest = above.min_by(|&a, &b| away(a).total_cmp(&away(b)))?;
        let (from, to) = cells.extent(nearest, self.gauge.isotherm, across, |cell| {
            within(cells.centre(cell))
        })?;
        let middle = dot(position, across);
        if meets_another(path, state, (middle - from).max(to - middle)) {
            return None;
        }
        let axis = axis_of(across);
        let mirrored = if self.ends_at_symmetry([from, to], across) {
            2.0
        } else {
            1.0
        };
        let is_near = |cell: usize| {
            let across = self.along(cell, across);
            across >= from - spacing && across <= to + spacing
        };
        let near = self.fractions.iter().filter(|(cell, _)| is_near(*cell));
        let areas = near.map(|&(cell, fraction)| {
            fraction * area_within_cell((at - self.along(cell, travel)) / spacing, travel)
        });
        let copies = mirrored * self.mirrored(travel, axis);
        let area = copies * areas.sum::<f64>() * spacing.powi(2);
        Some(Section {
            sides: Some([from, to]),
            width: Some(mirrored * (to - from)),
            area: (self.gauge.dimension == 3).then_some(area),
        })
    }

    /// Whether a section ends at a plane of symmetry normal to the direction across.
    fn ends_at_symmetry(&self, sides: [f64; 2], across: [f64; 3]) -> bool {
        let grid = self.cells.grid;
        self.gauge.symmetry.iter().any(|face| {
            let axis = face.axis();
            let plane =
                (grid.origin[axis] + self.gauge.face_in_cells(*face) * grid.spacing) * across[axis];
            let is_there = |side: f64| (side - plane).abs() < 1e-6 * grid.spacing;
            axis_of(across) == Some(axis) && sides.into_iter().any(is_there)
        })
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let away = [0, 1, 2].map(|axis| a[axis] - b[axis]);
    dot(away, away).sqrt()
}

/// Whether two states have directions of travel along different lines, by the cosine of the angle.
fn is_turned(a: &SourceState, b: &SourceState, cosine: f64) -> bool {
    match (a.travel, b.travel) {
        (Some(a), Some(b)) => dot(a, b).abs() < cosine,
        _ => false,
    }
}

/// Whether the directions of travel or of the beam change.
fn turns(path: &[SourceState]) -> bool {
    let Some((first, rest)) = path.split_first() else {
        return false;
    };
    let is_other = |state: &SourceState| {
        is_turned(first, state, ONE_DIRECTION) || dot(first.beam, state.beam) < ONE_DIRECTION
    };
    rest.iter().any(is_other)
}

/// Whether another part of the path, or a corner between two logged states, is nearer (m) than the end of a section.
fn meets_another(path: &[SourceState], state: usize, reach: f64) -> bool {
    let here = &path[state];
    let is_at_corner = |other: usize| {
        let pair = |first: usize| match path.get(first..first + 2) {
            Some([a, b]) => is_turned(a, b, STRAIGHT),
            _ => false,
        };
        pair(other) || other.checked_sub(1).is_some_and(pair)
    };
    (0..path.len()).any(|other| {
        distance(path[other].position, here.position) <= reach
            && (is_turned(here, &path[other], STRAIGHT) || is_at_corner(other))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell_grid::CellGrid;
    use crate::melt_pool::Travel;
    use perimelt_core::Face;
    use std::f64::consts::PI;

    const SPACING: f64 = 1e-4;

    /// Half axes of the section of the zone, m.
    const HALF: [f64; 2] = [8.2e-4, 5.3e-4];

    /// Cell centres of a plate whose surface is at z = 0, its corner at `from`, in cells.
    fn plate(from: [i32; 2], cells: [i32; 3]) -> Vec<[f64; 3]> {
        let mut positions = Vec::new();
        for k in -cells[2]..0 {
            for j in from[1]..from[1] + cells[1] {
                for i in from[0]..from[0] + cells[0] {
                    positions.push([i, j, k].map(|x| (f64::from(x) + 0.5) * SPACING));
                }
            }
        }
        positions
    }

    /// 1500 K at a distance from a segment in the plane z = 0: half an ellipse in each section, with round ends.
    fn around(p: [f64; 3], [from, to]: [[f64; 2]; 2], half: [f64; 2]) -> f64 {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        let unit = along.map(|x| x / length);
        let (x, y) = (p[0] - from[0], p[1] - from[1]);
        let nearest = (x * unit[0] + y * unit[1]).clamp(0.0, length);
        let away = (x - nearest * unit[0]).hypot(y - nearest * unit[1]);
        2000.0 - 500.0 * ((away / half[0]).powi(2) + (p[2] / half[1]).powi(2))
    }

    fn gauge(positions: &[[f64; 3]], symmetry: &[Face]) -> MeltPoolGauge {
        let grid = CellGrid::new(positions, SPACING).expect("a lattice");
        MeltPoolGauge::on(grid, (3, 1.0), 1500.0).with_symmetry(symmetry)
    }

    fn state(position: [f64; 2], travel: [f64; 2]) -> SourceState {
        SourceState {
            position: [position[0], position[1], 0.0],
            travel: Some([travel[0], travel[1], 0.0]),
            beam: [0.0, 0.0, -1.0],
            power: 1.0,
            path: 0.0,
        }
    }

    fn measured(gauge: &MeltPoolGauge, highest: &[f64], path: &[SourceState]) -> Zone {
        let aim = Aim {
            sources: path,
            ..Aim::fixed(Travel::X)
        };
        gauge.zone(highest, aim).expect("a zone")
    }

    /// Fractions of cells with linear values, five and more cells in each half axis.
    const TOLERANCE: f64 = 0.01;

    fn close(found: Option<f64>, expected: f64) {
        let ratio = found.expect("measured") / expected;
        assert!((ratio - 1.0).abs() < TOLERANCE, "{ratio} times {expected}");
    }

    #[test]
    fn the_area_of_a_straight_zone_is_that_of_half_an_ellipse() {
        let line = [[-10e-4, 0.0], [10e-4, 0.0]];
        let of = |positions: &[[f64; 3]], symmetry: &[Face]| {
            let highest: Vec<f64> = positions.iter().map(|p| around(*p, line, HALF)).collect();
            measured(&gauge(positions, symmetry), &highest, &[])
        };
        let area = 0.5 * PI * HALF[0] * HALF[1];
        let whole = of(&plate([-25, -12], [50, 24, 8]), &[]);
        close(whole.area(), area);
        assert!(!whole.turns());
        // the plane of symmetry that the zone reaches, and one that it does not reach
        let half = of(&plate([-25, 0], [50, 12, 8]), &[Face::YMin, Face::YMax]);
        close(half.area(), area);
        close(half.width(), 2.0 * HALF[0]);
        // without the plane of symmetry, the half that is there
        close(of(&plate([-25, 0], [50, 12, 8]), &[]).area(), 0.5 * area);
    }

    #[test]
    fn the_area_across_an_oblique_path_is_that_of_half_an_ellipse() {
        let positions = plate([-25, -25], [50, 50, 8]);
        for degrees in [20.0_f64, 45.0, 70.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let line = [[-10e-4 * cos, -10e-4 * sin], [10e-4 * cos, 10e-4 * sin]];
            let highest: Vec<f64> = positions.iter().map(|p| around(*p, line, HALF)).collect();
            let path = [state(line[0], [cos, sin]), state(line[1], [-cos, -sin])];
            let zone = measured(&gauge(&positions, &[]), &highest, &path);
            close(zone.area(), 0.5 * PI * HALF[0] * HALF[1]);
            close(zone.width(), 2.0 * HALF[0]);
        }
    }

    #[test]
    fn the_width_beside_an_inner_zone_is_that_of_the_wider_side() {
        let positions = plate([-25, -16], [50, 40, 8]);
        let line = |y: f64| [[-10e-4, y], [10e-4, y]];
        let of = |y: f64, half: [f64; 2]| {
            let highest: Vec<f64> = positions
                .iter()
                .map(|p| around(*p, line(y), half))
                .collect();
            measured(&gauge(&positions, &[]), &highest, &[])
        };
        let (inner, outer) = (of(0.0, HALF), of(3e-4, [14.1e-4, 7.7e-4]));
        // their sides are at 8.2 and 17.1
        close(outer.width_beside(&inner), 8.9e-4);
    }

    /// A seam along x that turns by an angle, and its states, one each 4e-4 m.
    fn corner(positions: &[[f64; 3]], degrees: f64) -> (Vec<f64>, Vec<SourceState>) {
        const LEG: f64 = 44e-4;
        let (sin, cos) = degrees.to_radians().sin_cos();
        let legs = [[[-LEG, 0.0], [0.0; 2]], [[0.0; 2], [LEG * cos, LEG * sin]]];
        let highest = |p: &[f64; 3]| around(*p, legs[0], HALF).max(around(*p, legs[1], HALF));
        let along = |step: i32| 4e-4 * f64::from(step);
        let first = (-11..=0).map(|step| state([along(step), 0.0], [1.0, 0.0]));
        let second = (1..=11).map(|step| {
            let at = along(step);
            state([at * cos, at * sin], [cos, sin])
        });
        (
            positions.iter().map(highest).collect(),
            first.chain(second).collect(),
        )
    }

    #[test]
    fn sections_follow_the_direction_of_a_path_that_turns() {
        let positions = plate([-56, -14], [112, 70, 8]);
        for degrees in [30.0, 60.0, 90.0, 120.0] {
            let (highest, path) = corner(&positions, degrees);
            let zone = measured(&gauge(&positions, &[]), &highest, &path);
            assert!(zone.turns(), "{degrees}");
            close(zone.width(), 2.0 * HALF[0]);
            close(zone.area(), 0.5 * PI * HALF[0] * HALF[1]);
            close(zone.depth, HALF[1]);
        }
    }

    #[test]
    fn a_section_that_ends_at_a_plane_of_symmetry_is_doubled() {
        // the first leg lies in the plane
        let positions = plate([-56, 0], [112, 56, 8]);
        let (highest, path) = corner(&positions, 90.0);
        // of the second leg only the state at the corner, through which no section counts
        let zone = measured(&gauge(&positions, &[Face::YMin]), &highest, &path[..13]);
        close(zone.width(), 2.0 * HALF[0]);
        close(zone.area(), 0.5 * PI * HALF[0] * HALF[1]);
    }

    #[test]
    fn a_torch_that_is_inclined_anew_turns_the_path() {
        let upright = state([0.0; 2], [1.0, 0.0]);
        let inclined = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let beam = [0.0, sin, -cos];
            SourceState { beam, ..upright }
        };
        assert!(!turns(&[upright, inclined(8.0)]));
        assert!(turns(&[upright, inclined(12.0)]));
    }

    #[test]
    fn a_path_with_no_section_across_has_no_width() {
        let positions = plate([-56, -14], [112, 70, 8]);
        let (highest, path) = corner(&positions, 90.0);
        // the ends of the legs only: the corner lies somewhere between
        let ends = [path[0], path[22]];
        let zone = measured(&gauge(&positions, &[]), &highest, &ends);
        assert_eq!((zone.length, zone.width(), zone.area()), (None, None, None));
        close(zone.depth, HALF[1]);
    }
}
