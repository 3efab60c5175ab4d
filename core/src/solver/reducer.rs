//! Sums and extremes over the points of a body, whichever process owns them, and the exchange of their values.

use std::sync::Arc;

use super::exact::ExactSum;
use super::reduce::{exact_sum_of, exact_sums_of_points};
use crate::transport::Processes;
use crate::transport::exchange::{SharedExchange, lock};

/// Sums and extremes over all points of a body, of which this process owns the first ones. Calls are collective: all processes make the same ones.
///
/// Sums have the same bits for any number of processes, see [`reduce`](super::reduce). Vectors have the same number of entries for each point; those
/// behind them belong to no point and count in no sum.
#[derive(Clone, Debug, Default)]
pub struct Reducer {
    /// Points that this process has, and how many of them it owns; zero for vectors of any length.
    points: usize,
    owned: usize,
    shared: Shared,
}

/// What processes that share a body know of each other's points; nothing in a run of one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shared {
    pub(crate) processes: Processes,
    pub(crate) exchange: SharedExchange,
    /// Number in the whole body of each point.
    pub(crate) numbers: Arc<[u32]>,
}

impl Reducer {
    /// Of a body of which this process has `points`, and owns the first `owned` ones; others are exchanged with those that share it.
    pub(crate) fn new(points: usize, owned: usize, shared: Shared) -> Self {
        Reducer {
            points,
            owned,
            shared,
        }
    }

    /// Of points that no other process has a part of.
    pub fn alone(points: usize) -> Self {
        Reducer::new(points, points, Shared::default())
    }

    /// Replaces values by point by those of the owners of the points; where no bond of this process reaches a point, it becomes zero. Not before
    /// the run starts.
    pub fn bring(&self, values: &mut [f64]) {
        if let Some(transport) = self.processes().transport() {
            let components = values.len() / self.points;
            lock(&self.shared.exchange).bring(transport, values, components);
        }
    }

    /// Number in the whole body of an entry of a vector of so many entries.
    pub(super) fn number_of_entry(&self, entry: usize, entries: usize) -> usize {
        if self.shared.numbers.is_empty() {
            return entry;
        }
        let components = entries / self.points;
        components * self.shared.numbers[entry / components] as usize + entry % components
    }

    /// Number of points that this process owns, the first ones.
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// The processes among which the points are divided.
    pub fn processes(&self) -> &Processes {
        &self.shared.processes
    }

    /// The entries of owned points, in a vector by point with any number of components.
    pub fn own<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        match self.points {
            0 => values,
            points => &values[..values.len() / points * self.owned],
        }
    }

    /// `sum_i f(a_i, b_i, ...)` over the entries of `N` vectors by point, of equal length.
    ///
    /// # Panics
    /// When the lengths differ.
    pub fn sum_of<const N: usize>(
        &self,
        inputs: [&[f64]; N],
        f: impl Fn([f64; N]) -> f64 + Sync,
    ) -> f64 {
        self.total(self.own_sum_of(inputs, f))
    }

    /// `sum_i a_i`.
    pub fn sum(&self, values: &[f64]) -> f64 {
        self.sum_of([values], |[value]| value)
    }

    /// `sum_i a_i b_i`.
    ///
    /// # Panics
    /// When the lengths differ.
    pub fn dot(&self, a: &[f64], b: &[f64]) -> f64 {
        self.sum_of([a, b], |[a, b]| a * b)
    }

    /// Euclidean norm `sqrt(sum_i a_i^2)`.
    pub fn norm(&self, values: &[f64]) -> f64 {
        self.sum_of([values], |[value]| value * value).sqrt()
    }

    /// The part of [`Reducer::sum_of`] of the points that this process owns. Not collective.
    ///
    /// # Panics
    /// See [`Reducer::sum_of`].
    pub fn own_sum_of<const N: usize>(
        &self,
        inputs: [&[f64]; N],
        f: impl Fn([f64; N]) -> f64 + Sync,
    ) -> ExactSum {
        exact_sum_of(inputs.map(|input| self.own(input)), f)
    }

    /// `sum_i f(i)` over the points, for several sums at once.
    pub fn sum_points<const N: usize>(&self, f: impl Fn(usize) -> [f64; N] + Sync) -> [f64; N] {
        exact_sums_of_points(self.owned, f).map(|sum| self.total(sum))
    }

    /// The total of what each process has summed.
    pub fn total(&self, mut own: ExactSum) -> f64 {
        own.add_up(&self.shared.processes);
        own.value()
    }

    /// The sum of the numbers of all processes.
    pub fn total_of(&self, own: f64) -> f64 {
        let mut sum = ExactSum::default();
        sum.add(own);
        self.total(sum)
    }

    /// The largest of what processes have found, if any has, with the numbers that belong to it; those of the first process where several have found
    /// the same.
    pub fn largest<const N: usize>(&self, own: Option<(f64, [f64; N])>) -> Option<(f64, [f64; N])> {
        if self.shared.processes.size() == 1 {
            return own;
        }
        let size = self.max(own.map_or(f64::NEG_INFINITY, |own| own.0));
        let rank = self.shared.processes.rank() as f64;
        let found = own.filter(|own| own.0 == size);
        let first = self.min(found.map_or(f64::INFINITY, |_| rank));
        let found = found.filter(|_| rank == first);
        let numbers = std::array::from_fn(|n| {
            self.max(found.map_or(f64::NEG_INFINITY, |(_, numbers)| numbers[n]))
        });
        first.is_finite().then_some((size, numbers))
    }

    /// Whether something is true in any process.
    pub fn any(&self, own: bool) -> bool {
        self.shared.processes.any(own)
    }

    /// The largest number of all processes, NaN if there is one.
    pub fn max(&self, own: f64) -> f64 {
        self.shared.processes.max(own)
    }

    /// The least number of all processes, NaN if there is one.
    pub fn min(&self, own: f64) -> f64 {
        self.shared.processes.min(own)
    }
}
