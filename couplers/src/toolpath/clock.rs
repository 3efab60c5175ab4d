//! The clock of a toolpath: time of the track against time of the run, which differ by the waits so far.
//!
//! A path waits only where a pass begins, and waits end only between steps, so that steps can end exactly on events: within a
//! step the clock runs evenly or stands still. A torch and the couplers that follow it share one path with one clock.

use std::cell::{Cell, RefCell};

use nalgebra::Vector3;
use perimelt_core::programme::{DoneFraction, Programme};
use perimelt_core::world::BodyIndex;
use perimelt_core::{Face, Read, Report, Setup, SetupError, World, keys};
use serde::{Deserialize, Serialize};

use super::pulse::{Pulse, Pulses};
use super::track::{Pose, Track};
use super::wait::Gauge;

/// Largest relative difference of two times that is rounding.
const ROUNDING: f64 = 1e-12;

/// Most passes whose starts are reported one by one.
const MOST_REPORTED: usize = 50;

/// A toolpath with its clock.
#[derive(Debug)]
pub struct TimedPath {
    track: Track,
    pulses: Option<Pulses>,
    /// Axis of the torch where the track does not give it.
    torch: Option<Vector3<f64>>,
    /// The heated face and its level (m) where the track does not give it.
    surface: (Face, Option<f64>),
    taken: RefCell<Vec<Taken>>,
    clock: RefCell<ClockState>,
    /// Start of the present step, s.
    now: Cell<f64>,
    gauges: RefCell<Option<Gauges>>,
}

/// Energy of the path that another coupler takes from a time on.
#[derive(Clone, Copy, Debug)]
struct Taken {
    /// Time of the track, s.
    from: f64,
    /// Fraction of the energy before any efficiency.
    fraction: f64,
}

/// Measurement of the conditions of the waits.
#[derive(Debug)]
struct Gauges {
    body: BodyIndex,
    temperature: Read<f64>,
    /// Gauges by pass.
    by_pass: Vec<Option<Gauge>>,
}

/// State of the clock, saved with checkpoints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClockState {
    /// Time spent waiting, s: time of the run less time of the track.
    delay: f64,
    /// Passes that have begun: time of the run (s), and the temperature that ended the wait (K).
    begun: Vec<(f64, Option<f64>)>,
    /// Last measured temperature while waiting, K.
    last: Option<f64>,
}

/// Time of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TrackTime {
    /// The path continues; time, s.
    Running(f64),
    /// The path waits before the pass that begins at this time of the track, s.
    Waiting(f64),
}

impl TrackTime {
    /// Whether `event` (s, of the track) lies in the past.
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
            pulses: None,
            torch: None,
            surface: (Face::ZMax, None),
            taken: RefCell::default(),
            clock: RefCell::default(),
            now: Cell::new(f64::NEG_INFINITY),
            gauges: RefCell::default(),
        }
    }

    /// This path with pulsed power.
    pub(crate) fn pulsed(self, pulse: Option<Pulse>) -> Self {
        let start = self
            .track
            .powered_moves()
            .next()
            .map_or(0.0, |(start, _)| start);
        TimedPath {
            pulses: pulse.map(|pulse| Pulses::new(pulse, start)),
            ..self
        }
    }

    /// This path over a heated face at a level (m), that of the path where it is left out, with an axis of the torch (unit vector, into
    /// the material) where the track does not give it.
    pub(crate) fn over(self, surface: (Face, Option<f64>), torch: Option<Vector3<f64>>) -> Self {
        TimedPath {
            surface,
            torch,
            ..self
        }
    }

    /// Axis of the torch (unit vector, into the material) where the track does not give it.
    pub(crate) fn torch(&self) -> Option<Vector3<f64>> {
        self.torch
    }

    /// The spot (m) in the heated face and the axis (unit vector, into the material) of a source at a pose.
    pub(crate) fn spot(&self, pose: &Pose) -> (Vector3<f64>, Vector3<f64>) {
        let (face, level) = self.surface;
        let mut position = pose.position;
        if let Some(axis) = pose.torch.or(self.torch) {
            return (position, axis);
        }
        if let Some(level) = level {
            position[face.axis()] = level;
        }
        (position, -face.normal())
    }

    /// Subtracts energies (J) at times of the track (s), such as those of droplets, from the energy of the path. The fraction is
    /// constant from one switch-on for a pass to the next.
    pub(crate) fn take(&self, parts: impl Iterator<Item = (f64, f64)>) {
        let starts = self.track.powered_passes();
        let mut energies = vec![0.0; starts.len()];
        for (time, energy) in parts {
            energies[starts.partition_point(|start| *start <= time).max(1) - 1] += energy;
        }
        let fraction = |k: usize| match energies[k] {
            0.0 => 0.0,
            energy => energy / self.energy(starts[k], starts.get(k + 1).copied()),
        };
        let taken = |k: usize| Taken {
            from: starts[k],
            fraction: fraction(k),
        };
        *self.taken.borrow_mut() = (0..starts.len()).map(taken).collect();
    }

    /// The fraction of the power that is left at a time of the run (s) for a source with an efficiency.
    pub(crate) fn left(&self, time: f64, efficiency: f64) -> f64 {
        let taken = self.taken.borrow();
        let (TrackTime::Running(now) | TrackTime::Waiting(now)) = self.at(time);
        let begun = taken.partition_point(|t| t.from <= now).max(1);
        match taken.get(begun - 1).map_or(0.0, |t| t.fraction) {
            0.0 => 1.0,
            fraction => 1.0 - fraction / efficiency,
        }
    }

    /// Energy between two times of the track, without `to` up to its end, before any efficiency, J; infinite for a path without an end.
    fn energy(&self, from: f64, to: Option<f64>) -> f64 {
        let Some(end) = to.or(self.track.end()) else {
            return f64::INFINITY;
        };
        let next = |from: &f64| self.next_switch(*from).filter(|next| *next < end);
        let part = |from: f64| {
            let to = self.next_switch(from).map_or(end, |next| next.min(end));
            let middle = 0.5 * (from + to);
            let factor = self.pulses.map_or(1.0, |pulses| pulses.factor(middle));
            factor * self.track.energy(from, to)
        };
        std::iter::successors(Some(from), next).map(part).sum()
    }

    /// [`Track::next_event`] with the switches of pulses, in time of the track.
    fn next_switch(&self, now: f64) -> Option<f64> {
        let event = self.track.next_event(now);
        match self.pulses {
            Some(pulses) if self.track.energy(now, event.unwrap_or(f64::INFINITY)) > 0.0 => {
                pulses.next_switch(now, event)
            }
            _ => event,
        }
    }

    /// The path in its own time.
    pub fn track(&self) -> &Track {
        &self.track
    }

    /// Reports the warnings of the path, and finds the points whose temperature its waits need.
    ///
    /// # Errors
    /// A condition that cannot be measured.
    pub(crate) fn prepare(&self, setup: &mut Setup<'_>, body: BodyIndex) -> Result<(), SetupError> {
        for warning in self.track.warnings() {
            setup.warn(warning);
        }
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
        self.now.set(time);
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

    /// [`Track::pose`] in time of the run; while the path waits the source is off.
    pub fn pose(&self, time: f64) -> Pose {
        match self.at(time) {
            TrackTime::Running(now) => {
                let mut pose = self.track.pose(now);
                pose.power *= self.pulses.map_or(1.0, |pulses| pulses.factor(now));
                pose
            }
            TrackTime::Waiting(at) => self.track.rest_before(at),
        }
    }

    /// [`Track::last_pose_with_power`] in time of the run.
    pub(crate) fn last_pose_with_power(&self, time: f64) -> Pose {
        match self.at(time) {
            TrackTime::Running(now) => self.track.last_pose_with_power(now),
            TrackTime::Waiting(at) => self.track.end_of_power_before(at),
        }
    }

    /// [`Track::next_event`] with the switches of pulses, in time of the run; no later than the start of the next wait.
    pub fn next_event(&self, after: f64) -> Option<f64> {
        self.next_of(after, |now| self.next_switch(now))
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

    /// Time of the track at a time of the run (s), which may lie in the future: future waits count as zero.
    pub(crate) fn foreseen(&self, time: f64) -> TrackTime {
        let now = self.now.get();
        if time <= now {
            return self.at(time);
        }
        let clock = self.clock.borrow();
        let next = self.track.passes().get(clock.begun.len());
        let waiting = next.filter(|pass| pass.time < now - clock.delay);
        TrackTime::Running(match waiting {
            Some(pass) => pass.time + (time - now),
            None => time - clock.delay,
        })
    }

    /// Whether the source has power between `time` (s) and the next event.
    pub(crate) fn is_on_after(&self, time: f64) -> bool {
        self.is_on(self.at(time))
    }

    /// Whether the source has power between a time (s), which may lie in the future, and the event after it. Future waits count
    /// as zero.
    pub(crate) fn will_be_on(&self, time: f64) -> bool {
        self.is_on(self.foreseen(time))
    }

    fn is_on(&self, time: TrackTime) -> bool {
        let TrackTime::Running(now) = time else {
            return false;
        };
        let until = self.track.next_event(now).unwrap_or(f64::INFINITY);
        self.track.energy(now, until) > 0.0
    }

    /// Time of the run of an event of the track that has happened since the last wait, s.
    pub(crate) fn time_of(&self, event: f64) -> f64 {
        event + self.clock.borrow().delay
    }

    /// First position, m.
    pub(crate) fn first_position(&self) -> Vector3<f64> {
        self.track.pose(self.track.start()).position
    }

    /// The condition for which the path waits at a time (s), as a sentence.
    fn unfinished(&self, time: f64) -> Option<String> {
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

    /// The path as a programme, at a time (s). Future waits count as zero.
    pub(crate) fn programme(&self, time: f64) -> Option<Programme> {
        let waits = self.unfinished(time);
        let delay = self.clock.borrow().delay;
        let track = &self.track;
        let Some(end) = track.power_end() else {
            // a path without an end has no fraction done
            return waits.map(|waits| Programme {
                waits: Some(waits),
                ..Programme::new("its toolpath", time)
            });
        };
        let length = |until: f64| track.powered_length(until);
        let energy = |until: f64| track.energy(f64::NEG_INFINITY, until);
        let now = time - delay;
        let done = match length(end) > 0.0 {
            true => DoneFraction {
                fraction: length(now) / length(end),
                of: "the path with power",
            },
            false => DoneFraction {
                fraction: energy(now) / energy(end),
                of: "the energy",
            },
        };
        Some(Programme {
            done: Some(done),
            waits,
            ..Programme::new("its toolpath", end + delay)
        })
    }

    /// Reports of the passes that have begun: time, and temperature at the end of the wait; none for a path with a single pass.
    pub(crate) fn report(&self) -> Vec<Report> {
        let passes = self.track.passes();
        if passes.is_empty() {
            return Vec::new();
        }
        let clock = self.clock.borrow();
        let mut all = vec![
            Report::new("passes.begun", "1", clock.begun.len() as f64),
            Report::new("passes.waited", "s", clock.delay),
        ];
        for (index, pass) in passes.iter().enumerate().take(MOST_REPORTED) {
            let begun = clock.begun.get(index);
            let number = index + 1;
            let start = begun.map_or(f64::NAN, |(start, _)| *start);
            all.push(Report::new(format!("pass.{number}.start"), "s", start));
            if pass.wait.is_some() {
                let temperature = begun.and_then(|(_, t)| *t).unwrap_or(f64::NAN);
                let name = format!("pass.{number}.temperature");
                all.push(Report::new(name, "K", temperature));
            }
        }
        all
    }

    /// State for a checkpoint.
    pub(crate) fn save(&self) -> ClockState {
        self.clock.borrow().clone()
    }

    /// Restores the state of [`TimedPath::save`].
    pub(crate) fn load(&self, clock: ClockState) {
        *self.clock.borrow_mut() = clock;
    }
}

#[cfg(test)]
mod tests;
