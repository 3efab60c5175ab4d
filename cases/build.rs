//! Tells the program from which commit it is built, and lists the benchmark cases.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

/// Folders whose cases are part of the program, in the order in which they are listed.
const FOLDERS: [&str; 8] = [
    "verification",
    "welding",
    "additive",
    "quenching",
    "geometry",
    "toolpaths",
    "fracture",
    "spacings",
];

fn main() {
    write_benchmarks().expect("the benchmark cases can be listed");
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_string())
    };
    let crates = ["src", "../core/src", "../physics/src", "../couplers/src"];
    let sources = [&crates[..], &FOLDERS].concat();
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

/// Writes the list of the cases, each with the files of its folder that it names.
fn write_benchmarks() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let mut list = String::from("&[\n");
    for folder in FOLDERS {
        let entries = fs::read_dir(root.join(folder))?.map(|entry| Ok(entry?.path()));
        let mut paths: Vec<PathBuf> = entries.collect::<io::Result<_>>()?;
        paths.sort();
        let is_case = |path: &PathBuf| path.extension().is_some_and(|e| e == "toml");
        let (cases, others): (Vec<_>, Vec<_>) = paths.into_iter().partition(is_case);
        for case in cases {
            let text = fs::read_to_string(&case)?;
            let read = others.iter().filter(|file| text.contains(name(file)));
            let files: String = read
                .map(|file| format!("({:?}, include_bytes!({file:?})), ", name(file)))
                .collect();
            let name = name(&case).trim_end_matches(".toml");
            list += &format!(
                "BuiltIn {{ folder: {folder:?}, name: {name:?}, text: include_str!({case:?}), files: &[{files}] }},\n"
            );
        }
    }
    fs::write(out.join("benchmarks.rs"), list + "]\n")
}

fn name(path: &Path) -> &str {
    path.file_name()
        .and_then(|name| name.to_str())
        .unwrap_or_default()
}
