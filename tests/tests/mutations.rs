//! The mutations of `tests/mutation/chosen.toml` fit the code: what each replaces occurs once.

use perimelt_tests::root;
use toml::Table;

#[test]
fn what_a_mutation_replaces_occurs_once() {
    let read = |path: &str| std::fs::read_to_string(root().join(path)).unwrap_or_default();
    let chosen: Table = read("tests/mutation/chosen.toml").parse().expect("TOML");
    let mutations = chosen["mutation"].as_array().expect("an array");
    assert!(mutations.len() > 30, "{}", mutations.len());
    let misfits = mutations.iter().filter_map(|mutation| {
        let text = |key: &str| mutation[key].as_str().expect("a text");
        let count = read(text("file")).matches(text("of")).count();
        (count != 1).then(|| format!("{}: {} times `{}`", text("file"), count, text("of")))
    });
    let misfits: Vec<_> = misfits.collect();
    assert!(misfits.is_empty(), "{misfits:#?}");
}
