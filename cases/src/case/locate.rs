//! Places of keys in a parsed case file.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A parsed value with its place.
pub type TomlValue<'i> = Spanned<DeValue<'i>>;
/// A parsed table.
pub type TomlTable<'i> = DeTable<'i>;

/// Place of a key and of its value.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyPlace {
    /// The key as written, or the header of its table.
    pub key: Range<usize>,
    /// The value.
    pub value: Range<usize>,
    /// Number of names of the path that were found.
    pub depth: usize,
}

/// Places of all keys and items of a table, by names and positions in lists.
#[derive(Debug, Default)]
pub struct Places(BTreeMap<String, Node>);

#[derive(Debug)]
struct Node {
    key: Range<usize>,
    value: Range<usize>,
    below: Places,
}

impl Places {
    /// The places in a parsed table.
    pub fn of(table: &TomlTable<'_>) -> Self {
        let node = |(key, value): (&Spanned<_>, &TomlValue<'_>)| {
            let name: &std::borrow::Cow<'_, str> = key.get_ref();
            (name.to_string(), Node::new(key.span(), value))
        };
        Places(table.iter().map(node).collect())
    }

    /// See [`find`].
    pub fn find(&self, path: &[&str]) -> Option<KeyPlace> {
        let mut found = None;
        let mut places = self;
        for (depth, name) in (1..).zip(path) {
            let Some(node) = places.0.get(*name) else {
                break;
            };
            found = Some(KeyPlace {
                key: node.key.clone(),
                value: node.value.clone(),
                depth,
            });
            places = &node.below;
        }
        found
    }
}

impl Node {
    fn new(key: Range<usize>, value: &TomlValue<'_>) -> Self {
        let below = match value.get_ref() {
            DeValue::Table(table) => Places::of(table),
            DeValue::Array(list) => {
                let items = list.iter().enumerate();
                let node = |(i, item): (usize, &TomlValue<'_>)| {
                    (i.to_string(), Node::new(item.span(), item))
                };
                Places(items.map(node).collect())
            }
            _ => Places::default(),
        };
        Node {
            key,
            value: value.span(),
            below,
        }
    }
}

/// The deepest part of `path` (names, or positions in lists) that `table` holds.
pub fn find(table: &TomlTable<'_>, path: &[&str]) -> Option<KeyPlace> {
    let (name, rest) = path.split_first()?;
    let (key, value) = table.get_key_value(*name)?;
    let here = KeyPlace {
        key: key.span(),
        value: value.span(),
        depth: 1,
    };
    Some(find_in(value, rest, here))
}

fn find_in(value: &TomlValue<'_>, path: &[&str], here: KeyPlace) -> KeyPlace {
    let Some((name, rest)) = path.split_first() else {
        return here;
    };
    let depth = here.depth + 1;
    match value.get_ref() {
        DeValue::Table(table) => match table.get_key_value(*name) {
            Some((key, value)) => {
                let there = KeyPlace {
                    key: key.span(),
                    value: value.span(),
                    depth,
                };
                find_in(value, rest, there)
            }
            None => here,
        },
        DeValue::Array(list) => match name.parse().ok().and_then(|i: usize| list.get(i)) {
            Some(value) => {
                let there = KeyPlace {
                    key: value.span(),
                    value: value.span(),
                    depth,
                };
                find_in(value, rest, there)
            }
            None => here,
        },
        _ => here,
    }
}

/// Names that lead from `table` to the innermost key or value at `span`.
pub fn path_to(table: &TomlTable<'_>, span: &Range<usize>) -> Vec<String> {
    let mut path = Vec::new();
    descend(table, span, &mut path);
    path
}

fn descend(table: &TomlTable<'_>, span: &Range<usize>, path: &mut Vec<String>) -> bool {
    for (key, value) in table {
        path.push(key.get_ref().to_string());
        if covers(&key.span(), span) || descend_value(value, span, path) {
            return true;
        }
        path.pop();
    }
    false
}

fn descend_value(value: &TomlValue<'_>, span: &Range<usize>, path: &mut Vec<String>) -> bool {
    let inner = match value.get_ref() {
        DeValue::Table(table) => descend(table, span, path),
        DeValue::Array(list) => list.iter().enumerate().any(|(i, item)| {
            path.push(i.to_string());
            let found = descend_value(item, span, path);
            if !found {
                path.pop();
            }
            found
        }),
        _ => false,
    };
    inner || covers(&value.span(), span)
}

fn covers(outer: &Range<usize>, inner: &Range<usize>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end && !outer.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "power = 5\n[toolpath]\npoints = [[0, 0], [1, 2]]\nline = { speed = 3 }\n";

    fn parsed() -> TomlTable<'static> {
        DeTable::parse(TEXT).expect("valid").into_inner()
    }

    #[test]
    fn a_dotted_key_leads_to_its_value() {
        let value = |path: &[&str]| &TEXT[find(&parsed(), path).expect("found").value];
        assert_eq!(value(&["power"]), "5");
        assert_eq!(value(&["toolpath", "line", "speed"]), "3");
        assert_eq!(value(&["toolpath", "points", "1", "0"]), "1");
    }

    #[test]
    fn what_is_missing_leads_to_the_deepest_part_that_is_there() {
        let place = find(&parsed(), &["toolpath", "line", "start"]).expect("the line is there");
        assert_eq!((&TEXT[place.key], place.depth), ("line", 2));
        assert_eq!(find(&parsed(), &["radius"]), None);
    }

    #[test]
    fn a_place_leads_back_to_its_names() {
        let at = TEXT.find('3').expect("there");
        assert_eq!(
            path_to(&parsed(), &(at..at + 1)),
            ["toolpath", "line", "speed"]
        );
        let at = TEXT.find("speed").expect("there");
        assert_eq!(
            path_to(&parsed(), &(at..at + 5)),
            ["toolpath", "line", "speed"]
        );
    }
}
