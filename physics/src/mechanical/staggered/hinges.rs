//! Material that is attached along edges only.

use perimelt_core::solver::Reducer;

use super::Corners;

impl Corners {
    /// Leaves out material that was born and touches other along edges or at corners only: it would swing about them. It takes part
    /// once faces join it to what was there. Material that touches nothing takes part. Collective.
    pub(in crate::mechanical) fn leave_out_hinges(
        &self,
        points: &Reducer,
        active: &mut [bool],
        was_present: &[bool],
    ) {
        let is_known = |point: usize| self.known_points().get(point).is_none_or(|known| *known);
        let pairs = active.iter().zip(was_present).enumerate();
        let born: Vec<bool> = pairs
            .map(|(point, (active, was))| *active && !was && is_known(point))
            .collect();
        if !points.any(born.contains(&true)) {
            return;
        }
        let least_in_pieces = |of_point: &dyn Fn(usize) -> f64| {
            let mut values: Vec<f64> = (0..born.len())
                .map(|point| if born[point] { of_point(point) } else { 0.0 })
                .collect();
            self.spread_least(points, &born, &mut values);
            values
        };
        let zero_if = |is: bool| if is { 0.0 } else { 1.0 };
        let piece = least_in_pieces(&|point| f64::from(points.number(point)));
        let is_free = least_in_pieces(&|point| {
            let mut around = self.neighbours(point, active);
            zero_if(around.any(|(other, is_behind_face)| is_behind_face && !born[other]))
        });
        let touches_none = least_in_pieces(&|point| {
            let mut around = self.neighbours(point, active);
            zero_if(around.any(|(other, _)| !born[other] || piece[other] != piece[point]))
        });
        for point in (0..born.len()).filter(|point| born[*point]) {
            active[point] = is_free[point] == 0.0 || touches_none[point] > 0.0;
        }
    }

    /// Gives each of some points the least value of those to which faces join it, across other such points. Collective.
    fn spread_least(&self, points: &Reducer, members: &[bool], values: &mut [f64]) {
        let mut order: Vec<usize> = (0..values.len()).filter(|p| members[*p]).collect();
        loop {
            // from the least value on, a point rarely gets another one twice
            order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
            for &first in &order {
                let mut next = vec![first];
                while let Some(point) = next.pop() {
                    for (other, is_behind_face) in self.neighbours(point, members) {
                        if is_behind_face && values[other] > values[point] {
                            values[other] = values[point];
                            next.push(other);
                        }
                    }
                }
            }
            let here = values.to_vec();
            points.bring(values);
            if !points.any(order.iter().any(|point| values[*point] != here[*point])) {
                return;
            }
        }
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
