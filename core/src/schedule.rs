//! The order of couplers and physics, derived from what plugins declare.
//!
//! A coupler runs right before the physics that takes up what it writes, at every sub-step,
//! after the couplers whose results it reads. Couplers whose results no physics takes up
//! (fields for logs and probes) run at the end of the macro step.
//!
//! **Groups.** A coupler that adds into sinks of two bodies (an *exchange*), and a physics that gives amounts to another
//! one, of the same body or of another, tie the physics that take them up: these advance together. In each step of a group its exchanges are
//! applied once, with all members at one time; then every member advances to the end of the step, in sub-steps of its own
//! where it must. What an exchange adds holds for all sub-steps (rates) or is taken up in the first one (amounts), so
//! that what one body loses the other one gets, whatever steps they take.

use crate::error::Problem;
use crate::field::FieldIndex;
use crate::setup::{Access, Declaration};
use crate::world::BodyIndex;

/// Which couplers run when, by their position in the case file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// For each physics, the couplers to apply before each of its sub-steps, in order.
    pub before: Vec<Vec<usize>>,
    /// Couplers to apply at the end of the macro step, in order.
    pub after: Vec<usize>,
    /// For each physics, the sinks to zero before each round of additions: those that somebody adds to.
    pub sinks: Vec<Vec<FieldIndex>>,
    /// For each physics, the sinks of amounts that it takes up once ([`Access::Take`]).
    pub amounts: Vec<Vec<FieldIndex>>,
    /// For each physics, the fields that it owns.
    pub owned: Vec<Vec<FieldIndex>>,
    /// For each physics, the fields of its state: those that it owns, and those that it keeps for itself.
    pub state: Vec<Vec<FieldIndex>>,
    /// For each physics, whether none of its couplers reads a field that it owns.
    pub one_way: Vec<bool>,
    /// All physics in the order in which they advance, those that advance together in one group.
    pub groups: Vec<Group>,
}

/// Physics that advance together; most groups have one member and no exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// Physics in the order in which they advance: one that reads the state of another body comes before the physics of that
    /// body, and one that gives amounts before the one that takes them up.
    pub members: Vec<usize>,
    /// Couplers to apply once in each step of the group, in order: exchanges, and what they read from.
    pub couplers: Vec<usize>,
    /// Members that give amounts to others, not summed over their sub-steps: the step of the group is not longer than theirs.
    pub givers: Vec<usize>,
    /// Sinks of members, not of amounts, that `couplers` add to.
    pub rates: Vec<FieldIndex>,
}

/// Declarations with what is asked of them.
struct Declared<'a> {
    all: &'a [Declaration],
    body_of_field: &'a [BodyIndex],
}

impl Declared<'_> {
    fn fields(&self, plugin: usize, test: fn(Access) -> bool) -> Vec<FieldIndex> {
        let of_plugin = self.all.iter();
        let of_plugin = of_plugin.filter(|d| d.plugin == plugin && test(d.access));
        of_plugin.map(|d| d.field).collect()
    }

    /// Whether a coupler adds into sinks of several bodies.
    fn is_exchange(&self, coupler: usize) -> bool {
        let added = self.fields(coupler, |a| a == Access::Add);
        let mut bodies = added.iter().map(|f| self.body_of_field[*f]);
        let first = bodies.next();
        bodies.any(|b| Some(b) != first)
    }
}

fn shares(a: &[FieldIndex], b: &[FieldIndex]) -> bool {
    a.iter().any(|f| b.contains(f))
}

impl Plan {
    /// Orders `couplers` (the first plugins) around the `physics` (the plugins after them).
    ///
    /// # Errors
    /// The plugins that wait for each other, by `labels`.
    pub fn derive(
        couplers: usize,
        physics: usize,
        declarations: &[Declaration],
        body_of_field: &[BodyIndex],
        labels: &[String],
    ) -> Result<Plan, Problem> {
        let declared = Declared {
            all: declarations,
            body_of_field,
        };
        let each = |test: fn(Access) -> bool| -> Vec<Vec<FieldIndex>> {
            (0..couplers).map(|c| declared.fields(c, test)).collect()
        };
        let (writes, reads) = (each(Access::writes), each(Access::reads));
        let derived = each(|a| a == Access::Write);
        let feeds = |a: usize, b: usize| a != b && shares(&derived[a], &reads[b]);
        let named = |cycle: Vec<usize>, first: usize| {
            Problem::Cycle(cycle.iter().map(|&c| labels[first + c].clone()).collect())
        };
        let order = topological(couplers, &feeds).map_err(|cycle| named(cycle, 0))?;
        // backwards through the order, feeders of feeders are reached in one pass
        let with_feeders = |mut needed: Vec<bool>| -> Vec<usize> {
            for &b in order.iter().rev() {
                if needed[b] {
                    (0..couplers)
                        .filter(|&a| feeds(a, b))
                        .for_each(|a| needed[a] = true);
                }
            }
            order.iter().copied().filter(|&c| needed[c]).collect()
        };
        let is_exchange: Vec<bool> = (0..couplers).map(|c| declared.is_exchange(c)).collect();

        let mut plan = Plan::default();
        let mut used = vec![false; couplers];
        for p in couplers..couplers + physics {
            let owned = declared.fields(p, |a| a == Access::Own);
            let mut wanted = declared.fields(p, Access::reads);
            wanted.extend(&owned);
            let needed = (0..couplers).map(|c| !is_exchange[c] && shares(&writes[c], &wanted));
            let before = with_feeders(needed.collect());
            before.iter().for_each(|&c| used[c] = true);
            let feeding = before.iter();
            plan.one_way
                .push(feeding.clone().all(|&c| !shares(&reads[c], &owned)));
            plan.before.push(before);
            let mut sinks = declared.fields(p, |a| a == Access::Consume);
            sinks.retain(|f| writes.iter().any(|w| w.contains(f)));
            plan.sinks.push(sinks);
            plan.amounts.push(declared.fields(p, |a| a == Access::Take));
            let kept = declared.fields(p, |a| a == Access::Keep);
            plan.state.push([&owned[..], &kept].concat());
            plan.owned.push(owned);
        }
        plan.groups = plan.derive_groups(&declared, couplers, &is_exchange, |cycle| {
            named(cycle, couplers)
        })?;
        for group in &mut plan.groups {
            let taken = |c: usize| {
                let takes = |p: &usize| {
                    shares(&writes[c], &plan.sinks[*p]) || shares(&writes[c], &plan.amounts[*p])
                };
                is_exchange[c] && group.members.iter().any(takes)
            };
            group.couplers = with_feeders((0..couplers).map(taken).collect());
            group.couplers.iter().for_each(|&c| used[c] = true);
            let sinks = group.members.iter().flat_map(|&p| &plan.sinks[p]);
            let added = |f: &&FieldIndex| group.couplers.iter().any(|&c| writes[c].contains(f));
            group.rates = sinks.filter(added).copied().collect();
        }
        plan.after = order.into_iter().filter(|&c| !used[c]).collect();
        Ok(plan)
    }

    fn derive_groups(
        &self,
        declared: &Declared<'_>,
        couplers: usize,
        is_exchange: &[bool],
        cycle: impl Fn(Vec<usize>) -> Problem,
    ) -> Result<Vec<Group>, Problem> {
        let physics = self.owned.len();
        let takes = |p: usize, fields: &[FieldIndex]| {
            shares(fields, &self.sinks[p]) || shares(fields, &self.amounts[p])
        };
        let given: Vec<_> = (0..physics)
            .map(|p| declared.fields(couplers + p, Access::gives))
            .collect();
        // the least physics of each group
        let mut group_of: Vec<usize> = (0..physics).collect();
        let mut tie = |tied: Vec<usize>| {
            let groups: Vec<usize> = tied.iter().map(|&p| group_of[p]).collect();
            if let Some(&least) = groups.iter().min() {
                let member = |g: &&mut usize| groups.contains(g);
                group_of.iter_mut().filter(member).for_each(|g| *g = least);
            }
        };
        for c in (0..couplers).filter(|&c| is_exchange[c]) {
            let added = declared.fields(c, |a| a == Access::Add);
            tie((0..physics).filter(|&p| takes(p, &added)).collect());
        }
        for (p, given) in given.iter().enumerate() {
            tie((0..physics)
                .filter(|&q| q == p || takes(q, given))
                .collect());
        }
        let mut groups = Vec::new();
        for first in (0..physics).filter(|&p| group_of[p] == p) {
            let members: Vec<usize> = (first..physics).filter(|&p| group_of[p] == first).collect();
            let sees = |p: usize, q: usize| {
                let own = declared.fields(couplers + p, |a| a == Access::Own);
                let home: Vec<_> = own.iter().map(|f| declared.body_of_field[*f]).collect();
                let mut seen = declared.fields(couplers + p, Access::reads);
                seen.retain(|f| !home.contains(&declared.body_of_field[*f]));
                p != q && (shares(&seen, &self.owned[q]) || takes(q, &given[p]))
            };
            let order = topological(members.len(), &|a, b| sees(members[a], members[b]));
            let order = order.map_err(|c| cycle(c.iter().map(|&m| members[m]).collect()))?;
            let members: Vec<usize> = order.into_iter().map(|m| members[m]).collect();
            let gives = |p: &usize| {
                let given = declared.fields(couplers + p, |a| a == Access::Give);
                !given.is_empty()
            };
            groups.push(Group {
                givers: members.iter().copied().filter(gives).collect(),
                members,
                ..Group::default()
            });
        }
        Ok(groups)
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
        let plan = Plan::derive(3, 1, &d, &[0; 4], &labels(4)).expect("no cycle");
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
        let plan = Plan::derive(1, 2, &d, &[0; 6], &labels(3)).expect("no cycle");
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
        let Err(Problem::Cycle(cycle)) = Plan::derive(3, 0, &d, &[0; 3], &labels(3)) else {
            panic!("a cycle must be found");
        };
        assert_eq!(cycle, ["c0", "c1", "c2", "c0"]);
    }

    #[test]
    fn exchanges_and_givers_tie_physics_in_the_order_of_what_they_see() {
        // bodies 0 and 1; physics: p0 owns 0 and takes 1 on body 0, p1 owns 2 and takes 3 on body 1, p2 owns 4 on body 0
        let own = [
            (2, Access::Own, 0),
            (2, Access::Take, 1),
            (3, Access::Own, 2),
            (3, Access::Take, 3),
            (4, Access::Own, 4),
        ];
        let body_of_field = [0, 0, 1, 1, 0];
        // c0 adds to both bodies, c1 to one of them
        let exchange = [
            (0, Access::Read, 0),
            (0, Access::Read, 2),
            (0, Access::Add, 1),
            (0, Access::Add, 3),
            (1, Access::Add, 3),
        ];
        let d = declare(&[&own[..], &exchange].concat());
        let plan = Plan::derive(2, 3, &d, &body_of_field, &labels(5)).expect("no cycle");
        let groups: Vec<_> = plan
            .groups
            .iter()
            .map(|g| (&g.members[..], &g.couplers[..]))
            .collect();
        assert_eq!(groups, [(&[0, 1][..], &[0][..]), (&[2][..], &[][..])]);
        assert_eq!(plan.before, [vec![], vec![1], vec![]]);
        assert!(plan.after.is_empty());

        // p1 sees the state of p0 and gives to it: it advances before p0, and in step with it
        let gives = [(3, Access::Read, 0), (3, Access::Give, 1)];
        let d = declare(&[&own[..], &gives].concat());
        let plan = Plan::derive(2, 3, &d, &body_of_field, &labels(5)).expect("no cycle");
        assert_eq!(plan.groups[0].members, [1, 0]);
        assert_eq!(plan.groups[0].givers, [1]);

        // who see each other cannot advance one after the other
        let both = [&own[..], &gives, &[(2, Access::Read, 2)]].concat();
        let found = Plan::derive(2, 3, &declare(&both), &body_of_field, &labels(5));
        assert!(matches!(found, Err(Problem::Cycle(_))));
    }

    /// A physics that gives amounts to another one of its body advances before it in each common step, whatever the order of
    /// the case, although it reads its state.
    #[test]
    fn a_giver_of_the_same_body_alternates_with_the_taker() {
        let d = declare(&[
            (0, Access::Own, 0),
            (0, Access::Take, 1),
            (1, Access::Own, 2),
            (1, Access::Read, 0),
            (1, Access::Give, 1),
        ]);
        let plan = Plan::derive(0, 2, &d, &[0; 3], &labels(2)).expect("no cycle");
        assert_eq!(plan.groups.len(), 1);
        assert_eq!(plan.groups[0].members, [1, 0]);
        assert_eq!(plan.groups[0].givers, [1]);
    }

    /// What a coupler adds to two bodies makes it an exchange, which ties their physics; what it reads does not.
    #[test]
    fn a_coupler_is_an_exchange_by_what_it_adds() {
        // p0 owns 0 and takes up 1 on body 0, p1 owns 2 and takes up 3 on body 1
        let own = [
            (1, Access::Own, 0),
            (1, Access::Consume, 1),
            (2, Access::Own, 2),
            (2, Access::Consume, 3),
        ];
        let plan = |coupler: &[(usize, Access, usize)]| {
            let d = declare(&[&own[..], coupler].concat());
            Plan::derive(1, 2, &d, &[0, 0, 1, 1], &labels(3)).expect("no cycle")
        };
        let adds_to_both = plan(&[(0, Access::Add, 1), (0, Access::Add, 3)]);
        let members = |plan: &Plan| -> Vec<Vec<usize>> {
            plan.groups.iter().map(|g| g.members.clone()).collect()
        };
        assert_eq!(members(&adds_to_both), [[0, 1]]);
        assert_eq!(adds_to_both.groups[0].couplers, [0]);
        assert_eq!(adds_to_both.groups[0].rates, [1, 3]);
        assert_eq!(adds_to_both.before, [[], []] as [[usize; 0]; 2]);

        let reads_both = plan(&[
            (0, Access::Read, 0),
            (0, Access::Read, 2),
            (0, Access::Add, 3),
        ]);
        assert_eq!(members(&reads_both), [[0], [1]]);
        assert_eq!(reads_both.before, [vec![], vec![0]]);
        assert!(reads_both.groups.iter().all(|g| g.couplers.is_empty()));
        // p1 feeds back to itself through the coupler, p0 does not
        assert_eq!(reads_both.one_way, [true, false]);
    }

    /// A coupler that derives what an exchange reads is applied with it, and one that nobody needs at the end.
    #[test]
    fn feeders_of_an_exchange_are_applied_with_it() {
        let d = declare(&[
            (0, Access::Add, 1),
            (0, Access::Add, 3),
            (0, Access::Read, 5),
            (1, Access::Write, 4),
            (2, Access::Write, 5),
            (3, Access::Own, 0),
            (3, Access::Take, 1),
            (4, Access::Own, 2),
            (4, Access::Take, 3),
        ]);
        let plan = Plan::derive(3, 2, &d, &[0, 0, 1, 1, 0, 0], &labels(5)).expect("no cycle");
        assert_eq!(plan.groups[0].couplers, [2, 0]);
        assert_eq!(plan.after, [1]);
        assert_eq!(plan.amounts, [[1], [3]]);
        assert!(plan.groups[0].rates.is_empty(), "amounts are no rates");
    }
}
