//! The packages that the program is built from: their licences, versions and sources are those that `deny.toml` allows; and
//! the arrows between the crates of this repository.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use perimelt_tests::root;
use toml::{Table, Value};

fn read(name: &str) -> Table {
    let text = std::fs::read_to_string(root().join(name)).expect("readable");
    text.parse().expect("TOML")
}

/// Elements of an array in the table `section`.
fn array<'a>(table: &'a Table, section: &str, key: &str) -> &'a [Value] {
    table[section][key].as_array().expect("an array")
}

/// Name, version and licence of each package that is built for this machine.
fn packages() -> BTreeSet<[String; 3]> {
    let tree = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["tree", "--workspace", "--locked", "--edges", "normal,build"])
        .args(["--prefix", "none", "--no-dedupe", "--format", "{p}|{l}"])
        .output()
        .expect("cargo runs");
    assert!(tree.status.success(), "{tree:?}");
    let text = String::from_utf8(tree.stdout).expect("text");
    let package = |line: &str| {
        let (package, licence) = line.split_once('|')?;
        let (name, version) = package.split_once(' ')?;
        let version = version.split(' ').next().unwrap_or_default();
        Some([name, version, licence].map(String::from))
    };
    text.lines().filter_map(package).collect()
}

/// Whether a licence expression can be fulfilled with the allowed ones: alternatives by `OR` and `/`, all of those by `AND`.
fn is_allowed(expression: &str, allowed: &[Value]) -> bool {
    let is_one = |name: &str| {
        let name = name.trim_matches(['(', ')', ' ']);
        allowed.iter().any(|a| a.as_str() == Some(name))
    };
    let alternatives = |part: &str| part.replace('/', " OR ").split(" OR ").any(is_one);
    expression.split(" AND ").all(alternatives)
}

#[test]
fn licences_are_allowed_and_packages_have_one_version() {
    let rules = read("deny.toml");
    let allowed = array(&rules, "licenses", "allow");
    let skipped = array(&rules, "bans", "skip").iter();
    let skipped: BTreeSet<&str> = skipped.filter_map(|s| s["name"].as_str()).collect();
    let packages = packages();
    assert!(packages.len() > 100, "{}", packages.len());
    let mut versions = BTreeMap::<&str, Vec<&str>>::new();
    for [name, version, licence] in &packages {
        assert!(is_allowed(licence, allowed), "{name} {version}: {licence}");
        versions.entry(name).or_default().push(version);
    }
    for (name, versions) in &versions {
        let twice = versions.len() > 1;
        assert_eq!(twice, skipped.contains(name), "{name}: {versions:?}");
    }
}

#[test]
fn crates_depend_on_those_below_them_only() {
    for (folder, below) in [
        ("core", &[][..]),
        ("plot", &[]),
        ("physics", &["perimelt-core"]),
        ("couplers", &["perimelt-core"]),
    ] {
        let manifest = read(&format!("{folder}/Cargo.toml"));
        let names = manifest["dependencies"].as_table().expect("a table").keys();
        let own = names.filter(|name| name.starts_with("perimelt"));
        assert!(own.eq(below), "{folder}");
    }
}

#[test]
fn packages_come_from_one_registry() {
    let lock = read("Cargo.lock");
    let packages = lock["package"].as_array().expect("an array");
    let sources = packages.iter().filter_map(|p| p.get("source")?.as_str());
    let sources: BTreeSet<&str> = sources.collect();
    assert_eq!(sources.len(), 1, "{sources:?}");
    assert!(
        sources.iter().all(|s| s.starts_with("registry+")),
        "{sources:?}"
    );
}

#[test]
fn expressions_of_licences_are_read() {
    let allowed = ["MIT", "Zlib"].map(Value::from);
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0-only", false),
        ("GPL-3.0-only OR MIT", true),
        ("Apache-2.0/MIT", true),
        ("(MIT OR Apache-2.0) AND Zlib", true),
        ("MIT AND GPL-3.0-only", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}
