//! `perimelt --version`: the data that an error report needs.

use crate::verify::results::machine;

/// The command line with its version. A program with additional plugins has its own name.
pub fn command(command: clap::Command) -> clap::Command {
    let short = format!(
        "{} ({})",
        env!("CARGO_PKG_VERSION"),
        env!("PERIMELT_COMMIT")
    );
    let machine = machine();
    let program = program();
    let long = match &program {
        Some(_) => format!("of perimelt {short}\n{machine}"),
        None => format!("{short}\n{machine}"),
    };
    let command = command
        .version(permanent(short))
        .long_version(permanent(long));
    match program {
        Some(name) => command.name(permanent(name)),
        None => command,
    }
}

/// Name of a program other than `perimelt`.
fn program() -> Option<String> {
    let path = std::env::current_exe().ok()?;
    let name = path.file_stem()?.to_string_lossy().into_owned();
    (name != "perimelt").then_some(name)
}

/// The parser of arguments takes texts that last as long as the program; this is called a few times only.
fn permanent(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}
