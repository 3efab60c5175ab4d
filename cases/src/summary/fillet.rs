//! Legs and throat of a fillet of deposited metal, from the cells of its sections.
//!
//! In a section normal to the direction of travel, the metal that was deposited touches the parent metal on two sides. The legs are
//! the lengths of both contacts. The throat is the height of the triangle with these legs that has the area of the section,
//! `2 A / sqrt(z1^2 + z2^2)`. Each is the median of the sections along the weld, with a resolution of the spacing.

use std::collections::{BTreeMap, BTreeSet};

use perimelt_core::log::{LatticeInfo, LogError, LoggedCloud};
use perimelt_core::text;

use super::{BodyRecord, Label, ReadOff, median};
use crate::quantity::survey::Reference;

/// Fewest sections along a weld.
const FEWEST: usize = 3;

/// Smallest length of a contact that counts, as a fraction of the longest contact.
const LEAST_CONTACT: f64 = 0.25;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads off the fillet of a body on which metal was deposited along an axis.
///
/// # Errors
/// A log that cannot be read.
pub(super) fn fillet(record: &BodyRecord<'_>, found: &mut Vec<ReadOff>) -> Result<(), LogError> {
    let &BodyRecord {
        log,
        sources,
        body,
        last,
    } = record;
    let Some(lattice) = body.lattice.as_ref().filter(|_| body.dimension == 3) else {
        return Ok(());
    };
    let first = log.first_cloud(&body.name)?;
    if first.positions.len() >= last.positions.len() {
        return Ok(());
    }
    let travels = sources.path().into_iter().filter_map(|state| state.travel);
    let axis_of = |travel: [f64; 3]| (0..3).find(|&axis| travel[axis].abs() > 0.99);
    let axes: BTreeSet<Option<usize>> = travels.map(axis_of).collect();
    let [Some(axis)] = axes.into_iter().collect::<Vec<_>>()[..] else {
        return Ok(());
    };
    let reference = Reference::new(log, body)?;
    let cells = |cloud: &LoggedCloud| -> BTreeSet<[i64; 3]> {
        let positions = reference.positions(cloud);
        positions.iter().map(|x| cell_of(lattice, x)).collect()
    };
    let (parent, all) = (cells(&first), cells(last));
    let deposited: BTreeSet<[i64; 3]> = all.difference(&parent).copied().collect();
    let spacing = lattice.spacing;
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let welds = connected(&deposited);
    let all = welds.iter().map(|weld| sections(&parent, weld, axis));
    let fillets: Vec<Vec<FilletSection>> = all.filter(|s| s.len() >= FEWEST).collect();
    for (index, sections) in fillets.iter().enumerate() {
        // a T-joint has a fillet on both sides
        let (id, of) = match fillets.len() {
            1 => (String::new(), "the deposited fillet".to_string()),
            _ => {
                let middle = |axis: usize| {
                    let sum: f64 = sections.iter().map(|s| s.middle[axis]).sum();
                    lattice.origin[axis] + spacing * sum / sections.len() as f64
                };
                let [at_u, at_v] = [u, v].map(|axis| text::number(1e3 * middle(axis), 3));
                let place = format!("{} = {at_u}, {} = {at_v} mm", AXES[u], AXES[v]);
                (
                    format!(".{}", index + 1),
                    format!("the deposited fillet at {place}"),
                )
            }
        };
        let mut add = |name: Label, of: &dyn Fn(&FilletSection) -> f64| {
            let values = sections.iter().map(of).collect();
            found.push(median(&body.name, name, values, "m", super::OUTSIDE));
        };
        for (leg, along) in [u, v].into_iter().enumerate() {
            let name = Label::new(
                format!("fillet{id}.leg.{}", AXES[along]),
                format!("leg of {of} along {}", AXES[along]),
            );
            add(name, &|section| section.legs[leg] * spacing);
        }
        let name = Label::new(format!("fillet{id}.throat"), format!("throat of {of}"));
        add(name, &|s| s.throat() * spacing);
    }
    Ok(())
}

/// The parts of a set of cells that are connected by faces, in the order of their first cells.
fn connected(cells: &BTreeSet<[i64; 3]>) -> Vec<BTreeSet<[i64; 3]>> {
    let mut left = cells.clone();
    let mut parts = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut part, mut border) = (BTreeSet::from([first]), vec![first]);
        while let Some(cell) = border.pop() {
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = cell;
                    beside[axis] += step;
                    if left.remove(&beside) {
                        part.insert(beside);
                        border.push(beside);
                    }
                }
            }
        }
        parts.push(part);
    }
    parts
}

fn cell_of(lattice: &LatticeInfo, x: &[f64; 3]) -> [i64; 3] {
    [0, 1, 2].map(|a| ((x[a] - lattice.origin[a]) / lattice.spacing).round() as i64)
}

/// A section of a fillet, in cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct FilletSection {
    /// along the first and the second axis of the section
    legs: [f64; 2],
    area: f64,
    middle: [f64; 3],
}

impl FilletSection {
    fn throat(&self) -> f64 {
        2.0 * self.area / self.legs[0].hypot(self.legs[1])
    }
}

/// The sections in which deposited cells touch parent metal on one side along each of both axes: neither a bead on a plate nor a
/// groove.
fn sections(
    parent: &BTreeSet<[i64; 3]>,
    deposited: &BTreeSet<[i64; 3]>,
    axis: usize,
) -> Vec<FilletSection> {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let mut all: BTreeMap<i64, SectionCounts> = BTreeMap::new();
    for cell in deposited {
        let slice = all.entry(cell[axis]).or_default();
        slice.cells += 1.0;
        (0..3).for_each(|a| slice.places[a] += cell[a] as f64);
        for (number, across) in [u, v].into_iter().enumerate() {
            for (side, step) in [-1, 1].into_iter().enumerate() {
                let mut beside = *cell;
                beside[across] += step;
                if parent.contains(&beside) {
                    slice.contacts[number][side] += 1.0;
                }
            }
        }
    }
    all.values().filter_map(SectionCounts::section).collect()
}

/// Counts of the deposited cells of a section.
#[derive(Clone, Copy, Debug, Default)]
struct SectionCounts {
    cells: f64,
    /// Sums of the cell indices.
    places: [f64; 3],
    /// Contacts with parent metal, by axis and side.
    contacts: [[f64; 2]; 2],
}

impl SectionCounts {
    fn section(&self) -> Option<FilletSection> {
        let longest = self.contacts.iter().flatten().copied().fold(0.0, f64::max);
        let one_side = |sides: [f64; 2]| {
            let [least, most] = [sides[0].min(sides[1]), sides[0].max(sides[1])];
            let counts = |contact: f64| contact >= LEAST_CONTACT * longest && contact > 0.0;
            (counts(most) && !counts(least)).then_some(most)
        };
        // a contact with a face normal to one axis is a leg along the other
        Some(FilletSection {
            legs: [one_side(self.contacts[1])?, one_side(self.contacts[0])?],
            area: self.cells,
            middle: self.places.map(|sum| sum / self.cells),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of a section of 60 by 60 at three places along x: parent metal in an L, metal where `is_deposited` says so.
    fn of(
        is_parent: impl Fn(i64, i64) -> bool,
        is_deposited: impl Fn(f64, f64) -> bool,
    ) -> Vec<FilletSection> {
        let (mut parent, mut deposited) = (BTreeSet::new(), BTreeSet::new());
        for x in 0..3 {
            for j in -10..60 {
                for k in -10..60 {
                    if is_parent(j, k) {
                        parent.insert([x, j, k]);
                    } else if is_deposited(j as f64 + 0.5, k as f64 + 0.5) {
                        deposited.insert([x, j, k]);
                    }
                }
            }
        }
        sections(&parent, &deposited, 0)
    }

    #[test]
    fn a_triangle_has_its_legs_and_its_throat() {
        let corner = |j: i64, k: i64| j < 0 || k < 0;
        let found = of(corner, |y, z| y / 24.0 + z / 32.0 < 1.0);
        assert_eq!(found.len(), 3);
        for section in found {
            // a cell
            assert!((section.legs[0] - 24.0).abs() <= 1.0, "{section:?}");
            assert!((section.legs[1] - 32.0).abs() <= 1.0, "{section:?}");
            // 24 * 32 / 40, by cells of a stair: half a cell
            let throat = section.throat();
            assert!((throat - 19.2).abs() < 0.5, "{throat}");
        }
    }

    #[test]
    fn fillets_on_both_sides_of_a_web_are_two() {
        let mut deposited = BTreeSet::new();
        for x in 0..3 {
            for k in 0..5 {
                let width = 5 - k;
                deposited.extend((0..width).flat_map(|j| [[x, j, k], [x, -4 - j, k]]));
            }
        }
        let welds = connected(&deposited);
        assert_eq!(welds.len(), 2);
        let mut parent = BTreeSet::new();
        for x in 0..3 {
            parent.extend((-20..20).map(|j| [x, j, -1]));
            parent.extend((-3..0).flat_map(|j| (0..20).map(move |k| [x, j, k])));
        }
        for weld in &welds {
            let sections = sections(&parent, weld, 0);
            assert_eq!(sections.len(), 3);
            assert_eq!(sections[0].legs, [5.0, 5.0]);
        }
    }

    #[test]
    fn a_bead_on_a_plate_and_a_groove_are_no_fillets() {
        let bead = of(|_, k| k < 0, |y, z| (y - 20.0).hypot(z) < 10.0);
        assert_eq!(bead, []);
        let groove = of(|j, k| k < 0 || !(0..20).contains(&j), |_, z| z < 30.0);
        assert_eq!(groove, []);
    }
}
