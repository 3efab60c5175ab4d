//! Heat and deformation together: what each gives the other, and that nothing is lost.

mod program;

use std::path::Path;
use std::process::Stdio;

use perimelt::case::Case;
use perimelt::core::law::Constants;
use perimelt::core::{
    Family, FamilySpec, Key, Physics, Prepared, RunError, RunningPhysics, Setup, Simulation, Step,
    StepLimits, Work, World, Write, register_physics,
};
use perimelt::physics::mechanical::Formulation;
use perimelt::physics::mechanical::law::{ElasticLaw, Parts};
use perimelt::physics::mechanical::linear::LinearSolids;
use perimelt::physics::mechanical::moduli::Elasticity;
use perimelt::physics::mechanical::solid::{Constitution, EnergyKind, Solid, Wanted};
use perimelt::physics::mechanical::stretch::Linear;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const ALPHA: f64 = 5e-5;
const YOUNG: f64 = 2e11;
const DENSITY: f64 = 7800.0;
const HEAT_CAPACITY: f64 = 500.0;
const T0: f64 = 300.0;

/// A case with a material that couples strongly and hardly conducts.
fn compose(body: &str, rest: &str) -> Simulation {
    let text = format!(
        "{body}
        [materials.solid]
        density = {DENSITY}
        specific_heat = {HEAT_CAPACITY}
        conductivity = 1e-9
        youngs_modulus = {YOUNG}
        thermal_expansion = {ALPHA}
        {rest}"
    );
    let case = Case::parse("coupled.toml", text, Path::new("")).expect("a valid case");
    case.compose()
        .unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn finish(simulation: &mut Simulation) {
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
}

fn values(simulation: &Simulation, field: &str) -> Vec<f64> {
    let fields = simulation.world().fields();
    let index = fields
        .find(0, field)
        .unwrap_or_else(|| panic!("there is `{field}`"));
    fields.field(index).data().flat().to_vec()
}

/// Largest distance of two states relative to the largest value.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max) / largest
}

/// A block of the given dimension whose box shrinks by `strain` along every axis in 1 ms.
fn compressed(dimension: usize, strain: f64, heat: &str) -> Simulation {
    let cells = [12, 8, 8];
    let mut max = [0.0; 3];
    let mut couplers = format!("[[couplers]]\ntype = \"deformation_heat\"\n{heat}\n");
    for axis in 0..dimension {
        max[axis] = 1e-3 * f64::from(cells[axis]);
        let name = ["x", "y", "z"][axis];
        let end = strain * max[axis];
        couplers += &format!(
            "[[couplers]]\ntype = \"prescribed_displacement\"\nface = \"{name}-\"\n{name} = 0\n
             [[couplers]]\ntype = \"prescribed_displacement\"\nface = \"{name}+\"\n
             {name} = {{ time = [0, 1e-3], value = [0, {end}] }}\n"
        );
    }
    let body = format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = {max:?} }}
        dimension = {dimension}
        spacing = 1e-3
        material = \"solid\"
        initial.temperature = {T0}"
    );
    let rest = format!(
        "[[physics]]\ntype = \"mechanical\"\nsolver.quasi_static = {{ tolerance = 1e-12 }}
        [[physics]]\ntype = \"thermal\"\n{couplers}\n[time]\nend = 1e-3\nstep = 1e-5"
    );
    let mut simulation = compose(&body, &rest);
    simulation.start().expect("it starts");
    finish(&mut simulation);
    simulation
}

#[test]
fn quick_uniform_compression_heats_an_insulated_block_by_the_thermoelastic_value() {
    let strain = -1e-5;
    for dimension in 1..=3 {
        for (heat, linear) in [("", false), ("linearised_at = 300", true)] {
            let simulation = compressed(dimension, strain, heat);
            let temperature = values(&simulation, "temperature");
            let conjugate_stress = values(&simulation, "conjugate_stress");
            // Poisson's ratio of bonds: p = E / (1 - (d - 1) nu) tr(strain), nu = 1/3 and 1/4
            let over = [1.0, 1.5, 2.0][dimension - 1];
            let classical = YOUNG * over * dimension as f64 * strain;
            let rise = |p: f64| {
                let exponent = -ALPHA * p / (DENSITY * HEAT_CAPACITY);
                if linear {
                    T0 * exponent
                } else {
                    T0 * exponent.exp_m1()
                }
            };
            let worst = |expected: &dyn Fn(usize) -> f64| {
                let of_point = |(i, t): (usize, &f64)| ((t - T0) / expected(i) - 1.0).abs();
                temperature
                    .iter()
                    .enumerate()
                    .map(of_point)
                    .fold(0.0, f64::max)
            };
            let by_stress = worst(&|i| rise(conjugate_stress[i]));
            let by_theory = worst(&|_| rise(classical));
            println!(
                "{dimension}D, linear {linear}: {by_stress:.1e} by the stress of the points, {by_theory:.1e} by the classical one"
            );
            // 100 steps of first order in an exponent of 1e-5 to 1e-4: half of it over 100
            assert!(by_stress < 1e-6, "{dimension}D: {by_stress:e}");
            assert!(by_theory < 1e-6, "{dimension}D: {by_theory:e}");
        }
    }
}

/// A free plate, stretched along x at the start.
fn vibrating(steps_per_period: f64, periods: f64, coupled: bool, iteration: &str) -> Simulation {
    let length: f64 = 0.02;
    let period = 2.0 * length / (YOUNG / DENSITY).sqrt();
    let (step, end) = (period / steps_per_period, periods * period);
    let couplers = if coupled {
        format!(
            "[[couplers]]\ntype = \"deformation_heat\"\nlinearised_at = {T0}
            [[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = {T0}"
        )
    } else {
        String::new()
    };
    let body = format!(
        "[bodies.plate]
        shape.box = {{ min = [0, 0, 0], max = [{length}, 0.006, 0] }}
        dimension = 2
        spacing = 1e-3
        material = \"solid\"
        initial.temperature = {T0}"
    );
    let rest = format!(
        "[[physics]]\ntype = \"mechanical\"\nsolver.explicit = {{}}
        [[physics]]\ntype = \"thermal\"\n{couplers}
        [time]\nend = {end}\nstep = {step}\n{iteration}\n[log]\ninterval = {end}"
    );
    let mut simulation = compose(&body, &rest);
    let positions = simulation.world().body(0).points.position.to_vec();
    for (point, x) in positions.iter().enumerate() {
        let along = -1e-6 * (std::f64::consts::PI * x.x / length).cos();
        let point = std::iter::once(point);
        simulation
            .set_initial(0, "displacement", point, &[along, 0.0, 0.0])
            .expect("it is owned");
    }
    simulation.start().expect("it starts");
    simulation
}

/// Kinetic, elastic and thermal energy, J: `rho v²/2`, `W(total stretch)`, `rho c theta²/(2 T0)`
/// (`docs/theory/thermomechanics.md`, eq. 4: their sum is kept where no heat is conducted).
fn energies(simulation: &Simulation, elastic: &mut dyn Solid) -> [f64; 3] {
    let volume = &simulation.world().body(0).points.volume;
    elastic.set_displacement(&values(simulation, "displacement"), &[]);
    let velocity = values(simulation, "velocity");
    let temperature = values(simulation, "temperature");
    let mut sums = [0.0; 3];
    for (i, ([w, _], volume)) in elastic
        .evaluate(Wanted::energy(EnergyKind::Total))
        .energy
        .iter()
        .zip(volume)
        .enumerate()
    {
        let speed: f64 = velocity[3 * i..][..3].iter().map(|v| v * v).sum();
        let theta = temperature[i] - T0;
        sums[0] += volume * 0.5 * DENSITY * speed;
        sums[1] += volume * w;
        sums[2] += volume * 0.5 * DENSITY * HEAT_CAPACITY / T0 * theta * theta;
    }
    sums
}

/// Largest change of the total energy and largest thermal energy, relative to the total at
/// the start, over 20 periods; the change at the end.
fn energy_over_twenty_periods(steps: f64, coupled: bool, iteration: &str) -> [f64; 3] {
    let mut simulation = vibrating(steps, 20.0, coupled, iteration);
    let body = simulation.world().body(0);
    let spec = FamilySpec::new(3e-3);
    let family = Family::build(body, &spec)
        .expect("it has neighbours")
        .into();
    let modulus = body.materials[0].get("youngs_modulus").cloned();
    let modulus = vec![modulus.expect("given above")];
    let elasticity = Elasticity::bond_based(modulus, body.dimension);
    let parts = Parts {
        body,
        family,
        constitution: Constitution::elastic(elasticity),
        formulation: Formulation::Bond,
        stabilisation: None,
        name: "linear",
        constants: Constants::of(body, "", "", &[]).expect("none"),
    };
    let law = Box::new(LinearSolids::from(Linear {}));
    let mut elastic = law.solid(parts).expect("elastic");
    let start: f64 = energies(&simulation, &mut *elastic).iter().sum();
    let [mut worst, mut thermal, mut change]: [f64; 3] = [0.0; 3];
    while !simulation.is_finished() {
        simulation.step().expect("a step");
        let now = energies(&simulation, &mut *elastic);
        change = now.iter().sum::<f64>() / start - 1.0;
        worst = worst.max(change.abs());
        thermal = thermal.max(now[2] / start);
    }
    [worst, thermal, change]
}

#[test]
fn energy_is_kept_over_a_free_vibration() {
    let strong = "iteration = { tolerance = 1e-12, passes = 20 }";
    let measure = |what: &str, steps: f64, coupled: bool, iteration: &str| {
        let [worst, thermal, end] = energy_over_twenty_periods(steps, coupled, iteration);
        println!(
            "{what}, {steps} steps a period: {worst:.2e} at most, {end:.2e} at the end, thermal {thermal:.2e}"
        );
        [worst, thermal]
    };
    let [alone, none] = measure("alone", 200.0, false, "");
    let [coarse, thermal] = measure("strong", 200.0, true, strong);
    let [fine, _] = measure("strong", 400.0, true, strong);
    let [weak, _] = measure("weak", 200.0, true, "");
    let [weak_fine, _] = measure("weak", 400.0, true, "");
    // nothing heats without the coupler; with it, alpha² T0 p² / (2 rho c) of
    // each change of p: some 0.08 of the elastic energy for the first quarter, four times that for half a period
    assert!(
        none < 1e-20 && thermal > 0.01,
        "thermal energy {none:e}, {thermal:e}"
    );
    // velocity Verlet keeps a nearby energy: the error is of second order and does not grow
    assert!(alone < 1e-3, "{alone:e}");
    assert!(coarse < 1e-3, "{coarse:e}");
    assert!(fine < 0.3 * coarse, "{fine:e} after {coarse:e}");
    // in one pass heat lags a step behind, which feeds the vibration in proportion to the step
    assert!(
        weak > coarse && weak_fine < 0.6 * weak,
        "{weak:e}, {weak_fine:e}"
    );
}

/// A free bar of steel that the program runs until its energy has grown: what it says when it stops.
fn stopped(initial: &str, rest: &str) -> String {
    let case = format!(
        "[bodies.bar]
        shape.box = {{ min = [0, 0, 0], max = [0.02, 0.005, 0.0005] }}
        dimension = 2
        thickness = 0.0005
        spacing = 0.0005
        material = \"steel\"
        {initial}
        [materials.steel]
        density = 7850
        youngs_modulus = 2e11
        poissons_ratio = 0.3
        specific_heat = 500
        conductivity = 40
        thermal_expansion = 12e-6
        {rest}"
    );
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("bar.toml"), case).expect("writable");
    let mut run = program::command(folder.path(), &["run", "bar.toml", "--quiet"]);
    let output = run.stderr(Stdio::piped()).output().expect("it starts");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "it ends well: {told}");
    told.split_whitespace().collect::<Vec<_>>().join(" ")
}

const CHAOS: &str =
    "initial.velocity = [\"1000*sin(20000*x+9000*y)\", \"1000*cos(6000000*x*y)\", 0]";
const FINITE_BONDS: &str = "[[physics]]
        type = \"mechanical\"
        formulation = \"bond\"
        kinematics = \"finite\"
        solver.explicit = {}
        [time]
        end = 2.4e-4
        [log]
        interval = 2e-5";

#[test]
fn the_program_fails_when_energy_grows_without_work() {
    let pressure = "[[couplers]]
        type = \"traction\"
        faces = [\"x+\"]
        pressure = 1
        factor = { time = [0, 1], value = [0, 1] }";
    let heat = "[[physics]]
        type = \"thermal\"
        horizon = 1
        [[physics]]
        type = \"mechanical\"
        formulation = \"ordinary\"
        solver.explicit = {}
        [[couplers]]
        type = \"thermal_expansion\"
        reference_temperature = 300
        [[couplers]]
        type = \"deformation_heat\"
        [time]
        end = 2e-3
        step = 4e-8
        [log]
        interval = 1e-4";
    let stretching = "initial.temperature = 300\ninitial.velocity = [\"0.1*x\", 0, 0]";
    let loaded = format!("{pressure}\n{FINITE_BONDS}");
    for (what, told) in [
        ("short", stopped(CHAOS, FINITE_BONDS)),
        ("loaded", stopped(CHAOS, &loaded)),
        ("heated", stopped(stretching, heat)),
    ] {
        assert!(
            told.contains("without work being done on it"),
            "{what}: {told}"
        );
        assert!(told.contains("mechanical failed at t ="), "{what}: {told}");
    }
}

/// A plate pulled along x whose heat makes it contract across: the state at the end of the pull.
fn pulled(steps: u32, iteration: &str) -> Vec<f64> {
    let step = 1e-3 / f64::from(steps);
    let body = format!(
        "[bodies.plate]
        shape.box = {{ min = [0, 0, 0], max = [0.016, 0.008, 0] }}
        dimension = 2
        spacing = 1e-3
        material = \"solid\"
        initial.temperature = {T0}"
    );
    let rest = format!(
        "[[physics]]\ntype = \"mechanical\"\nsolver.quasi_static = {{ tolerance = 1e-12 }}
        [[physics]]\ntype = \"thermal\"
        [[couplers]]\ntype = \"deformation_heat\"
        [[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = {T0}
        [[couplers]]\ntype = \"prescribed_displacement\"\nface = \"x-\"\nx = 0\ny = 0
        [[couplers]]\ntype = \"prescribed_displacement\"\nface = \"x+\"\nx = {{ time = [0, 1e-3], value = [0, 1e-6] }}
        [time]\nend = 1e-3\nstep = {step}\n{iteration}\n[log]\ninterval = 1e-3"
    );
    let mut simulation = compose(&body, &rest);
    simulation.start().expect("it starts");
    finish(&mut simulation);
    let mut state = values(&simulation, "displacement");
    let rise = values(&simulation, "temperature")
        .into_iter()
        .map(|t| t - T0);
    // in units of what each field reaches, about 1e-6 m and 0.1 K
    state.iter_mut().for_each(|u| *u *= 1e6);
    state.extend(rise.map(|t| 10.0 * t));
    state
}

#[test]
fn strong_coupling_finds_the_state_that_small_weak_steps_approach() {
    let strong = |steps| pulled(steps, "iteration = { tolerance = 1e-11, passes = 30 }");
    let (four, sixteen) = (strong(4), strong(16));
    let weak: Vec<f64> = [50, 100, 200]
        .map(|steps| distance(&pulled(steps, ""), &sixteen))
        .to_vec();
    let apart = distance(&four, &sixteen);
    println!(
        "weak in 50, 100, 200 steps: {weak:?} from strong; strong in 4 and 16: {apart:.2e} apart"
    );
    // the temperature changes by 1e-4 of itself, which heat follows in first order
    assert!(apart < 1e-4, "{apart:e}");
    // the heat of the last step of N is not yet in the expansion: 0.04 / N of the displacement
    assert!(weak[2] < 3e-4, "{weak:?}");
    assert!(
        weak[1] < 0.6 * weak[0] && weak[2] < 0.65 * weak[1],
        "{weak:?}"
    );
}

/// A field that changes faster than any stability limit tells.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Humidity {
    /// Largest interval at which others should read it, s.
    interval: f64,
}

struct RunningHumidity {
    interval: f64,
    humidity: Write<f64>,
}

#[typetag::serialize(name = "humidity_of_the_air")]
impl Physics for Humidity {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let key = Key::new("humidity", "1", "relative humidity");
        Ok(Box::new(RunningHumidity {
            interval: self.interval,
            humidity: setup.own(0, &key)?,
        }))
    }
}

register_physics!("humidity_of_the_air", Humidity);

impl RunningPhysics for RunningHumidity {
    fn step_limits(&self, _time: f64) -> StepLimits {
        StepLimits {
            longest: Some(self.interval),
            next_event: None,
        }
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        world.write(self.humidity).fill((40.0 * step.end()).sin());
        Ok(Work::of_stages(1))
    }
}

#[test]
fn a_physics_limits_the_interval_at_which_others_read_it() {
    let body = format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = [8e-3, 4e-3, 0] }}
        dimension = 2
        spacing = 1e-3
        material = \"solid\"
        initial.temperature = {T0}"
    );
    let run = |physics: &str| {
        let rest = format!(
            "[[physics]]\ntype = \"thermal\"\n{physics}\n[time]\nend = 1\n[log]\ninterval = 1"
        );
        let mut simulation = compose(&body, &rest);
        let limit = simulation.macro_step();
        finish(&mut simulation);
        (limit, simulation.progress().macro_steps)
    };
    let (alone, _) = run("");
    assert!(alone > 0.03, "a block that hardly conducts: {alone} s");
    let (limit, steps) = run("[[physics]]\ntype = \"humidity_of_the_air\"\ninterval = 0.03");
    assert_eq!(limit, 0.03);
    assert_eq!(steps, 34);
}

/// A hot fluid that flows past another body, which it heats; the tables of plugins in this order.
fn warmed(tables: &[&str]) -> Result<Simulation, String> {
    let text = format!(
        "[bodies.fluid]
        shape.box = {{ min = [0, 0, 0], max = [8e-3, 4e-3, 0] }}
        dimension = 2
        spacing = 1e-3
        material = 'water'
        periodic = ['x']
        initial = {{ temperature = 350, velocity = [0.1, 0, 0] }}
        [bodies.plate]
        shape.box = {{ min = [0, -2e-3, 0], max = [8e-3, 0, 0] }}
        dimension = 2
        spacing = 1e-3
        material = 'water'
        initial.temperature = 280
        [materials.water]
        density = 1000
        specific_heat = 4000
        conductivity = 0.6
        viscosity = 1e-3
        solidus = 273
        liquidus = 274
        latent_heat = 3.3e5
        {}
        [time]\nend = 1e-2\n[log]\ninterval = 1e-2",
        tables.join("\n")
    );
    let case = Case::parse("order.toml", text, Path::new("")).map_err(|e| e.render(false))?;
    let mut simulation = case.compose().map_err(|e| e.render(false))?;
    case.start(&mut simulation).map_err(|e| e.to_string())?;
    finish(&mut simulation);
    Ok(simulation)
}

#[test]
fn the_order_of_tables_in_a_case_file_does_not_matter() {
    let fluid = "[[physics]]\ntype = 'fluid'\nbody = 'fluid'\ndescription = 'eulerian'\nform = 'conservative'\n\
                 state.tait.sound_speed = 2";
    let heat = "[[physics]]\ntype = 'thermal'\nbody = 'fluid'\nsurfaces = 'mirrored'";
    let plate = "[[physics]]\ntype = 'thermal'\nbody = 'plate'";
    let walls = ["y-", "y+"].map(|face| {
        format!("[[couplers]]\ntype = 'wall'\nbody = 'fluid'\nfaces = ['{face}']\nkind = 'slip'")
    });
    let melting = "[[couplers]]\ntype = 'phase_change'\nbody = 'plate'";
    let exchange =
        "[[couplers]]\ntype = 'heat_interface'\nbody = 'fluid'\nother = 'plate'\nconductance = 1e4";
    let [lower, upper] = &walls;
    let state = |tables: &[&str]| {
        let simulation = warmed(tables).unwrap_or_else(|e| panic!("{e}"));
        let fields = simulation.world().fields();
        let heat = (0..2).map(|body| {
            let field = fields.find(body, "enthalpy").expect("it has heat");
            fields.field(field).data().flat().to_vec()
        });
        heat.collect::<Vec<_>>().concat()
    };
    let first = state(&[fluid, heat, plate, lower, upper, melting, exchange]);
    // couplers in any order give the same bits
    let couplers = state(&[fluid, heat, plate, exchange, melting, upper, lower]);
    assert!(first == couplers, "{}", distance(&couplers, &first));
    // physics advance in the order of the case, so that one reads the other before or after a step of the flow
    let physics = state(&[plate, heat, fluid, exchange, melting, upper, lower]);
    let apart = distance(&physics, &first);
    assert!(apart < 1e-6, "{apart}");
}

/// What happens to points is refused for plugins that do not support it, also those that only act through surfaces.
#[test]
fn plugins_that_need_points_at_rest_are_refused_where_a_fluid_moves_them() {
    let fluid = "[[physics]]\ntype = 'fluid'\nbody = 'fluid'\nform = 'conservative'\nstate.tait.sound_speed = 2";
    let heat = "[[physics]]\ntype = 'thermal'\nbody = 'fluid'";
    let film = "[[couplers]]\ntype = 'convection'\nbody = 'fluid'\ncoefficient = 10\nambient = 300";
    let history = "[[physics]]\ntype = 'thermal_history'\nbody = 'fluid'";
    for (plugin, refused) in [(film, "convection"), (history, "thermal_history")] {
        for tables in [[fluid, heat, plugin], [plugin, heat, fluid]] {
            let message = warmed(&tables).map(|_| ()).expect_err(refused);
            let expected = format!("moves the points of body `fluid`, which `{refused}");
            assert!(message.contains(&expected), "{message}");
        }
    }
}

/// Area of the pool on the surface and its depth below the arc (m2, m), of `spot_pool` with points of half a millimetre and
/// another table of melt flow.
fn spot_pool(flow: &str) -> [f64; 2] {
    const SPACING: f64 = 5e-4;
    let path = perimelt_tests::root().join("cases/welding/spot_pool.toml");
    let text = std::fs::read_to_string(&path).expect("readable");
    let start = text
        .find("[[physics]]\ntype = \"melt_flow\"")
        .expect("there");
    let end = text.find("[[physics]]\ntype = \"thermal\"").expect("there");
    let text = format!("{}{flow}{}", &text[..start], &text[end..]);
    let text = text.replace("= 2.5e-4", "= 5e-4");
    let case = Case::parse("spot_pool.toml", text, Path::new("")).expect("a valid case");
    let mut simulation = case
        .compose()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    simulation.start().expect("starts");
    finish(&mut simulation);
    let liquid = values(&simulation, "liquid_fraction");
    let points = simulation
        .world()
        .body(0)
        .points
        .position
        .iter()
        .zip(liquid);
    let [mut area, mut depth] = [0.0; 2];
    for (x, liquid) in points {
        area += if x.z > -SPACING {
            liquid * SPACING.powi(2)
        } else {
            0.0
        };
        depth += if x.x.max(x.y) < SPACING {
            liquid * SPACING
        } else {
            0.0
        };
    }
    [area, depth]
}

/// Melt that flows outwards along the surface makes the pool wide and shallow, melt that flows inwards narrow and deep.
#[test]
fn the_slope_of_the_surface_tension_decides_the_shape_of_the_pool() {
    let with = |slope: f64| {
        spot_pool(&format!(
            "[[physics]]\ntype = \"melt_flow\"\nviscosity_factor = 30\n\
             surface = {{ faces = [\"z+\"], tension.slope = {slope} }}\n\n"
        ))
    };
    let ([area, depth], out, inwards) = (spot_pool(""), with(-4e-4), with(4e-4));
    assert!(
        out[0] > 1.05 * area && out[1] < 0.75 * depth,
        "{out:?} {area} {depth}"
    );
    assert!(
        inwards[0] < 0.9 * area && inwards[1] > 1.2 * depth,
        "{inwards:?} {area} {depth}"
    );
}
