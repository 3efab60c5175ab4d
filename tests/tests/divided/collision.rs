//! Bodies that collide.

/// A ball breaks a plate, whose fragments collide; a rigid hammer strikes a block that slides on the plate.
pub const COLLISION: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.024, 0.02, 0.003] }
spacing = 1e-3
material = "glass"
regions.rim.box = { min = [-1, -1, -1], max = [0.003, 1, 1] }

[bodies.block]
shape.box = { min = [0.012, 0.004, 0.003], max = [0.022, 0.014, 0.009] }
spacing = 1e-3
material = "steel"
initial.velocity = [-20, 5, -30]

[bodies.hammer]
shape.box = { min = [0.0125, 0.0055, 0.0099], max = [0.0205, 0.0135, 0.0179] }
spacing = 1e-3
material = "steel"
initial.velocity = [0, 0, -150]

[materials.glass]
density = 2200
youngs_modulus = 22.35e9
critical_stretch = 2e-3

[materials.steel]
density = 7800
youngs_modulus = 2e11

[[physics]]
type = "mechanical"
body = "plate"
horizon = 3
kinematics = "finite"
fracture = {}
solver.explicit = {}

[[physics]]
type = "mechanical"
body = "block"
kinematics = "finite"
solver.explicit = {}

[[physics]]
type = "rigid_body"
body = "hammer"

[[couplers]]
type = "impactor"
body = "plate"
centre = [0.006, 0.01, 0.0061]
radius = 0.003
velocity = [0, 0, -300]
mass = 2e-3

[[couplers]]
type = "contact"
body = "plate"

[[couplers]]
type = "contact"
body = "block"
other = "plate"
friction = 0.4

[[couplers]]
type = "contact"
body = "hammer"
other = "block"
friction = 0.2

[[couplers]]
type = "prescribed_displacement"
body = "plate"
region = "rim"
x = 0
y = 0
z = 0

[time]
end = 9e-6

[log]
interval = 2e-6
"#;
