//! Words of a block by the code that they belong to.
//!
//! - `M` codes of printers, with numbers from 100 on and those of [`WITH_PLACES`], own every word after them in their block: `M204 P500
//!   R500`. X, Y and Z before a code of [`WITH_PLACES`] belong to that code, too, unless the block has a `G` code: `X500 M201`.
//! - Other `M` codes own what follows them but places, arcs with numbers, and feeds, which belong to the motion: `X10 M8`, `M62 P1`.
//! - `S` belongs to the codes that switch the power, to the motion, or to no code; `M7`, `M8` and their like take no word.
//!   Next to any other `M` code, in a block without a motion, it is an argument of that code, as are P and R: `S40 M106`.
//! - A block that begins with `T` selects a tool; `S`, `P` and `R` after it are its own.

use super::Gcode;
use super::line::{Code, Value, Word};

/// `M` codes of printers and their drives that take X, Y and Z: settings by axis, places of probes and areas.
const WITH_PLACES: [u32; 39] = [
    17, 18, 84, 92, 122, 201, 202, 203, 204, 205, 206, 207, 208, 218, 290, 350, 351, 420, 425, 555,
    557, 558, 566, 569, 574, 584, 593, 665, 666, 671, 851, 906, 907, 911, 912, 913, 914, 915, 919,
];

/// Standard `M` codes that take no word: end, tool change, coolant.
const WITHOUT_WORDS: [u32; 6] = [2, 6, 7, 8, 9, 30];

/// Letters of the axes and of the centre or radius of an arc.
const PLACES: &str = "XYZABCUVWIJKR";

/// Codes of a block and the words that belong to its `G` codes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Block {
    pub general: Vec<Code>,
    pub switches: Vec<Code>,
    pub words: Vec<Word>,
}

/// Owner of the next word.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    /// The `G` codes of the block, or the motion in force.
    Path,
    /// A code that switches the power.
    Switch,
    /// Another standard `M` code.
    Standard,
    /// An `M` code of a printer.
    Printer,
    /// A `T`.
    Tool,
}

impl Owner {
    fn of(code: Code, keys: &Gcode) -> Owner {
        let number = code.major;
        if keys.on.contains(&number) || keys.off.contains(&number) {
            return Owner::Switch;
        }
        match number {
            n if WITHOUT_WORDS.contains(&n) => Owner::Path,
            n if n >= 100 || WITH_PLACES.contains(&n) => Owner::Printer,
            _ => Owner::Standard,
        }
    }

    fn owns(self, word: &Word) -> bool {
        let is_number = matches!(word.value, Value::Number(_));
        match self {
            Owner::Path => false,
            Owner::Printer => true,
            Owner::Switch => !is_number || "PQL".contains(word.letter),
            Owner::Standard => !is_number || !(PLACES.contains(word.letter) || word.letter == 'F'),
            Owner::Tool => !is_number || "SPR".contains(word.letter),
        }
    }
}

impl Block {
    /// Sorts the words of a line.
    pub fn sort(words: &[Word], keys: &Gcode) -> Result<Block, String> {
        let mut block = Block::default();
        let mut owners = Vec::new();
        let mut owner = Owner::Path;
        for word in words {
            match word.letter {
                'N' => {}
                'G' => {
                    block.general.push(code_of(word)?);
                    owner = Owner::Path;
                }
                'M' => {
                    let code = code_of(word)?;
                    block.switches.push(code);
                    owner = Owner::of(code, keys);
                    owners.push(owner);
                }
                'T' if owner != Owner::Printer => {
                    let is_first = block == Block::default();
                    owner = if is_first { Owner::Tool } else { owner };
                }
                _ if owner.owns(word) => {}
                _ => block.words.push(word.clone()),
            }
        }
        let takes_places =
            |c: &Code| WITH_PLACES.contains(&c.major) && Owner::of(*c, keys) == Owner::Printer;
        if block.general.is_empty() && block.switches.iter().any(takes_places) {
            block.words.retain(|w| !PLACES.contains(w.letter));
        }
        let takes_words = |o: &Owner| matches!(o, Owner::Standard | Owner::Printer);
        if owners.iter().any(takes_words) && !owners.contains(&Owner::Switch) && !block.moves() {
            block.words.retain(|w| !"SPR".contains(w.letter));
        }
        Ok(block)
    }

    /// Whether it has the code of a motion or a rest, or a place. A radius alone is no place.
    fn moves(&self) -> bool {
        let is_motion = |c: &Code| c.major <= 4 && c.minor == 0;
        self.general.iter().any(is_motion) || self.has_any("XYZABCUVWIJK")
    }

    pub fn has_any(&self, letters: &str) -> bool {
        self.words.iter().any(|w| letters.contains(w.letter))
    }

    /// The last number with this letter; an error where the letter has none.
    pub fn number(&self, letter: char) -> Result<Option<f64>, String> {
        match self.words.iter().rev().find(|w| w.letter == letter) {
            None => Ok(None),
            Some(Word {
                value: Value::Number(number),
                ..
            }) => Ok(Some(*number)),
            Some(_) => Err(format!("`{letter}` has no number")),
        }
    }
}

fn code_of(word: &Word) -> Result<Code, String> {
    let code = match word.value {
        Value::Number(number) => Code::new(number),
        _ => None,
    };
    code.ok_or_else(|| {
        format!(
            "`{}` needs the number of a code, such as 1 or 92.1",
            word.letter
        )
    })
}
