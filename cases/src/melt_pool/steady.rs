//! The steady part of the melt pools of a run.

use super::MeltPool;
use super::directions::{SourceState, dot};

/// Cosine of the largest angle between the directions of travel of two states of one part of a path, 20 degrees: an arc
/// with states close to each other is one part, a corner begins a new one.
pub(super) const STRAIGHT: f64 = 0.94;

/// A state with the source that made its pool.
pub(crate) type PoolState<'a> = (&'a MeltPool, &'a SourceState);

/// The states, by their numbers, in which the pool is steady: the source is on and farther than the longest pool of the
/// straight part of its path from the first and from the last state of that part.
pub(crate) fn steady(states: &[Option<PoolState<'_>>]) -> Vec<usize> {
    let mut steady = Vec::new();
    let mut part: Vec<(usize, PoolState<'_>)> = Vec::new();
    for (index, state) in states.iter().enumerate() {
        let goes_on = |(pool, source): &PoolState<'_>| {
            let last = part.last().is_none_or(|(_, (last, before))| {
                dot(last.travel, pool.travel) > STRAIGHT && source.path > before.path
            });
            last && source.is_on && source.travel.is_some()
        };
        match state {
            Some(state) if goes_on(state) => part.push((index, *state)),
            state => {
                steady.extend(inside(&part));
                part.clear();
                let on = state.filter(|(_, s)| s.is_on && s.travel.is_some());
                part.extend(on.map(|state| (index, state)));
            }
        }
    }
    steady.extend(inside(&part));
    steady
}

/// The states of a straight part that are not near its ends.
fn inside<'a>(part: &'a [(usize, PoolState<'a>)]) -> impl Iterator<Item = usize> + 'a {
    let longest = part.iter().map(|(_, (pool, _))| pool.length());
    let longest = longest.fold(0.0, f64::max);
    let path = |state: Option<&(usize, PoolState<'_>)>| state.map_or(0.0, |(_, (_, s))| s.path);
    let (first, last) = (path(part.first()), path(part.last()));
    let is_inside = move |path: f64| path - first >= longest && last - path >= longest;
    let inside = part.iter().filter(move |(_, (_, s))| is_inside(s.path));
    inside.map(|(index, _)| *index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_near_the_ends_of_straight_parts_are_not_steady() {
        // 10 mm along x, 10 mm along y, then off; a state every millimetre, pools 2.5 mm long
        let state = |index: usize| {
            let travel = if index <= 10 {
                [1.0, 0.0, 0.0]
            } else {
                [0.0, 1.0, 0.0]
            };
            let pool = MeltPool {
                travel,
                rear: 0.0,
                front: 2.5e-3,
                width: None,
                sides: None,
                depth: None,
                volume: 0.0,
                peak: 2000.0,
                copies: 1.0,
            };
            let source = SourceState {
                position: [0.0; 3],
                travel: Some(travel),
                beam: [0.0, 0.0, -1.0],
                is_on: index <= 20,
                path: 1e-3 * index.min(20) as f64,
            };
            (pool, source)
        };
        let states: Vec<_> = (0..30).map(state).collect();
        let states: Vec<Option<PoolState<'_>>> = states.iter().map(|(p, s)| Some((p, s))).collect();
        assert_eq!(steady(&states), [3, 4, 5, 6, 7, 14, 15, 16, 17]);
    }
}
