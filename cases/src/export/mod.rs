//! (to be written)

/// Arguments of `perimelt export`.
#[derive(clap::Args, Debug)]
pub struct ExportArgs {
    /// The log.
    log: std::path::PathBuf,
}

/// Runs `perimelt export`.
///
/// # Errors
/// Always: this is yet to be written.
pub fn run(args: &ExportArgs) -> Result<(), Box<dyn std::error::Error>> {
    Err(format!("{} cannot be used yet", args.log.display()).into())
}
