//! How the points of a body are divided among processes: by recursive bisection of groups of points.
//!
//! A group is [`GROUP`] consecutive points, which sums over points add up in order: groups are not divided. Each bisection cuts the box
//! around the groups across its longest axis, so that the numbers of points on both sides are in proportion to those of processes. Compact parts have
//! few neighbours: slabs need 1.4 times as many ghosts on 4 processes and 5 times as many on 64, space-filling curves 1.3 to 1.5
//! times where the number of processes is no power of two.

use nalgebra::Vector3;

use super::Body;
use crate::transport::GROUP;

/// Consecutive points, and their mean position, m.
struct Group {
    number: usize,
    points: usize,
    centre: Vector3<f64>,
}

/// The process that owns each point of a body, for this number of processes. Periodic axes are not cut. `None` where some process would own
/// nothing.
pub(crate) fn owners(body: &Body, processes: usize) -> Option<Vec<u32>> {
    let count = body.points.len();
    let group = |number: usize| {
        let points = GROUP * number..(GROUP * (number + 1)).min(count);
        let sum: Vector3<f64> = (points.clone().map(|point| body.points.position.at(point))).sum();
        Group {
            number,
            points: points.len(),
            centre: sum / points.len() as f64,
        }
    };
    let mut groups: Vec<Group> = (0..count.div_ceil(GROUP)).map(group).collect();
    let axes: Vec<usize> = (0..body.dimension).filter(|a| !body.periodic[*a]).collect();
    let mut owner_of_group = vec![0; groups.len()];
    bisect(&mut groups, &axes, 0..processes as u32, &mut owner_of_group)?;
    Some(
        (0..count)
            .map(|point| owner_of_group[point / GROUP])
            .collect(),
    )
}

/// Divides groups among processes.
fn bisect(
    groups: &mut [Group],
    axes: &[usize],
    processes: std::ops::Range<u32>,
    owner: &mut [u32],
) -> Option<()> {
    if groups.is_empty() {
        return None;
    }
    if processes.len() == 1 {
        groups
            .iter()
            .for_each(|group| owner[group.number] = processes.start);
        return Some(());
    }
    let extent = |axis: &usize| {
        let along = || groups.iter().map(|group| group.centre[*axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    let longest = axes
        .iter()
        .copied()
        .max_by(|a, b| extent(a).total_cmp(&extent(b)))?;
    groups.sort_by(|a, b| {
        let order = a.centre[longest].total_cmp(&b.centre[longest]);
        order.then(a.number.cmp(&b.number))
    });
    let half = processes.len() / 2;
    let all: usize = groups.iter().map(|group| group.points).sum();
    let wanted = all as f64 * half as f64 / processes.len() as f64;
    let mut before = 0.0;
    // the cut is where the number of points is nearest to what is wanted
    let cut = groups.iter().position(|group| {
        let middle = before + 0.5 * group.points as f64;
        before += group.points as f64;
        middle > wanted
    });
    let (low, high) = groups.split_at_mut(cut.unwrap_or(0));
    let middle = processes.start + half as u32;
    bisect(low, axes, processes.start..middle, owner)?;
    bisect(high, axes, middle..processes.end, owner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Shape};

    fn block(cells: [usize; 3]) -> Body {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: cells.map(|n| n as f64),
        });
        Body::fill("block", &shape, 3, 1.0, 1.0).expect("valid")
    }

    #[test]
    fn parts_are_of_whole_groups_and_equal_sizes() {
        let body = block([40, 30, 20]);
        for processes in 1..=9 {
            let owner = owners(&body, processes).expect("enough points");
            let mut count = vec![0; processes];
            owner
                .iter()
                .for_each(|process| count[*process as usize] += 1);
            let mean = owner.len() as f64 / processes as f64;
            for count in count {
                let difference = (count as f64 - mean).abs();
                assert!(
                    difference <= 2.0 * GROUP as f64,
                    "{processes}: {count} {mean}"
                );
            }
            assert!(
                owner
                    .chunks(GROUP)
                    .all(|group| group.iter().all(|p| *p == group[0]))
            );
        }
        assert!(owners(&block([5, 5, 5]), 3).is_none());
    }

    /// Points beside another process over those beside the cuts of an ideal division into equal boxes.
    #[test]
    fn surfaces_between_parts_are_near_those_of_boxes() {
        let body = block([128, 64, 64]);
        for (processes, squares) in [(2, 1.0), (4, 3.0), (8, 5.0)] {
            let ideal = 2.0 * squares * 64.0 * 64.0;
            let owner = owners(&body, processes).expect("enough points");
            let lattice = body.lattice().expect("a lattice");
            let differs = |point: usize, axis: usize| {
                let mut cell = lattice.cell(point).map(i64::from);
                cell[axis] += 1;
                lattice
                    .point(cell)
                    .is_some_and(|other| owner[other] != owner[point])
            };
            let faces: usize = (0..owner.len())
                .map(|point| (0..3).filter(|axis| differs(point, *axis)).count())
                .sum();
            let ghosts = 2.0 * faces as f64;
            assert!(ghosts < 1.3 * ideal, "{processes}: {ghosts} {ideal}");
        }
    }

    #[test]
    fn periodic_axes_are_not_cut() {
        let mut body = block([64, 8, 8]);
        body.periodic = [true, false, false];
        let owner = owners(&body, 2).expect("enough points");
        let row = |point: usize| body.points.position.at(point).yz();
        for (a, b) in (0..owner.len()).map(|p| (p, p ^ 1)) {
            assert!(row(a) != row(b) || owner[a] == owner[b]);
        }
        body.periodic = [true; 3];
        assert!(owners(&body, 2).is_none());
    }
}
