//! Toolpath from a program in G-code (RS-274): straight and circular moves, rests, feeds, power on and off.
//!
//! | word | meaning |
//! |---|---|
//! | `G0` | to a place at `rapid_speed`, power off |
//! | `G1`, `G2`, `G3` | straight, clockwise and counter-clockwise to a place at the feed; centres of circles by `I`, `J` from the start, or a radius `R` (negative: the longer way round) |
//! | `G4` | rest of `P` seconds (or milliseconds, see `dwell`) or `S` seconds, with the power that is on |
//! | `G17`, `G20`, `G21`, `G90`, `G91` | plane xy, inches, millimetres, places absolute and relative |
//! | `F` | feed per minute |
//! | `S` | power, times `power_per_s`; without it that of the source |
//! | `M3`, `M4`, `M5` | power on, on and off; other numbers by `on` and `off` |
//! | `M0`, `M1` | wait for `wait_until`, if it is given; other numbers by `wait_at` |
//! | `M2`, `M30` | end |
//!
//! Motion and feed last until they are changed, as controllers do. Codes without a meaning here (tools, coolant, work offsets,
//! cutter compensation off) are skipped; motions that are not in the table are refused, since the path would differ.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use gcode::core::{Number, Span};
use gcode::{Block, Code};
use nalgebra::Vector3;
use perimelt_core::input::{self, InputError};
use perimelt_core::text::number;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::track::TrackBuilder;
use super::{ToolpathError, Track, WaitUntil, finite, not_negative, place, positive, power_of};

/// Difference of the radii at both ends of an arc that is taken for rounding, relative and in m.
const ROUNDING: [f64; 2] = [5e-3, 5e-6];

/// Moves and power from a program in G-code.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gcode {
    /// File with the program; relative to the folder of the case file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The program itself, between three quotes, instead of a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<String>,
    /// When the program starts (s); default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Where the program's zero lies in the case (m); default 0, 0, 0.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Speed of `G0` (m/s); default 0.1.
    #[serde(default = "usual_rapid_speed")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rapid_speed: f64,
    /// Power (W) of one unit of `S`; default 1.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub power_per_s: f64,
    /// Numbers of the `M` codes that switch the power on; default 3 and 4.
    #[serde(default = "on_codes")]
    pub on: Vec<u32>,
    /// Numbers of the `M` codes that switch the power off; default 5.
    #[serde(default = "off_codes")]
    pub off: Vec<u32>,
    /// Unit of `P` of `G4`; default seconds.
    #[serde(default)]
    pub dwell: DwellUnit,
    /// What the program waits for, with power off, at the `M` codes of `wait_at`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wait_until: Option<WaitUntil>,
    /// Numbers of the `M` codes at which it waits; default 0 and 1, program stops.
    #[serde(default = "stop_codes")]
    pub wait_at: Vec<u32>,
}

/// Unit of the rest that `G4 P` gives.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DwellUnit {
    /// As in RS-274.
    #[default]
    Seconds,
    /// As controllers of printers have it.
    Milliseconds,
}

fn usual_rapid_speed() -> f64 {
    0.1
}

fn one() -> f64 {
    1.0
}

fn on_codes() -> Vec<u32> {
    vec![3, 4]
}

fn stop_codes() -> Vec<u32> {
    vec![0, 1]
}

fn off_codes() -> Vec<u32> {
    vec![5]
}

/// What can be wrong with a program.
#[derive(Debug, thiserror::Error)]
pub enum GcodeError {
    /// The file cannot be read.
    #[error("cannot read the program {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: InputError,
    },
    /// A line that is no G-code, or that this toolpath cannot follow.
    #[error("line {line} of the program {}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: usize,
        /// What is wrong, and what was expected.
        message: String,
    },
    /// Both a file and a program are given, or neither.
    #[error("G-code needs either `file` or `program`")]
    Source,
    /// The program moves nowhere.
    #[error("the program {} has no move", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

impl Gcode {
    pub(super) fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, ToolpathError> {
        let file = match (&self.file, &self.program) {
            (Some(file), None) => file,
            (None, Some(program)) => {
                return self.read(program, Path::new("of the case"), default_power);
            }
            _ => return Err(GcodeError::Source.into()),
        };
        let path = base_dir.join(file);
        match input::read_text(&path, input::LIMIT) {
            Ok(text) => self.read(&text, &path, default_power),
            Err(source) => Err(GcodeError::Open { path, source }.into()),
        }
    }

    fn read(
        &self,
        text: &str,
        path: &Path,
        default_power: Option<f64>,
    ) -> Result<Track, ToolpathError> {
        let at_line = |(line, message): Mistake| GcodeError::Line {
            path: path.into(),
            line: line + 1,
            message,
        };
        let start = place("origin", self.origin)?;
        let mut machine = Machine {
            keys: self,
            text,
            track: TrackBuilder::new(finite("start_time", self.start_time)?, start),
            at: start,
            rapid_speed: positive("rapid_speed", self.rapid_speed)?,
            power: default_power,
            default_power,
            is_on: false,
            unit: 1e-3,
            is_relative: false,
            feed: None,
            motion: None,
        };
        not_negative("power_per_s", self.power_per_s)?;
        let program = gcode::parse(text).map_err(|mistakes| {
            let first = mistakes.iter().next();
            let (line, message) =
                first.map_or((0, String::new()), |m| (m.span.line, m.kind.to_string()));
            at_line((line, message))
        })?;
        for block in &program.blocks {
            if machine.run(block).map_err(at_line)? == Flow::End {
                break;
            }
        }
        let empty = || GcodeError::Empty { path: path.into() };
        Ok(machine.track.finish().ok_or_else(empty)?)
    }
}

/// Line, counted from 0, and what is wrong.
type Mistake = (usize, String);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    GoOn,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Rapid,
    Straight,
    Clockwise,
    CounterClockwise,
}

/// The state of a controller.
struct Machine<'a> {
    keys: &'a Gcode,
    text: &'a str,
    track: TrackBuilder,
    /// m, in the case.
    at: Vector3<f64>,
    /// m/s.
    rapid_speed: f64,
    /// While it is on, W.
    power: Option<f64>,
    default_power: Option<f64>,
    is_on: bool,
    /// Length unit of the program, m.
    unit: f64,
    is_relative: bool,
    /// m/s.
    feed: Option<f64>,
    motion: Option<Motion>,
}

/// Numbers of the words of a block by their letter.
struct Words {
    line: usize,
    all: Vec<(char, f64)>,
}

impl Words {
    fn get(&self, letter: char) -> Option<f64> {
        self.all
            .iter()
            .rev()
            .find(|(l, _)| *l == letter)
            .map(|(_, value)| *value)
    }

    fn has_any(&self, letters: &str) -> bool {
        self.all.iter().any(|(l, _)| letters.contains(*l))
    }
}

impl Machine<'_> {
    fn run(&mut self, block: &Block) -> Result<Flow, Mistake> {
        let words = self.words(block)?;
        let line = words.line;
        let mut rests = false;
        let mut ends = false;
        let mut waits = false;
        for code in &block.codes {
            match code {
                Code::General(code) => rests |= self.prepare(code.number, line)?,
                Code::Miscellaneous(code) => {
                    ends |= self.switch(code.number);
                    waits |= self.keys.wait_at.contains(&code.number.major());
                }
                _ => {}
            }
        }
        if let Some(feed) = words.get('F') {
            if !(feed > 0.0) {
                return Err((
                    line,
                    format!("the feed `F` is {feed}, expected a number above 0"),
                ));
            }
            self.feed = Some(feed * self.unit / 60.0);
        }
        if rests {
            self.rest(&words)?;
        } else {
            if let Some(s) = words.get('S') {
                if s < 0.0 {
                    return Err((
                        line,
                        format!("`S` is {s}, expected a number that is not negative"),
                    ));
                }
                self.power = Some(s * self.keys.power_per_s);
            }
            if words.has_any("XYZIJR") {
                self.go(&words)?;
            }
        }
        if waits && self.keys.wait_until.is_some() {
            self.track.begin_pass(self.keys.wait_until.as_ref());
        }
        Ok(if ends { Flow::End } else { Flow::GoOn })
    }

    /// All words of a block, in double precision.
    fn words(&self, block: &Block) -> Result<Words, Mistake> {
        let line = block.span.line;
        let of_codes = block.codes.iter().flat_map(|code| match code {
            Code::General(code) => &code.args[..],
            Code::Miscellaneous(code) => &code.args[..],
            _ => &[],
        });
        let spans = of_codes.map(|word| (word.letter, word.span));
        let spans = spans.chain(
            block
                .word_addresses
                .iter()
                .map(|word| (word.letter, word.span)),
        );
        let read = |(letter, span): (char, Span)| {
            let text = self
                .text
                .get(span.start..span.start + span.length)
                .unwrap_or("");
            let number =
                text.trim_start_matches(|c: char| c.is_ascii_alphabetic() || c.is_whitespace());
            match number.replace(' ', "").parse::<f64>() {
                Ok(number) if number.is_finite() => Ok((letter.to_ascii_uppercase(), number)),
                _ => Err((
                    line,
                    format!("`{text}` is no number; variables are not evaluated"),
                )),
            }
        };
        let all = spans.map(read).collect::<Result<_, _>>()?;
        Ok(Words { line, all })
    }

    /// Takes up a `G` code; whether it is a rest.
    fn prepare(&mut self, number: Number, line: usize) -> Result<bool, Mistake> {
        match (
            number.major(),
            number.minor().map_or(0, std::num::NonZero::get),
        ) {
            (0, 0) => self.motion = Some(Motion::Rapid),
            (1, 0) => self.motion = Some(Motion::Straight),
            (2, 0) => self.motion = Some(Motion::Clockwise),
            (3, 0) => self.motion = Some(Motion::CounterClockwise),
            (4, 0) => return Ok(true),
            (20, 0) => self.unit = 0.0254,
            (21, 0) => self.unit = 1e-3,
            (90, 0) => self.is_relative = false,
            (91, 0) => self.is_relative = true,
            // plane xy, compensations off, work offsets, path modes, cycles off, centres relative, feed per minute
            (17 | 40 | 49 | 54..=59 | 61 | 64 | 80 | 94, _) | (91, 1) => {}
            _ => {
                let message = format!(
                    "`G{number}` is not supported, expected one of G0 to G4, G17, G20, G21, G90 and G91"
                );
                return Err((line, message));
            }
        }
        Ok(false)
    }

    /// Takes up an `M` code; whether the program ends.
    fn switch(&mut self, number: Number) -> bool {
        let major = number.major();
        if self.keys.on.contains(&major) {
            self.is_on = true;
        } else if self.keys.off.contains(&major) {
            self.is_on = false;
        }
        matches!(major, 2 | 30)
    }

    fn power(&self) -> Result<f64, ToolpathError> {
        match self.is_on {
            true => power_of("power", self.power, self.default_power),
            false => Ok(0.0),
        }
    }

    fn power_at(&self, line: usize) -> Result<f64, Mistake> {
        self.power().map_err(|e| (line, e.to_string()))
    }

    fn rest(&mut self, words: &Words) -> Result<(), Mistake> {
        let unit = match self.keys.dwell {
            DwellUnit::Seconds => 1.0,
            DwellUnit::Milliseconds => 1e-3,
        };
        let time = words.get('P').map(|p| p * unit).or(words.get('S'));
        match time.filter(|t| *t >= 0.0) {
            Some(time) => self.track.dwell(time, self.power_at(words.line)?),
            None => {
                return Err((
                    words.line,
                    "a rest `G4` needs its time `P`, zero or above".into(),
                ));
            }
        }
        Ok(())
    }

    fn go(&mut self, words: &Words) -> Result<(), Mistake> {
        let line = words.line;
        let Some(motion) = self.motion else {
            return Err((
                line,
                "a place comes before the first of G0, G1, G2 and G3".into(),
            ));
        };
        let mut to = self.at;
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(value) = words.get(letter) {
                let from = if self.is_relative {
                    self.at[axis]
                } else {
                    self.keys.origin[axis]
                };
                to[axis] = from + value * self.unit;
            }
        }
        if motion == Motion::Rapid {
            self.track.go(to, self.rapid_speed, 0.0);
            self.at = to;
            return Ok(());
        }
        let Some(feed) = self.feed else {
            return Err((line, "a move comes before the first feed `F`".into()));
        };
        let power = self.power_at(line)?;
        match motion {
            Motion::Clockwise | Motion::CounterClockwise => {
                let (centre, angle) = self.arc(words, to, motion == Motion::Clockwise)?;
                let radius = (self.at - centre).norm();
                let duration = angle.abs() * radius / feed;
                self.track.turn(centre, angle / duration, duration, power);
            }
            _ => self.track.go(to, feed, power),
        }
        self.at = to;
        Ok(())
    }

    /// Centre (m) and angle (rad, positive counter-clockwise) of an arc to a place.
    fn arc(
        &self,
        words: &Words,
        to: Vector3<f64>,
        is_clockwise: bool,
    ) -> Result<(Vector3<f64>, f64), Mistake> {
        let line = words.line;
        let way = to - self.at;
        if way.z.abs() > ROUNDING[1] {
            return Err((
                line,
                "an arc that changes its height is not supported".into(),
            ));
        }
        let sign = if is_clockwise { -1.0 } else { 1.0 };
        let centre = match (words.get('R'), words.has_any("IJ")) {
            (Some(radius), false) => {
                let (radius, chord) = (radius * self.unit, way.norm());
                let height = radius * radius - 0.25 * chord * chord;
                if chord == 0.0 || height < -2.0 * radius.abs() * ROUNDING[1] {
                    let message =
                        format!("an arc of radius {radius} m does not reach over {chord} m");
                    return Err((line, message));
                }
                let left = Vector3::new(-way.y, way.x, 0.0) / chord;
                self.at + 0.5 * way + left * (sign * radius.signum() * height.max(0.0).sqrt())
            }
            (None, true) => {
                let offset = |letter| words.get(letter).unwrap_or(0.0) * self.unit;
                self.at + Vector3::new(offset('I'), offset('J'), 0.0)
            }
            _ => {
                return Err((
                    line,
                    "an arc needs either its centre, `I` and `J`, or its radius `R`".into(),
                ));
            }
        };
        let [from, end] = [self.at - centre, to - centre];
        let [first, last] = [from.norm(), end.norm()];
        let difference = (first - last).abs();
        if first == 0.0 || difference > (ROUNDING[0] * first).max(ROUNDING[1]) {
            let [first, last] = [first, last].map(|x| number(x, 5));
            let message = format!("the arc starts {first} m and ends {last} m from its centre");
            return Err((line, message));
        }
        let turned = end.y.atan2(end.x) - from.y.atan2(from.x);
        let angle = (sign * turned).rem_euclid(TAU);
        // back to where it starts: a whole turn
        let is_whole = way.norm() < ROUNDING[1] * 1e-3;
        Ok((centre, sign * if is_whole { TAU } else { angle }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(keys: &str, text: &str) -> Result<Track, String> {
        let gcode: Gcode =
            toml::from_str(&format!("file = 'part.gcode'\n{keys}")).expect("valid keys");
        gcode
            .read(text, Path::new("part.gcode"), Some(100.0))
            .map_err(|e| e.to_string())
    }

    fn close(found: Vector3<f64>, exact: [f64; 3]) {
        assert!(
            (found - Vector3::from(exact)).norm() < 1e-12,
            "{found:?} for {exact:?}"
        );
    }

    #[test]
    fn moves_feeds_and_powers_last_until_they_change() {
        let track = program(
            "origin = [0.001, 0, 0.002]\npower_per_s = 2\nrapid_speed = 0.05",
            "%
            G21 G90 (millimetres) ; absolute
            G0 X10 Y0 Z0
            M3 S150
            G1 X20 F600
            Y10
            M5
            G91 G1 X-5 F1200
            G4 P0.5
            M3
            G90
            X0 Y0
            M30
            G1 X100",
        )
        .expect("a valid program");
        // 10 mm at 50 mm/s
        assert_eq!(track.power(0.1), 0.0);
        close(track.pose(0.1).position, [0.006, 0.0, 0.002]);
        // 10 mm at 10 mm/s twice, 300 W
        assert_eq!(track.power(0.7), 300.0);
        close(track.pose(0.7).position, [0.016, 0.0, 0.002]);
        close(track.pose(1.7).position, [0.021, 0.005, 0.002]);
        close(track.pose(1.7).direction, [0.0, 1.0, 0.0]);
        // 5 mm at 20 mm/s without power, a rest, back to zero with power
        assert_eq!(track.power(2.3), 0.0);
        close(track.pose(2.6).position, [0.016, 0.01, 0.002]);
        let end = 0.2 + 1.0 + 1.0 + 0.25 + 0.5 + 15f64.hypot(10.0) / 20.0;
        assert!((track.end().expect("an end") - end).abs() < 1e-12);
        assert_eq!(track.power(end - 1e-6), 300.0);
        let energy = 300.0 * (2.0 + 15f64.hypot(10.0) / 20.0);
        assert!((track.energy(0.0, end) - energy).abs() < 1e-9 * energy);
    }

    #[test]
    fn arcs_run_the_way_that_their_code_says() {
        let at = |text: &str, share: f64| {
            let track = program("", &format!("G1 X10 F6000 \n M3 \n {text}")).expect("valid");
            let (start, end) = (0.1, track.end().expect("an end"));
            let pose = track.pose(start + share * (end - start));
            (pose.position * 1e3, end - start)
        };
        let quarter = 0.5 * std::f64::consts::PI * 0.01 / 0.1;
        let check = |text: &str, middle: [f64; 3], time: f64| {
            let (found, took) = at(text, 0.5);
            assert!(
                (found - Vector3::from(middle)).norm() < 1e-9,
                "{text}: {found:?}"
            );
            assert!((took - time).abs() < 1e-12, "{text}: {took}");
        };
        let r = 10.0 * 0.5f64.sqrt();
        check("G3 X0 Y10 I-10 J0", [r, r, 0.0], quarter);
        check("G3 X0 Y10 R10", [r, r, 0.0], quarter);
        check("G2 X0 Y10 I-10 J0", [-r, -r, 0.0], 3.0 * quarter);
        // the longer way round a circle about (10, 10)
        check("G3 X0 Y10 R-10", [10.0 + r, 10.0 + r, 0.0], 3.0 * quarter);
        check("G2 X0 Y10 R10", [10.0 - r, 10.0 - r, 0.0], quarter);
        check("G2 I-10", [-10.0, 0.0, 0.0], 4.0 * quarter);
        let inches = program("", "G20 G1 X1 F60").expect("valid");
        close(inches.pose(0.5).position, [0.0127, 0.0, 0.0]);
    }

    #[test]
    fn the_line_of_a_mistake_is_told() {
        for (text, message) in [
            (
                "G1 X1",
                "line 1 of the program part.gcode: a move comes before the first feed",
            ),
            (
                "X1 F100",
                "line 1 of the program part.gcode: a place comes before",
            ),
            (
                "G21\nG5 X1 F100",
                "line 2 of the program part.gcode: `G5` is not supported",
            ),
            ("G2 X1 F100", "an arc needs either its centre"),
            (
                "G1 F100 X10\nG2 X0 Y10 I-10 J3",
                "line 2 of the program part.gcode: the arc starts 0.01044 m",
            ),
            ("G2 X10 R1 F100", "does not reach over 0.01 m"),
            ("G2 X10 Z1 I5 F100", "changes its height"),
            ("G4", "needs its time `P`"),
            ("G1 F-3", "the feed `F` is -3"),
            ("M3", "the program part.gcode has no move"),
        ] {
            let found = program("", text).expect_err(text);
            assert!(found.contains(message), "{text}: {found}");
        }
        assert!(program("", "G1 X#1 F100").is_err(), "a variable");
    }
}
