//! Bodies that grow and are cut, melt that flows, keyholes and water that runs, shared by processes.

use super::cases::WELD;

/// A wall that an arc builds up on a plate in two beads, the second one when the part has cooled. Then the plate is cut off.
pub const BUILD: &str = r#"
[bodies.part]
shape.union = [
  { box = { min = [0, 0, 0], max = [0.02, 0.01, 0.003] } },
  { box = { min = [0.003, 0, 0.003], max = [0.017, 0.003, 0.007] } },
]
spacing = 1e-3
material = "steel"
materials = { end = "tin" }
regions.end.box = { min = [0.013, 0, 0], max = [1, 1, 1] }
initial.temperature = "350 + 2e3 * x"
regions.wall.box = { min = [0, 0, 0.003], max = [1, 1, 1] }
regions.plate.box = { min = [0, 0, 0], max = [1, 1, 0.003] }

[materials.steel]
density = 7800
thermal_expansion = 1.2e-5
youngs_modulus = { temperature = [300, 1600], value = [2.1e11, 2e10] }
poissons_ratio = 0.3
yield_stress = { temperature = [300, 1600], value = [2e8, 1e7] }
hardening_modulus = 2e9
specific_heat = 600
conductivity = { temperature = [300, 1500], value = [40, 25] }
solidus = 1700
liquidus = 1750
latent_heat = 2.5e5
emissivity = 0.5

[materials.tin]
density = 7300
thermal_expansion = 2e-5
youngs_modulus = 5e10
poissons_ratio = 0.3
yield_stress = 5e7
hardening_modulus = 1e9
specific_heat = 300
conductivity = 60
solidus = 1700
liquidus = 1750
latent_heat = 1e5
emissivity = 0.3

[[physics]]
type = "thermal"
horizon = HORIZON

[[physics]]
type = "thermal_history"

[[couplers]]
type = "phase_change"

[[couplers]]
type = "goldak"
name = "torch"
power = 4000
efficiency = 0.8
front_length = 2e-3
rear_length = 3e-3
half_width = 2e-3
depth = 2e-3
[[couplers.toolpath.sequence.passes]]
toolpath.line = { start = [0.003, 0, 0.005], end = [0.017, 0, 0.005], speed = 0.015 }
[[couplers.toolpath.sequence.passes]]
toolpath.line = { start = [0.017, 0, 0.007], end = [0.003, 0, 0.007], speed = 0.015 }
wait_until = { temperature = 1100, at = [0.016, 0.0005, 0.0045] }

[[couplers]]
type = "deposit"
region = "wall"
source = "torch"
heat = "from_source"
temperature = 1900
bead = { width = 6e-3, height = 2e-3 }

[[couplers]]
type = "cut"
region = "plate"
time = 3.0

[[couplers]]
type = "symmetry"
face = "y-"

[[couplers]]
type = "convection"
coefficient = 2000
ambient = 293.15

[[couplers]]
type = "radiation"
ambient = 293.15

[time]
end = 3.3

[log]
interval = 0.55
"#;

/// The wall with stress, which builds up as the metal shrinks.
pub fn solid(formulation: &str, solver: &str) -> String {
    let mechanical = format!(
        r#"[[physics]]
type = "mechanical"
formulation = "{formulation}"
plasticity = {{ annealing_temperature = 1200 }}
{solver}

[[couplers]]
type = "thermal_expansion"
reference_temperature = 350
cutoff_temperature = 1200

[[couplers]]
type = "phase_change""#
    );
    (BUILD.replace("HORIZON", "1")).replace("[[couplers]]\ntype = \"phase_change\"", &mechanical)
}

/// A bar in motion that gets layers and loses them.
pub const MOVING_BAR: &str = r#"
[bodies.bar]
shape.box = { min = [0, 0, 0], max = [0.04, 0.008, 1] }
dimension = 2
spacing = 5e-4
material = "metal"
initial.velocity = ["3 + 50 * x", "0", "0"]
regions.layer.box = { min = [0, 0.004, 0], max = [0.03, 0.008, 1] }

[materials.metal]
density = 7800
youngs_modulus = 200e9
poissons_ratio = 0.3

[[physics]]
type = "mechanical"
formulation = "FORMULATION"
kinematics = "finite"
solver.explicit = {}

[[couplers]]
type = "deposit"
region = "layer"
temperature = 300
layers = { height = 1e-3, interval = 5e-6, first = 5e-6 }

[[couplers]]
type = "cut"
region = "layer"
time = 2e-5

[[couplers]]
type = "gravity"
acceleration = [0, -9.81, 0]

[time]
end = 3e-5

[log]
interval = 1e-5
"#;

/// A jet of water that runs along a hot plate, from which its film lifts off.
pub const JET: &str = r#"
[bodies.plate]
shape.difference = { from = { box = { min = [0, 0, 0], max = [0.03, 0.01, 0.003] } }, subtract = { cylinder = { start = [0.015, 0.005, -1], end = [0.015, 0.005, 1], radius = 2e-3 } } }
spacing = 1e-3
material = "steel"
initial.temperature = "1000 + 3e3 * x - 2e4 * y"

[materials.steel]
density = 7800
specific_heat = 600
conductivity = 30

[[physics]]
type = "thermal"
horizon = 1

[[couplers]]
type = "water_jet"
faces = ["z+", "y-"]
flow = "x+"
start = 0
speed = 0.04
impingement = 3e-3
leidenfrost = 850
water = 293
flux = { temperature = [293, 373, 420, 520, 620, 900], value = [0, 1e6, 4e6, 2.5e6, 1e6, 5e5] }

[time]
end = 0.6

[log]
interval = 0.2
"#;

/// A pool that convects while an arc moves along a plate.
pub const POOL: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.024, 0.008, 0.004] }
spacing = 5e-4
material = "steel"
initial.temperature = "800 + 1e4 * x"

[materials.steel]
library = "S355"
liquid_expansion = 1.2e-4

[[physics]]
type = "melt_flow"
buoyancy.gravity = [0, 0, -9.81]
surface = { faces = ["z+"], tension.slope = -4e-4 }
viscosity_factor = 10

[[physics]]
type = "thermal"
horizon = 1

[[couplers]]
type = "phase_change"

[[couplers]]
type = "gaussian_source"
name = "arc"
power = 3000
sigma = 1.2e-3
effective_depth = 1e-3
toolpath.line = { start = [0.004, 0, 0.004], end = [0.02, 0, 0.004], speed = 0.04 }

[[couplers]]
type = "lorentz_force"
source = "arc"
current = 150
width = 1.5e-3
thickness = 0.004

[[couplers]]
type = "symmetry"
face = "y-"

[[couplers]]
type = "convection"
coefficient = 500
ambient = 293.15

[time]
end = 0.3

[log]
interval = 0.1
"#;

/// A lap joint: two plates, the upper one turned, that touch and lose heat where neither covers the other.
pub const LAP: &str = r#"
[bodies.lower]
shape.box = { min = [0, 0, 0], max = [0.024, 0.01, 0.003] }
spacing = 1e-3
material = "steel"
initial.temperature = 300

[bodies.upper]
shape.box = { min = [0.009, -0.006, 0.003], max = [0.015, 0.02, 0.005] }
spacing = 5e-4
material = "tin"
initial.temperature = "450 + 5e3 * y"

[materials.steel]
density = 7800
specific_heat = 600
conductivity = 30

[materials.tin]
density = 7300
specific_heat = 300
conductivity = { temperature = [300, 500], value = [65, 55] }

[[physics]]
type = "thermal"
body = "lower"
horizon = 1

[[physics]]
type = "thermal"
body = "upper"
horizon = 1

[[couplers]]
type = "heat_interface"
body = "upper"
other = "lower"
conductance = 3e3

[[couplers]]
type = "convection"
name = "air below"
body = "lower"
coefficient = 500
ambient = 300

[[couplers]]
type = "convection"
name = "air above"
body = "upper"
coefficient = 500
ambient = 300

[time]
end = 0.3

[log]
interval = 0.1
"#;

/// The weld by a beam that drills a keyhole.
pub fn keyhole() -> String {
    let beam = r#"type = "super_gaussian"
name = "torch"
radius = 1.5e-3
penetration = "keyhole"
absorptivity = 0.4
reflections = true
power = 9000"#;
    let text = WELD.replace("spacing = 5e-4", "spacing = 1e-3");
    let start = text.find("type = \"goldak\"").expect("an arc");
    let end = text.find("toolpath.line").expect("its path");
    format!("{}{beam}\n{}", &text[..start], &text[end..]).replace("HORIZON", "1")
}
