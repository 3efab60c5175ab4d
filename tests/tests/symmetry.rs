//! Half of a problem with a plane of symmetry has the fields of the whole.

use std::collections::HashMap;

use perimelt_tests::start;

/// An L or a U, whose notch a boundary reaches, with a block in the notch where it is asked for.
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

/// Temperatures at the end of a case, by place to a millionth of a metre.
fn temperatures(text: String) -> HashMap<[i64; 3], f64> {
    let started = start("case.toml", text);
    let (_, mut simulation) = started.unwrap_or_else(|e| panic!("{e}"));
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    let world = simulation.world();
    let field = world.fields().find(0, "temperature").expect("it is there");
    let data = world.fields().field(field).data();
    let places = world.body(0).points.position.iter();
    let places = places.map(|x| [x.x, x.y, x.z].map(|x| (1e6 * x).round() as i64));
    places.zip(data.flat().iter().copied()).collect()
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
            let half = temperatures(notched(false, horizon, boundary));
            let whole = temperatures(notched(true, horizon, boundary));
            assert_eq!(2 * half.len(), whole.len());
            let differences = half.iter().map(|(place, t)| (t - whole[place]).abs());
            let largest = differences.fold(0.0, f64::max);
            assert!(largest < 1e-9, "{boundary}, horizon {horizon}: {largest}");
        }
    }
}
