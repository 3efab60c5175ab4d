//! The documents of the repository: paths that they name exist, and the two entry pages stay short.

use std::path::{Path, PathBuf};

use perimelt_tests::{files_with, root};

/// `README.md`, `ARCHITECTURE.md` and the Markdown files of `docs`.
fn documents() -> Vec<PathBuf> {
    let mut documents = vec![root().join("README.md"), root().join("ARCHITECTURE.md")];
    documents.extend(files_with("md", &root().join("docs")));
    documents
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).expect("a document")
}

/// The text outside of fenced blocks.
fn prose(text: &str) -> String {
    let blocks = text.split("```").step_by(2);
    blocks.collect::<Vec<_>>().join("\n")
}

/// Files that the links of a document lead to.
fn linked(document: &Path, text: &str) -> Vec<PathBuf> {
    let folder = document.parent().expect("a folder");
    let targets = text.split("](").skip(1);
    let targets = targets.filter_map(|rest| rest.split([')', '#', ' ']).next());
    let files = targets.filter(|t| !t.is_empty() && !t.contains("://"));
    files.map(|t| folder.join(t)).collect()
}

/// Paths from the root of the repository that stand between backticks. Patterns (`<name>`, `*`) are left out, and
/// `a/{b,c}` names two paths.
fn named(text: &str) -> Vec<PathBuf> {
    let spans = text.split('`').skip(1).step_by(2);
    let spans = spans.flat_map(str::split_whitespace);
    let paths = spans.filter(|span| {
        let first = span.split_once('/').map(|(first, _)| first);
        first.is_some_and(|f| !f.is_empty() && f != ".." && root().join(f).is_dir())
            && !span.contains(['<', '*', '=', '"', '('])
    });
    paths.flat_map(alternatives).collect()
}

fn alternatives(path: &str) -> Vec<PathBuf> {
    let path = path.trim_end_matches([',', ';', ':']);
    let Some((before, rest)) = path.split_once('{') else {
        return vec![root().join(path)];
    };
    let (inside, after) = rest.split_once('}').expect("a closing brace");
    let names = inside.split(',');
    names
        .map(|name| root().join(format!("{before}{name}{after}")))
        .collect()
}

#[test]
fn paths_that_documents_name_exist() {
    let (mut missing, mut count) = (Vec::new(), 0);
    for document in documents() {
        let text = prose(&read(&document));
        for path in linked(&document, &text).into_iter().chain(named(&text)) {
            count += 1;
            if !path.exists() {
                missing.push(format!("{}: {}", document.display(), path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "no such files:\n{}", missing.join("\n"));
    assert!(count > 200, "{count} paths");
}

#[test]
fn the_entry_pages_are_short() {
    let lines = read(&root().join("README.md")).lines().count();
    assert!(lines < 150, "README.md has {lines} lines");
    let bytes = read(&root().join("ARCHITECTURE.md")).len();
    assert!(bytes < 12_000, "ARCHITECTURE.md has {bytes} bytes");
}
