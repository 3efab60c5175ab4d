//! Programmes in time: what a plugin does up to a certain time, such as along a toolpath, by a table of values or in layers.
//!
//! A plugin states when its programme ends ([`Stepping`](crate::Stepping)); a run that ends earlier warns
//! ([`Simulation::unreached`](crate::Simulation::unreached)).

use std::borrow::Cow;

use crate::in_time::InTime;
use crate::text::number;

/// Most events that are looked at for the last one.
const MOST_EVENTS: usize = 10_000;

/// Difference of times that is taken for rounding, relative.
const ROUNDING: f64 = 1e-9;

/// The activity of a plugin up to a certain time.
#[derive(Clone, Debug, PartialEq)]
pub struct Programme {
    /// What happens last, before ` at 40 s`: `its toolpath`, `the cut is made`.
    pub what: Cow<'static, str>,
    /// When it ends, s.
    pub end: f64,
    /// The part of it that is done at the end of the run, where there is such a number.
    pub done: Option<DoneFraction>,
    /// What it waits for at the time for which it is known, as a sentence without a full stop.
    pub waits: Option<String>,
}

/// A part of a programme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoneFraction {
    /// 0 to 1.
    pub fraction: f64,
    /// The whole, such as `the path with power`.
    pub of: &'static str,
}

impl Programme {
    /// A programme that ends at `end` (s).
    pub fn new(what: impl Into<Cow<'static, str>>, end: f64) -> Self {
        Programme {
            what: what.into(),
            end,
            done: None,
            waits: None,
        }
    }

    /// The events after a time (s) of a plugin that states no other programme; `next` gives the first one after a time.
    pub fn of_events(after: f64, next: impl Fn(f64) -> Option<f64>) -> Option<Self> {
        let events = std::iter::successors(next(after), |event| next(*event));
        let last = events.take(MOST_EVENTS).last()?;
        Some(Programme::new("its last event is", last))
    }

    /// The values of keys that may change in time: up to the last change of any of them.
    pub fn of_values<'a>(
        values: impl IntoIterator<Item = (&'static str, &'a InTime)>,
    ) -> Option<Self> {
        let changes = values
            .into_iter()
            .filter_map(|(key, value)| Some((value.last_change()?, key)));
        let (end, key) = changes.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Programme::new(
            format!("the last change of `{key}` is"),
            end,
        ))
    }

    /// A warning if a run that ends at a time (s) does not reach the end of the programme, as a sentence without a full stop.
    pub fn unreached(&self, run_end: f64) -> Option<String> {
        if self.end <= run_end * (1.0 + ROUNDING) {
            return None;
        }
        let done = self.done.map_or(String::new(), |done| {
            format!(" ({} % of {})", number(100.0 * done.fraction, 3), done.of)
        });
        let [run_end, end] = [run_end, self.end].map(|t| number(t, 6));
        Some(format!(
            "the run ends at {run_end} s, {} at {end} s{done}",
            self.what
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_ends_before_a_programme_is_told() {
        let path = Programme {
            done: Some(DoneFraction {
                fraction: 0.1,
                of: "the path with power",
            }),
            ..Programme::new("its toolpath", 40.0)
        };
        let told = "the run ends at 4 s, its toolpath at 40 s (10 % of the path with power)";
        assert_eq!(path.unreached(4.0).as_deref(), Some(told));
        assert_eq!(path.unreached(40.0), None);
        assert_eq!(path.unreached(40.0 - 1e-9), None, "rounding");
        assert_eq!(path.unreached(50.0), None);
    }

    #[test]
    fn values_end_with_their_last_change() {
        let table = |time: &[f64], value: &[f64]| {
            let json = serde_json::json!({ "time": time, "value": value });
            serde_json::from_value::<InTime>(json).expect("a table")
        };
        let end = |values: &[(&'static str, &InTime)]| {
            Programme::of_values(values.iter().copied()).map(|p| p.end)
        };
        let ramp = table(&[0.0, 10.0], &[300.0, 500.0]);
        let held = table(&[0.0, 5.0, 1e9], &[300.0, 500.0, 500.0]);
        let constant = table(&[0.0, 5.0], &[300.0, 300.0]);
        assert_eq!(end(&[("ambient", &ramp)]), Some(10.0));
        assert_eq!(end(&[("ambient", &held)]), Some(5.0));
        assert_eq!(
            end(&[("ambient", &constant), ("flux", &InTime::Constant(1.0))]),
            None
        );
        let both = Programme::of_values([("x", &held), ("y", &ramp)]).expect("changes");
        assert_eq!((&*both.what, both.end), ("the last change of `y` is", 10.0));
    }

    #[test]
    fn events_end_with_the_last_one() {
        let events = [1.0, 2.0, 5.0];
        let next = |after: f64| events.into_iter().find(|e| *e > after);
        assert_eq!(Programme::of_events(1.5, next).map(|p| p.end), Some(5.0));
        assert_eq!(Programme::of_events(5.0, next), None);
    }
}
