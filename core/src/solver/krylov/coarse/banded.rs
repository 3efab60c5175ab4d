//! A banded symmetric matrix and its Cholesky factor. By hand, since nalgebra has only dense ones.

use crate::solver::Reducer;
use crate::solver::exact::{FixedPoint, Halves};
use crate::solver::reduce::ordered_sum;

/// Relative stiffening of the diagonal. Free bodies have rigid modes and nodes with few points around them
/// may move freely; both make the matrix singular.
const STIFFENING: f64 = 1e-8;

/// A symmetric matrix of entries near its diagonal, or its Cholesky factor `L` (`L L^T`).
#[derive(Clone, Debug)]
pub(super) struct Banded {
    band: usize,
    /// The entries of each row from the edge of the band to the diagonal.
    rows: Vec<f64>,
}

/// Sums that become the entries of a [`Banded`] matrix.
pub(super) struct BandedSums {
    band: usize,
    entries: Halves,
}

impl BandedSums {
    pub(super) fn new(rows: usize, band: usize) -> Self {
        BandedSums {
            band,
            entries: Halves::zeros(rows * (band + 1)),
        }
    }

    /// Adds both parts of another sum at a row and column, if it is left of the diagonal or on it.
    pub(super) fn add(&mut self, [row, column]: [usize; 2], parts: [f64; 2]) {
        if column <= row {
            let entry = (row + 1) * (self.band + 1) - 1 - (row - column);
            self.entries.add_to(entry, parts);
        }
    }

    /// The matrix of the sums of all processes.
    pub(super) fn total(self, fixed: FixedPoint, points: &Reducer) -> Banded {
        Banded {
            band: self.band,
            rows: fixed.total(self.entries, points),
        }
    }
}

/// `sum_i a_i b_i` of rows.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    ordered_sum([a, b], &|[a, b]| a * b)
}

impl Banded {
    fn len(&self) -> usize {
        self.rows.len() / (self.band + 1)
    }

    /// First column of a row, and its entries from there to the diagonal.
    fn row(&self, row: usize) -> (usize, &[f64]) {
        let first = row.saturating_sub(self.band);
        let end = (row + 1) * (self.band + 1);
        (first, &self.rows[end - 1 - (row - first)..end])
    }

    /// `L`, with the diagonal stiffened; `None` if the matrix is still not positive definite.
    pub(super) fn factors(mut self) -> Option<Self> {
        for row in 0..self.len() {
            let end = (row + 1) * (self.band + 1);
            self.rows[end - 1] = match self.rows[end - 1] {
                0.0 => 1.0,
                diagonal => diagonal * (1.0 + STIFFENING),
            };
            let first = row.saturating_sub(self.band);
            let start = end - 1 - (row - first);
            for column in first..row {
                let (from, other) = self.row(column);
                let before = dot(
                    &self.rows[start..][..column - first],
                    &other[first - from..column - from],
                );
                let diagonal = other[column - from];
                let entry = &mut self.rows[start + column - first];
                *entry = (*entry - before) / diagonal;
            }
            let left = &self.rows[start..end - 1];
            let pivot = self.rows[end - 1] - dot(left, left);
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            self.rows[end - 1] = pivot.sqrt();
        }
        Some(self)
    }

    /// Solves `L L^T x = b` in place.
    pub(super) fn solve(&self, b: &mut [f64]) {
        for row in 0..b.len() {
            let (first, entries) = self.row(row);
            let (diagonal, left) = entries.split_last().expect("a row has its diagonal");
            b[row] = (b[row] - dot(left, &b[first..row])) / diagonal;
        }
        for row in (0..b.len()).rev() {
            let (first, entries) = self.row(row);
            let (diagonal, left) = entries.split_last().expect("a row has its diagonal");
            b[row] /= diagonal;
            let value = b[row];
            let before = b[first..row].iter_mut().zip(left);
            before.for_each(|(b, entry)| *b -= value * entry);
        }
    }
}
