//! The cases of a sweep.

use std::path::{Path, PathBuf};

use super::SweepError;
use crate::case::Case;
use crate::case::change::Change;

/// One case of a sweep.
#[derive(Clone, Debug)]
pub struct Variant {
    /// Number of the variant, from 1.
    pub number: usize,
    /// Differences to the case of the sweep.
    pub changes: Vec<Change>,
    /// Text of the case.
    pub text: String,
    digits: usize,
}

impl Variant {
    fn file(&self, folder: &Path, extension: &str) -> PathBuf {
        let (number, digits) = (self.number, self.digits);
        folder.join(format!("{number:0digits$}.{extension}"))
    }

    /// The case file.
    pub fn case(&self, folder: &Path) -> PathBuf {
        self.file(folder, "toml")
    }

    /// The log.
    pub fn log(&self, folder: &Path) -> PathBuf {
        self.file(folder, "mcap")
    }

    /// The values in the order of the keys.
    pub fn values(&self) -> String {
        let values: Vec<&str> = self.changes.iter().map(|c| c.value.as_str()).collect();
        values.join(", ")
    }
}

/// A key with its values, from `key=[values]`.
fn set(given: &str) -> Result<Vec<Change>, SweepError> {
    let wrong = |message: &str| SweepError::Set {
        given: given.into(),
        message: message.into(),
    };
    let Change { key, value } = given.parse().map_err(|_| wrong("there is no `=`"))?;
    let table: toml::Table = toml::from_str(&format!("values = {value}"))
        .map_err(|_| wrong("the values are not TOML"))?;
    let values = table["values"]
        .as_array()
        .filter(|values| !values.is_empty());
    let values = values.ok_or_else(|| wrong("the values are no list, or there are none"))?;
    Ok(values
        .iter()
        .map(|value| Change {
            key: key.clone(),
            value: value.to_string(),
        })
        .collect())
}

/// Cases with all combinations of the values, the last key varying fastest; or with all keys varying together.
///
/// # Errors
/// The argument is not `key=[values]`, the case has no place for the key, or the key does not take the value.
pub fn variants(case: &Case, given: &[String], together: bool) -> Result<Vec<Variant>, SweepError> {
    let sets: Vec<Vec<Change>> = given.iter().map(|g| set(g)).collect::<Result<_, _>>()?;
    let mut combinations: Vec<Vec<Change>> = vec![Vec::new()];
    if together {
        let count = sets.first().map_or(0, Vec::len);
        if let Some(other) = sets.iter().find(|s| s.len() != count) {
            return Err(SweepError::Lengths(count, other.len()));
        }
        let of = |i: usize| sets.iter().map(|s| s[i].clone()).collect();
        combinations = (0..count).map(of).collect();
    } else {
        for set in &sets {
            let longer = combinations.iter().flat_map(|before| {
                set.iter().map(move |change| {
                    let mut changes = before.clone();
                    changes.push(change.clone());
                    changes
                })
            });
            combinations = longer.collect();
        }
    }
    let digits = combinations.len().to_string().len();
    let mut variants = Vec::with_capacity(combinations.len());
    for (index, changes) in combinations.into_iter().enumerate() {
        let changed = case.changed(&changes)?;
        changed.compose()?;
        variants.push(Variant {
            number: index + 1,
            changes,
            text: changed.file.text.clone(),
            digits,
        });
    }
    Ok(variants)
}
