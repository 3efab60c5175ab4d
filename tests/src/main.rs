//! `perimelt` once more, so that tests of this package find a binary (`CARGO_BIN_EXE_...` is
//! given to tests of the package that holds the binary only).
fn main() -> std::process::ExitCode {
    perimelt::main()
}
