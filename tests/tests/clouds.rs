//! Conduction and elasticity across a jump of the spacing, with both kinds of horizon.

use std::path::Path;

use perimelt::case::Case;
use perimelt_core::Simulation;

const BODY: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.2, 0.06, 0.01] }
dimension = 2
zones = [
    { min = [0, 0, 0], max = [0.1, 0.06, 0], spacing = 0.005 },
    { min = [0.1, 0, 0], max = [0.2, 0.06, 0], spacing = 0.01 },
]
material = "steel"
{initial}

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 40
youngs_modulus = 200e9

[time]
end = 1
step = 1

[log]
interval = 1
"#;

fn run(initial: &str, text: &str) -> Simulation {
    let text = BODY.replace("{initial}", initial) + text;
    let case = Case::parse("plate.toml", text, Path::new(""));
    let case = case.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let mut simulation = case
        .compose()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    case.start(&mut simulation).expect("starts");
    while !simulation.is_finished() {
        simulation.step().expect("steps");
    }
    simulation
}

/// x of each point and a component of a field there.
fn along_x(simulation: &Simulation, field: &str) -> Vec<(f64, f64)> {
    let fields = simulation.world().fields();
    let data = fields
        .field(fields.find(0, field).expect("it exists"))
        .data();
    let values = data.flat().iter().step_by(data.components());
    let points = simulation.world().body(0).points.position.iter();
    points.zip(values).map(|(x, v)| (x.x, *v)).collect()
}

/// Slope of a field between two places where points lie.
fn slope(values: &[(f64, f64)], from: f64, to: f64) -> f64 {
    let mean = |at: f64| {
        let there: Vec<f64> = values
            .iter()
            .filter(|(x, _)| (x - at).abs() < 1e-6)
            .map(|v| v.1)
            .collect();
        assert!(!there.is_empty(), "no points at {at}");
        there.iter().sum::<f64>() / there.len() as f64
    };
    (mean(to) - mean(from)) / (to - from)
}

#[test]
fn a_flux_makes_its_gradient_on_both_sides_of_a_jump_of_spacing() {
    for (horizon, limit) in [("3", 1e-3), ("{ length = 0.03 }", 6e-3)] {
        let simulation = run(
            "initial.temperature = 300",
            &format!(
                r#"
            [[physics]]
            type = "thermal"
            horizon = {horizon}
            solver = "steady"

            [[couplers]]
            type = "heat_flux"
            faces = ["x-"]
            flux = 40e3

            [[couplers]]
            type = "prescribed_temperature"
            face = "x+"
            value = 300
            "#
            ),
        );
        let temperature = along_x(&simulation, "temperature");
        // away from the flux, which enters the outermost points, and from the jump
        for (from, to) in [(0.0325, 0.0675), (0.135, 0.195)] {
            let gradient = slope(&temperature, from, to);
            // what is left of the layers in which flux enters and the horizon jumps
            assert!(
                (gradient / -1000.0 - 1.0).abs() < limit,
                "{horizon}: {gradient}"
            );
        }
        // the jump itself: residual flows cancel within a horizon
        let across = slope(&temperature, 0.0525, 0.145);
        assert!((across / -1000.0 - 1.0).abs() < 0.02, "{horizon}: {across}");
    }
}

#[test]
fn a_pulled_plate_stretches_evenly_but_for_the_jump() {
    let solvers = ["quasi_static", "relaxation"];
    let horizons = [("3", 0.02), ("{ length = 0.03 }", 0.01)];
    let all = horizons.iter().flat_map(|h| solvers.map(|s| (*h, s)));
    for ((horizon, error), solver) in all {
        let simulation = run(
            "",
            &format!(
                r#"
            [[physics]]
            type = "mechanical"
            horizon = {horizon}
            solver.{solver} = {{}}

            [[couplers]]
            type = "prescribed_displacement"
            face = "x-"
            x = 0

            [[couplers]]
            type = "prescribed_displacement"
            face = "x+"
            x = 2e-4

            [[couplers]]
            type = "symmetry"
            face = "y-"

            [[couplers]]
            type = "symmetry"
            face = "y+"
            "#
            ),
        );
        for (x, u) in along_x(&simulation, "displacement") {
            assert!(
                (u - 1e-3 * x).abs() < error * 2e-4,
                "{horizon}, {solver}: {u} at {x}"
            );
        }
    }
}
