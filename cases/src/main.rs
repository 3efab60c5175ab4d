//! The `perimelt` binary.
fn main() -> std::process::ExitCode {
    perimelt::main()
}
