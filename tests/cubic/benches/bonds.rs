//! A step of explicit motion with the built-in law `linear`, and with a law of this crate that has the same formula, side by
//! side: `cargo bench -p cubic`. Both must take the same time.

use std::path::Path;

use divan::Bencher;
use perimelt::case::Case;
use perimelt_core::{Number, Simulation};
use perimelt_physics::mechanical::stretch::{BondConstants, BondLaw};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

fn main() {
    divan::main();
}

/// Force in proportion to the stretch.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Twin {}

impl BondLaw for Twin {
    #[inline(always)]
    fn force<N: Number>(&self, _: &BondConstants, stretch: N) -> N {
        stretch
    }

    #[inline(always)]
    fn mean_force(&self, _: &BondConstants, stretch: f64) -> f64 {
        0.5 * stretch
    }

    #[inline(always)]
    fn slope(&self, _: &BondConstants, _: f64) -> f64 {
        1.0
    }

    fn steepest(&self, _: &BondConstants) -> f64 {
        1.0
    }
}

perimelt_physics::register_bond_law!("twin", Twin);

/// A block of 40³ points that vibrates.
fn simulation(formulation: &str, law: &str) -> Simulation {
    let text = format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = [0.04, 0.04, 0.04] }}
        spacing = 1e-3
        material = 'metal'
        initial.velocity = ['10 * x', 0, 0]
        [materials.metal]
        density = 7850
        youngs_modulus = 200e9
        poissons_ratio = 0.3
        [[physics]]
        type = 'mechanical'
        formulation = '{formulation}'
        law.{law} = {{}}
        solver.explicit = {{}}
        [time]
        end = 1
        [log]
        interval = 1"
    );
    let case = Case::parse("block.toml", text, Path::new("")).expect("a valid case");
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    case.start(&mut simulation).expect("it starts");
    for _ in 0..5 {
        simulation.step().expect("a step");
    }
    simulation
}

#[divan::bench(args = ["linear", "twin"])]
fn bond(bencher: Bencher<'_, '_>, law: &str) {
    let mut simulation = simulation("bond", law);
    bencher.bench_local(|| simulation.step().expect("a step"));
}

#[divan::bench(args = ["linear", "twin"])]
fn ordinary(bencher: Bencher<'_, '_>, law: &str) {
    let mut simulation = simulation("ordinary", law);
    bencher.bench_local(|| simulation.step().expect("a step"));
}
