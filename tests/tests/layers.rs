//! The order of modules: each uses those below it only, so that none has to be understood together with those above it. And
//! the files with `unsafe` code.

use std::collections::BTreeSet;
use std::path::Path;

use perimelt_tests::{files_with, root};

/// Modules of `perimelt-core`, the lowest first.
const CORE: &str = "instructions parallel transport arithmetic axis orientation named input folder text explanation flattened cell_list neighbours fire formula shape material samples in_time programme point_rows body \
                    solver family device pddo error numbers surface_tension law stepping in_space field world setup pair_list schedule plugin log simulation";

/// Modules of `perimelt-plot`, the lowest first.
const PLOT: &str =
    "colour scale picture axes heading curves section contour smooth layout snapshot palette film";

/// Modules of `perimelt`, the lowest first.
const CASES: &str = "interrupt terminal file_names argument library cell_grid component growing_log unit output tables \
                     log_names log_file moment melt_pool probe case quantity plot run export summary diff sweep verify \
                     view bench commands";

/// The code of a file without comments and tests.
fn code(path: &Path) -> String {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    if name == "tests" || name == "testing" || name == "fixture" || name.ends_with("_tests") {
        return String::new();
    }
    let text = std::fs::read_to_string(path).expect("a source file");
    let lines = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    let code = lines.take_while(|line| *line != "mod tests {");
    code.collect::<Vec<_>>().join(" ")
}

/// Names of modules of the crate that code uses: `a` and `b` of `crate::a::f` and `crate::{a::f, b}`.
fn used(code: &str) -> BTreeSet<String> {
    let name = |text: &str| -> String {
        let is_of_name = |c: &char| c.is_alphanumeric() || *c == '_';
        text.trim_start().chars().take_while(is_of_name).collect()
    };
    let mut found = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            found.insert(name(rest));
            continue;
        };
        let mut depth = 0;
        found.insert(name(list));
        for (place, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    found.insert(name(&list[place + 1..]));
                }
                _ => {}
            }
        }
    }
    found
}

#[test]
fn modules_use_those_below_them_only() {
    for (folder, order) in [("core", CORE), ("plot", PLOT), ("cases", CASES)] {
        let root = root().join(folder).join("src");
        let order: Vec<&str> = order.split_whitespace().collect();
        let rank = |name: &str| order.iter().position(|module| *module == name);
        for path in files_with("rs", &root) {
            let inside = path.strip_prefix(&root).expect("inside");
            let first = inside.iter().next().expect("a name");
            let module = Path::new(first).file_stem().unwrap_or_default();
            let module = module.to_string_lossy();
            if ["lib", "main"].contains(&&*module) {
                continue;
            }
            let own = rank(&module)
                .unwrap_or_else(|| panic!("{folder}: `{module}` has no place in the order"));
            for other in used(&code(&path)) {
                let is_below = rank(&other).is_none_or(|other| other <= own);
                assert!(
                    is_below,
                    "{}: `{other}` stands above `{module}`",
                    path.display()
                );
            }
        }
    }
}

/// Files with `unsafe` code, and what they need it for.
const UNSAFE: [(&str, &str); 3] = [
    (
        "core/src/family/kernel/",
        "sweeps over bonds: reads without a check of each index, writes of disjoint parts by several threads",
    ),
    (
        "core/src/solver/exact/split.rs",
        "splits terms of sums with the instructions that were detected",
    ),
    (
        "physics/src/mechanical/points/umat/library.rs",
        "calls of the C function of a user's library",
    ),
];

#[test]
fn unsafe_code_stands_in_few_files() {
    let mut found = BTreeSet::new();
    for folder in ["core", "physics", "couplers", "plot", "cases"] {
        for path in files_with("rs", &root().join(folder).join("src")) {
            let code = code(&path);
            let words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
            if words.filter(|word| *word == "unsafe").count() > 0 {
                let path = path.strip_prefix(root()).expect("inside");
                let path = path.to_string_lossy().into_owned();
                let allowed = UNSAFE.iter().find(|(place, _)| path.starts_with(place));
                let (place, _) = allowed.unwrap_or_else(|| panic!("{path}: `unsafe`"));
                found.insert(*place);
            }
        }
    }
    assert_eq!(found.len(), UNSAFE.len(), "{found:?}");
}
