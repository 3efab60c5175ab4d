//! What the command line tells of case files: templates, explanations, completions.

mod program;

use std::path::Path;
use std::process::Stdio;

use program::command;

/// Whether it succeeded, and what it printed, or said where errors go.
fn told(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = command(folder, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let text = match output.status.success() {
        true => output.stdout,
        false => output.stderr,
    };
    (
        output.status.success(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

#[test]
fn a_new_case_can_be_checked_and_is_not_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (done, templates) = told(folder, &["new"]);
    assert!(done && templates.contains("bead_on_plate"), "{templates}");
    for template in templates.lines() {
        let name = template.split_whitespace().next().expect("a name");
        let (done, told_of) = told(folder, &["new", name]);
        assert!(done && told_of.contains("perimelt run"), "{told_of}");
    }
    let (done, message) = told(folder, &["check", "haz_hardness.toml"]);
    assert!(done, "{message}");
    let (done, message) = told(folder, &["new", "haz_hardness"]);
    assert!(!done && message.contains("exists"), "{message}");
    let (done, message) = told(folder, &["new", "haz_hardnes", "--out", "other.toml"]);
    assert!(
        !done && message.contains("did you mean `haz_hardness`?"),
        "{message}"
    );
}

#[test]
fn everything_that_a_case_can_name_is_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for (name, expected) in [
        ("goldak", "half_width"),
        ("goldak.toolpath.polyline", "segments"),
        ("goldak.toolpath.polyline.segments.dwell_power", "W"),
        ("polyline", "segments"),
        ("hatch", "also: "),
        ("box", "max"),
        ("melt_pool", "probes.kind.melt_pool"),
        ("S355", "EN 10025-2"),
        ("solidus", "[K]"),
        ("hardness", "Vickers"),
        ("time.step", "auto"),
    ] {
        let (done, text) = told(folder, &["explain", name]);
        assert!(done && text.contains(expected), "{name}: {text}");
    }
    for (name, nearest) in [
        ("goldack", "goldak"),
        ("goldak.toolpath.polylin", "polyline"),
        ("hardnes", "hardness"),
        ("S35", "S355"),
    ] {
        let (done, message) = told(folder, &["explain", name]);
        let hint = format!("did you mean `{nearest}`?");
        assert!(!done && message.contains(&hint), "{message}");
    }
}

#[test]
fn every_shell_has_completions() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (done, script) = told(folder.path(), &["completions", shell]);
        assert!(done && script.contains("resume"), "{shell}");
    }
}
