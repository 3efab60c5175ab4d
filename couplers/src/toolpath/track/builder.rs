//! Builds a track from moves, rests and passes.

use nalgebra::Vector3;

use super::{Curve, Facing, Move, Pass, Plane, Track};
use crate::toolpath::wait::WaitUntil;

/// Builds a track move by move; each starts at the time, position and direction at which the one before ended.
#[derive(Debug)]
pub(in crate::toolpath) struct TrackBuilder {
    moves: Vec<Move>,
    passes: Vec<Pass>,
    warnings: Vec<String>,
    time: f64,
    position: Vector3<f64>,
    direction: Vector3<f64>,
}

/// A turn about a centre in a plane.
pub(in crate::toolpath) struct Turn {
    pub centre: Vector3<f64>,
    pub plane: Plane,
    /// Angular velocity, rad/s; clockwise where negative.
    pub rate: f64,
    pub facing: Facing,
}

impl TrackBuilder {
    pub fn new(time: f64, position: Vector3<f64>) -> Self {
        Self {
            moves: Vec::new(),
            passes: Vec::new(),
            warnings: Vec::new(),
            time,
            position,
            direction: Vector3::x(),
        }
    }

    /// Position at the end of the last move (m).
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }

    fn push(&mut self, duration: f64, curve: Curve, power: [f64; 2]) {
        let end = self.time + duration;
        // a duration below the resolution of the time adds no move
        if end > self.time {
            let direction = self.direction;
            self.moves.push(Move {
                start: self.time,
                end,
                curve,
                direction,
                power,
                torch: None,
            });
            self.time = end;
        }
    }

    /// A straight move that takes `duration` (s); a rest when `to` is the present position.
    pub fn glide(&mut self, to: Vector3<f64>, duration: f64, power: [f64; 2]) {
        let way = to - self.position;
        if let Some(direction) = way.try_normalize(0.0) {
            self.direction = direction;
        }
        if duration > 0.0 {
            let curve = Curve::Straight {
                from: self.position,
                velocity: way / duration,
            };
            self.push(duration, curve, power);
        }
        self.position = to;
    }

    /// A straight move at `speed` (m/s) and constant power (W).
    pub fn go(&mut self, to: Vector3<f64>, speed: f64, power: f64) {
        self.glide(to, (to - self.position).norm() / speed, [power; 2]);
    }

    /// A straight move in a direction until `end` (s), which may be infinite.
    pub fn go_on(&mut self, direction: Vector3<f64>, speed: f64, end: f64, power: f64) {
        self.direction = direction;
        let curve = Curve::Straight {
            from: self.position,
            velocity: direction * speed,
        };
        self.push(end - self.time, curve, [power; 2]);
    }

    /// A rest of `duration` (s) at constant power (W).
    pub fn dwell(&mut self, duration: f64, power: f64) {
        self.glide(self.position, duration, [power; 2]);
    }

    /// A turn about `centre` in a plane normal to z, from the present position, at `rate` (rad/s; clockwise where negative).
    pub fn turn(&mut self, centre: Vector3<f64>, rate: f64, duration: f64, power: f64) {
        let turn = Turn {
            centre,
            plane: [Vector3::x(), Vector3::y()],
            rate,
            facing: Facing::Fixed,
        };
        self.turn_in(turn, duration, power);
    }

    /// A turn that takes `duration` (s), from the present position.
    pub fn turn_in(&mut self, turn: Turn, duration: f64, power: f64) {
        let Turn {
            centre,
            plane,
            rate,
            facing,
        } = turn;
        let [u, v] = plane;
        let arm = self.position - centre;
        let [x, y] = [arm.dot(&u), arm.dot(&v)];
        let curve = Curve::Arc {
            centre,
            plane,
            radius: arm.norm(),
            angle: y.atan2(x),
            rate,
            facing,
        };
        self.push(duration, curve, [power; 2]);
        let (sin, cos) = (rate * duration).sin_cos();
        let turned = |x: f64, y: f64| u * (cos * x - sin * y) + v * (sin * x + cos * y);
        self.position = centre + turned(x, y);
        let tangent = turned(-y, x) * rate.signum();
        self.direction = tangent.try_normalize(0.0).unwrap_or(self.direction);
    }

    /// Adds a warning of a possible mistake.
    pub fn warn(&mut self, message: String) {
        self.warnings.push(message);
    }

    /// A pass begins here, after a wait if there is one.
    pub fn begin_pass(&mut self, wait: Option<&WaitUntil>) {
        self.passes.push(Pass {
            time: self.time,
            wait: wait.cloned(),
        });
    }

    /// A whole track, whose time starts now; until its first move the source rests at its first position. `torch` is the
    /// axis of the torch where the track does not give it.
    pub fn follow(&mut self, track: &Track, torch: Option<Vector3<f64>>) {
        let shift = self.time;
        self.warnings.extend(track.warnings.iter().cloned());
        let first = &track.moves[0];
        self.position = first.position(first.start);
        self.dwell(first.start, 0.0);
        self.passes.extend(track.passes.iter().map(|pass| Pass {
            time: pass.time + shift,
            wait: pass.wait.clone(),
        }));
        self.moves.extend(track.moves.iter().map(|m| Move {
            start: m.start + shift,
            end: m.end + shift,
            torch: m.torch.or(torch),
            ..m.clone()
        }));
        let last = &track.moves[track.moves.len() - 1];
        self.time = last.end + shift;
        self.position = last.position(last.end);
        self.direction = last.direction(last.end);
    }

    /// A seam to `to` with the sideways oscillation `sideways sin(rate s)`.
    pub fn swing(
        &mut self,
        to: Vector3<f64>,
        speed: f64,
        sideways: Vector3<f64>,
        rate: f64,
        power: f64,
    ) {
        let way = to - self.position;
        self.direction = way.normalize();
        let curve = Curve::Sine {
            from: self.position,
            velocity: self.direction * speed,
            sideways,
            rate,
        };
        self.push(way.norm() / speed, curve, [power; 2]);
        self.position = to;
    }

    /// Turns the reported travel direction of all moves to the one given.
    pub fn facing(mut self, direction: Vector3<f64>) -> Self {
        for each in &mut self.moves {
            each.direction = direction;
        }
        self
    }

    /// The finished track, or `None` when nothing takes any time.
    pub fn finish(self) -> Option<Track> {
        let start = self.moves.first()?.start;
        let mut passes = self.passes;
        // a wait after the last move delays nothing
        passes.retain(|pass| pass.time < self.time);
        if passes.first().is_some_and(|first| first.time > start) {
            passes.insert(
                0,
                Pass {
                    time: start,
                    wait: None,
                },
            );
        }
        Some(Track {
            moves: self.moves,
            passes,
            warnings: self.warnings,
        })
    }
}
