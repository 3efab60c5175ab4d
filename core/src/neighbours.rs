//! Neighbours that are found with a skin: they stay valid until a point has moved by half the skin.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::cell_list::CellList;

/// Points that a thread takes at a time.
const POINTS: usize = 4096;

/// Points whose neighbours a thread finds at a time.
const SEARCHED: usize = 64;

/// Where points were when their neighbours were found.
#[derive(Clone, Debug, Default)]
pub(crate) struct FoundAt(Vec<Vector3<f64>>);

impl FoundAt {
    pub(crate) fn new(positions: &[Vector3<f64>]) -> FoundAt {
        FoundAt(positions.to_vec())
    }

    /// Positions (m) at which neighbours are found now.
    pub(crate) fn set(&mut self, positions: &[Vector3<f64>]) {
        self.0.clear();
        self.0.extend_from_slice(positions);
    }

    /// Positions at which neighbours were found, m.
    pub(crate) fn positions(&self) -> &[Vector3<f64>] {
        &self.0
    }

    /// Whether a point has moved so far to its current position (m) that neighbours must be found again: by half its skin
    /// (m, by point). Neighbours that were never found must be, too.
    pub(crate) fn is_outdated(
        &self,
        positions: &[Vector3<f64>],
        skin: impl Fn(usize) -> f64 + Sync,
    ) -> bool {
        let pairs = positions.par_iter().zip(&self.0).enumerate();
        let has_moved = |(point, (x, before)): (usize, (&Vector3<f64>, &Vector3<f64>))| {
            (x - before).norm_squared() > (0.5 * skin(point)).powi(2)
        };
        positions.len() != self.0.len() || pairs.with_min_len(POINTS).any(has_moved)
    }
}

/// Points with the distances from which they are found, m.
#[derive(Clone, Copy)]
pub(crate) struct Reaching<'a> {
    pub(crate) positions: &'a [Vector3<f64>],
    pub(crate) reach: &'a [f64],
}

/// For each of `owners` the candidates within the distance `within(owner, candidate)` (m), which is not larger than the reach of
/// both, ascending, so that sums over them do not depend on when they were found; none where it is `None`. `cells` then holds
/// the candidates.
pub(crate) fn find(
    cells: &mut CellList,
    owners: Reaching<'_>,
    candidates: Reaching<'_>,
    within: impl Fn(usize, usize) -> Option<f64> + Sync,
) -> Vec<Vec<u32>> {
    cells.update(candidates.positions, candidates.reach);
    let near = |owner: usize| {
        let at = &owners.positions[owner];
        let mut row = Vec::with_capacity(64);
        cells.visit_near(at, owners.reach[owner], |other| {
            let squared = (candidates.positions[other] - at).norm_squared();
            if within(owner, other).is_some_and(|within| squared <= within * within) {
                row.push(other as u32);
            }
        });
        row.sort_unstable();
        row
    };
    let points = (0..owners.reach.len()).into_par_iter();
    points.with_min_len(SEARCHED).map(near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One rule for all users: half of the skin of the point that moves.
    #[test]
    fn neighbours_are_outdated_when_a_point_has_moved_by_half_its_skin() {
        let start = vec![Vector3::zeros(), Vector3::x()];
        let mut found = FoundAt::default();
        let skin = |point: usize| [0.5, 0.25][point];
        assert!(found.is_outdated(&start, skin), "never found");
        found.set(&start);
        for (point, way, outdated) in [
            (0, 0.24, false),
            (0, 0.26, true),
            (1, 0.12, false),
            (1, 0.13, true),
        ] {
            let mut now = start.clone();
            now[point].y += way;
            assert_eq!(found.is_outdated(&now, skin), outdated, "{point}: {way}");
        }
    }
}
