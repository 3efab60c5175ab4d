//! Loops over points on all threads whose distribution is compiled once. rayon compiles its own for each loop: with several hundred
//! loops these are a quarter of all code that the compiler works on.

use rayon::iter::plumbing::{Producer, ProducerCallback};
use rayon::prelude::*;

/// Parts of a loop for each thread, so that a thread whose points are slow can leave some to the others.
const PARTS_PER_THREAD: usize = 4;

/// Loops on all threads. `with_min_len` is the number of items for which a thread is worth while.
pub trait ParallelLoop: IndexedParallelIterator {
    /// Calls `f` with every item, in any order.
    fn for_all(self, f: impl Fn(Self::Item) + Sync) {
        let len = self.len();
        self.with_producer(Loop { len, f });
    }

    /// Sets a vector to the items, in their order. It is allocated anew only where it is too short.
    fn fill(self, values: &mut Vec<Self::Item>)
    where
        Self::Item: Default,
    {
        values.resize_with(self.len(), Default::default);
        let both = values.par_iter_mut().zip(self);
        both.for_all(|(value, item)| *value = item);
    }
}

impl<I: IndexedParallelIterator> ParallelLoop for I {}

struct Loop<F> {
    len: usize,
    f: F,
}

impl<T, F: Fn(T) + Sync> ProducerCallback<T> for Loop<F> {
    type Output = ();

    fn callback<P: Producer<Item = T>>(self, items: P) {
        let parts = number_of_parts(self.len, items.min_len());
        distribute(items, [self.len, parts], &self.f);
    }
}

fn number_of_parts(len: usize, min_len: usize) -> usize {
    (len / min_len.max(1)).clamp(1, PARTS_PER_THREAD * rayon::current_num_threads())
}

/// Passes a number of items to `f`, in a number of parts.
fn distribute<P: Producer>(items: P, [len, parts]: [usize; 2], f: &(impl Fn(P::Item) + Sync)) {
    let before = parts / 2;
    if before == 0 {
        return items.into_iter().for_each(f);
    }
    let middle = len * before / parts;
    let (first, second) = items.split_at(middle);
    let (mut first, mut second) = (Some(first), Some(second));
    both(
        &mut || {
            if let Some(items) = first.take() {
                distribute(items, [middle, before], f);
            }
        },
        &mut || {
            if let Some(items) = second.take() {
                distribute(items, [len - middle, parts - before], f);
            }
        },
    );
}

/// Does both on two threads if another one is idle. Dynamic, so that it is compiled once.
fn both(first: &mut (dyn FnMut() + Send), second: &mut (dyn FnMut() + Send)) {
    rayon::join(first, second);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_threads(threads: usize, work: impl FnOnce() + Send) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(work);
    }

    #[test]
    fn every_item_is_visited_once_with_those_of_the_same_number() {
        for threads in [1, 2, 3, 8] {
            on_threads(threads, || {
                for len in [0, 1, 2, 3, 7, 64, 1001] {
                    for min_len in [1, 3, 100, 5000] {
                        let numbers: Vec<usize> = (0..len).collect();
                        let mut visits = vec![(0, usize::MAX); len];
                        let items = visits.par_iter_mut().zip(&numbers).enumerate();
                        items
                            .with_min_len(min_len)
                            .for_all(|(place, (visit, number))| {
                                visit.0 += 1;
                                visit.1 = place + number;
                            });
                        let expected = (0..len).map(|number| (1, 2 * number));
                        assert!(visits.into_iter().eq(expected));
                    }
                }
            });
        }
    }

    #[test]
    fn a_vector_is_filled_whatever_it_held() {
        on_threads(3, || {
            let squares = || (0..1000_usize).into_par_iter().map(|n| n * n);
            let expected: Vec<usize> = (0..1000).map(|n| n * n).collect();
            for len in [0, 10, 2000] {
                let mut values = vec![usize::MAX; len];
                squares().fill(&mut values);
                assert_eq!(values, expected);
            }
        });
    }

    #[test]
    fn a_loop_is_parted_where_its_parts_are_worth_while() {
        on_threads(2, || {
            assert_eq!(number_of_parts(0, 1), 1);
            assert_eq!(number_of_parts(4000, 4096), 1);
            assert_eq!(number_of_parts(3 * 4096, 4096), 3);
            assert_eq!(number_of_parts(1_000_000, 4096), 2 * PARTS_PER_THREAD);
        });
    }
}
