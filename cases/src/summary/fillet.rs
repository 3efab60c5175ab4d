//! Legs and throat of a fillet of deposited metal, from the cells of its sections.
//!
//! In a section normal to the direction of travel, the metal that was deposited touches the parent metal on two sides. The legs are
//! the lengths of both contacts. The throat is the height of the triangle with these legs that has the area of the section,
//! `2 A / sqrt(z1^2 + z2^2)`. Each is the median of the sections along the weld, with a resolution of the spacing.

use std::collections::{BTreeMap, BTreeSet};

use perimelt_core::log::{BodyInfo, LatticeInfo, Log, LogError, LoggedCloud};

use super::{ReadOff, median};
use crate::melt_pool::LoggedSources;
use crate::plot::survey::Reference;

/// Fewest sections along a weld.
const FEWEST: usize = 3;

/// A contact on a side counts if it is at least this part of the longest contact.
const LEAST_CONTACT: f64 = 0.25;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads off the fillet of a body on which metal was deposited along an axis.
///
/// # Errors
/// A log that cannot be read.
pub(super) fn fillet(
    (log, sources): (&Log, &LoggedSources),
    (body, last): (&BodyInfo, &LoggedCloud),
    found: &mut Vec<ReadOff>,
) -> Result<(), LogError> {
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
    let sections = sections(&parent, &deposited, axis);
    if sections.len() < FEWEST {
        return Ok(());
    }
    let spacing = lattice.spacing;
    let mut add = |name: (String, String), of: &dyn Fn(&Section) -> f64| {
        let values = sections.iter().map(of).collect();
        found.push(median(&body.name, name, values, "m", super::OUTSIDE));
    };
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    for (number, along) in [u, v].into_iter().enumerate() {
        let name = (
            format!("fillet.leg.{}", AXES[along]),
            format!("leg of the deposited fillet along {}", AXES[along]),
        );
        add(name, &|section| section.legs[number] * spacing);
    }
    let name = (
        "fillet.throat".into(),
        "throat of the deposited fillet".into(),
    );
    add(name, &|s| s.throat() * spacing);
    Ok(())
}

fn cell_of(lattice: &LatticeInfo, x: &[f64; 3]) -> [i64; 3] {
    [0, 1, 2].map(|a| ((x[a] - lattice.origin[a]) / lattice.spacing).round() as i64)
}

/// A section of a fillet, in cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Section {
    /// along the first and the second axis of the section
    legs: [f64; 2],
    area: f64,
}

impl Section {
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
) -> Vec<Section> {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    // contacts by axis and side, and the number of cells, by section
    let mut all: BTreeMap<i64, ([[f64; 2]; 2], f64)> = BTreeMap::new();
    for cell in deposited {
        let (contacts, area) = all.entry(cell[axis]).or_default();
        *area += 1.0;
        for (number, across) in [u, v].into_iter().enumerate() {
            for (side, step) in [-1, 1].into_iter().enumerate() {
                let mut beside = *cell;
                beside[across] += step;
                if parent.contains(&beside) {
                    contacts[number][side] += 1.0;
                }
            }
        }
    }
    let section = |(contacts, area): ([[f64; 2]; 2], f64)| {
        let longest = contacts.iter().flatten().copied().fold(0.0, f64::max);
        let one_side = |sides: [f64; 2]| {
            let [least, most] = [sides[0].min(sides[1]), sides[0].max(sides[1])];
            let counts = |contact: f64| contact >= LEAST_CONTACT * longest && contact > 0.0;
            (counts(most) && !counts(least)).then_some(most)
        };
        // a contact with a face normal to one axis is a leg along the other
        Some(Section {
            legs: [one_side(contacts[1])?, one_side(contacts[0])?],
            area,
        })
    };
    all.into_values().filter_map(section).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of a section of 60 by 60 at three places along x: parent metal in an L, metal where `is_deposited` says so.
    fn of(
        is_parent: impl Fn(i64, i64) -> bool,
        is_deposited: impl Fn(f64, f64) -> bool,
    ) -> Vec<Section> {
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
    fn a_bead_on_a_plate_and_a_groove_are_no_fillets() {
        let bead = of(|_, k| k < 0, |y, z| (y - 20.0).hypot(z) < 10.0);
        assert_eq!(bead, []);
        let groove = of(|j, k| k < 0 || !(0..20).contains(&j), |_, z| z < 30.0);
        assert_eq!(groove, []);
    }
}
