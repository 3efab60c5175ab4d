//! Logged states by the times that a user asks for.

use perimelt_core::log::{LogError, LoggedCloud};

use crate::commands::tell;

/// Why no logged state belongs to a time.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MomentError {
    /// Not a time.
    #[error("`--at` is {0}, expected a time in s")]
    NotATime(f64),
    /// Before the first or after the last logged state.
    #[error("`--at {at}` lies outside of the logged times, {first} to {last} s")]
    Outside {
        /// Asked for, s.
        at: f64,
        /// Of the first state, s.
        first: f64,
        /// Of the last state, s.
        last: f64,
    },
}

/// Number of the logged time nearest to `at` (s); the user is told of another time than that. `None` if there are none.
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
    // logged times are printed with fewer digits than they have
    let slack = 1e-4 * (last - first);
    if at < first - slack || at > last + slack {
        return Err(MomentError::Outside { at, first, last });
    }
    let distance = |index: &usize| (times[*index] - at).abs();
    let nearest = (0..times.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    if let Some(&time) = nearest
        .map(|n| &times[n])
        .filter(|t| (**t - at).abs() > slack)
    {
        tell(&format!(
            "note: the logged state nearest to {at} s is that at {time} s"
        ));
    }
    Ok(nearest)
}

/// A logged state; `None` for a damaged one, of which the user is told.
///
/// # Errors
/// Any other error.
pub(crate) fn sound(cloud: Result<LoggedCloud, LogError>) -> Result<Option<LoggedCloud>, LogError> {
    match cloud {
        Err(damage @ LogError::Damaged { .. }) => {
            tell(&format!("warning: a state is left out: {damage}"));
            Ok(None)
        }
        cloud => cloud.map(Some),
    }
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
        let late = state_at(&times, 3.0).expect_err("late").to_string();
        assert_eq!(
            late,
            "`--at 3` lies outside of the logged times, 0 to 2.5 s"
        );
        assert!(state_at(&times, f64::NAN).is_err());
        assert!(state_at(&times, -1.0).is_err());
    }
}
