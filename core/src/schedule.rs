//! The order of couplers, derived from what plugins declare.
//!
//! A coupler runs right before the physics that takes up what it writes, at every sub-step,
//! after the couplers whose results it reads. Couplers whose results no physics takes up
//! (fields for logs and probes) run at the end of the macro step.

use crate::error::Problem;
use crate::field::FieldIndex;
use crate::setup::{Access, Declaration};

/// Which couplers run when, by their position in the case file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// For each physics, the couplers to apply before each of its sub-steps, in order.
    pub before: Vec<Vec<usize>>,
    /// Couplers to apply at the end of the macro step, in order.
    pub after: Vec<usize>,
    /// For each physics, the sinks to zero before each round of additions: those that somebody adds to.
    pub sinks: Vec<Vec<FieldIndex>>,
    /// For each physics, the fields that it owns.
    pub owned: Vec<Vec<FieldIndex>>,
    /// For each physics, whether none of its couplers reads a field that it owns.
    pub one_way: Vec<bool>,
}

impl Plan {
    /// Orders `couplers` (the first plugins) around the `physics` (the plugins after them).
    ///
    /// # Errors
    /// The couplers that wait for each other, by `labels`.
    pub fn derive(
        couplers: usize,
        physics: usize,
        declarations: &[Declaration],
        labels: &[String],
    ) -> Result<Plan, Problem> {
        let fields = |plugin: usize, test: fn(Access) -> bool| {
            let of_plugin = declarations
                .iter()
                .filter(move |d| d.plugin == plugin && test(d.access));
            of_plugin.map(|d| d.field).collect::<Vec<_>>()
        };
        let writes: Vec<_> = (0..couplers).map(|c| fields(c, Access::writes)).collect();
        let derived: Vec<_> = (0..couplers)
            .map(|c| fields(c, |a| a == Access::Write))
            .collect();
        let reads: Vec<_> = (0..couplers).map(|c| fields(c, Access::reads)).collect();
        let shares = |a: &[FieldIndex], b: &[FieldIndex]| a.iter().any(|f| b.contains(f));
        let feeds = |a: usize, b: usize| a != b && shares(&derived[a], &reads[b]);

        let order = topological(couplers, &feeds)
            .map_err(|cycle| Problem::Cycle(cycle.iter().map(|&c| labels[c].clone()).collect()))?;
        let mut plan = Plan::default();
        let mut used = vec![false; couplers];
        for p in couplers..couplers + physics {
            let owned = fields(p, |a| a == Access::Own);
            let mut wanted = fields(p, Access::reads);
            wanted.extend(&owned);
            let mut needed: Vec<bool> =
                (0..couplers).map(|c| shares(&writes[c], &wanted)).collect();
            // backwards through the order, feeders of feeders are reached in one pass
            for &b in order.iter().rev() {
                if needed[b] {
                    (0..couplers)
                        .filter(|&a| feeds(a, b))
                        .for_each(|a| needed[a] = true);
                }
            }
            plan.before
                .push(order.iter().copied().filter(|&c| needed[c]).collect());
            needed.iter().zip(&mut used).for_each(|(f, u)| *u |= f);
            let mut sinks = fields(p, Access::consumes);
            sinks.retain(|f| writes.iter().any(|w| w.contains(f)));
            plan.sinks.push(sinks);
            let feeding = (0..couplers).filter(|&c| needed[c]);
            plan.one_way
                .push(feeding.into_iter().all(|c| !shares(&reads[c], &owned)));
            plan.owned.push(owned);
        }
        plan.after = order.into_iter().filter(|&c| !used[c]).collect();
        Ok(plan)
    }
}

/// Positions `0..count` with every `a` before the `b` that it feeds, else in ascending
/// order; `Err` with a cycle that ends where it began.
fn topological(
    count: usize,
    feeds: &impl Fn(usize, usize) -> bool,
) -> Result<Vec<usize>, Vec<usize>> {
    let mut order: Vec<usize> = Vec::new();
    while order.len() < count {
        let waits = |b: usize| (0..count).find(|&a| !order.contains(&a) && feeds(a, b));
        let left = || (0..count).filter(|c| !order.contains(c));
        match left().find(|&b| waits(b).is_none()) {
            Some(next) => order.push(next),
            None => {
                // everybody left waits for somebody: following the waits must close a loop
                let mut path = vec![left().next().expect("the loop runs while some are left")];
                loop {
                    let next = waits(path[path.len() - 1]).expect("everybody left waits");
                    if let Some(start) = path.iter().position(|&c| c == next) {
                        let mut cycle = path.split_off(start);
                        cycle.push(next);
                        cycle.reverse();
                        return Err(cycle);
                    }
                    path.push(next);
                }
            }
        }
    }
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declare(list: &[(usize, Access, usize)]) -> Vec<Declaration> {
        list.iter()
            .map(|&(plugin, access, field)| Declaration {
                plugin,
                access,
                field,
            })
            .collect()
    }

    fn labels(count: usize) -> Vec<String> {
        (0..count).map(|c| format!("c{c}")).collect()
    }

    #[test]
    fn a_coupler_follows_the_one_it_reads_whatever_the_case_order() {
        // c0 adds into sink 0 from derived field 1, which c1 writes; c2 writes field 2 for logs
        let d = declare(&[
            (0, Access::Read, 1),
            (0, Access::Add, 0),
            (1, Access::Write, 1),
            (2, Access::Write, 2),
            (3, Access::Consume, 0),
            (3, Access::Own, 3),
        ]);
        let plan = Plan::derive(3, 1, &d, &labels(4)).expect("no cycle");
        assert_eq!(plan.before, [[1, 0]]);
        assert_eq!(plan.after, [2]);
        assert_eq!(
            (&plan.sinks[0][..], &plan.owned[0][..]),
            (&[0][..], &[3][..])
        );
    }

    #[test]
    fn a_layer_is_set_before_the_owner_of_its_field() {
        let d = declare(&[
            (0, Access::Layer, 5),
            (1, Access::Own, 4),
            (2, Access::Own, 5),
        ]);
        let plan = Plan::derive(1, 2, &d, &labels(3)).expect("no cycle");
        assert_eq!(plan.before, [vec![], vec![0]]);
    }

    #[test]
    fn a_cycle_is_named_in_its_order() {
        let d = declare(&[
            (0, Access::Write, 0),
            (0, Access::Read, 2),
            (1, Access::Write, 1),
            (1, Access::Read, 0),
            (2, Access::Write, 2),
            (2, Access::Read, 1),
        ]);
        let Err(Problem::Cycle(cycle)) = Plan::derive(3, 0, &d, &labels(3)) else {
            panic!("a cycle must be found");
        };
        assert_eq!(cycle, ["c0", "c1", "c2", "c0"]);
    }
}
