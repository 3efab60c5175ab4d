//! A toolpath laid out in time: contiguous moves, found by bisection.

mod builder;

pub(super) use builder::{TrackBuilder, Turn};

use nalgebra::Vector3;

use super::wait::WaitUntil;

/// Position, travel direction and power of a source at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position (m).
    pub position: Vector3<f64>,
    /// Unit vector of travel. While the source rests it is that of the last move, before the first move +x. On a
    /// weave it is the direction of the seam, because the torch does not turn.
    pub direction: Vector3<f64>,
    /// Power (W); 0 while the source is off.
    pub power: f64,
    /// Speed along the path (m/s).
    pub speed: f64,
    /// Unit vector of the torch's axis, into the material, where the path gives it.
    pub torch: Option<Vector3<f64>>,
}

/// Contiguous moves from the start of a toolpath to its end. Before the start and after the end the source is
/// off and rests at the first or the last position.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    moves: Vec<Move>,
    /// Passes in the order of time; none for a path with a single pass.
    passes: Vec<Pass>,
    /// Warnings of possible mistakes in the description of the path, as sentences.
    warnings: Vec<String>,
}

/// Start of a pass of a track, and the condition for which it waits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pass {
    /// Time of the track, s.
    pub time: f64,
    pub wait: Option<WaitUntil>,
}

/// Unit vectors that span the plane of an arc; angles count from the first towards the second.
pub(super) type Plane = [Vector3<f64>; 2];

/// Direction of the torch on an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Facing {
    Fixed,
    Inward,
    Outward,
}

#[derive(Debug, Clone, PartialEq)]
struct Move {
    start: f64,
    end: f64,
    curve: Curve,
    direction: Vector3<f64>,
    /// Power at the start and at the end (W), linear between.
    power: [f64; 2],
    /// Axis of the torch, where the path gives it.
    torch: Option<Vector3<f64>>,
}

/// Position as a function of time.
#[derive(Debug, Clone, PartialEq)]
enum Curve {
    /// `from + velocity s`, s = time since the start of the move.
    Straight {
        from: Vector3<f64>,
        velocity: Vector3<f64>,
    },
    /// `centre + radius (u cos phi + v sin phi)`, `phi = angle + rate s`, with the unit vectors u and v of the plane.
    Arc {
        centre: Vector3<f64>,
        plane: Plane,
        radius: f64,
        angle: f64,
        rate: f64,
        facing: Facing,
    },
    /// `from + velocity s + sideways sin(rate s)`.
    Sine {
        from: Vector3<f64>,
        velocity: Vector3<f64>,
        sideways: Vector3<f64>,
        rate: f64,
    },
}

impl Move {
    fn position(&self, time: f64) -> Vector3<f64> {
        let s = time - self.start;
        match &self.curve {
            Curve::Straight { from, velocity } => from + velocity * s,
            Curve::Arc {
                centre,
                plane: [u, v],
                radius,
                angle,
                rate,
                ..
            } => {
                let (sin, cos) = (angle + rate * s).sin_cos();
                centre + u * (cos * radius) + v * (sin * radius)
            }
            Curve::Sine {
                from,
                velocity,
                sideways,
                rate,
            } => from + velocity * s + sideways * (rate * s).sin(),
        }
    }

    fn velocity(&self, time: f64) -> Vector3<f64> {
        let s = time - self.start;
        match &self.curve {
            Curve::Straight { velocity, .. } => *velocity,
            Curve::Arc {
                plane: [u, v],
                radius,
                angle,
                rate,
                ..
            } => {
                let (sin, cos) = (angle + rate * s).sin_cos();
                (v * cos - u * sin) * (radius * rate)
            }
            Curve::Sine {
                velocity,
                sideways,
                rate,
                ..
            } => velocity + sideways * (rate * (rate * s).cos()),
        }
    }

    fn direction(&self, time: f64) -> Vector3<f64> {
        match &self.curve {
            Curve::Arc { .. } => self.velocity(time).normalize(),
            Curve::Straight { .. } | Curve::Sine { .. } => self.direction,
        }
    }

    fn torch(&self, time: f64) -> Option<Vector3<f64>> {
        let outward = |centre: &Vector3<f64>| (self.position(time) - centre).normalize();
        match &self.curve {
            Curve::Arc {
                centre,
                facing: Facing::Inward,
                ..
            } => Some(-outward(centre)),
            Curve::Arc {
                centre,
                facing: Facing::Outward,
                ..
            } => Some(outward(centre)),
            _ => self.torch,
        }
    }

    /// Pose at rest without power at a time of the move.
    fn rest(&self, time: f64) -> Pose {
        Pose {
            position: self.position(time),
            direction: self.direction(time),
            power: 0.0,
            speed: 0.0,
            torch: self.torch(time),
        }
    }

    fn power(&self, time: f64) -> f64 {
        let [first, last] = self.power;
        // a move without an end has constant power; the quotient below would not be a number
        if first == last {
            return first;
        }
        first + (last - first) * (time - self.start) / (self.end - self.start)
    }
}

impl Track {
    /// Position, direction, power and speed at `time` (s); at an event those of the later move.
    pub fn pose(&self, time: f64) -> Pose {
        let first = &self.moves[0];
        let last = &self.moves[self.moves.len() - 1];
        if time < first.start {
            return first.rest(first.start);
        }
        if time >= last.end {
            return last.rest(last.end);
        }
        let active = &self.moves[self.moves.partition_point(|m| m.end <= time)];
        Pose {
            position: active.position(time),
            direction: active.direction(time),
            power: active.power(time),
            speed: active.velocity(time).norm(),
            torch: active.torch(time),
        }
    }

    /// The pose at `time` (s) where the source has power, otherwise the pose at the end of the last move with power, whose
    /// directions the melt pool keeps. Before the first power, the pose at `time`.
    pub(crate) fn last_pose_with_power(&self, time: f64) -> Pose {
        let pose = self.pose(time);
        if pose.power > 0.0 {
            return pose;
        }
        self.end_of_power_before(time)
    }

    /// The pose at the end of the last move with power that has ended at `time` (s). Before the first power, the pose at `time`.
    pub(crate) fn end_of_power_before(&self, time: f64) -> Pose {
        let over = self.moves.partition_point(|m| m.end <= time);
        let mut over = self.moves[..over].iter().rev();
        let last = over.find(|m| m.power.iter().any(|power| *power > 0.0));
        last.map_or_else(|| self.pose(time), |last| last.rest(last.end))
    }

    /// Pose at rest without power at the end of the move before `time` (s), where a path waits.
    pub(crate) fn rest_before(&self, time: f64) -> Pose {
        let next = self.moves.partition_point(|m| m.end < time);
        match self.moves.get(next) {
            Some(before) if before.end == time => before.rest(time),
            Some(first) => first.rest(first.start),
            None => self.pose(time),
        }
    }

    /// Starts and conditions of the passes; none for a path with a single pass.
    pub(crate) fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// When the source is switched on for each pass (s), the first one included; passes that follow each other with power and without
    /// a wait are one.
    pub(crate) fn powered_passes(&self) -> Vec<f64> {
        let begin = |pass: &Pass| {
            let on = self.moves.partition_point(|m| m.end <= pass.time);
            let on = on + self.moves[on..].iter().position(|m| m.power != [0.0; 2])?;
            let is_on_before = on > 0 && self.moves[on - 1].power != [0.0; 2];
            (pass.wait.is_some() || !is_on_before).then_some(self.moves[on].start)
        };
        let later = self.passes.iter().skip(1).filter_map(begin);
        std::iter::once(self.start()).chain(later).collect()
    }

    /// Warnings of possible mistakes in the description of the path, as sentences without a full stop.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The first time after `after` at which the motion or the power has a kink or a jump (s).
    ///
    /// Time steps should end on events. The time is greater than `after`; `None` after the last event.
    pub fn next_event(&self, after: f64) -> Option<f64> {
        if after < self.start() {
            return Some(self.start());
        }
        let next = self.moves.partition_point(|m| m.end <= after);
        self.moves
            .get(next)
            .map(|m| m.end)
            .filter(|end| end.is_finite())
    }

    /// When the source is first switched on or starts to move (s).
    pub fn start(&self) -> f64 {
        self.moves[0].start
    }

    /// When the path ends (s); `None` for a line without an end.
    pub fn end(&self) -> Option<f64> {
        self.moves
            .last()
            .map(|m| m.end)
            .filter(|end| end.is_finite())
    }

    /// Power at `time` (W).
    pub fn power(&self, time: f64) -> f64 {
        self.pose(time).power
    }

    /// Energy released between two times (J): the integral of the power, in closed form.
    pub fn energy(&self, from: f64, to: f64) -> f64 {
        let first = self.moves.partition_point(|m| m.end <= from);
        self.moves[first..]
            .iter()
            .take_while(|m| m.start < to)
            .map(|m| {
                let (a, b) = (m.start.max(from), m.end.min(to));
                // the mean of a linear power is the value in the middle
                m.power(0.5 * (a + b)) * (b - a)
            })
            .sum()
    }
}

impl Track {
    /// Start and end of the moves with power (s); the end of the last may be infinite.
    pub(crate) fn powered_moves(&self) -> impl Iterator<Item = (f64, f64)> {
        let after = |start: &f64| self.next_event(*start);
        std::iter::successors(Some(self.start()), after)
            .map(|start| (start, self.next_event(start).unwrap_or(f64::INFINITY)))
            .filter(|&(start, end)| self.energy(start, end) > 0.0)
    }

    /// When the last move with power ends, s; `None` for one without an end, and without power.
    pub(crate) fn power_end(&self) -> Option<f64> {
        let last = self.moves.iter().rfind(|m| m.power != [0.0; 2])?;
        Some(last.end).filter(|end| end.is_finite())
    }

    /// Length of the path with power up to a time, m; along the seam of a weave.
    pub(crate) fn powered_length(&self, until: f64) -> f64 {
        let speed = |m: &Move| match &m.curve {
            Curve::Sine { velocity, .. } => velocity.norm(),
            _ => m.velocity(m.start).norm(),
        };
        let begun = self.moves.iter().take_while(|m| m.start < until);
        begun
            .filter(|m| m.power != [0.0; 2])
            .map(|m| speed(m) * (m.end.min(until) - m.start))
            .sum()
    }

    /// Highest speed with power, m/s. A move is fastest at its start or at its middle: straight and circular moves
    /// have constant speed, weaves start on the seam, where they are fastest.
    pub(crate) fn fastest(&self) -> f64 {
        let speed = |(start, end): (f64, f64)| {
            let middle = if end.is_finite() {
                0.5 * (start + end)
            } else {
                start
            };
            self.pose(start).speed.max(self.pose(middle).speed)
        };
        self.powered_moves().map(speed).fold(0.0, f64::max)
    }
}
