//! Tables whose keys depend on each other: a choice, such as that of a form, decides which other keys there are.
//!
//! The table of a plugin lists all keys side by side, those that depend on the choice as options. The keys of a choice are
//! taken out of the table ([`take_keys`]). A choice that is not built is refused, and so is a key that is left although another
//! choice takes it; the message names the nearest choices that work.

use std::collections::BTreeSet;

use perimelt_core::SetupError;
use serde::Serialize;
use serde_json::{Map, Value};

/// What decides which keys a table has.
pub(crate) trait Choice: Copy {
    /// All choices, whether they are built or not.
    fn all() -> impl Iterator<Item = Self>;

    /// The parts of the choice, in the order in which messages name them; every choice has the same ones.
    fn parts(self) -> Vec<Part>;
}

/// A part of a choice.
#[derive(PartialEq)]
pub(crate) struct Part {
    /// The key that decides; `None` where other tables of the case decide.
    key: Option<&'static str>,
    /// The part as messages name it.
    text: String,
}

impl Part {
    /// A key of the table with its value.
    pub(crate) fn key(key: &'static str, value: &impl Serialize) -> Part {
        let value = serde_json::to_value(value).unwrap_or_default();
        Part {
            key: Some(key),
            text: written(key, &value),
        }
    }

    /// A key whose value messages name in words.
    pub(crate) fn named(key: &'static str, text: &str) -> Part {
        Part {
            key: Some(key),
            text: text.into(),
        }
    }

    /// What other tables of the case decide, in words.
    pub(crate) fn elsewhere(text: &str) -> Part {
        Part {
            key: None,
            text: text.into(),
        }
    }
}

/// Takes the keys of a choice out of a table by `take`, which returns `None` for a choice that is not built. Refuses keys that
/// only other choices take.
pub(crate) fn take_keys<T: Clone + Serialize, C: Choice, K>(
    table: &T,
    choice: C,
    take: impl Fn(&mut T, C) -> Option<K>,
) -> Result<K, SetupError> {
    let taken = |choice| {
        let mut rest = table.clone();
        take(&mut rest, choice).map(|keys| (keys, given(&rest)))
    };
    let Some((keys, left)) = taken(choice) else {
        return Err(Misfit::of(choice, |c| taken(c).is_some()).of_choice());
    };
    let takes =
        |choice, key: &String| taken(choice).is_some_and(|(_, left)| !left.contains_key(key));
    let mut left = left.iter();
    match left.find(|(key, _)| C::all().any(|c| takes(c, key))) {
        Some((key, value)) => Err(Misfit::of(choice, |c| takes(c, key)).of_key(key, value)),
        None => Ok(keys),
    }
}

/// How a choice differs from the nearest ones that fit.
struct Misfit {
    parts: Vec<Part>,
    /// Parts in which the nearest choices differ.
    differing: BTreeSet<usize>,
    /// Parts in which the nearest choices differ that the table decides.
    decided: BTreeSet<usize>,
    /// Changes of the table to these, as they are written.
    changes: Vec<String>,
}

impl Misfit {
    fn of<C: Choice>(choice: C, fits: impl Fn(C) -> bool) -> Misfit {
        let parts = choice.parts();
        let others = C::all().filter(|c| fits(*c)).map(|c| {
            let others = c.parts().into_iter().enumerate();
            let others = others.filter(|(number, part)| *part != parts[*number]);
            others.collect::<Vec<_>>()
        });
        let others: Vec<Vec<(usize, Part)>> = others.collect();
        let in_table = others
            .iter()
            .filter(|o| o.iter().all(|(_, p)| p.key.is_some()));
        let in_table = nearest(in_table.collect());
        let numbers = |choices: &[&Vec<(usize, Part)>]| {
            let parts = choices.iter().flat_map(|parts| parts.iter());
            parts.map(|(number, _)| *number).collect()
        };
        let change = |parts: &&Vec<(usize, Part)>| {
            let texts: Vec<&str> = parts.iter().map(|(_, part)| &part.text[..]).collect();
            texts.join(" with ")
        };
        Misfit {
            differing: numbers(&nearest(others.iter().collect())),
            decided: numbers(&in_table),
            changes: in_table.iter().map(change).collect(),
            parts,
        }
    }

    /// The parts in which the nearest choices differ, except for one; all others where they differ in that one only.
    fn others(&self, except: Option<usize>) -> String {
        let differing = self.differing.iter().copied();
        let mut others: Vec<usize> = differing.filter(|n| Some(*n) != except).collect();
        if others.is_empty() {
            others.extend((0..self.parts.len()).filter(|n| Some(*n) != except));
        }
        let others: Vec<&str> = others.iter().map(|n| &self.parts[*n].text[..]).collect();
        others.join(" and ")
    }

    /// The choice is not built.
    fn of_choice(self) -> SetupError {
        let first = self.decided.first().copied();
        let wrong = &self.parts[first.unwrap_or(0)];
        let message = format!("{} does not work with {}", wrong.text, self.others(first));
        let expected = alternatives(&self.changes);
        SetupError::value(wrong.key.unwrap_or_default(), message, expected)
    }

    /// The choice has no such key, or not with that value.
    fn of_key(mut self, key: &str, value: &Value) -> SetupError {
        let message = format!(
            "{} does not work with {}",
            written(key, value),
            self.others(None)
        );
        self.changes.push(format!("no `{key}`"));
        SetupError::value(key, message, alternatives(&self.changes))
    }
}

/// The choices with the fewest parts that differ.
fn nearest(choices: Vec<&Vec<(usize, Part)>>) -> Vec<&Vec<(usize, Part)>> {
    let least = choices.iter().map(|parts| parts.len()).min();
    let nearest = choices.into_iter();
    nearest.filter(|parts| Some(parts.len()) == least).collect()
}

/// "a, b or c".
fn alternatives(of: &[String]) -> String {
    match of.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => of.concat(),
    }
}

/// The keys that are given, with their values.
fn given(table: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(table) {
        Ok(Value::Object(mut keys)) => {
            keys.retain(|_, value| !value.is_null());
            keys
        }
        _ => Map::new(),
    }
}

/// A key as it is written: with its value where that is one of several names.
fn written(key: &str, value: &Value) -> String {
    match value {
        Value::String(_) => format!("`{key} = {value}`"),
        _ => format!("`{key}`"),
    }
}

/// What a plugin needs of its body, its material and other plugins. Where it is not met, the key is refused.
pub(crate) fn need(
    is_met: bool,
    key: &str,
    message: &str,
    expected: &str,
) -> Result<(), SetupError> {
    match is_met {
        true => Ok(()),
        false => Err(SetupError::value(key, message, expected)),
    }
}
