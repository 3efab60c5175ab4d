//! The controller that runs a program: its state, and what each block does.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use nalgebra::Vector3;

use super::block::Block;
use super::line::Code;
use super::{DwellUnit, Gcode};
use crate::toolpath::track::TrackBuilder;
use crate::toolpath::{Track, power_of};

/// Letters without a meaning for the path: extruder, numbers of tools and of their offsets.
const DROPPED: &str = "ETHD";

/// Rotary and secondary axes, which must keep their values.
const OTHER_AXES: &str = "ABCUVW";

/// Codes that are skipped with their words and a warning: firmware retraction, reference runs, levelling of a bed.
const SKIPPED: [u32; 5] = [10, 11, 28, 29, 30];

/// Codes of subprograms.
const SUBPROGRAMS: [u32; 3] = [97, 98, 99];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MotionCode {
    Rapid,
    Straight,
    Clockwise,
    CounterClockwise,
}

impl MotionCode {
    fn of(code: Code) -> Option<MotionCode> {
        match (code.major, code.minor) {
            (0, 0) => Some(MotionCode::Rapid),
            (1, 0) => Some(MotionCode::Straight),
            (2, 0) => Some(MotionCode::Clockwise),
            (3, 0) => Some(MotionCode::CounterClockwise),
            _ => None,
        }
    }

    fn is_arc(self) -> bool {
        matches!(self, MotionCode::Clockwise | MotionCode::CounterClockwise)
    }
}

/// Purpose of the words of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// The motion of the block, or the motion in force.
    Motion,
    /// G4.
    Rest,
    /// G92: the present place has these coordinates.
    SetPlace,
    /// A code that is skipped with its words.
    Skipped,
}

/// The state of a controller.
pub(super) struct Machine<'a> {
    keys: &'a Gcode,
    skip: Skip,
    track: TrackBuilder,
    /// Position in the case, m.
    pub at: Vector3<f64>,
    /// Position of the zero of the program in the case, m.
    zero: Vector3<f64>,
    /// Values of A, B, C, U, V and W.
    others: [f64; 6],
    /// Whether a move with a feed has been made.
    has_moved: bool,
    /// Power while it is on, W.
    power: Option<f64>,
    default_power: Option<f64>,
    is_on: bool,
    /// Length unit of the program, m.
    pub unit: f64,
    is_relative: bool,
    /// Feed, m/s.
    feed: Option<f64>,
    motion: Option<MotionCode>,
    /// G54 to G59.3, once one is chosen.
    offset: Option<Code>,
    /// Codes that were skipped: the first line, and how often.
    skipped: BTreeMap<String, (usize, usize)>,
}

/// Codes of the key `skip`.
pub(super) struct Skip {
    pub general: Vec<Code>,
    pub switches: Vec<Code>,
}

impl<'a> Machine<'a> {
    pub fn new(
        keys: &'a Gcode,
        skip: Skip,
        time: f64,
        start: Vector3<f64>,
        power: Option<f64>,
    ) -> Self {
        Machine {
            keys,
            skip,
            track: TrackBuilder::new(time, start),
            at: start,
            zero: start,
            others: [0.0; 6],
            has_moved: false,
            power,
            default_power: power,
            is_on: false,
            unit: 1e-3,
            is_relative: false,
            feed: None,
            motion: None,
            offset: None,
            skipped: BTreeMap::new(),
        }
    }

    /// Runs a block, in line `line` (counted from 1), and breaks at the end of the program; an error says what is wrong with
    /// the block.
    pub fn run(&mut self, block: &Block, line: usize) -> Result<ControlFlow<()>, String> {
        let mut purpose = None;
        let mut named = None;
        for &code in &block.general {
            let of_code = self.prepare(code, line)?;
            let Some(of_code) = of_code else {
                continue;
            };
            if of_code == Purpose::Motion {
                named = Some(code);
            } else if purpose.replace((of_code, code)).is_some() {
                return Err(two_codes(block));
            }
        }
        let machine_place = block.general.iter().any(|c| (c.major, c.minor) == (53, 0));
        let purpose = match purpose {
            Some(_) if named.is_some() && block.has_any("XYZABCUVWIJKR") => {
                return Err(two_codes(block));
            }
            Some((purpose, _)) => purpose,
            None if machine_place => {
                if self.motion.is_some_and(|m| m != MotionCode::Rapid) {
                    let message = "`G53` moves in machine coordinates, which the case does not know, expected a rapid move (G0)";
                    return Err(message.into());
                }
                Purpose::Skipped
            }
            None => Purpose::Motion,
        };
        let mut ends = false;
        let mut waits = false;
        for &code in &block.switches {
            ends |= self.switch(code, line)?;
            waits |= code.minor == 0 && self.keys.wait_at.contains(&code.major);
        }
        match purpose {
            Purpose::Skipped => {}
            Purpose::Rest => self.rest(block)?,
            Purpose::SetPlace => self.set_place(block, line)?,
            Purpose::Motion => self.take_words(block, named.is_some())?,
        }
        if waits && self.keys.wait_until.is_some() {
            self.track.begin_pass(self.keys.wait_until.as_ref());
        }
        Ok(match ends {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        })
    }

    /// The path of the program, with a warning for each code that was skipped; `None` without a move.
    pub fn finish(mut self) -> Option<Track> {
        for (code, (line, count)) in self.skipped {
            let more = match count - 1 {
                0 => String::new(),
                1 => " and in one more line".into(),
                more => format!(" and in {more} more lines"),
            };
            self.track.warn(format!(
                "`{code}` in line {line}{more} of the program is skipped; the path continues from the position before it"
            ));
        }
        self.track.finish()
    }

    fn note_skipped(&mut self, code: String, line: usize) {
        self.skipped.entry(code).or_insert((line, 0)).1 += 1;
    }

    /// Applies a `G` code; returns the purpose of the words of its block, if it has one.
    fn prepare(&mut self, code: Code, line: usize) -> Result<Option<Purpose>, String> {
        if let Some(motion) = MotionCode::of(code) {
            self.motion = Some(motion);
            return Ok(Some(Purpose::Motion));
        }
        match (code.major, code.minor) {
            (4, 0) => return Ok(Some(Purpose::Rest)),
            (20, 0) => self.unit = 0.0254,
            (21, 0) => self.unit = 1e-3,
            (90, 0) => self.is_relative = false,
            (91, 0) => self.is_relative = true,
            (92, 0) => return Ok(Some(Purpose::SetPlace)),
            (92, 1 | 2) => self.zero = self.keys.origin.into(),
            (54..=59, _) => {
                if self.skip.general.contains(&code) {
                    self.note_skipped(format!("G{code}"), line);
                } else if self.offset.is_some_and(|chosen| chosen != code) {
                    let message = format!(
                        "`G{code}` chooses another work offset, which the case does not know, expected one offset in the program"
                    );
                    return Err(message);
                } else {
                    self.offset = Some(code);
                }
            }
            // plane xy, compensations off, path modes, cycles off, centres relative, feed per minute
            (17 | 40 | 49 | 61 | 64 | 80 | 94 | 97 | 98, _) | (91, 1) => {}
            // tool length; machine coordinates
            (43 | 53, 0) => self.note_skipped(format!("G{code}"), line),
            (major, 0) if SKIPPED.contains(&major) => {
                self.note_skipped(format!("G{code}"), line);
                return Ok(Some(Purpose::Skipped));
            }
            _ if self.skip.general.contains(&code) => {
                self.note_skipped(format!("G{code}"), line);
                return Ok(Some(Purpose::Skipped));
            }
            _ => {
                let message = format!(
                    "`G{code}` is not supported, expected one of G0 to G4, G17, G20, G21, G90, G91 and G92; \
                     list it in `skip` if it does not change the path"
                );
                return Err(message);
            }
        }
        Ok(None)
    }

    /// Applies an `M` code; returns whether the program ends.
    fn switch(&mut self, code: Code, line: usize) -> Result<bool, String> {
        if self.skip.switches.contains(&code) {
            self.note_skipped(format!("M{code}"), line);
            return Ok(false);
        }
        if code.minor > 0 {
            return Ok(false);
        }
        if self.keys.on.contains(&code.major) {
            self.is_on = true;
        } else if self.keys.off.contains(&code.major) {
            self.is_on = false;
        } else if SUBPROGRAMS.contains(&code.major) {
            return Err(format!("`M{code}` {SUBPROGRAM}"));
        }
        Ok(matches!(code.major, 2 | 30))
    }

    fn power(&self) -> Result<f64, String> {
        match self.is_on {
            true => power_of("power", self.power, self.default_power).map_err(|e| e.to_string()),
            false => Ok(0.0),
        }
    }

    fn rest(&mut self, block: &Block) -> Result<(), String> {
        let unit = match self.keys.dwell {
            DwellUnit::Seconds => 1.0,
            DwellUnit::Milliseconds => 1e-3,
        };
        let time = match block.number('P')? {
            Some(p) => Some(p * unit),
            // seconds by `S`; on controllers of mills by `X` or `U`
            None => block
                .number('S')?
                .or(block.number('X')?)
                .or(block.number('U')?),
        };
        match time.filter(|t| *t >= 0.0) {
            Some(time) => self.track.dwell(time, self.power()?),
            None => return Err("a dwell `G4` needs its time `P`, zero or above".into()),
        }
        Ok(())
    }

    /// The present place gets new coordinates.
    fn set_place(&mut self, block: &Block, line: usize) -> Result<(), String> {
        if !block.has_any("XYZ") {
            let sets_other = block.has_any("EABCUVW");
            if !sets_other {
                self.note_skipped("G92".into(), line);
            }
        }
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(value) = block.number(letter)? {
                self.zero[axis] = self.at[axis] - value * self.unit;
            }
        }
        for (value, letter) in self.others.iter_mut().zip(OTHER_AXES.chars()) {
            *value = block.number(letter)?.unwrap_or(*value);
        }
        Ok(())
    }

    /// Feed, power and place of a block; `is_named`: it has the code of its motion.
    fn take_words(&mut self, block: &Block, is_named: bool) -> Result<(), String> {
        self.check_letters(block)?;
        if let Some(feed) = block.number('F')? {
            if !(feed > 0.0) {
                return Err(format!("the feed `F` is {feed}, expected a number above 0"));
            }
            self.feed = Some(feed * self.unit / 60.0);
        }
        if let Some(s) = block.number('S')? {
            if s < 0.0 {
                return Err(format!(
                    "`S` is {s}, expected a number that is not negative"
                ));
            }
            self.power = Some(s * self.keys.power_per_s);
        }
        let arc_words = block.has_any("IJKR");
        if !block.has_any("XYZABCUVW") && !arc_words {
            return Ok(());
        }
        let Some(motion) = self.motion else {
            return Err("coordinates come before the first G0, G1, G2 or G3".into());
        };
        if arc_words && !motion.is_arc() {
            let of_block = if is_named { "of the block" } else { "in force" };
            return Err(format!(
                "`I`, `J`, `K` and `R` belong to an arc, G2 or G3, but the motion {of_block} is straight"
            ));
        }
        self.go(block, motion)
    }

    /// Refuses letters without a meaning in the block.
    fn check_letters(&self, block: &Block) -> Result<(), String> {
        let has = |major: u32| block.general.iter().any(|c| c.major == major);
        let is_arc = self.motion.is_some_and(MotionCode::is_arc);
        for word in &block.words {
            let letter = word.letter;
            let is_known = "XYZIJKRFS".contains(letter)
                || OTHER_AXES.contains(letter)
                || DROPPED.contains(letter)
                || (letter == 'P' && is_arc)
                || ("PQ".contains(letter) && has(64));
            if letter == 'O' {
                return Err(format!("`O` {SUBPROGRAM}"));
            }
            if !is_known {
                return Err(format!(
                    "`{letter}` has no meaning in this block, expected words of X, Y, Z, I, J, R, F and S"
                ));
            }
            block.number(letter)?;
        }
        Ok(())
    }

    /// Refuses a change of an axis that the path does not have, except before the first move with a feed.
    fn keep_other_axes(&mut self, block: &Block, motion: MotionCode) -> Result<(), String> {
        let is_setup = !self.has_moved && motion == MotionCode::Rapid;
        for (value, letter) in self.others.iter_mut().zip(OTHER_AXES.chars()) {
            let Some(given) = block.number(letter)? else {
                continue;
            };
            let new = if self.is_relative {
                *value + given
            } else {
                given
            };
            if (new - *value).abs() > 1e-9 && !is_setup {
                let message = format!(
                    "axis `{letter}` moves from {value} to {new}; rotary and secondary axes must keep their values, \
                     since neither the body nor the torch turns with them"
                );
                return Err(message);
            }
            *value = new;
        }
        Ok(())
    }

    fn go(&mut self, block: &Block, motion: MotionCode) -> Result<(), String> {
        self.keep_other_axes(block, motion)?;
        if !block.has_any("XYZIJKR") {
            return Ok(());
        }
        let mut to = self.at;
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(value) = block.number(letter)? {
                let from = if self.is_relative {
                    self.at[axis]
                } else {
                    self.zero[axis]
                };
                to[axis] = from + value * self.unit;
            }
        }
        if motion == MotionCode::Rapid {
            self.track.go(to, self.keys.rapid_speed, 0.0);
            self.at = to;
            return Ok(());
        }
        let feed = self.feed.ok_or("a move comes before the first feed `F`")?;
        let power = self.power()?;
        if motion.is_arc() {
            let (centre, angle) = self.arc(block, to, motion == MotionCode::Clockwise)?;
            let radius = (self.at - centre).norm();
            let duration = angle.abs() * radius / feed;
            self.track.turn(centre, angle / duration, duration, power);
        } else {
            self.track.go(to, feed, power);
        }
        self.at = to;
        self.has_moved = true;
        Ok(())
    }
}

const SUBPROGRAM: &str = "belongs to a subprogram; subprograms are not supported";

fn two_codes(block: &Block) -> String {
    let codes: Vec<_> = block.general.iter().map(|c| format!("`G{c}`")).collect();
    format!(
        "{} in one block each need coordinates or words of their own, expected one of them in a block",
        codes.join(", ")
    )
}
