//! `perimelt` with the plugins of this crate: `cargo run -p moisture -- run tests/moisture/drying.toml`.
use moisture as _;

fn main() -> std::process::ExitCode {
    perimelt::main()
}
