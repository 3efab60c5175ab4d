//! Bonds beyond their limits, and how they break.

use perimelt_core::family::BrokenBonds;
use perimelt_core::solver::Reducer;
use perimelt_core::{Bond, Family};

/// A bond beyond its limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exceeding {
    /// Load over limit.
    pub(super) ratio: f64,
    /// The set of bonds that it belongs to.
    pub(super) set: usize,
    /// Its point.
    pub(super) point: usize,
    /// The slot of its other end.
    pub(super) slot: usize,
}

/// A set of bonds that may break.
#[derive(Clone, Copy)]
pub(super) struct Breakable<'a> {
    /// Number of the set.
    pub(super) set: usize,
    pub(super) family: &'a Family,
    pub(super) broken: &'a BrokenBonds,
}

impl Breakable<'_> {
    /// Adds the unbroken bonds of `points` beyond their limit to `found`; `ratio` is the load over the limit of a bond of a point, by its
    /// number there, with a slot.
    pub(super) fn find_exceeding(
        self,
        points: impl Iterator<Item = usize>,
        ratio: impl Fn(usize, usize, &Bond, usize) -> f64,
        found: &mut Vec<Exceeding>,
    ) {
        let Breakable {
            set,
            family,
            broken,
        } = self;
        for point in points {
            family.for_each_bond(point, |number, bond, slot| {
                if !broken.is_broken(point, number) {
                    let ratio = ratio(point, number, bond, slot);
                    if ratio >= 1.0 {
                        found.push(Exceeding {
                            ratio,
                            set,
                            point,
                            slot,
                        });
                    }
                }
            });
        }
    }
}

impl Exceeding {
    /// Keeps those with at least `fraction` of the largest load of all processes that share the points.
    pub(super) fn keep_largest(found: &mut Vec<Exceeding>, fraction: f64, points: &Reducer) {
        if fraction > 0.0 {
            let largest = points.max(found.iter().map(|e| e.ratio).fold(0.0, f64::max));
            found.retain(|e| e.ratio >= fraction * largest);
        }
    }

    /// Breaks both directions of the bond, and passes each that was intact to `on_break`: its point, its number there. The
    /// pair of points, the smaller one first, if there are two and one direction was intact.
    pub(super) fn break_bond(
        &self,
        family: &Family,
        broken: &mut BrokenBonds,
        mut on_break: impl FnMut(usize, usize),
    ) -> Option<[u32; 2]> {
        let Exceeding { point, slot, .. } = *self;
        let mut is_new = break_direction(family, broken, [point, slot], &mut on_break);
        let own = family.slot_of(point);
        let other = family.any_point_in(slot)?;
        if other < family.points() {
            // by rounding, only one end may have exceeded the limit
            is_new |= break_direction(family, broken, [other, own], &mut on_break);
        } else {
            family.break_remote(other, own, broken);
        }
        is_new.then(|| [point.min(other) as u32, point.max(other) as u32])
    }
}

/// Breaks the bonds of a point with a slot; whether one was intact.
fn break_direction(
    family: &Family,
    broken: &mut BrokenBonds,
    [point, slot]: [usize; 2],
    on_break: &mut impl FnMut(usize, usize),
) -> bool {
    let mut was_intact = false;
    family.for_each_bond(point, |number, _, other| {
        if other == slot && !broken.is_broken(point, number) {
            broken.break_bond(point, number);
            on_break(point, number);
            was_intact = true;
        }
    });
    was_intact
}

/// Fraction of the weight of the bonds of a point that count, which is that of broken ones.
pub(super) fn lost_fraction(
    family: &Family,
    broken: &BrokenBonds,
    point: usize,
    counts: impl Fn(&Bond) -> bool,
) -> f64 {
    if broken.of(point) == 0 {
        return 0.0;
    }
    let (mut lost, mut total) = (0.0, 0.0);
    family.for_each_bond(point, |number, bond, _| {
        if counts(bond) {
            total += bond.weight;
            if broken.is_broken(point, number) {
                lost += bond.weight;
            }
        }
    });
    lost / total
}

/// All pairs of points that lost their bond, the smaller one first.
pub(super) fn broken_pairs<'a>(
    family: &'a Family,
    broken: &'a BrokenBonds,
) -> impl Iterator<Item = [usize; 2]> + 'a {
    let lost = (0..family.points()).filter(|p| broken.of(*p) > 0);
    lost.flat_map(|point| {
        let mut pairs = Vec::new();
        family.for_each_bond(point, |number, _, slot| {
            if broken.is_broken(point, number)
                && let Some(other) = family.any_point_in(slot)
                && other > point
            {
                pairs.push([point, other]);
            }
        });
        pairs
    })
}
