//! `perimelt new`: a case file to start from.

use std::io::Write;
use std::path::{Path, PathBuf};

use perimelt_core::error::nearest;

use super::Done;
use crate::verify::benchmarks::BENCHMARKS;

#[derive(clap::Args, Debug)]
pub struct NewArgs {
    /// The case to start from; left out, the command lists them
    template: Option<String>,
    /// The file to write [default: name of the template with .toml, in the working directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Why no case can be written.
#[derive(Debug, thiserror::Error)]
enum NewError {
    #[error("no template is called `{name}`{}; `perimelt new` lists them", .close.as_ref().map_or(String::new(), |c| format!("; did you mean `{c}`?")))]
    Unknown { name: String, close: Option<String> },
    #[error("{path} exists; name another file with `--out`", path = .0.display())]
    Exists(PathBuf),
    #[error("cannot write {path}: {source}", path = .path.display())]
    Write {
        path: PathBuf,
        source: std::io::Error,
    },
}

pub fn run(args: &NewArgs) -> Done {
    let out = &mut crate::terminal::output();
    let processes = || BENCHMARKS.iter().filter(|b| b.folder != "verification");
    let Some(name) = &args.template else {
        for template in processes() {
            let title = title(template.text);
            writeln!(out, "  {:<24} {title}", template.name)?;
        }
        return Ok(());
    };
    // benchmarks are templates, too, though too many to list
    let Some(template) = BENCHMARKS.iter().find(|b| b.name == name) else {
        let close = nearest(name, BENCHMARKS.iter().map(|b| b.name)).map(String::from);
        let name = name.clone();
        return Err(NewError::Unknown { name, close }.into());
    };
    let path = match &args.out {
        Some(path) => path.clone(),
        None => Path::new(template.name).with_extension("toml"),
    };
    let file = std::fs::File::create_new(&path);
    let mut file = file.map_err(|source| not_created(path.clone(), source))?;
    let written = file.write_all(template.text.as_bytes());
    written.map_err(|source| NewError::Write {
        path: path.clone(),
        source,
    })?;
    let files = template.write_files(path.parent().unwrap_or(Path::new("")));
    files.map_err(|(path, source)| not_created(path, source))?;
    let path = path.display();
    Ok(writeln!(
        out,
        "{path}: change it, then `perimelt check {path}` and `perimelt run {path}`"
    )?)
}

fn not_created(path: PathBuf, source: std::io::Error) -> NewError {
    match source.kind() {
        std::io::ErrorKind::AlreadyExists => NewError::Exists(path),
        _ => NewError::Write { path, source },
    }
}

/// The title of a case.
fn title(text: &str) -> &str {
    let line = text.lines().find_map(|line| line.strip_prefix("title = "));
    line.unwrap_or("").trim_matches('"')
}
