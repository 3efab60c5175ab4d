//! Whether two bodies are at one place.

use super::Body;
use crate::cell_list::CellList;

/// Part of a cell from which others cover it. Cells of curved surfaces on different lattices overlap by less.
const COVERED: f64 = 0.75;

impl Body {
    /// The first point whose cell is covered by cells of another body.
    pub fn first_inside(&self, other: &Body) -> Option<usize> {
        let (own, others) = (&self.points, &other.points);
        let list = CellList::new(&others.position, &others.spacing);
        let dimension = self.dimension.min(other.dimension);
        let is_covered = |point: &usize| {
            let (place, size) = (own.position[*point], own.spacing[*point]);
            let mut covered = 0.0;
            list.visit_near(&place, size, |at| {
                let apart = (others.position[at] - place).abs();
                let reach = 0.5 * (size + others.spacing[at]);
                let narrower = size.min(others.spacing[at]);
                let along = |axis: usize| (reach - apart[axis]).clamp(0.0, narrower) / size;
                covered += (0..dimension).map(along).product::<f64>();
            });
            covered > COVERED
        };
        (0..own.position.len()).find(is_covered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Shape};

    fn block(min: [f64; 3], max: [f64; 3], spacing: f64) -> Body {
        let shape = Shape::Box(BoxShape { min, max });
        Body::fill("block", &shape, 2, spacing, 1.0).expect("valid")
    }

    #[test]
    fn a_body_is_inside_another_one_from_the_first_row_that_they_share() {
        let pool = block([0.0; 3], [1.0, 1.0, 0.1], 0.1);
        for (low, size, inside) in [
            ([1.0, 0.0], 0.1, false),
            ([0.9, 0.0], 0.1, true),
            ([0.95, 0.95], 0.1, false),
            ([0.85, 0.85], 0.1, true),
            ([0.75, 0.75], 0.1, true),
            ([0.4, 0.4], 0.3, true),
            ([0.9, 0.0], 0.05, true),
            ([0.95, 0.0], 0.05, false),
        ] {
            let [x, y] = low;
            let other = block([x, y, 0.0], [x + 3.0 * size, y + 3.0 * size, 0.1], size);
            let found = pool.first_inside(&other);
            assert_eq!(found.is_some(), inside, "{low:?}, {size}");
        }
    }
}
