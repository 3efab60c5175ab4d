//! Results do not depend on the instruction set, but for the rounding of sums that visit each bond once. That results with AVX-512 are those with
//! AVX2, and those of clouds in lanes, are a unit test of `perimelt-core`: the program that tests build has no such sweeps.

mod program;

use perimelt_tests::last_checkpoint;
use program::command;

const WELD: &str = include_str!("cases/weld.toml");
const SETS: [&str; 2] = ["baseline", "avx2"];

/// A bar that a wave runs through, with the bonds of one body visited once.
const BAR: &str = r#"
[bodies.bar]
shape.box = { min = [0, 0, 0], max = [0.04, 0.01, 0.01] }
spacing = 0.001
material = "steel"
initial.velocity = ["10 * sin(100 * x)", "0", "0"]

[materials.steel]
density = 7800
youngs_modulus = 2e11
poissons_ratio = 0.25

[[physics]]
type = "mechanical"
formulation = "bond"
kinematics = "finite"
solver.explicit = {}

[time]
end = 2e-5

[log]
interval = 1e-5
checkpoint = 1e-5
"#;

/// Bytes of the last checkpoint of a run with an instruction set, or with the widest.
fn end_of(case: &str, set: Option<&str>) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder for logs");
    std::fs::write(folder.path().join("case.toml"), case).expect("writable");
    let mut arguments = vec!["run", "case.toml", "--quiet"];
    arguments.extend(set.into_iter().flat_map(|set| ["--instructions", set]));
    let run = command(folder.path(), &arguments).status();
    assert!(run.expect("it starts").success(), "{case}");
    last_checkpoint(&folder.path().join("case.mcap"))
}

#[test]
fn heat_has_the_same_bits_with_every_instruction_set() {
    let short = WELD.replace("end = 1.5", "end = 0.3");
    let cloud = short.replace(
        "spacing = 0.001",
        "spacing = 0.001\njitter = { amplitude = 0.2 }",
    );
    assert!(cloud != short && short != WELD);
    for case in [short, cloud] {
        let widest = end_of(&case, None);
        for set in SETS {
            assert!(end_of(&case, Some(set)) == widest, "{set}: {case}");
        }
    }
}

#[test]
fn the_limit_reaches_the_sweeps_of_bonds() {
    let [baseline, avx2] = SETS.map(|set| end_of(BAR, Some(set)));
    // the limit reaches the sweep: where there is a fused multiply-add, other last bits
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        assert!(baseline != avx2);
    }
}
