//! `perimelt` with the law of this crate: `cargo run -p swift -- run tests/swift/bar.toml`.
use swift as _;

fn main() -> std::process::ExitCode {
    perimelt::main()
}
