//! A step of explicit motion under plastic flow with the built-in law `j2`, and with a law of this crate that has the same
//! formula, side by side: `cargo bench -p swift`. Both must take the same time.

use std::path::Path;

use divan::Bencher;
use perimelt::case::Case;
use perimelt_core::Simulation;
use perimelt_core::law::Constant;
use perimelt_physics::mechanical::plasticity::{EquivalentStrain, FlowPoint, FlowStressLaw};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

fn main() {
    divan::main();
}

/// Linear hardening.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Linear {}

impl FlowStressLaw for Linear {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("yield_stress"),
        Constant::or("hardening_modulus", 0.0),
    ];

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        point.constants[0] + point.constants[1] * strain.end
    }

    fn hardening(&self, point: &FlowPoint<'_>, _: EquivalentStrain) -> f64 {
        point.constants[1]
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

perimelt_physics::register_flow_stress_law!("linear", Linear);

/// A block of 32³ points that is drawn beyond yield and flies apart slowly, so that all points flow in each step.
fn simulation(law: &str) -> Simulation {
    let text = format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = [0.032, 0.032, 0.032] }}
        spacing = 1e-3
        material = 'metal'
        initial.velocity = ['2000 * x', '-600 * y', '-600 * z']
        [materials.metal]
        density = 7850
        youngs_modulus = 200e9
        poissons_ratio = 0.3
        yield_stress = 20e6
        hardening_modulus = 1e9
        [[physics]]
        type = 'mechanical'
        formulation = 'correspondence'
        flow.{law} = {{}}
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

#[divan::bench(args = ["j2", "linear"])]
fn step(bencher: Bencher<'_, '_>, law: &str) {
    let mut simulation = simulation(law);
    bencher.bench_local(|| simulation.step().expect("a step"));
}
