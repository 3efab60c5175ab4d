//! Logged states by requested times.

use crate::terminal::tell;
use crate::unit::number;

/// Why no logged state belongs to a time.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MomentError {
    /// The argument is not a time.
    #[error("`--at` is {0}, expected a time in s")]
    NotATime(f64),
    /// Before the first or after the last logged state.
    #[error("`--at {at}` lies outside of the logged times, {first} to {last} s")]
    Outside {
        /// The requested time, s.
        at: f64,
        /// Time of the first state, s.
        first: f64,
        /// Time of the last state, s.
        last: f64,
    },
}

/// Fraction of the span of the logged times within which two times are equal: printed times have fewer digits.
const ROUNDED: f64 = 1e-4;

/// Number of the logged time nearest to `at` (s); `None` if there are none.
///
/// # Errors
/// No time, or one outside of the log.
pub(crate) fn state_at(times: &[f64], at: f64) -> Result<Option<usize>, MomentError> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return Ok(None);
    };
    if !at.is_finite() {
        return Err(MomentError::NotATime(at));
    }
    let slack = ROUNDED * (last - first);
    if at < first - slack || at > last + slack {
        return Err(MomentError::Outside { at, first, last });
    }
    let distance = |index: &usize| (times[*index] - at).abs();
    Ok((0..times.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))))
}

/// Numbers of the logged times nearest to these (s), in order and each once.
///
/// # Errors
/// No time, or one outside of the log.
pub(crate) fn states_at(times: &[f64], at: &[f64]) -> Result<Vec<usize>, MomentError> {
    let states = at.iter().map(|&at| state_at(times, at));
    let mut states: Vec<usize> = states
        .filter_map(Result::transpose)
        .collect::<Result<_, _>>()?;
    states.sort_unstable();
    states.dedup();
    Ok(states)
}

/// Prints a note for each requested time whose nearest logged time differs.
pub(crate) fn note_other_times(times: &[f64], at: &[f64]) {
    for note in other_times(times, at) {
        tell(&note);
    }
}

fn other_times(times: &[f64], at: &[f64]) -> Vec<String> {
    let extent = times
        .last()
        .zip(times.first())
        .map(|(last, first)| last - first);
    let note = |&at: &f64| {
        let time = times[state_at(times, at).ok()??];
        let is_other = (time - at).abs() > ROUNDED * extent?;
        is_other.then(|| {
            let (at, time) = (number(at, 6), number(time, 6));
            format!("note: the logged state nearest to {at} s is that at {time} s")
        })
    };
    at.iter().filter_map(note).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_state_is_found_within_the_log_only() {
        let times = [0.0, 1.0, 2.5];
        assert_eq!(state_at(&times, 1.6), Ok(Some(1)));
        assert_eq!(state_at(&times, 2.5001), Ok(Some(2)));
        assert_eq!(state_at(&[], 2.5), Ok(None));
        assert_eq!(states_at(&times, &[2.4, 0.1, 2.5]), Ok(vec![0, 2]));
        let notes = other_times(&times, &[1.6, 2.5001, 9.0]);
        assert_eq!(
            notes,
            ["note: the logged state nearest to 1.6 s is that at 1 s"]
        );
        let late = state_at(&times, 3.0).expect_err("late").to_string();
        assert_eq!(
            late,
            "`--at 3` lies outside of the logged times, 0 to 2.5 s"
        );
        assert!(state_at(&times, f64::NAN).is_err());
        assert!(state_at(&times, -1.0).is_err());
    }
}
