//! Mistakes that a user makes about laminates, and what the user is told; the messages are in `snapshots/`.

use perimelt_tests::{changed, message, start};

const PLATE: &str = r#"[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.01, 0.01, 0.002] }
spacing = 0.001
layup = { angles = [0, 90] }
material = "ply"
regions.end.box = { min = [0.009, 0, 0], max = [0.01, 0.01, 0.002] }

[materials.ply]
density = 1620
youngs_modulus_1 = 181e9
youngs_modulus_2 = 10.3e9
youngs_modulus_3 = 3.4e9
poissons_ratio_12 = 0.28
shear_modulus_12 = 7.17e9
shear_modulus_13 = 1.308e9
shear_modulus_23 = 1.308e9
thermal_expansion = { axes = [0.02e-6, 22.5e-6, 63e-6] }

[[physics]]
type = "mechanical"
law.lamina = {}

[[couplers]]
type = "thermal_expansion"
temperature = "300 + 10 * x * t"
reference_temperature = 300

[time]
end = 1
step = 1

[log]
interval = 1
"#;

/// What is said about the case with `right` replaced by `wrong`.
fn told(right: &str, wrong: &str) -> String {
    message("plate.toml", changed(PLATE, right, wrong))
}

fn all(changes: &[(&str, &str)]) -> String {
    let told: Vec<String> = changes
        .iter()
        .map(|(right, wrong)| told(right, wrong))
        .collect();
    told.join("\n\n")
}

#[test]
fn the_case_itself_is_right() {
    start("plate.toml", PLATE.to_string()).unwrap_or_else(|e| panic!("{e:?}"));
}

#[test]
fn lay_ups_that_do_not_fit() {
    insta::assert_snapshot!(all(&[
        (
            "angles = [0, 90]",
            "angles = [0, 90], ply_thickness = [1e-3, 2e-3]"
        ),
        (
            "angles = [0, 90]",
            "angles = [0, 90], ply_thickness = [1e-3]"
        ),
        (
            "angles = [0, 90]",
            "angles = [0, 90], ply_thickness = [2e-3, 0]"
        ),
        ("angles = [0, 90]", "angles = []"),
        ("angles = [0, 90]", "angels = [0, 90]"),
        ("angles = [0, 90]", "angles = [0, 90], stations = \"three\""),
        ("spacing = 0.001\n", "spacing = 0.001\ndimension = 2\n"),
        (
            "spacing = 0.001\n",
            "spacing = 0.001\njitter = { amplitude = 0.1 }\n"
        ),
        (
            "material = \"ply\"\n",
            "material = \"ply\"\ninitial.orientation.angle = 30\n"
        ),
    ]));
}

#[test]
fn plies_that_have_no_bonds() {
    insta::assert_snapshot!(all(&[
        ("angles = [0, 90]", "angles = [0, 30]"),
        ("law.lamina = {}", "law.lamina = {}\nhorizon = 1"),
        ("angles = [0, 90]", "angles = [0], stations = \"one\""),
        ("shear_modulus_13 = 1.308e9", "shear_modulus_13 = 9e9"),
        ("poissons_ratio_12 = 0.28", "poissons_ratio_12 = 4.3"),
        ("youngs_modulus_2 = 10.3e9\n", ""),
        (
            "youngs_modulus_2 = 10.3e9",
            "youngs_modulus_2 = { temperature = [300, 400], value = [10.3e9, 2400e9] }"
        ),
        (
            "shear_modulus_12 = 7.17e9",
            "shear_modulus_12 = { temperature = [300, 400], value = [7e9, 200e9] }"
        ),
        (
            "shear_modulus_13 = 1.308e9",
            "shear_modulus_13 = { temperature = [300, 400], value = [1.308e9, 9e9] }"
        ),
    ]));
}

#[test]
fn what_plies_do_not_support() {
    insta::assert_snapshot!(all(&[
        ("law.lamina = {}", "law.lamnia = {}"),
        (
            "law.lamina = {}",
            "law.lamina = { classes = \"published\" }"
        ),
        ("law.lamina = {}", "law.linear = {}"),
        ("law.lamina = {}", "formulation = \"staggered\""),
        (
            "law.lamina = {}",
            "formulation = \"ordinary\"\nlaw.lamina = {}"
        ),
        ("law.lamina = {}", "law.lamina = {}\nflow.j2 = {}"),
        ("layup = { angles = [0, 90] }\n", ""),
        (
            "[[couplers]]\n",
            "[[couplers]]\ntype = \"plastic_heat\"\n[[couplers]]\n"
        ),
        (
            "[[couplers]]\n",
            "[[couplers]]\ntype = \"insulated_crack\"\ncorner = [0, 0.005, 0]\nedges = [[0.005, 0, 0], [0, 0, 0.001]]\n[[couplers]]\n"
        ),
        (
            "[[couplers]]\n",
            "[[couplers]]\ntype = \"prescribed_displacement\"\nface = \"x-\"\nx = 0\n[[couplers]]\n"
        ),
    ]));
}

#[test]
fn strengths_of_plies() {
    const BREAKS: &str = "law.lamina = {}\nfracture = {}";
    const STRONG: &str = "density = 1620\nfracture_energy = 2370\nshear_fracture_energy = 7110";
    let brittle = PLATE.replace("law.lamina = {}", BREAKS);
    let strong = brittle.replace("density = 1620", STRONG);
    start("plate.toml", strong.clone()).unwrap_or_else(|e| panic!("{e:?}"));
    let mut told = Vec::new();
    for (case, right, wrong) in [
        (&brittle, "fracture = {}", "fracture = {}"),
        (
            &strong,
            "shear_fracture_energy = 7110",
            "shear_fracture_energy = 0",
        ),
        (
            &strong,
            "\nfracture_energy = 2370",
            "\nfracture_energy = { temperature = [300, 400], value = [2370, 0] }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { criterion = \"energy\" }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { interface = { between = [\"ply\", \"ply\"], fracture_energy = 10 } }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { no_fail = [\"ends\"] }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { mode = \"sliding\" }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { limits = \"printed\" }",
        ),
        (
            &strong,
            "fracture = {}",
            "fracture = { mixed_mode_exponent = 0 }",
        ),
    ] {
        told.push(message("plate.toml", changed(case, right, wrong)));
    }
    insta::assert_snapshot!(told.join("\n\n"));
}

#[test]
fn heat_of_plies() {
    const CONDUCTS: &str =
        "density = 1620\nspecific_heat = 1093\nconductivity = { axes = [8.3, 0.76, 0.2] }";
    let heated = PLATE.replace("density = 1620", CONDUCTS);
    let heated = heated.replace(
        "material = \"ply\"\n",
        "material = \"ply\"\ninitial.temperature = 300\n",
    );
    let heated = heated.replace(
        "[[couplers]]\n",
        "[[physics]]\ntype = \"thermal\"\nhorizon = 3\n\n[[couplers]]\n",
    );
    let heated = heated.replace("temperature = \"300 + 10 * x * t\"\n", "");
    start("plate.toml", heated.clone()).unwrap_or_else(|e| panic!("{e:?}"));
    let mut told = Vec::new();
    for (right, wrong) in [
        ("horizon = 3", "form = \"ordinary\""),
        ("horizon = 3", "surfaces = \"mirrored\""),
        (
            "conductivity = { axes = [8.3, 0.76, 0.2] }",
            "conductivity = { axes = [{ temperature = [300, 400], value = [8.3, 0.1] }, 0.76, 0.2] }",
        ),
        ("spacing = 0.001\n", "spacing = 0.001\nperiodic = [\"x\"]\n"),
        (
            "[[couplers]]\n",
            "[[couplers]]\ntype = \"radiation\"\nfaces = [\"z+\"]\nambient = 300\n\n[[couplers]]\n",
        ),
        (
            "[[couplers]]\n",
            "[[couplers]]\ntype = \"convection\"\nregion = \"end\"\nfaces = [\"x-\"]\ncoefficient = 10\nambient = 300\n\n[[couplers]]\n",
        ),
    ] {
        told.push(message("plate.toml", changed(&heated, right, wrong)));
    }
    insta::assert_snapshot!(told.join("\n\n"));
}

/// `check` and the tables of results tell the bonds of laminates: those in each of the four layers and those between them.
#[test]
fn bonds_of_laminates_are_counted() {
    let text = changed(PLATE, "law.lamina = {}\n", "law.lamina = {}\nhorizon = 3\n");
    let (_, simulation) = start("plate.toml", text).unwrap_or_else(|e| panic!("{e:?}"));
    // 10 x 10 points: each offset within the horizon leads from the points that have such a neighbour
    let offsets = (-3..=3_i32).flat_map(|i| (-3..=3_i32).map(move |j| [i, j]));
    let within = offsets.filter(|[i, j]| (1..=9).contains(&(i * i + j * j)));
    let plane: i32 = within.map(|[i, j]| (10 - i.abs()) * (10 - j.abs())).sum();
    let plane = plane as usize;
    let above_each_other = 2 * 100;
    let bonds: Vec<usize> = simulation.family_sizes().iter().map(|f| f.bonds).collect();
    assert_eq!(bonds, [4 * plane + 3 * (2 * plane + above_each_other)]);
}
