//! A law of bonds of a crate of its own: its physics, and what a user is told.

use std::path::Path;

use cubic as _;
use perimelt::case::Case;
use perimelt_core::Simulation;

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
        finish(&mut simulation);
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

/// A block of glue in space, with keys of the body, of the mechanics, and what acts on it.
fn block(body: &str, mechanics: &str, rest: &str) -> Simulation {
    let text = format!(
        r#"
[bodies.block]
shape.box = {{ min = [0, 0, 0], max = [0.009, 0.008, 0.007] }}
spacing = 1e-3
material = "glue"
regions.all.box = {{ min = [-1, -1, -1], max = [1, 1, 1] }}
{body}

[materials.glue]
density = 1000
youngs_modulus = 2e8
poissons_ratio = 0.1
fracture_energy = 2e4
thermal_expansion = 1e-4
specific_heat = 500
conductivity = 1
cubic_stiffness = 30

[[physics]]
type = "mechanical"
{mechanics}
{rest}
"#
    );
    let case = case(text);
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    case.start(&mut simulation).expect("it starts");
    simulation
}

/// Lets a simulation run to its end.
fn finish(simulation: &mut Simulation) {
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
}

/// A number of the reports whose name ends so.
fn reported(simulation: &Simulation, name: &str) -> f64 {
    let all = simulation.reports();
    let mut all = all.into_iter().flat_map(|(_, reports)| reports);
    all.find(|r| r.name.ends_with(name))
        .expect("a report")
        .value
}

/// The energy of bonds is that of their forces: a block that swings keeps the sum of both energies.
#[test]
fn energy_is_conserved() {
    let body = r#"initial.velocity = ["1e3 * (x - 0.0045)", "-8e2 * (x + y - 0.0085)", "6e2 * (z - 0.0035)"]"#;
    let rest = "solver.explicit = { }\n[time]\nend = 4e-5\n[log]\ninterval = 1e-6";
    for (formulation, kinematics) in [
        ("bond", "linear"),
        ("bond", "finite"),
        ("ordinary", "linear"),
        ("ordinary", "finite"),
    ] {
        let law = "law.cubic = { largest_stretch = 0.2 }";
        let keys = format!("formulation = \"{formulation}\"\nkinematics = \"{kinematics}\"\n{law}");
        let mut simulation = block(body, &keys, rest);
        let total =
            |s: &Simulation| ["energy.kinetic", "energy.elastic"].map(|name| reported(s, name));
        let [first, _] = total(&simulation);
        let (mut largest, mut error): (f64, f64) = (0.0, 0.0);
        while !simulation.is_finished() {
            simulation.step().expect("a step");
            let [kinetic, elastic] = total(&simulation);
            largest = largest.max(elastic / first);
            error = error.max(((kinetic + elastic) / first - 1.0).abs());
        }
        // the error of the steps in time
        assert!(largest > 0.5 && error < 0.02, "{keys}: {largest} {error}");
    }
}

/// The force of the law on the whole.
fn force_at(stretch: f64) -> f64 {
    stretch + 30.0 * stretch.powi(3)
}

/// Holds all points of a block expanded by a strain.
fn expanded(strain: f64) -> String {
    format!(
        r#"[[couplers]]
type = "prescribed_displacement"
region = "all"
x = "{strain} * x"
y = "{strain} * y"
z = "{strain} * z"

[time]
step = 1
end = 1

[log]
interval = 1
"#
    )
}

/// All bonds of a body that expands evenly have the same stretch s. The bonds have `(d + 2) mu` of the modulus `d bulk`, and
/// the pressure of the dilatation, which is linear, has the rest.
#[test]
fn an_even_expansion_has_the_stress_of_the_law() {
    let (strain, eigenstrain) = (0.02, -0.01);
    let heat = format!(
        r#"
[[physics]]
type = "thermal"

[[couplers]]
type = "thermal_expansion"
reference_temperature = 400

{}"#,
        expanded(strain)
    );
    for (formulation, ratio) in [("bond", 0.25), ("ordinary", 0.1)] {
        for kinematics in ["linear", "finite"] {
            let law = "law.cubic = { largest_stretch = 0.1 }";
            let keys =
                format!("formulation = \"{formulation}\"\nkinematics = \"{kinematics}\"\n{law}");
            let mut simulation = block("initial.temperature = 300", &keys, &heat);
            finish(&mut simulation);
            let shear = 1e8 / (1.0 + ratio);
            let bulk = 2e8 / (3.0 * (1.0 - 2.0 * ratio));
            let stretch = strain - eigenstrain;
            let expected = 5.0 * shear * force_at(stretch) + (3.0 * bulk - 5.0 * shear) * stretch;
            let fields = simulation.world().fields();
            let stress = fields.find(0, "stress").expect("owned");
            for s in fields.field(stress).data().flat().chunks(9) {
                let error = (s[0] + s[4] + s[8]) / (3.0 * expected) - 1.0;
                assert!(error.abs() < 1e-9, "{keys}: {error}");
            }
        }
    }
}

/// The strain of a block at which bonds begin to break.
fn strain_at_fracture(formulation: &str, law: &str) -> f64 {
    let (mut low, mut high) = (0.0, 0.5);
    while high - low > 1e-6 {
        let strain = 0.5 * (low + high);
        let keys = format!("formulation = \"{formulation}\"\nfracture = {{}}\n{law}");
        let mut simulation = block("", &keys, &expanded(strain));
        finish(&mut simulation);
        match reported(&simulation, "bonds.broken") > 0.0 {
            true => high = strain,
            false => low = strain,
        }
    }
    high
}

/// The fracture energy is the energy of the bonds of the law at their critical stretch, not that of linear bonds.
#[test]
fn bonds_break_at_the_stretch_that_takes_the_fracture_energy() {
    let law = "law.cubic = { largest_stretch = 0.2 }";
    // at Poisson's ratio 0.1: of the energy of bonds across a plane that an even expansion stretches, that of the forces along bonds, and
    // that of the pressure of the dilatation, which is linear and lowers it (docs/theory/mechanics.md)
    let (shear, bulk) = (1e8 / 1.1, 2e8 / 2.4);
    let along = 0.3 * 10.0 * shear;
    let of_pressure = (bulk - 5.0 / 3.0 * shear) * 0.75f64.powi(4);
    for (formulation, part) in [("bond", 1.0), ("ordinary", along / (along + of_pressure))] {
        let [linear, found] = ["", law].map(|law| strain_at_fracture(formulation, law));
        let energy = found.powi(2) + part * 15.0 * found.powi(4);
        let error = energy / linear.powi(2) - 1.0;
        assert!(
            error.abs() < 1e-4 && found < 0.9 * linear,
            "{formulation}: {found} {linear} {error}"
        );
    }
}

/// The largest frequency goes with the root of the largest slope.
#[test]
fn the_stable_step_follows_the_steepest_slope() {
    let rest = "solver.explicit = {}\n[time]\nend = 1e-6\n[log]\ninterval = 1e-6";
    let step = |law: &str| block("", law, rest).sub_steps()[0];
    let ratio = step("") / step("law.cubic = { largest_stretch = 0.1 }");
    let slope: f64 = 1.0 + 3.0 * 30.0 * 0.01;
    assert!((ratio / slope.sqrt() - 1.0).abs() < 1e-12, "{ratio}");
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
