//! Tells the program from which commit it is built.

use std::process::Command;

fn main() {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_string())
    };
    let sources = [
        "src",
        "verification",
        "welding",
        "additive",
        "quenching",
        "geometry",
        "toolpaths",
        "fracture",
        "spacings",
        "../core/src",
        "../physics/src",
        "../couplers/src",
    ];
    let commit = git(&["rev-parse", "--short=12", "HEAD"]);
    let changes = git(&[&["status", "--porcelain", "--"][..], &sources].concat());
    let commit = match (commit, changes.unwrap_or_default().is_empty()) {
        (Some(commit), true) => commit,
        (Some(commit), false) => format!("{commit}+"),
        (None, _) => "unknown".into(),
    };
    println!("cargo::rustc-env=PERIMELT_COMMIT={commit}");
    // the log of the branch changes with each commit
    for path in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", path]) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    for path in sources {
        println!("cargo::rerun-if-changed={path}");
    }
}
