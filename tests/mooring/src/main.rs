//! `perimelt` with the plugins of this crate: `cargo run -p mooring -- run tests/mooring/berthing.toml`.
use mooring as _;

fn main() -> std::process::ExitCode {
    perimelt::main()
}
