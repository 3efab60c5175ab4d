//! Bodies with a stiffness along three axes: symmetry, resumption of the axes, and mistakes.

use perimelt_core::Simulation;
use perimelt_tests::{changed, message, start};

/// Grain that meets at x = 0 like a V, pulled along y; `{from}` is where the body begins.
const CHEVRON: &str = r#"
[bodies.board]
shape.box = { min = [{from}, 0, 0], max = [0.006, 0.01, {depth}] }
dimension = {dimension}
spacing = 0.001
material = "wood"
initial.orientation = [0, 0, "0.5 * signum(x)"]
regions.band.box = { min = [-0.003, 0.004, 0], max = [0.003, 0.006, 0.004] }

[materials.wood]
density = 450
youngs_modulus_1 = 12e9
youngs_modulus_2 = 0.8e9
youngs_modulus_3 = 0.5e9
poissons_ratio_12 = 0.4
poissons_ratio_13 = 0.45
poissons_ratio_23 = 0.5
shear_modulus_12 = 0.7e9
shear_modulus_13 = 0.6e9
shear_modulus_23 = 0.05e9

[[physics]]
type = "mechanical"
law.orthotropic = {}
{keys}

[[couplers]]
type = "prescribed_displacement"
face = "y-"
y = 0

[[couplers]]
type = "prescribed_displacement"
face = "y+"
y = 1e-5

[[couplers]]
type = "inherent_strain"
region = "band"
strain = [1e-3, -5e-4, 2e-4, 0, 0, 0]

{couplers}

[time]
end = 1
step = 1

[log]
interval = 1
"#;

fn board(from: &str, dimension: usize, keys: &str, couplers: &str) -> String {
    let depth = if dimension == 2 { "0.001" } else { "0.004" };
    let text = CHEVRON.replace("{from}", from).replace("{depth}", depth);
    let text = text.replace("{dimension}", &dimension.to_string());
    let text = text.replace("{keys}", keys);
    text.replace("{couplers}", couplers)
}

fn chevron(from: &str, dimension: usize, keys: &str, couplers: &str) -> Simulation {
    let (_, mut simulation) =
        start("board.toml", board(from, dimension, keys, couplers)).expect("a valid case");
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    simulation
}

/// The points of a body at positive x, with a field there.
fn right_half(simulation: &Simulation, field: &str) -> Vec<Vec<f64>> {
    let fields = simulation.world().fields();
    let data = fields
        .field(fields.find(0, field).expect("it exists"))
        .data();
    let values = data.flat().chunks(data.components());
    let points = simulation.world().body(0).points.position.iter();
    points
        .zip(values)
        .filter(|(x, _)| x.x > 0.0)
        .map(|(_, v)| v.to_vec())
        .collect()
}

/// A half with a plane of symmetry is the half of the whole: fibres of the images run as in the mirror.
#[test]
fn a_half_with_symmetry_is_half_of_the_whole() {
    let symmetry = "[[couplers]]\ntype = \"symmetry\"\nface = \"x-\"\n";
    for dimension in [2, 3] {
        for keys in [
            "formulation = \"correspondence\"",
            "formulation = \"staggered\"",
            "formulation = \"correspondence\"\nkinematics = \"finite\"",
        ] {
            let whole = chevron("-0.006", dimension, keys, "");
            let half = chevron("0", dimension, keys, symmetry);
            for field in ["displacement", "stress"] {
                let (whole, half) = (right_half(&whole, field), right_half(&half, field));
                assert_eq!(whole.len(), half.len());
                let largest = whole.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
                for (a, b) in whole.iter().flatten().zip(half.iter().flatten()) {
                    assert!(
                        (a - b).abs() < 1e-6 * largest,
                        "{dimension}D {keys} {field}: {a} {b}"
                    );
                }
            }
        }
    }
}

#[test]
fn mistakes_about_constants() {
    let text = board("0", 3, "formulation = \"staggered\"", "");
    let told = |right: &str, wrong: &str| message("board.toml", changed(&text, right, wrong));
    let all = [
        told("poissons_ratio_13 = 0.45\n", ""),
        told("poissons_ratio_12 = 0.4\n", "poissons_ratio_12 = 4\n"),
        told(
            "poissons_ratio_12 = 0.4\n",
            "poissons_ratio_12 = { temperature = [300, 500], value = [0.4, 4] }\n",
        ),
        told("formulation = \"staggered\"", "formulation = \"bond\""),
        told(
            "formulation = \"staggered\"",
            "formulation = \"staggered\"\nplasticity = {}",
        ),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
}
