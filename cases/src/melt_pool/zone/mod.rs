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
//! of the source counts. A section that reaches a corner, or a part of the path whose sections have another direction, is left
//! out: it cuts that part lengthwise. Sections around a pipe have one direction across, that of its axis. There is no length.
//! The resolution is that of the logged states.
//!
//! Depths lie along the beam, from the molten surface (`depth`). Where the beam turns, as around a pipe, each section has the
//! depth along its own beam, and the largest one counts.

use super::cells::{CellValues, area_within_cell};
use super::depth::{Penetration, Region};
use super::directions::{ONE_DIRECTION, SourceState, dot};
use super::steady::STRAIGHT;
use super::{Aim, Directions, MeltPool, MeltPoolGauge, axis_of};

/// Most sections across a path that turns; more states than these are thinned.
const MOST_SECTIONS: usize = 500;

/// The region in which the highest temperatures reach an isotherm.
#[derive(Clone, Debug)]
pub(crate) struct Zone {
    /// extent along the direction of travel, m; `None` where that turns
    pub length: Option<f64>,
    /// whether the direction of travel or the beam turns
    pub turns: bool,
    /// penetration along the beam from the molten surface; the largest one of the sections where the beam turns
    pub penetration: Option<Penetration>,
    /// the root, where the beam pierces the metal
    pub root: Option<Root>,
    /// the largest section, or those of the logged states on a path that turns; `None` for one that is left out
    sections: Vec<Option<ZoneSection>>,
}

/// The side of a zone that lies on the far side of the metal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root {
    /// largest extent across, m
    pub width: f64,
    /// fraction of the length of the zone in which the beam pierces the metal
    pub fraction: f64,
}

/// A section normal to the direction of travel.
#[derive(Clone, Copy, Debug)]
struct ZoneSection {
    /// smallest and largest coordinate across, m; `None` if the body does not have that direction
    sides: Option<[f64; 2]>,
    /// extent across, m, with its mirror image behind a plane of symmetry
    width: Option<f64>,
    /// m², with its mirror images; `None` for a body that is not three-dimensional
    area: Option<f64>,
    /// penetration along the beam of the section
    penetration: Option<Penetration>,
    /// width of the root, m; `None` where the beam does not pierce the metal
    root: Option<f64>,
}

impl Zone {
    /// Largest width of the sections, m.
    pub(crate) fn width(&self) -> Option<f64> {
        self.largest(|section| section.width)
    }

    /// Largest area of the sections, m².
    pub(crate) fn area(&self) -> Option<f64> {
        self.largest(|section| section.area)
    }

    /// Largest depth along the beam, m.
    pub(crate) fn depth(&self) -> Option<f64> {
        self.penetration.map(|penetration| penetration.depth)
    }

    fn largest(&self, size: impl Fn(&ZoneSection) -> Option<f64>) -> Option<f64> {
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
        let present = (0..values.len()).filter(|&cell| !values[cell].is_nan());
        let hottest = present.max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let cut = CutRegion {
            gauge: self,
            hottest,
            cells,
            fractions,
            halves: self.halves(&values),
        };
        let unknown = pool.depth.map(|depth| Penetration {
            depth,
            fraction: f64::NAN,
        });
        if pool.peak.is_nan() {
            return Some(Zone {
                length: Some(pool.length()),
                turns: false,
                penetration: unknown,
                root: None,
                sections: vec![Some(ZoneSection::of_pool(&pool, self, f64::NAN))],
            });
        }
        let whole = Region::above(&cut.cells, self.isotherm);
        let directions = aim.at(cut.hottest_place());
        let beam = Some(directions.beam).filter(|beam| self.has(*beam));
        let penetration = beam.and_then(|beam| whole.penetration(cut.hottest, beam));
        let across = Some(directions.across()).filter(|across| self.has(*across));
        if !turns(aim.sources) {
            let section = ZoneSection::of_pool(&pool, self, cut.largest_area(pool.travel));
            let root = beam.zip(across).and_then(|(beam, across)| {
                let [width, length] = whole.root(beam, across, directions.travel)?;
                let mirrored = axis_of(across).map_or(1.0, |axis| cut.halves[axis]);
                Some(Root {
                    width: mirrored * width,
                    fraction: (length / pool.length()).min(1.0),
                })
            });
            return Some(Zone {
                length: Some(pool.length()),
                turns: false,
                penetration,
                root,
                sections: vec![Some(section)],
            });
        }
        let thinned = aim.sources.len().div_ceil(MOST_SECTIONS).max(1);
        let states = (0..aim.sources.len()).step_by(thinned);
        let sections = states.map(|state| {
            let directions = aim.sources[state].directions(aim.otherwise);
            cut.across(aim.sources, state, directions)
        });
        let sections: Vec<Option<ZoneSection>> = sections.collect();
        let there = || sections.iter().flatten();
        let roots = there().filter_map(|section| section.root);
        let width = roots.clone().fold(0.0, f64::max);
        let fraction = roots.count() as f64 / there().count().max(1) as f64;
        // along one direction, the whole region has a depth
        let deepest = match has_one_beam(aim.sources) {
            true => penetration,
            false => there()
                .filter_map(|section| section.penetration)
                .max_by(|a, b| a.depth.total_cmp(&b.depth)),
        };
        Some(Zone {
            length: has_one_travel(aim.sources).then(|| pool.length()),
            turns: true,
            penetration: deepest,
            root: (fraction > 0.0).then_some(Root { width, fraction }),
            sections,
        })
    }
}

impl ZoneSection {
    /// The section of a zone along a straight path, with its largest area (m²).
    fn of_pool(pool: &MeltPool, gauge: &MeltPoolGauge, area: f64) -> Self {
        ZoneSection {
            sides: pool.sides,
            width: pool.width,
            area: (gauge.dimension == 3).then_some(area),
            penetration: None,
            root: None,
        }
    }
}

/// A region above an isotherm that is cut by planes.
struct CutRegion<'a> {
    gauge: &'a MeltPoolGauge,
    cells: CellValues<'a>,
    hottest: usize,
    /// fractions above the isotherm, of the cells that are not entirely below it
    fractions: Vec<(usize, f64)>,
    /// 2 for each axis whose normal plane of symmetry cuts the region, else 1
    halves: [f64; 3],
}

impl CutRegion<'_> {
    /// Centre of the hottest cell, m.
    fn hottest_place(&self) -> [f64; 3] {
        self.cells.centre(self.cells.cell(self.hottest))
    }

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
    fn across(&self, path: &[SourceState], state: usize, d: Directions) -> Option<ZoneSection> {
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
        let region = Region::around(cells, nearest, self.gauge.isotherm, within);
        // the isotherm also crosses cells beside those of the region
        let joins = |&&(cell, _): &&(usize, f64)| {
            let place = cells.cell(cell);
            let beside = cells.neighbours(place);
            let mut beside = beside.filter_map(|next| cells.index(next));
            within(cells.centre(place))
                && (region.is_inside[cell] || beside.any(|next| region.is_inside[next]))
        };
        let areas = self
            .fractions
            .iter()
            .filter(joins)
            .map(|&(cell, fraction)| {
                fraction * area_within_cell((at - self.along(cell, travel)) / spacing, travel)
            });
        let copies = mirrored * self.mirrored(travel, axis);
        let area = copies * areas.sum::<f64>() * spacing.powi(2);
        let root = region.root(d.beam, across, travel);
        Some(ZoneSection {
            sides: Some([from, to]),
            width: Some(mirrored * (to - from)),
            area: (self.gauge.dimension == 3).then_some(area),
            penetration: region.penetration(nearest, d.beam),
            root: root.map(|[width, _]| mirrored * width),
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

/// Whether two unit vectors lie along different lines, by the cosine of the angle.
fn is_turned(a: [f64; 3], b: [f64; 3], cosine: f64) -> bool {
    dot(a, b).abs() < cosine
}

/// The direction across the path in a state; `None` for a source that never moves.
fn across_path(state: &SourceState) -> Option<[f64; 3]> {
    let (travel, beam) = (state.travel?, state.beam);
    Some(Directions { travel, beam }.across())
}

/// Whether the directions of travel or of the beam change.
fn turns(path: &[SourceState]) -> bool {
    !(has_one_travel(path) && has_one_beam(path))
}

/// Whether all directions of travel lie on lines within 10 degrees.
fn has_one_travel(path: &[SourceState]) -> bool {
    let mut travels = path.iter().filter_map(|state| state.travel);
    let first = travels.next();
    travels.all(|travel| first.is_none_or(|first| !is_turned(first, travel, ONE_DIRECTION)))
}

/// Whether all beams are within 10 degrees.
fn has_one_beam(path: &[SourceState]) -> bool {
    let mut pairs = path.iter().zip(path.first().into_iter().cycle());
    pairs.all(|(state, first)| dot(state.beam, first.beam) >= ONE_DIRECTION)
}

/// Whether another part of the path whose sections have another direction, or a corner between two logged states, is nearer (m)
/// than the end of a section.
fn meets_another(path: &[SourceState], state: usize, reach: f64) -> bool {
    let here = &path[state];
    let cross = |a: &SourceState, b: &SourceState| {
        let both = across_path(a).zip(across_path(b));
        both.is_some_and(|(a, b)| is_turned(a, b, STRAIGHT))
    };
    let is_at_corner = |other: usize| {
        let pair = |first: usize| match path.get(first..first + 2) {
            Some([a, b]) => cross(a, b),
            _ => false,
        };
        pair(other) || other.checked_sub(1).is_some_and(pair)
    };
    (0..path.len()).any(|other| {
        distance(path[other].position, here.position) <= reach
            && (cross(here, &path[other]) || is_at_corner(other))
    })
}

#[cfg(test)]
mod tests;
