//! Toolpath from a program in G-code (RS-274): straight and circular moves, rests, feeds, power on and off.
//!
//! | word | meaning |
//! |---|---|
//! | `G0` | to a place at `rapid_speed`, power off |
//! | `G1`, `G2`, `G3` | straight, clockwise and counter-clockwise to a place at the feed; centres of circles by `I`, `J` from the start, or a radius `R` (negative: the longer way round) |
//! | `G4` | rest of `P` seconds (or milliseconds, see `dwell`), or of `S` or `X` seconds, with the power that is on |
//! | `G17`, `G20`, `G21`, `G90`, `G91` | plane xy, inches, millimetres, places absolute and relative |
//! | `G92` | the present place gets the coordinates X, Y, Z; other axes and an extruder are not followed. `G92.1` takes it back |
//! | `F` | feed per minute |
//! | `S` | power, times `power_per_s`; without it that of the source |
//! | `M3`, `M4`, `M5` | power on, on and off; other numbers by `on` and `off` |
//! | `M0`, `M1` | wait for `wait_until`, if it is given; other numbers by `wait_at` |
//! | `M2`, `M30`, the second `%` | end; what follows is not read |
//!
//! The program is read line by line (`line.rs`); the words of a block go to the codes that they belong to (`block.rs`), so that
//! settings such as `M204 P500 R500` are neither moves nor powers; a controller (`machine.rs`) runs the blocks. Motion and feed last
//! until they are changed.
//!
//! - Codes without a meaning here (tools, coolant, one work offset, cutter compensation off) are skipped. Reference runs (G28, G30),
//!   levelling (G29), firmware retraction (G10, G11), tool length (G43), rapid moves in coordinates of the machine (G53), and
//!   codes of the key `skip` are skipped with a warning.
//! - What would change the path and is not in the table is refused with its line: other motions, arcs of several turns,
//!   subprograms (M97 to M99, O), variables, changes of the work offset, and axes A, B, C, U, V, W whose values change.
//! - The letters E, N, T, H and D are dropped; others without a meaning in their block are an error.
//!
//! Reference: T. R. Kramer, F. M. Proctor, E. Messina, The NIST RS274NGC Interpreter, version 3, NISTIR 6556 (2000).

mod arc;
mod block;
mod line;
mod machine;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use block::Block;
use line::{Code, Line};
use machine::{Machine, Skip};

use super::{Track, WaitUntil, place};
use perimelt_core::SetupError;
use perimelt_core::numbers::{check_at_least, check_finite, check_positive};

/// Moves and power from a program in G-code, the dialect RS-274 of NIST. Codes of printers and slicers that do not change the path
/// are skipped; what would change the path and is not supported is refused with its line.
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
    /// Codes that are skipped with their words and a warning, such as `["G5", "M98"]`. Those of moves, units and places cannot
    /// be. Default none; G10, G11, G28, G29, G30, G43 and G53 are skipped anyway.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skip: Vec<String>,
    /// Whether blocks that begin with `/` are left out, as with the switch of the machine on. It is needed for programs that
    /// have such blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block_delete: Option<bool>,
}

/// Unit of the rest that `G4 P` gives.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DwellUnit {
    /// The rule of RS-274.
    #[default]
    Seconds,
    /// The rule of printer controllers.
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

impl Gcode {
    pub(super) fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, SetupError> {
        let file = match (&self.file, &self.program) {
            (Some(file), None) => file,
            (None, Some(program)) => {
                return self.read(program, Path::new("of the case"), default_power);
            }
            _ => {
                let message = "G-code comes from a file or is part of the case";
                return Err(SetupError::value(
                    "file",
                    message,
                    "either `file` or `program`",
                ));
            }
        };
        let path = base_dir.join(file);
        match perimelt_core::input::read_text(&path, perimelt_core::input::LIMIT) {
            Ok(text) => self.read(&text, &path, default_power),
            Err(source) => {
                let message = format!("cannot read the program {}: {source}", path.display());
                Err(SetupError::other("file", message))
            }
        }
    }

    fn read(
        &self,
        text: &str,
        path: &Path,
        default_power: Option<f64>,
    ) -> Result<Track, SetupError> {
        let at_line = |line: usize| {
            move |message: String| {
                let path = path.display();
                SetupError::other(
                    "file",
                    format!("line {line} of the program {path}: {message}"),
                )
            }
        };
        let start = place("origin", self.origin)?;
        check_positive("rapid_speed", self.rapid_speed, "m/s")?;
        check_at_least("power_per_s", self.power_per_s, 0.0, "W")?;
        let time = check_finite("start_time", self.start_time)?;
        let mut machine = Machine::new(self, self.skipped()?, time, start, default_power);
        let text = text.trim_start_matches('\u{feff}');
        // whether a `%`, and whether a block came before
        let [mut has_begun, mut has_block] = [false; 2];
        for (line, text) in (1..).zip(text.lines()) {
            if self.block_delete == Some(true) && text.trim_start().starts_with('/') {
                continue;
            }
            let words = match Line::read(text).map_err(at_line(line))? {
                Line::Tape if has_begun => break,
                Line::Tape => {
                    has_begun = true;
                    continue;
                }
                Line::Block { words, .. } if words.is_empty() => continue,
                Line::Block { deletable, .. } if deletable && self.block_delete.is_none() => {
                    return Err(at_line(line)(DELETABLE.into()));
                }
                Line::Block { words, .. } => words,
            };
            has_begun = true;
            // `O1000` above the program is its name
            if words.len() == 1 && words[0].letter == 'O' && !has_block {
                continue;
            }
            has_block = true;
            let block = Block::sort(&words, self).map_err(at_line(line))?;
            let flow = machine.run(&block, line).map_err(at_line(line))?;
            if flow.is_break() {
                break;
            }
        }
        let empty = || {
            let message = format!("the program {} has no move", path.display());
            SetupError::other("file", message)
        };
        machine.finish().ok_or_else(empty)
    }

    /// The codes of `skip`.
    fn skipped(&self) -> Result<Skip, SetupError> {
        let mut skip = Skip {
            general: Vec::new(),
            switches: Vec::new(),
        };
        for entry in &self.skip {
            let wrong = || {
                let expected = "codes such as \"G28\" that set no motion, units or coordinates";
                SetupError::value("skip", format!("`skip` has \"{entry}\""), expected)
            };
            let mut letters = entry.trim().chars();
            let letter = letters.next().map(|c| c.to_ascii_uppercase());
            let number = letters.as_str().trim().parse().ok();
            let code = number.and_then(Code::new).ok_or_else(wrong)?;
            match letter {
                Some('G') if code.minor > 0 || !NEEDED.contains(&code.major) => {
                    skip.general.push(code)
                }
                Some('M') => skip.switches.push(code),
                _ => return Err(wrong()),
            }
        }
        Ok(skip)
    }
}

/// `G` codes that the path needs.
const NEEDED: [u32; 10] = [0, 1, 2, 3, 4, 20, 21, 90, 91, 92];

const DELETABLE: &str = "a `/` marks a block that the machine leaves out where its switch for that is on; \
    set `block_delete = true` to leave such blocks out, or `false` to run them";
