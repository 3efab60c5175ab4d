//! Names of files for the bodies, probes and fields of a log.

use std::collections::BTreeMap;

/// The names of the files of one command. Different names get different files, also on systems that ignore the
/// case of letters.
#[derive(Clone, Debug, Default)]
pub(crate) struct FileNames {
    /// Names by the name of the file in small letters.
    taken: BTreeMap<String, String>,
}

impl FileNames {
    /// The file for a name; a number is added to the second one of two that would be equal.
    pub(crate) fn of(&mut self, name: &str, extension: &str) -> String {
        let stem = file_name(name);
        let mut file = format!("{stem}.{extension}");
        for number in 2.. {
            let owner = self.taken.entry(file.to_lowercase());
            if owner.or_insert_with(|| name.into()) == name {
                break;
            }
            file = format!("{stem}-{number}.{extension}");
        }
        file
    }
}

/// A name without spaces and separators of folders; numbers stay together with their units.
pub(crate) fn file_name(name: &str) -> String {
    let mut file = String::new();
    let mut signs = name.chars().peekable();
    while let Some(sign) = signs.next() {
        let is_unit = file.ends_with(|c: char| c.is_ascii_digit())
            && signs.peek().is_some_and(|c| c.is_alphabetic() || *c == 'µ');
        match sign {
            ' ' if is_unit => {}
            // separators of folders, and what some systems refuse in names
            ' ' | '/' | '\\' | '<' | '>' | ':' | '"' | '|' | '?' | '*' => file.push('-'),
            sign if sign.is_control() => file.push('-'),
            sign => file.push(sign),
        }
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_names_get_different_files() {
        let mut names = FileNames::default();
        let mut of = |name: &str| names.of(name, "csv");
        assert_eq!(of("a b-1"), "a-b-1.csv");
        assert_eq!(of("a-b-1"), "a-b-1-2.csv");
        assert_eq!(of("A-b-1"), "A-b-1-3.csv");
        // a repeated name
        assert_eq!(of("a b-1"), "a-b-1.csv");
        assert_eq!(of("../\u{1b}x"), "..--x.csv");
    }
}
