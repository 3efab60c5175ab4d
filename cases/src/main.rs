//! The `perimelt` binary.
fn main() {}
