//! Times at which states are logged.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A first part of the run with a log interval of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogStage {
    /// End, s; a state is logged there.
    pub until: f64,
    /// Simulated time between logged states up to then, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: f64,
}

/// Times at which states are logged: those of each stage, counted from its start, and its end; then those after the last stage.
#[derive(Clone, Debug, PartialEq)]
pub struct LogTimes {
    /// Stages in the order of time.
    pub stages: Vec<LogStage>,
    /// Interval after the last stage, s.
    pub interval: f64,
}

/// Log times are products of floating-point numbers: intervals that are complete but for this part count as complete.
const ROUNDING: f64 = 1e-12;

/// A part of an interval below this is rounding, and no state.
const LEAST_PART: f64 = 1e-9;

/// A stage with its start (s) and its number of logged states.
struct CountedStage {
    from: f64,
    stage: LogStage,
    count: u64,
}

impl LogTimes {
    /// One interval (s) during the whole run.
    #[must_use]
    pub fn every(interval: f64) -> LogTimes {
        LogTimes {
            stages: Vec::new(),
            interval,
        }
    }

    fn stages(&self) -> impl Iterator<Item = CountedStage> + '_ {
        let mut start = 0.0;
        self.stages.iter().map(move |stage| {
            let from = std::mem::replace(&mut start, stage.until);
            let intervals = (stage.until - from) / stage.interval * (1.0 - LEAST_PART);
            CountedStage {
                from,
                stage: *stage,
                count: intervals.ceil() as u64,
            }
        })
    }

    /// Start of the part after the last stage, s.
    fn after_stages(&self) -> f64 {
        self.stages.last().map_or(0.0, |stage| stage.until)
    }

    /// Time (s) of the logged state with a number, the initial state having 0.
    #[must_use]
    pub fn time(&self, number: u64) -> f64 {
        let mut left = number;
        for CountedStage { from, stage, count } in self.stages() {
            if left < count {
                return from + left as f64 * stage.interval;
            }
            left -= count;
        }
        self.after_stages() + left as f64 * self.interval
    }

    /// Time (s) of the logged state with a number in a run up to `end` (s), where one is logged, too: those within rounding of it are that one.
    #[must_use]
    pub fn time_until(&self, number: u64, end: f64) -> f64 {
        let time = self.time(number);
        match end - time <= LEAST_PART * self.interval_at(time) {
            true => end,
            false => time,
        }
    }

    /// Number of the last logged state up to a time (s).
    #[must_use]
    pub fn until(&self, time: f64) -> u64 {
        let complete = |from: f64, interval: f64| {
            let intervals = (time - from).max(0.0) / interval;
            (intervals * (1.0 + ROUNDING) + LEAST_PART) as u64
        };
        let mut number = 0;
        for CountedStage { from, stage, count } in self.stages() {
            if time * (1.0 + ROUNDING) < stage.until {
                return number + complete(from, stage.interval).min(count - 1);
            }
            number += count;
        }
        number + complete(self.after_stages(), self.interval)
    }

    /// Interval of the states that are logged after a time, s.
    #[must_use]
    pub fn interval_at(&self, time: f64) -> f64 {
        let stage = self.stages.iter().find(|stage| time < stage.until);
        stage.map_or(self.interval, |stage| stage.interval)
    }

    /// Number of states that are logged after `time` and up to `end` (s), at which one is logged, too.
    #[must_use]
    pub fn left(&self, time: f64, end: f64) -> u64 {
        let last = self.until(end);
        let at_end = u64::from(self.time_until(last, end) < end);
        (last + at_end).saturating_sub(self.until(time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(until: f64, interval: f64) -> LogStage {
        LogStage { until, interval }
    }

    /// Ten intervals of 4e-6 s end 7e-21 s before 4e-5 s.
    #[test]
    fn the_last_state_is_logged_once() {
        for (interval, count, end) in [
            (4e-6, 10, 4e-5),
            (1e-6, 100, 1e-4),
            (0.1, 3, 0.3),
            (7e-7, 100, 7e-5),
        ] {
            let times = LogTimes::every(interval);
            assert_eq!(times.time_until(count, end), end, "{interval}");
            assert!(times.time_until(count - 1, end) < end - 0.9 * interval);
            assert_eq!([times.until(end), times.left(0.0, end)], [count; 2]);
        }
        assert!(LogTimes::every(4e-6).time(10) < 4e-5);
    }

    #[test]
    fn each_stage_has_its_interval_and_a_state_at_its_end() {
        let times = LogTimes {
            stages: vec![stage(1.0, 0.4), stage(3.0, 1.0)],
            interval: 5.0,
        };
        let expected = [0.0, 0.4, 0.8, 1.0, 2.0, 3.0, 8.0, 13.0];
        for (number, time) in expected.into_iter().enumerate() {
            let number = number as u64;
            assert!((times.time(number) - time).abs() < 1e-12, "{number}");
            assert_eq!(times.until(time), number, "{time}");
            assert_eq!(times.until(time + 0.1), number, "after {time}");
        }
        let interval = |time| times.interval_at(time);
        assert_eq!([0.0, 1.0, 2.9, 3.0].map(interval), [0.4, 1.0, 1.0, 5.0]);
        // a state at the end of the run, within an interval or not
        assert_eq!((times.left(0.0, 8.0), times.left(0.0, 9.0)), (6, 7));
        assert_eq!((times.left(0.9, 8.0), times.left(8.0, 8.0)), (4, 0));
    }

    #[test]
    fn rounding_neither_adds_nor_loses_a_state() {
        // 0.6 / 0.2 is 2.9999999999999996, 0.3 / 0.1 likewise
        let times = LogTimes {
            stages: vec![stage(0.3, 0.1), stage(0.9, 0.2)],
            interval: 1e-3,
        };
        assert_eq!((times.until(0.3), times.until(0.9)), (3, 6));
        assert_eq!(times.until(0.1 + 0.2), 3);
        assert_eq!(times.left(0.0, 0.9), 6);
        assert_eq!(LogTimes::every(0.2).until(0.6), 3);
    }
}
