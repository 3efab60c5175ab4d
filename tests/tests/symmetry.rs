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
