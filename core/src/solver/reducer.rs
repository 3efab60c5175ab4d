//! Sums and extremes over the points of a body, whichever process owns them, and the exchange of their values.

use std::borrow::Cow;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::exact::ExactSum;
use super::reduce::{Groups, exact_sum_of, exact_sums_of_points, max_abs};
use crate::body::Sizes;
use crate::transport::exchange::{Owners, SharedExchange, gather_to_all, lock};
use crate::transport::{GROUP, Processes};

/// Sums and extremes over all points of a body, of which this process owns the first ones. Calls are collective: all processes make the same ones.
///
/// Sums have the same bits for any number of processes, see [`reduce`](super::reduce). Vectors have the same number of entries for each point; those
/// behind them belong to no point and count in no sum.
#[derive(Clone, Debug, Default)]
pub struct Reducer {
    /// Points that this process has, and how many of them it owns; zero for vectors of any length.
    points: usize,
    owned: usize,
    /// Those of nodes; `None` where groups have [`GROUP`] entries.
    groups: Option<NodeGroups>,
    shared: Shared,
}

/// Groups of nodes whose sums add up exactly.
#[derive(Clone, Debug)]
struct NodeGroups {
    /// Where the groups of owned nodes begin, and where the last one ends.
    starts: Arc<[u32]>,
    /// Number of nodes of the largest group of all processes.
    largest: f64,
}

/// What processes that share a body know of each other's points; nothing in a run of one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shared {
    pub(crate) processes: Processes,
    pub(crate) exchange: SharedExchange,
    /// Number in the whole body of each point.
    pub(crate) numbers: Arc<[u32]>,
    /// The process that owns each of the points that this one does not.
    pub(crate) owners: Arc<[u32]>,
}

/// Nodes, such as the corners of cells, each of which belongs to the owner of a point.
#[derive(Clone, Debug, Default)]
pub struct SharedNodes {
    /// Number of each node, the same in all processes; owned ones first, each part ascending.
    pub numbers: Vec<u32>,
    /// The point to which each belongs. Nodes of points with ascending numbers have ascending numbers.
    pub point: Vec<u32>,
    /// Whether this process needs the values of each.
    pub is_needed: Vec<bool>,
}

impl Reducer {
    /// Of a body of which this process has `points`, and owns the first `owned` ones; others are exchanged with those that share it.
    pub(crate) fn new(points: usize, owned: usize, shared: Shared) -> Self {
        Reducer {
            points,
            owned,
            groups: None,
            shared,
        }
    }

    /// Of points that no other process has a part of.
    pub fn alone(points: usize) -> Self {
        Reducer::new(points, points, Shared::default())
    }

    /// The nodes of a body whose points these are. Those of a group of points form a group. Collective.
    pub fn of_nodes(&self, nodes: SharedNodes) -> Self {
        let SharedNodes {
            numbers,
            point,
            is_needed,
        } = nodes;
        let rank = self.processes().rank();
        let owners = point.iter().map(|point| self.owner(*point as usize));
        let (own, others): (Vec<usize>, Vec<usize>) = owners.partition(|owner| *owner == rank);
        let owned = own.len();
        let owners: Vec<u32> = others.into_iter().map(|owner| owner as u32).collect();
        let group = |node: usize| self.number(point[node] as usize) as usize / GROUP;
        let begins = |node: &usize| *node == 0 || group(*node) != group(*node - 1);
        let starts = (0..owned).filter(begins).chain([owned]);
        let starts: Vec<u32> = starts.map(|node| node as u32).collect();
        let sizes = starts.windows(2).map(|ends| ends[1] - ends[0]);
        let groups = NodeGroups {
            largest: self.max(f64::from(sizes.max().unwrap_or_default())),
            starts: starts.into(),
        };
        let plan = Owners {
            numbers: &numbers,
            owned,
            of_others: &owners,
        };
        let exchange = plan.plan(self.processes(), &is_needed);
        Reducer {
            points: numbers.len(),
            owned,
            groups: Some(groups),
            shared: Shared {
                processes: self.processes().clone(),
                exchange: Arc::new(Mutex::new(exchange)),
                numbers: numbers.into(),
                owners: owners.into(),
            },
        }
    }

    /// The group of each owned point.
    pub(super) fn group_of_points(&self) -> Vec<u32> {
        match &self.groups {
            None => (0..self.owned).map(|p| (p / GROUP) as u32).collect(),
            Some(groups) => {
                let groups = (0..).zip(groups.starts.windows(2));
                let points = groups.flat_map(|(n, ends)| (ends[0]..ends[1]).map(move |_| n));
                points.collect()
            }
        }
    }

    /// Number of points of the largest group of all processes, or more.
    pub(super) fn largest_group(&self) -> f64 {
        self.groups.as_ref().map_or(GROUP as f64, |g| g.largest)
    }

    /// The groups of a vector with so many entries of owned points.
    fn groups(&self, entries: usize) -> Groups<'_> {
        match &self.groups {
            Some(groups) => Groups::From(&groups.starts, entries / self.owned.max(1)),
            None => Groups::Even(entries),
        }
    }

    /// The process that owns a point.
    pub fn owner(&self, point: usize) -> usize {
        let other = point.checked_sub(self.owned);
        let owner = other.and_then(|other| self.shared.owners.get(other));
        owner.map_or(self.processes().rank(), |owner| *owner as usize)
    }

    /// Number of a point in the whole body.
    pub fn number(&self, point: usize) -> u32 {
        let numbers = &self.shared.numbers;
        numbers.get(point).copied().unwrap_or(point as u32)
    }

    /// Values by point of all processes, in the order of their numbers, in each of them, from those of owned points; nothing where no
    /// process has any. Collective.
    pub fn whole_of<'a, T>(&self, values: &'a [T]) -> Cow<'a, [T]>
    where
        T: Clone + Serialize + DeserializeOwned,
    {
        let Some(transport) = self.processes().transport() else {
            return Cow::Borrowed(values);
        };
        if !self.processes().any(!values.is_empty()) {
            return Cow::Borrowed(values);
        }
        let own = rmp_serde::to_vec(&values[..self.owned]).expect("values in memory");
        let numbers = gather_to_all(transport, &self.shared.numbers[..self.owned]);
        let lengths = gather_to_all(transport, &[own.len() as u64]);
        let bytes: Vec<u8> = gather_to_all(transport, &own);
        let mut rest = &bytes[..];
        let mut all: Vec<T> = Vec::with_capacity(numbers.len());
        for length in lengths {
            let (of_process, behind) = rest.split_at(length as usize);
            let values: Vec<T> = rmp_serde::from_slice(of_process).expect("what was written");
            all.extend(values);
            rest = behind;
        }
        let mut in_order: Vec<(u32, T)> = numbers.into_iter().zip(all).collect();
        in_order.sort_unstable_by_key(|(number, _)| *number);
        Cow::Owned(in_order.into_iter().map(|(_, value)| value).collect())
    }

    /// Those of the values that [`Reducer::whole_of`] gave which belong to points of this process; nothing of nothing. Collective.
    pub fn part_of<T: Clone>(&self, whole: Vec<T>) -> Vec<T> {
        let Some(transport) = self.processes().transport() else {
            return whole;
        };
        if whole.is_empty() {
            return whole;
        }
        let mut numbers = gather_to_all(transport, &self.shared.numbers[..self.owned]);
        numbers.sort_unstable();
        let of_number = |number: &u32| {
            // nobody owns some nodes at the rim of a part, whose values are not used
            let place = numbers.binary_search(number).unwrap_or_else(|near| near);
            whole[place.min(whole.len() - 1)].clone()
        };
        self.shared.numbers.iter().map(of_number).collect()
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
        let own = inputs.map(|input| self.own(input));
        exact_sum_of(self.groups(own[0].len()), own, f)
    }

    /// `sum_i f(a_i, s_i)` over values and sizes of the points.
    ///
    /// # Panics
    /// When the numbers of points differ.
    pub fn sum_over(
        &self,
        values: &[f64],
        sizes: &Sizes,
        f: impl Fn(f64, f64) -> f64 + Sync,
    ) -> f64 {
        self.total(self.own_sum_over(values, sizes, f))
    }

    /// The part of [`Reducer::sum_over`] of the points that this process owns. Not collective.
    ///
    /// # Panics
    /// See [`Reducer::sum_over`].
    pub fn own_sum_over(
        &self,
        values: &[f64],
        sizes: &Sizes,
        f: impl Fn(f64, f64) -> f64 + Sync,
    ) -> ExactSum {
        match sizes.same() {
            Some(size) => self.own_sum_of([values], |[value]| f(value, size)),
            None => self.own_sum_of([values, sizes], |[value, size]| f(value, size)),
        }
    }

    /// `sum_i f(i)` over the points, for several sums at once.
    pub fn sum_points<const N: usize>(&self, f: impl Fn(usize) -> [f64; N] + Sync) -> [f64; N] {
        exact_sums_of_points(self.groups(self.owned), f).map(|sum| self.total(sum))
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

    /// The largest magnitude of a vector by point of any process, zero for an empty one, NaN if an entry is NaN.
    pub fn max_abs(&self, values: &[f64]) -> f64 {
        self.max(max_abs(self.own(values)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Memory;

    /// Points of a body, of which each process owns every so many groups and knows all others.
    fn points(processes: &Processes, groups: usize) -> Reducer {
        let owner = |point: &u32| *point as usize / GROUP % processes.size();
        let all = 0..(groups * GROUP) as u32;
        let is_own = |point: &u32| owner(point) == processes.rank();
        let (own, others): (Vec<u32>, Vec<u32>) = all.partition(is_own);
        let shared = Shared {
            processes: processes.clone(),
            exchange: SharedExchange::default(),
            numbers: own.iter().chain(&others).copied().collect(),
            owners: others.iter().map(|p| owner(p) as u32).collect(),
        };
        Reducer::new(groups * GROUP, own.len(), shared)
    }

    /// Up to three nodes of each point.
    fn nodes(points: &Reducer) -> Reducer {
        let mut nodes = SharedNodes::default();
        for point in 0..points.points {
            let number = points.number(point);
            for node in 0..number % 4 {
                nodes.numbers.push(8 * number + node);
                nodes.point.push(point as u32);
                nodes.is_needed.push(true);
            }
        }
        points.of_nodes(nodes)
    }

    #[test]
    fn nodes_have_the_same_sums_and_values_for_any_number_of_processes() {
        let of_number = |number: u32| f64::from(number).sin() * 10f64.powi((number % 7) as i32);
        let found = [1, 2, 3].map(|size| {
            let run = |process: Memory| {
                let processes = Processes::new(Arc::new(process));
                let nodes = nodes(&points(&processes, 7));
                let numbers: Vec<u32> = (0..nodes.points).map(|node| nodes.number(node)).collect();
                let all: Vec<f64> = numbers.iter().map(|n| of_number(*n)).collect();
                let vectors: Vec<f64> = all.iter().flat_map(|v| [*v, -2.0 * v, v * v]).collect();
                let sums = [
                    nodes.sum(&all),
                    nodes.norm(&vectors),
                    nodes.sum_points(|node| [all[node]])[0],
                ];
                let whole = nodes.whole_of(&all).into_owned();
                assert_eq!(nodes.part_of(whole.clone()), all);
                // owned values alone, until others are brought
                let mut brought = all.clone();
                brought[nodes.owned..].fill(f64::NAN);
                nodes.bring(&mut brought);
                assert_eq!(brought, all);
                (sums.map(f64::to_bits), whole)
            };
            let results = std::thread::scope(|scope| {
                let start = |process| scope.spawn(|| run(process));
                let threads: Vec<_> = Memory::processes(size).into_iter().map(start).collect();
                let results = threads.into_iter().map(|t| t.join().expect("no panic"));
                results.collect::<Vec<_>>()
            });
            assert!(results.iter().all(|result| *result == results[0]));
            results.into_iter().next().expect("a process")
        });
        assert_eq!(found[0], found[1]);
        assert_eq!(found[0], found[2]);
    }
}
