//! State variables of a law at the points of a body: at the end of the last step, and tried in this one.

use rayon::prelude::*;

/// State variables of all points, in rows. A trial state is committed or rejected as a whole.
#[derive(Debug, Default)]
pub(super) struct VariableStates {
    /// Numbers of a point.
    width: usize,
    settled: Vec<f64>,
    tried: Vec<f64>,
}

impl VariableStates {
    /// Zero everywhere.
    pub(super) fn new(points: usize, width: usize) -> Self {
        // rows of at least one number, since chunks are not empty
        let settled = vec![0.0; points * width.max(1)];
        VariableStates {
            width,
            tried: settled.clone(),
            settled,
        }
    }

    fn row<'a>(&self, variables: &'a [f64], point: usize) -> &'a [f64] {
        &variables[point * self.width.max(1)..][..self.width]
    }

    /// State variables of a point at the end of the last step.
    pub(super) fn settled(&self, point: usize) -> &[f64] {
        self.row(&self.settled, point)
    }

    /// State variables of a point in the trial state.
    pub(super) fn tried(&self, point: usize) -> &[f64] {
        self.row(&self.tried, point)
    }

    /// The settled state of each point, with the trial state to be found from it.
    pub(super) fn try_from_settled(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (&[f64], &mut [f64])> {
        let (width, row) = (self.width, self.width.max(1));
        let tried = self.tried.par_chunks_exact_mut(row);
        let rows = self.settled.par_chunks_exact(row).zip(tried);
        rows.map(move |(settled, tried)| (&settled[..width], &mut tried[..width]))
    }

    /// The variable at a place of the row of each point, of settled states.
    pub(super) fn values<const N: usize>(&self, at: usize) -> impl Iterator<Item = [f64; N]> {
        let rows = self.settled.chunks_exact(self.width.max(1));
        rows.map(move |row| std::array::from_fn(|n| row[at + n]))
    }

    /// Replaces the variable at a place of the row of each point, of settled states; [`VariableStates::reject`] must follow.
    pub(super) fn replace<const N: usize>(
        &mut self,
        at: usize,
        values: impl Iterator<Item = [f64; N]>,
    ) {
        let rows = self.settled.chunks_exact_mut(self.width.max(1));
        rows.zip(values)
            .for_each(|(row, value)| row[at..at + N].copy_from_slice(&value));
    }

    /// Takes the settled state from a point; [`VariableStates::reject`] must follow.
    pub(super) fn clear(&mut self, point: usize) {
        let row = self.width.max(1);
        self.settled[point * row..][..row].fill(0.0);
    }

    /// Accepts the trial states.
    pub(super) fn commit(&mut self) {
        self.settled.copy_from_slice(&self.tried);
    }

    /// Goes back to the settled states.
    pub(super) fn reject(&mut self) {
        self.tried.copy_from_slice(&self.settled);
    }
}
