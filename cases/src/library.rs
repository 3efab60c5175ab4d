//! The material library: `cases/materials/*.toml`, built into the program.

use perimelt_core::material::{Material, MaterialSection};

macro_rules! entries {
    ($($name:literal),* $(,)?) => {
        /// Names and texts of the library entries.
        pub const ENTRIES: &[(&str, &str)] = &[
            $(($name, include_str!(concat!("../materials/", $name, ".toml")))),*
        ];
    };
}

entries!(
    "304L",
    "316L",
    "6061",
    "AlSi10Mg",
    "IN625",
    "IN718",
    "S355",
    "Ti-6Al-4V",
    "water",
);

/// Names of the library entries.
pub fn names() -> impl Iterator<Item = &'static str> {
    ENTRIES.iter().map(|(name, _)| *name)
}

/// The library entry called `name`.
pub fn find(name: &str) -> Option<Material> {
    let (name, text) = ENTRIES.iter().find(|(n, _)| *n == name)?;
    let section: MaterialSection =
        toml::from_str(text).expect("a test reads every entry of the library");
    Some(Material::new(*name, section, None).expect("a test reads every entry of the library"))
}

#[cfg(test)]
mod sources;

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_file_of_the_library_is_built_in_and_reads() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/materials");
        let files: BTreeSet<String> = std::fs::read_dir(folder)
            .expect("the folder of the library")
            .map(|entry| entry.expect("readable").path())
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .filter_map(|path| Some(path.file_stem()?.to_str()?.to_string()))
            .collect();
        assert_eq!(files, names().map(String::from).collect());
        for name in names() {
            assert_eq!(find(name).expect("it is listed").name(), name);
        }
    }
}
