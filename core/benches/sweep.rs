//! Bonds per second of the sweep, by store and kernel: `cargo bench -p perimelt-core`.
//!
//! Block of 48³ points, horizon 3.015 spacings, 122 bonds each (on the cloud, whose points are
//! displaced by up to a fifth of a spacing, on average). What limits each kernel
//! stands in `docs/performance.md`.

use divan::Bencher;
use divan::counter::ItemsCount;
use perimelt_core::body::{Body, Jitter, Store};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Bond, BondKernel, Correction, Face, Family, FamilySpec};

fn main() {
    divan::main();
}

#[derive(Clone, Copy)]
enum Points {
    Lattice(Store),
    /// Without layers, each point with weights of its own at the surface.
    Bare,
    Cloud,
}

fn family(points: Points) -> (Body, Family) {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [48.0; 3],
    });
    let mut body = Body::fill("block", &shape, 3, 1.0, 1.0).expect("a valid block");
    match points {
        Points::Lattice(store) => body.store = store,
        Points::Bare => body.store = Store::Lattice,
        Points::Cloud => {
            let jitter = Jitter {
                amplitude: 0.2,
                seed: 1,
            };
            body = body.jittered(jitter).expect("a valid amplitude");
        }
    }
    let bare = matches!(points, Points::Bare);
    let spec = FamilySpec {
        correction: if bare {
            Correction::Point
        } else {
            Correction::Lattice
        },
        layers: if bare { Vec::new() } else { Face::ALL.to_vec() },
        ..FamilySpec::new(3.015)
    };
    let family = Family::build(&body, &spec).expect("a valid family");
    (body, family)
}

struct Heat;

impl BondKernel<1, 1> for Heat {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// Bond force with finite stretch.
struct Force<const PAIRS: bool>;

impl<const PAIRS: bool> BondKernel<3, 3> for Force<PAIRS> {
    const PAIRED: usize = if PAIRS { 3 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 3] {
        let y: [f64; 3] = std::array::from_fn(|a| bond.xi[a] + other[a] - own[a]);
        let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
        let force = bond.mean() * (bond.inverse_length - 1.0 / length);
        y.map(|y| force * y)
    }
}

fn sweep<const I: usize, const O: usize>(
    bencher: Bencher<'_, '_>,
    kernel: &impl BondKernel<I, O>,
    points: Points,
    threads: usize,
) {
    let (body, family) = family(points);
    let fields: [Vec<f64>; I] = std::array::from_fn(|i| {
        (0..family.slots())
            .map(|s| ((s * (i + 7)) as f64).sin() * 1e-3)
            .collect()
    });
    let mut sums = vec![[0.0; O]; body.points.len()];
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    bencher
        .counter(ItemsCount::new(family.bonds()))
        .bench_local(|| {
            let inputs = std::array::from_fn(|i| &fields[i][..]);
            pool.install(|| family.sum(kernel, inputs, &mut sums));
        });
}

#[divan::bench(args = [1, 2])]
fn heat_lattice(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(bencher, &Heat, Points::Lattice(Store::Lattice), threads);
}

#[divan::bench(args = [1, 2])]
fn heat_list(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(bencher, &Heat, Points::Lattice(Store::List), threads);
}

#[divan::bench(args = [1, 2])]
fn force_lattice(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(
        bencher,
        &Force::<true>,
        Points::Lattice(Store::Lattice),
        threads,
    );
}

#[divan::bench(args = [1, 2])]
fn force_bare_lattice(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(bencher, &Force::<true>, Points::Bare, threads);
}

#[divan::bench(args = [1, 2])]
fn force_lattice_from_both_ends(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(
        bencher,
        &Force::<false>,
        Points::Lattice(Store::Lattice),
        threads,
    );
}

#[divan::bench(args = [1, 2])]
fn force_list(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(
        bencher,
        &Force::<true>,
        Points::Lattice(Store::List),
        threads,
    );
}

#[divan::bench(args = [1, 2])]
fn heat_cloud(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(bencher, &Heat, Points::Cloud, threads);
}

#[divan::bench(args = [1, 2])]
fn force_cloud(bencher: Bencher<'_, '_>, threads: usize) {
    sweep(bencher, &Force::<true>, Points::Cloud, threads);
}
