//! (to be written)

/// Arguments of `perimelt verify`.
#[derive(clap::Args, Debug)]
pub struct VerifyArgs {
    /// Only cases whose name contains this.
    filter: Option<String>,
    /// Also the long ones.
    #[arg(long)]
    full: bool,
}

/// Runs `perimelt verify`.
///
/// # Errors
/// Always: this is yet to be written.
pub fn run(args: &VerifyArgs) -> Result<(), Box<dyn std::error::Error>> {
    Err(format!("{args:?} cannot be used yet").into())
}
