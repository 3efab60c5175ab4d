//! Cases that processes share.

/// A moving arc on a plate with a hole that melts, with convection, radiation, a flux and a held temperature.
pub const WELD: &str = r#"
[bodies.plate]
shape.difference = { from = { box = { min = [0, 0, 0], max = [0.024, 0.02, 0.0085] } }, subtract = { cylinder = { start = [0.017, 0.012, -1], end = [0.017, 0.012, 1], radius = 3e-3 } } }
spacing = 5e-4
material = "S355"
initial.temperature = "293.15 + 2e3 * x"

[[physics]]
type = "thermal"
horizon = HORIZON

[[couplers]]
type = "phase_change"

[[couplers]]
type = "goldak"
name = "torch"
power = 2500
efficiency = 0.8
half_width = 2e-3
depth = 3e-3
front_length = 2e-3
rear_length = 4e-3
toolpath.line = { start = [0.002, 0.008, 0.0085], end = [0.02, 0.008, 0.0085], speed = 0.01 }

[[couplers]]
type = "convection"
coefficient = 25
ambient = 293.15

[[couplers]]
type = "radiation"
faces = ["z+"]
ambient = 293.15

[[couplers]]
type = "symmetry"
face = "y-"

[[couplers]]
type = "prescribed_temperature"
face = "x-"
value = 293.15

[time]
end = 0.6

[log]
interval = 0.2
"#;

/// The weld with another solver, which takes long steps.
pub fn weld_by(solver: &str) -> String {
    let text = WELD.replace("HORIZON", &format!("1\nstep = 0.05\nsolver = \"{solver}\""));
    text.replace("spacing = 5e-4", "spacing = 1e-3")
}

/// The plate of the weld in a steady state: with the heat of all boundaries, and with none of them, so that its mean temperature decides.
pub fn steady(is_insulated: bool) -> String {
    let text = weld_by("steady");
    let all: Vec<&str> = text.split("[[couplers]]").collect();
    let (end, couplers) = all.split_last().expect("parts");
    let (held, time) = end.split_once("[time]").expect("times");
    let boundaries = couplers[3..].iter().chain([&held]);
    let boundaries = boundaries.map(|text| format!("[[couplers]]{text}"));
    let boundaries: String = if is_insulated {
        String::new()
    } else {
        boundaries.collect()
    };
    let material = "density = 7800\nspecific_heat = 500\nconductivity = { temperature = [300, 900], value = [40, 25] }\nemissivity = 0.7";
    let body = all[0].replace("\"S355\"", "\"steel\"");
    format!("{body}[materials.steel]\n{material}\n\n{boundaries}[time]{time}")
}

/// A bracket of two materials whose stiffness depends on the temperature: it conducts heat, is pressed, moved and pulled down, and vibrates.
pub const BRACKET: &str = r#"
[bodies.bracket]
shape.difference = { from = { box = { min = [0, 0, 0], max = [0.024, 0.018, 0.0075] } }, subtract = { cylinder = { start = [0.017, 0.012, -1], end = [0.017, 0.012, 1], radius = 3e-3 } } }
spacing = 1e-3
material = "steel"
materials = { end = "tin" }
regions.end.box = { min = [0.018, 0, 0], max = [1, 1, 1] }
regions.foot.box = { min = [0, 0, 0], max = [0.001, 1, 1] }
initial.temperature = "293.15 + 2e4 * x"
initial.velocity = ["20 * y", "0", "-30 * x"]

[materials.steel]
density = 7800
fracture_energy = 2e4
thermal_expansion = 1.2e-5
youngs_modulus = { temperature = [300, 800], value = [2.1e11, 1.5e11] }
poissons_ratio = 0.25
yield_stress = 3e8
specific_heat = 500
conductivity = 40

[materials.tin]
density = 7300
fracture_energy = 2e4
thermal_expansion = 2.3e-5
youngs_modulus = 5e10
poissons_ratio = 0.25
specific_heat = 500
conductivity = 40

[[physics]]
type = "thermal"
horizon = 1

[[physics]]
type = "mechanical"
kinematics = "KINEMATICS"
solver.explicit = { damping = 1e3 }
sections = [{ name = "middle", axis = "x", at = 0.012 }]

[[couplers]]
type = "thermal_expansion"
reference_temperature = 293.15

[[couplers]]
type = "gravity"
acceleration = [0, 0, -9.81e4]

[[couplers]]
type = "traction"
faces = ["x+", "z+"]
pressure = "1e7 * (1 + 50 * y)"
factor = { time = [0, 2e-6], value = [0, 1] }

[[couplers]]
type = "prescribed_displacement"
region = "foot"
x = { time = [0, 3e-6], value = [0, 1e-6] }
z = 0

[[couplers]]
type = "symmetry"
face = "y-"

[time]
end = 6e-6

[log]
interval = 2e-6
"#;

/// A bracket that is ordinary state-based.
pub fn ordinary(text: &str) -> String {
    formulated(text, "ordinary").replace("poissons_ratio = 0.25", "poissons_ratio = 0.3")
}

/// A bracket in another formulation.
pub fn formulated(text: &str, formulation: &str) -> String {
    let key = format!("formulation = \"{formulation}\"\nkinematics");
    text.replace("kinematics", &key)
}

/// A correspondence bracket.
pub fn correspondence(text: &str) -> String {
    formulated(text, "correspondence")
}

/// The bracket in motion, which heats up and cools down where it is compressed and extended.
pub fn with_heat_of_deformation() -> String {
    BRACKET.replace(
        "[time]",
        "[[couplers]]\ntype = \"deformation_heat\"\n\n[time]",
    )
}

/// The bracket, torn apart along `x` and along its diagonals, with an interface through it.
pub fn torn(kinematics: &str, criterion: &str) -> String {
    let fracture = format!(
        r#"fracture = {{ criterion = "{criterion}", no_fail = ["foot"], interface = {{ through = [[0.01, -1], [0.01, 1]], fracture_energy = 1e4 }} }}
kinematics"#
    );
    let text = BRACKET.replace("kinematics", &fracture);
    let text = text.replace("KINEMATICS", kinematics);
    let slow = r#"initial.velocity = ["20 * y", "0", "-30 * x"]"#;
    assert!(text.contains(slow));
    text.replace(
        slow,
        r#"initial.velocity = ["6e3 * (x - 0.012)", "3e3 * (y - 0.009) * (x - 0.004) / 0.01", "0"]"#,
    )
}

/// The bracket in equilibrium while it heats up and loads grow.
pub fn still(solver: &str) -> String {
    let changes = [
        (
            "solver.explicit = { damping = 1e3 }",
            format!("solver{solver}"),
        ),
        (
            r#"initial.velocity = ["20 * y", "0", "-30 * x"]"#,
            String::new(),
        ),
        ("[0, 2e-6]", "[0, 0.02]".into()),
        ("[0, 3e-6]", "[0, 0.02]".into()),
        ("end = 6e-6", "end = 0.03".into()),
        ("interval = 2e-6", "interval = 0.01".into()),
    ];
    changes
        .iter()
        .fold(BRACKET.into(), |text: String, (old, new)| {
            assert!(text.contains(old), "{old}");
            text.replace(old, new)
        })
}

/// The bracket in equilibrium, held at a face and under traction by layers.
pub fn layered(text: &str) -> String {
    let changes = [
        (
            "pressure = \"1e7 * (1 + 50 * y)\"",
            "traction = [1e7, 4e6, -5e6]\nby = \"layer\"",
        ),
        ("region = \"foot\"", "face = \"x-\""),
    ];
    changes
        .iter()
        .fold(text.into(), |text: String, (old, new)| {
            assert!(text.contains(old), "{old}");
            text.replace(old, new)
        })
}

/// A hot block of steel with a hole that is quenched: austenite transforms, metal flows and heats up, and its stress follows.
pub const QUENCH: &str = r#"
[bodies.block]
shape.difference = { from = { box = { min = [0, 0, 0], max = [0.024, 0.018, 0.0075] } }, subtract = { cylinder = { start = [0.017, 0.012, -1], end = [0.017, 0.012, 1], radius = 3e-3 } } }
spacing = 1.5e-3
material = "steel"
regions.end.box = { min = [0.018, 0, 0], max = [1, 1, 1] }
initial.temperature = "1000 - 1e4 * x"

[materials.steel]
density = 7800
carbon = 0.2
manganese = 1.3
silicon = 0.3
thermal_expansion = 1.2e-5
youngs_modulus = { temperature = [300, 1100], value = [2.1e11, 8e10] }
poissons_ratio = 0.3
yield_stress = { temperature = [300, 1100], value = [1e8, 2e7] }
hardening_modulus = 2e9
specific_heat = 600
conductivity = 30

[[physics]]
type = "thermal"
horizon = 1

[[physics]]
type = "thermal_history"
above = 700
cooling = [900, 600]
solidification = 850

[[physics]]
type = "metallurgy"
initial = { austenite = 1 }
transformation_plasticity = 1e-10

[[physics]]
type = "mechanical"
formulation = "FORMULATION"
kinematics = "KINEMATICS"
flow.j2 = {}
annealing_temperature = 950
update = "step"
solver.quasi_static = {}

[[couplers]]
type = "phase_strength"
martensite = 1e9

[[couplers]]
type = "phase_expansion"
reference_temperature = 900
reference_austenite = 1

[[couplers]]
type = "transformation_heat"

[[couplers]]
type = "plastic_heat"

[[couplers]]
type = "convection"
faces = ["x+", "y+", "z+", "z-"]
coefficient = 2e4
ambient = 293.15

[[couplers]]
type = "symmetry"
face = "y-"

[[couplers]]
type = "prescribed_displacement"
face = "x-"
x = 0
y = 0
z = 0

[time]
step = 0.05
end = 0.4

[log]
interval = 0.2
"#;

/// The quench with a strain that is prescribed in a part of the block and differs by direction.
pub fn shrunk() -> String {
    let inherent = "[[couplers]]\ntype = \"inherent_strain\"\nregion = \"end\"\nby_height = { height = [0, 0.004], strain = [[-0.002, -0.001, 0], [0, 0, 0.001]] }\n\n[time]";
    QUENCH.replace("[time]", inherent)
}

/// The bracket in equilibrium, which nothing holds and only its temperature deforms.
pub fn free() -> String {
    let text = still(".quasi_static = {}");
    let (start, rest) = text
        .split_once("[[couplers]]\ntype = \"gravity\"")
        .expect("loads");
    let (_, time) = rest.split_once("[time]").expect("times");
    format!("{start}[time]{time}")
}

/// The plate of the weld without a hole and without an arc.
pub fn cooled() -> String {
    let text = WELD.replace("spacing = 5e-4", "spacing = 1e-3");
    let (start, rest) = text
        .split_once("[[couplers]]\ntype = \"goldak\"")
        .expect("an arc");
    let (_, rest) = rest.split_once("[[couplers]]").expect("boundaries");
    let text = without_hole(&format!("{start}[[couplers]]{rest}")).replace("HORIZON", "1");
    // a face that one process has
    text.replace("faces = [\"z+\"]", "faces = [\"x+\"]")
}

/// The plate of the weld without a hole, heated by sources of all kinds.
pub fn heated() -> String {
    let text = WELD.replace("spacing = 5e-4", "spacing = 1e-3");
    let sources = r#"[[couplers]]
type = "gaussian_source"
name = "beam"
power = 200
sigma = 1e-3
effective_depth = 1e-3
toolpath.line = { start = [0.02, 0.014, 0.008], end = [0.002, 0.014, 0.008], speed = 0.02 }

[[couplers]]
type = "point_source"
name = "flame"
power = 100
toolpath.line = { start = [0.012, 0.002, 0.008], end = [0.012, 0.018, 0.008], speed = 0.02 }

[[couplers]]
type = "convection""#;
    let text = text.replace("[[couplers]]\ntype = \"convection\"", sources);
    without_hole(&text.replace("0.0085]", "0.008]")).replace("HORIZON", "1")
}

/// A plate of the size of that of the weld.
fn without_hole(text: &str) -> String {
    let hole = text.lines().find(|line| line.contains("cylinder"));
    let plate = "shape.box = { min = [0, 0, 0], max = [0.024, 0.02, 0.008] }";
    text.replace(hole.expect("a shape"), plate)
}

/// A plate of a weld without a hole, whose end is of another metal with a conductivity of its own.
pub fn dissimilar(text: &str, conductivity: &str) -> String {
    let text = without_hole(text);
    let metal = format!(
        "[materials.tin]\ndensity = 7300\nspecific_heat = 300\nconductivity = {conductivity}\nemissivity = 0.3\n\n[[physics]]"
    );
    let parts = "material = \"S355\"\nmaterials = { end = \"tin\" }\nregions.end.box = { min = [0.012, 0, 0], max = [1, 1, 1] }\nregions.core.box = { min = [0.01, 0.008, 0.002], max = [0.016, 0.013, 0.006] }";
    (text.replace("material = \"S355\"", parts)).replacen("[[physics]]", &metal, 1)
}

/// A bracket whose points are displaced at random.
pub fn jittered(text: &str) -> String {
    let text = text.replace("horizon = 1\n", "horizon = 1.6\n");
    text.replace(
        "spacing = 1e-3",
        "spacing = 1.2e-3\njitter = { amplitude = 0.15, seed = 3 }",
    )
}

/// A bracket of which one half has finer points.
pub fn zoned(text: &str) -> String {
    let text = text.replace("horizon = 1\n", "horizon = 1.6\n");
    let zones = "zones = [{ min = [0, 0, 0], max = [0.012, 0.018, 0.0075], spacing = 1.5e-3 }, { min = [0.012, 0, 0], max = [0.024, 0.018, 0.0075], spacing = 7.5e-4 }]";
    text.replace("spacing = 1e-3", zones)
}

/// The torn bracket, which a ball and a shock wave in water strike.
pub fn struck() -> String {
    let loads = r#"[[couplers]]
type = "impactor"
centre = [0.012, 0.009, 0.0105]
radius = 0.003
velocity = [0, 0, -500]
mass = 1e-3

[[couplers]]
type = "undex"
faces = ["x+"]
incident = "9.65e6 * exp(-t / 2e-7)"

[time]"#;
    torn("finite", "energy").replace("[time]", loads)
}

/// A hot plate, pulled while a crack grows through it.
pub const CRACK: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.06, 0.04, 0.001] }
dimension = 2
spacing = 1e-3
material = "steel"
initial.temperature = "300 + 1e4 * y"
regions.foot.box = { min = [-1, -1, -1], max = [1, 0.003, 1] }

[materials.steel]
density = 7800
youngs_modulus = 2e11
poissons_ratio = 0.3333333333333333
thermal_expansion = 1e-5
specific_heat = 500
conductivity = 40

[[physics]]
type = "thermal"

[[physics]]
type = "mechanical"
kinematics = "finite"
solver.explicit = {}

[[couplers]]
type = "thermal_expansion"
reference_temperature = 300

[[couplers]]
type = "growing_crack"
from = [0, 0.0205]
to = [0.05, 0.0203]
speed = 3000

[[couplers]]
type = "prescribed_displacement"
region = "foot"
x = 0
y = 0

[[couplers]]
type = "traction"
faces = ["y+"]
pressure = -1e8

[time]
end = 1e-5

[log]
interval = 5e-6
"#;

/// A plate whose rows of points are longer than a group, and go on from their ends.
pub const PERIODIC: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.3, 0.03, 0.001] }
dimension = 2
spacing = 1e-3
material = "steel"
periodic = ["x"]
initial.temperature = "500 + 3000 * y"

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 40

[[physics]]
type = "thermal"
horizon = 1

[time]
end = 0.2

[log]
interval = 0.1
"#;
