//! A law of bonds of a crate of its own: its physics, and what a user is told.

use std::path::Path;

use cubic as _;
use perimelt::case::Case;

const CASE: &str = include_str!("../bar.toml");

fn case(text: String) -> Case {
    Case::parse("bar.toml", text, Path::new("")).expect("a valid case")
}

/// All bonds of a drawn bar have its strain s. The stress is that of a linear bar, E s, times (s + b s^3) / s.
#[test]
fn a_drawn_bar_has_the_stress_of_the_law() {
    for kinematics in ["linear", "finite"] {
        let keys = format!("kinematics = \"{kinematics}\"\nlaw.cubic");
        let case = case(CASE.replace("law.cubic", &keys));
        let composed = case.compose();
        let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
        case.start(&mut simulation).expect("it starts");
        while !simulation.is_finished() {
            simulation.step().expect("a step");
        }
        let fields = simulation.world().fields();
        let stress = fields.find(0, "stress").expect("owned");
        for point in fields.field(stress).data().flat().chunks(9) {
            let (s, b) = (0.05, 20.0);
            let error = point[0] / (200e6 * (s + b * s * s * s)) - 1.0;
            // the unbalanced force that the solver leaves
            assert!(error.abs() < 1e-9, "{kinematics}: {error}");
        }
    }
}

#[test]
fn a_constant_that_is_not_one_number_is_refused() {
    let table = "cubic_stiffness = { temperature = [300, 400], value = [20, 10] }";
    let case = case(CASE.replace("cubic_stiffness = 20", table));
    let told = case.compose().err().expect("a mistake").render(false);
    assert!(
        told.contains("`cubic_stiffness` is not one number"),
        "{told}"
    );
}
