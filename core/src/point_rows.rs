//! Rows of numbers of some points of a body, such as those with broken bonds.

use serde::{Deserialize, Serialize};

/// Rows of equal length of some points, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointRows {
    pub(crate) points: Vec<u32>,
    /// Any 64 bits, such as those of an `f64`.
    pub(crate) values: Vec<u64>,
}

impl PointRows {
    /// Adds the row of a point that follows those before.
    pub fn push(&mut self, point: usize, row: &[u64]) {
        self.points.push(point as u32);
        self.values.extend_from_slice(row);
    }

    /// Takes all rows away.
    pub fn clear(&mut self) {
        self.points.clear();
        self.values.clear();
    }

    /// Points and their rows of a length that is not zero.
    pub fn iter(&self, length: usize) -> impl Iterator<Item = (usize, &[u64])> {
        let points = self.points.iter().map(|point| *point as usize);
        points.zip(self.values.chunks_exact(length.max(1)))
    }

    /// Whether there is a row of a length for each point, and each point is one of a number of them, ascending.
    #[must_use]
    pub fn is_valid(&self, points: usize, length: usize) -> bool {
        self.values.len() == self.points.len() * length
            && self.points.is_sorted_by(|a, b| a < b)
            && self
                .points
                .last()
                .is_none_or(|last| (*last as usize) < points)
    }

    /// Length of a row.
    fn row_length(&self) -> usize {
        self.values
            .len()
            .checked_div(self.points.len())
            .unwrap_or(0)
    }

    /// The rows of points that get a new number, in the order of these.
    pub(crate) fn renumbered(&self, number: impl Fn(u32) -> Option<u32>) -> PointRows {
        let rows = self.iter(self.row_length());
        let mut rows: Vec<(u32, &[u64])> = rows
            .filter_map(|(point, row)| Some((number(point as u32)?, row)))
            .collect();
        rows.sort_unstable_by_key(|(point, _)| *point);
        let mut renumbered = PointRows::default();
        rows.into_iter()
            .for_each(|(point, row)| renumbered.push(point as usize, row));
        renumbered
    }
}
