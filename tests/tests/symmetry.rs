//! Half of a problem with a plane of symmetry has the fields of the whole.

use std::collections::HashMap;

use perimelt_tests::start;

/// A U, or the L that is half of it, with a boundary that reaches the notch.
fn notched(whole: bool, horizon: u32, boundary: &str) -> String {
    let (low, notch) = if whole { (-2, -1) } else { (0, 0) };
    let symmetry = match whole {
        true => "",
        false => "[[couplers]]\ntype = \"symmetry\"\nbody = \"notched\"\nface = \"x-\"\n",
    };
    format!(
        r#"
[bodies.notched]
shape.difference = {{ from = {{ box = {{ min = [{low}, 0, 0], max = [2, 2, 0.1] }} }}, subtract = {{ box = {{ min = [{notch}, 0, 0], max = [1, 1, 0.1] }} }} }}
dimension = 2
spacing = 0.1
material = "m"
initial.temperature = "300 + 20 * y + 30 * abs(x)"

[materials.m]
density = 1
specific_heat = 1
conductivity = 0.5

[[physics]]
type = "thermal"
horizon = {horizon}

[[couplers]]
body = "notched"
{boundary}

{symmetry}
[time]
end = 0.02

[log]
interval = 0.02
"#
    )
}

/// Values of a field at the end of a case, by the initial place to a millionth of a metre.
fn at_end(text: String, field: &str) -> HashMap<[i64; 3], Vec<f64>> {
    let started = start("case.toml", text);
    let (_, mut simulation) = started.unwrap_or_else(|e| panic!("{e}"));
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    let world = simulation.world();
    let field = world.fields().find(0, field).expect("it is there");
    let data = world.fields().field(field).data();
    let places = world.body(0).points.position.iter();
    let places = places.map(|x| [x.x, x.y, x.z].map(|x| (1e6 * x).round() as i64));
    let values = data.flat().chunks(data.components());
    places.zip(values.map(<[f64]>::to_vec)).collect()
}

/// Largest difference of a half and a whole, over the largest value.
fn difference(half: &HashMap<[i64; 3], Vec<f64>>, whole: &HashMap<[i64; 3], Vec<f64>>) -> f64 {
    assert_eq!(2 * half.len(), whole.len());
    let pairs = half
        .iter()
        .flat_map(|(place, a)| a.iter().zip(&whole[place]));
    let (differences, sizes): (Vec<f64>, Vec<f64>) =
        pairs.map(|(a, b)| ((a - b).abs(), b.abs())).unzip();
    let largest = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
    largest(differences) / largest(sizes)
}

/// Surfaces of a notch that face as the plane of symmetry does have nothing mirrored behind them.
#[test]
fn surfaces_of_a_notch_exchange_what_those_of_the_whole_do() {
    let boundaries = [
        "type = \"convection\"\ncoefficient = 100\nambient = 500",
        "type = \"radiation\"\nemissivity = 0.8\nambient = 2000",
    ];
    for boundary in boundaries {
        for horizon in [1, 3] {
            let [half, whole] =
                [false, true].map(|whole| at_end(notched(whole, horizon, boundary), "temperature"));
            let found = difference(&half, &whole);
            assert!(found < 1e-12, "{boundary}, horizon {horizon}: {found}");
        }
    }
}

/// Half of a drop of points that move, or the whole drop, smoothed once.
fn drop(whole: bool, smoothed: &str) -> String {
    let (low, drop_low, faces, symmetry) = match whole {
        true => ("-0.05", "-0.01125", "\"x-\", ", ""),
        false => (
            "0",
            "0",
            "",
            "[[couplers]]\ntype = \"symmetry\"\nface = \"x-\"\n",
        ),
    };
    format!(
        r#"
[bodies.fluid]
shape.box = {{ min = [{low}, 0, 0], max = [0.05, 0.05, 2.5e-3] }}
dimension = 2
spacing = 2.5e-3
material = "gas"
materials = {{ drop = "liquid" }}
regions.drop.box = {{ min = [{drop_low}, 0, 0], max = [0.01125, 0.0125, 2.5e-3] }}

[materials.liquid]
density = 1000
viscosity = 0.05

[materials.gas]
density = 100
viscosity = 0.005

[[physics]]
type = "fluid"
partial_volume = "none"
state.rate.bulk_modulus = 722.5
fluids = ["liquid", "gas"]
interface = {{ surface_tension = 0.07 }}
shifting = 0.01
smoothing = 20
smoothed = "{smoothed}"
step = 1e-4

[[couplers]]
type = "wall"
faces = ["y-"]
contact_angle = 60

[[couplers]]
type = "wall"
faces = [{faces}"y+", "x+"]

{symmetry}
[time]
end = 0.002

[log]
interval = 0.001
"#
    )
}

/// Images behind a plane of symmetry are neighbours in moving least squares.
#[test]
fn half_a_drop_is_smoothed_as_the_whole() {
    for smoothed in ["velocity_and_density", "density"] {
        for field in ["velocity", "pressure"] {
            let [half, whole] = [false, true].map(|whole| at_end(drop(whole, smoothed), field));
            let found = difference(&half, &whole);
            assert!(found < 1e-9, "{smoothed}, {field}: {found}");
        }
    }
}

/// Half of a plate, or the whole plate, that is held at its lower face.
fn plate(whole: bool, formulation: &str, motion: bool) -> String {
    let low = if whole { -0.06 } else { 0.0 };
    let symmetry = match whole {
        true => "",
        false => "[[couplers]]\ntype = \"symmetry\"\nface = \"x-\"\n",
    };
    let (initial, solver, rest) = match motion {
        true => (
            "initial.velocity = [\"3 * sin(20 * x)\", \"5 * cos(25 * x)\", \"0\"]",
            "solver.explicit = {}\nstep = 1e-7",
            "[time]\nend = 2e-6\nstep = 1e-7\n[log]\ninterval = 2e-6",
        ),
        false => (
            "initial.temperature = \"400 + 150 * cos(31 * x)\"",
            "",
            "[[physics]]\ntype = \"thermal\"\nhorizon = 1\n\n[[couplers]]\ntype = \"thermal_expansion\"\n\
             reference_temperature = 400\n\n[time]\nend = 0.01\nstep = 0.01\n[log]\ninterval = 0.01",
        ),
    };
    format!(
        r#"
[bodies.plate]
shape.box = {{ min = [{low}, 0, 0], max = [0.06, 0.04, 0.01] }}
dimension = 2
thickness = 0.01
spacing = 0.01
material = "m"
{initial}

[materials.m]
density = 7850
youngs_modulus = 2e11
poissons_ratio = 0.3
conductivity = 40
specific_heat = 500
thermal_expansion = 1.2e-5

[[physics]]
type = "mechanical"
formulation = "{formulation}"
{solver}

[[couplers]]
type = "prescribed_displacement"
face = "y-"
x = 0
y = 0

{symmetry}
{rest}
"#
    )
}

/// Gradients of temperature and velocity at the plane are those with the image behind it.
#[test]
fn half_a_plate_deforms_as_the_whole() {
    for formulation in ["ordinary", "correspondence", "staggered"] {
        for motion in [false, true] {
            let fields: &[&str] = match motion {
                true => &["velocity", "displacement", "stress"],
                false => &["displacement", "stress"],
            };
            for field in fields {
                let [half, whole] =
                    [false, true].map(|whole| at_end(plate(whole, formulation, motion), field));
                let found = difference(&half, &whole);
                // the tolerance of the equilibrium
                assert!(found < 1e-6, "{formulation}, {field}, {motion}: {found}");
            }
        }
    }
}

/// Flow in a box from `low` on.
fn flow(low: f64, horizon: f64, state: &str, rest: &str) -> String {
    format!(
        r#"
[bodies.box]
shape.box = {{ min = [{low}, 0, 0], max = [0.4, 0.4, 0.05] }}
dimension = 2
spacing = 0.05
material = "a"

[materials.a]
density = 1
viscosity = 0.05

[[physics]]
type = "fluid"
description = "eulerian"
form = "conservative"
horizon = {horizon}
step = 5e-3
{state}

{rest}
[time]
end = 0.1
[log]
interval = 0.1
"#
    )
}

/// Layers behind walls that do not slip are curved, also behind the corners of planes of symmetry.
#[test]
fn half_a_box_of_fluid_flows_as_the_whole() {
    let walls = |faces: &str| {
        format!("[[couplers]]\ntype = \"wall\"\nfaces = [{faces}]\nkind = \"no_slip\"\n")
    };
    let force = "[[couplers]]\ntype = \"gravity\"\nacceleration = [0, 1, 0]\n";
    let state = "state.tait.sound_speed = 10";
    for horizon in [2.015, 3.015] {
        let symmetric = "[[couplers]]\ntype = \"symmetry\"\nface = \"x-\"\n";
        let start = |text: String| {
            // a flow that is symmetric about x = 0
            text.replace(
                "material = \"a\"",
                "material = \"a\"\ninitial.velocity = [\"0.1 * sin(7.85 * x) * y\", \"0.2 * cos(7.85 * x) * y\", \"0\"]",
            )
        };
        let half = format!("{}{force}{symmetric}", walls("\"x+\", \"y-\", \"y+\""));
        let whole = format!("{}{force}", walls("\"x-\", \"x+\", \"y-\", \"y+\""));
        for field in ["velocity", "pressure"] {
            let half = at_end(start(flow(0.0, horizon, state, &half)), field);
            let whole = at_end(start(flow(-0.4, horizon, state, &whole)), field);
            let found = difference(&half, &whole);
            assert!(found < 1e-11, "{field}, horizon {horizon}: {found}");
        }
    }
}

/// A channel has the same flow in all its sections, whichever axis lies along it.
#[test]
fn a_channel_is_uniform_along_its_periodic_axis() {
    for (along, across) in [("x", "y"), ("y", "x")] {
        let axis = usize::from(along == "y");
        let mut acceleration = [0, 0, 0];
        acceleration[axis] = 1;
        let rest = format!(
            "[[couplers]]\ntype = \"wall\"\nfaces = [\"{across}-\", \"{across}+\"]\nkind = \"no_slip\"\n\
             [[couplers]]\ntype = \"gravity\"\nacceleration = {acceleration:?}\n"
        );
        for state in ["state.tait.sound_speed = 10", "state.incompressible = {}"] {
            let text = flow(0.0, 2.015, state, &rest);
            let text = text.replace(
                "material = \"a\"",
                &format!("material = \"a\"\nperiodic = [\"{along}\"]"),
            );
            let velocity = at_end(text, "velocity");
            let mut sections: HashMap<i64, Vec<f64>> = HashMap::new();
            for (place, v) in &velocity {
                assert!(v[1 - axis].abs() < 1e-12, "{along}: {v:?}");
                sections.entry(place[1 - axis]).or_default().push(v[axis]);
            }
            assert_eq!(sections.len(), 8);
            for values in sections.values() {
                let spread = values
                    .iter()
                    .map(|v| (v - values[0]).abs())
                    .fold(0.0, f64::max);
                assert!(spread < 1e-12, "{along}, {state}: {values:?}");
            }
        }
    }
}
