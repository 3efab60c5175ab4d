//! (to be written)

/// Arguments of `perimelt plot`.
#[derive(clap::Args, Debug)]
pub struct PlotArgs {
    /// The log.
    log: std::path::PathBuf,
}

/// Runs `perimelt plot`.
///
/// # Errors
/// Always: this is yet to be written.
pub fn run(args: &PlotArgs) -> Result<(), Box<dyn std::error::Error>> {
    Err(format!("{} cannot be used yet", args.log.display()).into())
}
