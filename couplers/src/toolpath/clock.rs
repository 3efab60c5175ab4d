//! The clock of a toolpath: time of the track against time of the run, which differ by the waits so far.
//!
//! A path waits only where a pass begins, and waits end between steps only, so that events land exactly: within a step the
//! clock runs evenly or stands still. A torch and what follows it share one path with one clock.

use std::cell::RefCell;

use nalgebra::Vector3;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Read, Report, Setup, SetupError, World, keys};
use serde::{Deserialize, Serialize};

use super::track::{Pose, Track};
use super::wait::Gauge;

/// Difference of times that is taken for rounding, relative to the time.
const ROUNDING: f64 = 1e-12;

/// Most passes whose starts are reported one by one.
const MOST_REPORTED: usize = 50;

/// A toolpath with its clock.
#[derive(Debug)]
pub struct TimedPath {
    track: Track,
    clock: RefCell<Clock>,
    gauges: RefCell<Option<Gauges>>,
}

/// Where the conditions of the waits are measured.
#[derive(Debug)]
struct Gauges {
    body: BodyIndex,
    temperature: Read<f64>,
    /// By pass.
    by_pass: Vec<Option<Gauge>>,
}

/// State of the clock, saved with checkpoints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Clock {
    /// Time spent waiting, s: time of the run less time of the track.
    delay: f64,
    /// Passes that have begun: time of the run (s), and temperature that ended the wait (K).
    begun: Vec<(f64, Option<f64>)>,
    /// Temperature at the last look while waiting, K.
    last: Option<f64>,
}

/// Time of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TrackTime {
    /// The path goes on, s.
    Running(f64),
    /// The path waits before the pass that begins at this time of the track, s.
    Waiting(f64),
}

impl TrackTime {
    /// Whether something that happens at `event` (s, of the track) has happened.
    pub fn has_passed(self, event: f64) -> bool {
        match self {
            TrackTime::Running(now) => event <= now,
            TrackTime::Waiting(at) => event < at,
        }
    }
}

impl TimedPath {
    /// A path at its start.
    pub fn new(track: Track) -> Self {
        TimedPath {
            track,
            clock: RefCell::default(),
            gauges: RefCell::default(),
        }
    }

    /// The path in its own time.
    pub fn track(&self) -> &Track {
        &self.track
    }

    /// Finds the points whose temperature the waits of the path need.
    ///
    /// # Errors
    /// A condition that cannot be measured.
    pub(crate) fn prepare(&self, setup: &mut Setup<'_>, body: BodyIndex) -> Result<(), SetupError> {
        if !self.waits() {
            return Ok(());
        }
        let gauge = |pass: &super::track::Pass| {
            let wait = pass.wait.as_ref();
            wait.map(|w| w.gauge(setup, body)).transpose()
        };
        let by_pass = self
            .track
            .passes()
            .iter()
            .map(gauge)
            .collect::<Result<_, _>>()?;
        *self.gauges.borrow_mut() = Some(Gauges {
            body,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            by_pass,
        });
        Ok(())
    }

    /// Whether any pass waits for something.
    pub(crate) fn waits(&self) -> bool {
        self.track.passes().iter().any(|p| p.wait.is_some())
    }

    /// Begins the passes whose time has come and whose condition is met, with the state at the start of a step.
    pub(crate) fn begin_step(&self, world: &World, time: f64) {
        let clock = &mut *self.clock.borrow_mut();
        let gauges = self.gauges.borrow();
        while let Some(pass) = self.track.passes().get(clock.begun.len()) {
            let due = pass.time + clock.delay;
            if due - time > ROUNDING * time.abs() {
                break;
            }
            let measured = pass.wait.as_ref().and_then(|_| {
                let gauges = gauges.as_ref()?;
                let gauge = gauges.by_pass.get(clock.begun.len())?.as_ref()?;
                gauge.measure(world, gauges.body, gauges.temperature)
            });
            clock.last = measured;
            match (&pass.wait, measured) {
                (Some(wait), Some(temperature)) if !wait.is_over(temperature) => break,
                (Some(_), _) if time > due => clock.delay = time - pass.time,
                _ => {}
            }
            clock.begun.push((pass.time + clock.delay, measured));
        }
    }

    /// Time of the track at a time of the run, s.
    pub(crate) fn at(&self, time: f64) -> TrackTime {
        let clock = self.clock.borrow();
        let now = time - clock.delay;
        let ahead = self.track.passes().iter().skip(clock.begun.len());
        let wait = ahead.filter(|p| p.wait.is_some()).find(|p| now >= p.time);
        if let Some(pass) = wait {
            return TrackTime::Waiting(pass.time);
        }
        // the difference of two times may fall short of an event by its rounding
        let slack = match clock.delay {
            0.0 => 0.0,
            delay => 4.0 * f64::EPSILON * (time.abs() + delay),
        };
        let event = self.track.next_event(now).filter(|e| e - now <= slack);
        TrackTime::Running(event.unwrap_or(now))
    }

    /// As [`Track::pose`], in time of the run; while the path waits the source is off.
    pub fn pose(&self, time: f64) -> Pose {
        match self.at(time) {
            TrackTime::Running(now) => self.track.pose(now),
            TrackTime::Waiting(at) => self.track.rest_before(at),
        }
    }

    /// As [`Track::last_pose_with_power`], in time of the run.
    pub(crate) fn last_pose_with_power(&self, time: f64) -> Pose {
        let (TrackTime::Running(now) | TrackTime::Waiting(now)) = self.at(time);
        self.track.last_pose_with_power(now)
    }

    /// As [`Track::next_event`], in time of the run, as far as it is known: up to the next wait.
    pub fn next_event(&self, after: f64) -> Option<f64> {
        self.next_of(after, |now| self.track.next_event(now))
    }

    /// The first time of the run after `after` (s) from events of the track: `next` gives the first one after a time of
    /// the track.
    pub(crate) fn next_of(&self, after: f64, next: impl Fn(f64) -> Option<f64>) -> Option<f64> {
        let TrackTime::Running(now) = self.at(after) else {
            return None;
        };
        let clock = self.clock.borrow();
        let ahead = self.track.passes().iter().skip(clock.begun.len());
        let wait = ahead.filter(|p| p.wait.is_some()).map(|p| p.time).next();
        let event = next(now);
        let event = match (event, wait) {
            (Some(event), Some(wait)) => event.min(wait),
            (event, wait) => event.or(wait)?,
        };
        Some(event + clock.delay)
    }

    /// Whether the source has power between `time` (s) and the next event.
    pub(crate) fn is_on_after(&self, time: f64) -> bool {
        let TrackTime::Running(now) = self.at(time) else {
            return false;
        };
        let until = self.track.next_event(now).unwrap_or(f64::INFINITY);
        self.track.energy(now, until) > 0.0
    }

    /// Time of the run of an event of the track that has happened since the last wait, s.
    pub(crate) fn time_of(&self, event: f64) -> f64 {
        event + self.clock.borrow().delay
    }

    /// At the first position, m.
    pub(crate) fn first_position(&self) -> Vector3<f64> {
        self.track.pose(self.track.start()).position
    }

    /// What the path waits for at a time (s), as a sentence.
    pub(crate) fn unfinished(&self, time: f64) -> Option<String> {
        let clock = self.clock.borrow();
        let passes = self.track.passes();
        let next = passes.get(clock.begun.len())?;
        let wait = next.wait.as_ref()?;
        let since = next.time + clock.delay;
        if since > time {
            return None;
        }
        let last = clock
            .last
            .map_or(String::new(), |t| format!(", now {t:.1} K"));
        Some(format!(
            "the run ends while pass {} of {} waits, since {since:.6} s, for {}{last}",
            clock.begun.len() + 1,
            passes.len(),
            wait.phrase(),
        ))
    }

    /// Passes that have begun, when, and at which temperature a wait ended; nothing for a path that is a single pass.
    pub(crate) fn report(&self) -> Vec<Report> {
        let passes = self.track.passes();
        if passes.is_empty() {
            return Vec::new();
        }
        let clock = self.clock.borrow();
        let report = |name: String, unit: &str, value: f64| Report {
            name,
            unit: unit.into(),
            value,
        };
        let mut all = vec![
            report("passes.begun".into(), "1", clock.begun.len() as f64),
            report("passes.waited".into(), "s", clock.delay),
        ];
        for (index, pass) in passes.iter().enumerate().take(MOST_REPORTED) {
            let begun = clock.begun.get(index);
            let number = index + 1;
            let start = begun.map_or(f64::NAN, |(start, _)| *start);
            all.push(report(format!("pass.{number}.start"), "s", start));
            if pass.wait.is_some() {
                let temperature = begun.and_then(|(_, t)| *t).unwrap_or(f64::NAN);
                all.push(report(
                    format!("pass.{number}.temperature"),
                    "K",
                    temperature,
                ));
            }
        }
        all
    }

    /// State for a checkpoint.
    pub(crate) fn save(&self) -> Clock {
        self.clock.borrow().clone()
    }

    /// Restores what [`TimedPath::save`] gave.
    pub(crate) fn load(&self, clock: Clock) {
        *self.clock.borrow_mut() = clock;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, set};
    use perimelt_core::World;
    use std::path::Path;

    /// A path of three passes on a block whose temperature the test sets, with waits before the last two.
    fn path() -> (TimedPath, World) {
        let toolpath: crate::toolpath::Toolpath = toml::from_str(
            "sequence = { wait_until = { temperature = 400, region = 'left' }, passes = [
                { toolpath.line = { start = [0, 0, 0], end = [2, 0, 0], speed = 1 } },
                { toolpath.line = { start = [0, 0, 0], end = [3, 0, 0], speed = 1 } },
                { toolpath.line = { start = [1, 1, 0], end = [4, 1, 0], speed = 1 },
                  wait_until = { temperature = 350, when = 'above', at = [3.2, 0.5, 0.5] } } ] }",
        )
        .expect("well formed");
        let track = toolpath.track(Some(100.0), Path::new("")).expect("valid");
        let path = TimedPath::new(track);
        let mut world = World::new(vec![block([4, 2, 2], 3, STEEL)]);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("the torch");
        path.prepare(&mut setup, 0).expect("a region and a place");
        (path, world)
    }

    fn heat(world: &mut World, temperature: f64) {
        set(world, &keys::TEMPERATURE, |_| temperature);
    }

    #[test]
    fn a_path_waits_for_its_temperature_and_goes_on_where_it_was() {
        let (path, mut world) = path();
        heat(&mut world, 500.0);
        path.begin_step(&world, 0.0);
        assert_eq!(path.next_event(0.0), Some(2.0));
        assert_eq!(path.pose(1.0).power, 100.0);
        path.begin_step(&world, 2.0);
        // the source is off at the end of its pass, and nothing is known to happen
        let pose = path.pose(2.5);
        assert_eq!((pose.power, pose.position.x), (0.0, 2.0));
        assert_eq!(path.next_event(2.0), None);
        assert!(!path.is_on_after(2.0));
        let told = path.unfinished(5.0).expect("it waits");
        assert!(
            told.contains("pass 2 of 3") && told.contains("at most 400 K in region `left`"),
            "{told}"
        );
        // a part of the region alone is not enough
        set(&mut world, &keys::TEMPERATURE, |point| {
            if point == 0 { 400.5 } else { 300.0 }
        });
        path.begin_step(&world, 5.0);
        assert_eq!(path.pose(5.1).power, 0.0);
        heat(&mut world, 399.0);
        path.begin_step(&world, 5.3);
        assert_eq!(path.pose(5.3 + 1.5).position.x, 1.5);
        assert!(path.is_on_after(5.3));
        let event = path.next_event(5.3).expect("the end of the pass");
        assert!((event - 8.3).abs() < 1e-14);
        assert!(path.unfinished(7.0).is_none());
        path.begin_step(&world, event);
        // pass 3 waits for nothing: it is hot enough
        let place = path.pose(event + 1.0).position;
        // rounding of times
        assert!((place - Vector3::new(2.0, 1.0, 0.0)).norm() < 1e-14);
        let report = path.report();
        let value = |name: &str| {
            report
                .iter()
                .find(|r| r.name == name)
                .expect("reported")
                .value
        };
        assert_eq!(value("pass.2.start"), 5.3);
        assert_eq!(value("pass.2.temperature"), 399.0);
        assert_eq!(value("pass.3.start"), event);
        assert_eq!(value("passes.begun"), 3.0);
        assert!((value("passes.waited") - 3.3).abs() < 1e-14);
    }

    #[test]
    fn the_clock_of_a_waiting_path_is_restored() {
        let (path, mut world) = path();
        heat(&mut world, 500.0);
        for time in [0.0, 2.0, 3.0] {
            path.begin_step(&world, time);
        }
        let (resumed, _) = self::path();
        resumed.load(path.save());
        heat(&mut world, 300.0);
        for each in [&path, &resumed] {
            each.begin_step(&world, 4.1);
        }
        assert_eq!(path.save(), resumed.save());
        assert_eq!(path.next_event(4.1), resumed.next_event(4.1));
        // pass 3 waits, since the block is colder than what it needs
        path.begin_step(&world, path.next_event(4.1).expect("the end of the pass"));
        assert!(
            path.unfinished(9.0)
                .is_some_and(|told| told.contains("at least 350 K at"))
        );
    }

    #[test]
    fn what_happens_at_the_beginning_of_a_pass_has_not_happened_while_it_waits() {
        assert!(TrackTime::Running(2.0).has_passed(2.0));
        assert!(!TrackTime::Waiting(2.0).has_passed(2.0));
        assert!(TrackTime::Waiting(2.0).has_passed(1.9));
    }

    #[test]
    fn conditions_that_cannot_be_measured_are_refused() {
        for (wait, message) in [
            ("temperature = -3", "`wait_until.temperature` is -3 K"),
            (
                "temperature = 400, region = 'right'",
                "no region is called `right`",
            ),
            (
                "temperature = 400, at = [9, 0, 0]",
                "`wait_until.at` is [9, 0, 0] m",
            ),
            (
                "temperature = 400, at = [0, 0, 0], region = 'left'",
                "both `region` and `at`",
            ),
        ] {
            let toolpath: crate::toolpath::Toolpath = toml::from_str(&format!(
                "sequence.passes = [{{ toolpath.line = {{ start = [0, 0, 0], end = [2, 0, 0], speed = 1 }},
                 wait_until = {{ {wait} }} }}]"
            ))
            .expect("well formed");
            let track = toolpath.track(Some(100.0), Path::new("")).expect("valid");
            let mut world = World::new(vec![block([4, 2, 2], 3, STEEL)]);
            let mut setup = Setup::new(&mut world, Path::new("."));
            setup.next_plugin("the torch");
            let refused = TimedPath::new(track)
                .prepare(&mut setup, 0)
                .expect_err(wait);
            assert!(refused.to_string().contains(message), "{refused}");
        }
    }
}
