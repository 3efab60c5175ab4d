//! Material that is attached along edges only.

use super::Corners;

impl Corners {
    /// Leaves out material that was born and touches other along edges or at corners only: it would swing about them. It takes part
    /// once faces join it to what was there. Material that touches nothing takes part.
    pub(in crate::mechanical) fn leave_out_hinges(
        &self,
        active: &mut [bool],
        was_present: &[bool],
    ) {
        let born: Vec<bool> = active
            .iter()
            .zip(was_present)
            .map(|(a, w)| *a && !w)
            .collect();
        if !born.contains(&true) {
            return;
        }
        // the first point of the piece that each point belongs to
        let mut piece_of = vec![usize::MAX; active.len()];
        let mut left_out = Vec::new();
        for first in (0..born.len()).filter(|point| born[*point]) {
            if piece_of[first] != usize::MAX {
                continue;
            }
            let (mut piece, mut is_attached) = (vec![first], false);
            piece_of[first] = first;
            let mut next = 0;
            while let Some(&point) = piece.get(next) {
                next += 1;
                for (neighbour, is_behind_face) in self.neighbours(point, active) {
                    is_attached |= is_behind_face && !born[neighbour];
                    if is_behind_face && born[neighbour] && piece_of[neighbour] != first {
                        piece_of[neighbour] = first;
                        piece.push(neighbour);
                    }
                }
            }
            let is_other = |(point, _): (usize, bool)| piece_of[point] != first;
            let touches = |point: &usize| self.neighbours(*point, active).any(is_other);
            if !is_attached && piece.iter().any(touches) {
                left_out.append(&mut piece);
            }
        }
        left_out.into_iter().for_each(|point| active[point] = false);
    }

    /// The points with material that share a corner with a point, some of them repeatedly, and whether they lie behind a face of its cell.
    fn neighbours<'a>(
        &'a self,
        point: usize,
        present: &'a [bool],
    ) -> impl Iterator<Item = (usize, bool)> + 'a {
        let corners = self.of(point).iter().enumerate();
        corners.flat_map(move |(number, &corner)| {
            let around = self.around(corner as usize, present);
            around.map(move |(other, neighbour)| (neighbour, (other ^ number).is_power_of_two()))
        })
    }
}
