//! `perimelt bench`.

use super::{Done, processes};
use crate::bench::{BenchArgs, bench, bench_messages};

pub fn run(args: &BenchArgs) -> Done {
    match args.mpi {
        true => processes::shared(|all| bench_messages(&all, &mut crate::terminal::output())),
        false => bench(args, &mut crate::terminal::output()),
    }
}
