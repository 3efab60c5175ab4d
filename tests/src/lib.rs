//! Verification and command-line tests, and what several of them need.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use perimelt::case::Case;
use perimelt::run::Failure;
use perimelt_core::Simulation;
use perimelt_core::log::Log;
use perimelt_core::transport::{Memory, Processes};
use toml::{Table, Value};

/// The folder of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A case file of this name and text, ready for its first step.
///
/// # Errors
/// What is wrong with it.
pub fn start(name: &str, text: String) -> Result<(Case, Simulation), Failure> {
    let case = Case::parse(name, text, Path::new(""))?;
    let mut simulation = case.compose()?;
    case.start(&mut simulation)?;
    Ok((case, simulation))
}

/// A text with `right` replaced by `wrong`.
///
/// # Panics
/// Where `right` does not occur once.
pub fn changed(text: &str, right: &str, wrong: &str) -> String {
    assert_eq!(text.matches(right).count(), 1, "`{right}` is there once");
    text.replace(right, wrong)
}

/// What is said about a case file of this name and text, which has a mistake.
///
/// # Panics
/// Where it has none.
pub fn message(name: &str, text: String) -> String {
    match start(name, text.clone()) {
        Err(Failure::Case(mistake)) => mistake.render(false),
        Err(other) => panic!("not a mistake in the case file: {other}"),
        Ok(_) => panic!("accepted:\n{text}"),
    }
}

/// What case files that differ in numbers only, such as spacing and material, have in common; the dimension counts.
pub fn kind(case: &Table) -> String {
    let mut kind = case.clone();
    for section in ["case", "verify"] {
        kind.remove(section);
    }
    for (name, value) in kind.iter_mut() {
        forget_numbers(name, value);
    }
    kind.to_string()
}

fn forget_numbers(name: &str, value: &mut Value) {
    match value {
        Value::Float(_) | Value::Integer(_) if name != "dimension" => *value = 0.into(),
        Value::Array(values) => values.iter_mut().for_each(|v| forget_numbers(name, v)),
        Value::Table(table) => table.iter_mut().for_each(|(n, v)| forget_numbers(n, v)),
        _ => {}
    }
}

/// Files with this extension in a folder and its folders.
///
/// # Panics
/// Where a folder cannot be read.
pub fn files_with(extension: &str, folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let files = paths.flat_map(|path| match path.is_dir() {
        true => files_with(extension, &path),
        false => vec![path],
    });
    files
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect()
}

/// Bytes of the last checkpoint of a log.
///
/// # Panics
/// For a log that is damaged or has no checkpoint.
pub fn last_checkpoint(log: &Path) -> Vec<u8> {
    let log = Log::open(log).expect("the log opens");
    let last = log.last_checkpoint().expect("it has a checkpoint");
    log.checkpoint(last).expect("it reads")
}

/// What each of `count` processes, which are threads, finds.
///
/// # Panics
/// When one does.
pub fn in_processes<T: Send>(count: usize, work: impl Fn(Processes) -> T + Sync) -> Vec<T> {
    if count == 1 {
        return vec![work(Processes::ALONE)];
    }
    let work = &work;
    std::thread::scope(|scope| {
        let start = |process: Memory| {
            let processes = Processes::new(Arc::new(process));
            scope.spawn(move || work(processes))
        };
        let threads: Vec<_> = Memory::processes(count).into_iter().map(start).collect();
        let results = threads.into_iter().map(|thread| thread.join());
        results.map(|result| result.expect("no panic")).collect()
    })
}

/// Compiles the material subroutines of the tests to a library in a folder; `None`, with a message, without a compiler.
///
/// # Panics
/// Where they do not compile.
pub fn compile_subroutines(folder: &Path) -> Option<PathBuf> {
    let library = folder.join("materials.so");
    let source = root().join("tests/tests/umat/materials.c");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]);
    match compiler.arg(&library).arg(source).arg("-lm").status() {
        Ok(status) => {
            assert!(status.success(), "the subroutines do not compile");
            Some(library)
        }
        Err(error) => {
            eprintln!("left out, no compiler `cc`: {error}");
            None
        }
    }
}
