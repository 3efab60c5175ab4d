use std::collections::BTreeSet;

use super::{BENCHMARKS, BuiltIn, load};
use crate::verify::check::Check;

#[test]
fn built_in_cases_find_their_files_in_any_working_directory() {
    let benchmarks = load(None).expect("valid cases");
    for built_in in BENCHMARKS.iter().filter(|b| !b.files.is_empty()) {
        let mut cases = benchmarks.cases.iter();
        let (_, case) = cases.find(|(n, _)| n == built_in.name).expect("there");
        let composed = case.compose();
        assert!(composed.is_ok(), "{}: {:?}", built_in.name, composed.err());
    }
}

#[test]
fn files_of_a_case_do_not_replace_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let elbow = BENCHMARKS.iter().find(|b| b.name == "elbow");
    let elbow = elbow.expect("there");
    elbow.write_files(folder.path()).expect("an empty folder");
    elbow.write_files(folder.path()).expect("the same contents");
    std::fs::write(folder.path().join("elbow.stl"), "solid").expect("writable");
    let (path, source) = elbow
        .write_files(folder.path())
        .expect_err("other contents");
    assert_eq!(source.kind(), std::io::ErrorKind::AlreadyExists);
    assert_eq!(path, folder.path().join("elbow.stl"));
}

// the schema of case files, `--level` and the files of results have this spelling
#[test]
fn the_level_of_long_checks_has_one_spelling() {
    for BuiltIn { name, text, .. } in BENCHMARKS {
        let other = text.contains("level = \"full\"");
        assert!(!other, "{name}: write `level = \"nightly\"`");
    }
}

#[test]
fn the_plate_with_bonds_across_its_hole_is_the_one_that_warns_of_them() {
    for (name, is_told) in [
        ("khoshrou-4.2-phi8-unstable", true),
        ("khoshrou-4.2-phi8-narrow", false),
    ] {
        let cases = load(None).expect("valid cases").cases;
        let case = cases.into_iter().find(|(n, _)| n == name).expect("there").1;
        let simulation = case.compose().expect("a valid case");
        let warnings = case.warnings(&simulation).expect("valid sections");
        let told = warnings.iter().any(|w| w.contains("bonds cross a gap"));
        assert_eq!(told, is_told, "{name}: {warnings:?}");
    }
}

#[test]
fn no_two_checks_of_a_case_have_one_name() {
    for (name, case) in load(None).expect("valid cases").cases {
        let checks: Vec<Check> = case.verify_entries().expect("valid");
        let names: BTreeSet<_> = checks.iter().map(|c| &c.quantity).collect();
        assert_eq!(
            names.len(),
            checks.len(),
            "{name}: results are kept by quantity"
        );
    }
}

/// Each `source` names a publication of `docs/theory/references.md` by its key, a page of the theory or a program that is there.
#[test]
fn sources_name_publications_pages_or_programs_that_exist() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the repository");
    let references = std::fs::read_to_string(root.join("docs/theory/references.md"));
    let references = references.expect("the page of references");
    let keys: BTreeSet<&str> = references
        .lines()
        .filter_map(|line| Some(line.strip_prefix("- **[")?.split_once("]**")?.0))
        .collect();
    let exists = |path: &&str| root.join(path).is_file();
    let mut unknown = Vec::new();
    for (name, case) in load(None).expect("valid cases").cases {
        let checks: Vec<Check> = case.verify_entries().expect("valid");
        for Check { source, .. } in &checks {
            let cited: Vec<&str> = source
                .split('[')
                .skip(1)
                .filter_map(|rest| Some(rest.split_once(']')?.0))
                .filter(|key| key.starts_with(char::is_uppercase))
                .collect();
            let words = source.split([' ', ',', ';', '(', ')', '"']);
            let words = words.map(|w| w.trim_end_matches(['.', ':']));
            let paths: Vec<&str> = words
                .filter(|w| w.starts_with("docs/") || w.starts_with("cases/"))
                .collect();
            let is_known = cited.iter().all(|key| keys.contains(key)) && paths.iter().all(exists);
            if !is_known || cited.len() + paths.len() == 0 {
                unknown.push(format!("{name}: {source}"));
            }
        }
    }
    unknown.dedup();
    assert!(unknown.is_empty(), "{}", unknown.join("\n"));
}
