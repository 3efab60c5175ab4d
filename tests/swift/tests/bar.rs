//! A law of a crate of its own: its physics, and what a user is told.

use std::path::Path;
use std::process::Command;

use perimelt::case::Case;
use swift as _;

const CASE: &str = include_str!("../bar.toml");

/// The plastic strain of a bar: the stress of the law is that of the elastic strain.
fn expected(strain: f64) -> f64 {
    let stress = |p: f64| 530e6 * (4e-3 + p).powf(0.25);
    let (mut low, mut high) = (0.0, strain);
    for _ in 0..100 {
        let p = 0.5 * (low + high);
        match p + stress(p) / 200e9 > strain {
            true => high = p,
            false => low = p,
        }
    }
    low
}

#[test]
fn a_drawn_bar_has_the_plastic_strain_of_the_law() {
    // ordinary solids have a stiffness of their own at surfaces
    for (formulation, limit) in [("correspondence", 1e-7), ("ordinary", 2e-3)] {
        let text = CASE.replace("correspondence", formulation);
        let case = Case::parse("bar.toml", text, Path::new("")).expect("a valid case");
        let composed = case.compose();
        let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
        case.start(&mut simulation).expect("it starts");
        while !simulation.is_finished() {
            simulation.step().expect("a step");
        }
        let fields = simulation.world().fields();
        let strain = fields.find(0, "equivalent_plastic_strain").expect("owned");
        let field = fields.field(strain).data();
        let values = field.flat();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let error = (mean - expected(0.1)).abs();
        assert!(error < limit, "{formulation}: {mean}, {error}");
    }
}

fn told(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_swift"));
    let output = command.current_dir(folder).args(arguments).output();
    let output = output.expect("the binary starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn the_law_is_listed_and_explained() {
    let folder = Path::new(".");
    assert!(told(folder, &["list"]).contains("Power hardening of Swift."));
    let help = told(folder, &["explain", "flow.swift"]);
    for expected in [
        "property `swift_offset`",
        "tangent: closed form",
        "correspondence",
    ] {
        assert!(help.contains(expected), "{help}");
    }
    let help = told(folder, &["explain", "swift_exponent"]);
    assert!(help.contains("of Swift"), "{help}");
}
