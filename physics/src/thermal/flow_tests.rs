//! Heat on bodies whose points move, and in Eulerian fluids.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use perimelt_core::body::{Body, Store};
use perimelt_core::{
    Axis, LayerRole, Physics, RunError, RunningCoupler, Setup, SetupError, Simulation, World,
};

use super::Thermal;
use crate::fluid::Fluid;
use crate::testing::{block, read, run, set, simulation, values};

/// A square of 1 m, periodic along both axes, with `n` points along each.
fn periodic(n: usize, material: &str) -> Body {
    let mut body = block([n, n, 1], 2, 1.0 / n as f64, Store::Lattice, material);
    body.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    body
}

fn flow_with_heat(body: Body, fluid: &str, thermal: &str, end: f64) -> Simulation {
    let fluid: Fluid = read(fluid);
    let thermal: Thermal = read(thermal);
    simulation(body, vec![Box::new(fluid), Box::new(thermal)], vec![], end)
}

/// All of it in steps of the fluid.
fn to_the_end(s: &mut Simulation) {
    s.start().expect("starts");
    while !s.is_finished() {
        s.step().expect("steps");
    }
}

#[test]
fn an_eulerian_flow_carries_temperature_along_and_a_lagrangian_one_with_its_points() {
    let material = "density = 1\nviscosity = 0.1\nspecific_heat = 1\nconductivity = 0.05";
    let (end, v) = (0.25, 1.0);
    for (description, form, carried) in [
        ("eulerian", "second_derivatives", true),
        ("eulerian", "bonds", true),
        ("total_lagrangian", "bonds", false),
    ] {
        let fluid =
            format!("description = '{description}'\nstate.tait.sound_speed = 10\nstep = 4e-4");
        let thermal = format!("form = '{form}'\nhorizon = 3.015\nstep = 4e-4");
        let mut s = flow_with_heat(periodic(40, material), &fluid, &thermal, end);
        set(&mut s, "velocity", |_| [v, 0.0, 0.0]);
        set(&mut s, "temperature", |[x, _, _]| [2.0 + (TAU * x).sin()]);
        run(&mut s);
        let places = s.world().body(0).points.position.to_vec();
        let decay = (-0.05 * TAU * TAU * end).exp();
        for (x, t) in places.iter().zip(values(&s, "temperature")) {
            let moved = if carried { v * end } else { 0.0 };
            let exact = 2.0 + decay * (TAU * (x.x - moved)).sin();
            // 1.5 % of the rate at 40 points, and a phase error of the gradient
            assert!(
                (t - exact).abs() < 0.03,
                "{description} {form} at {x}: {t} {exact}"
            );
        }
    }
}

#[test]
fn an_eulerian_flow_keeps_the_heat_of_its_mass_and_moves_a_hot_spot() {
    let material = "density = 1\nviscosity = 1e-3\nspecific_heat = 1\nconductivity = 1e-4";
    let fluid = "description = 'eulerian'\nstate.tait.sound_speed = 10";
    let mut s = flow_with_heat(periodic(32, material), fluid, "", 0.25);
    set(&mut s, "velocity", |_| [1.0, 0.0, 0.0]);
    let spot = |x: f64, y: f64| (-((x - 0.3).powi(2) + (y - 0.5).powi(2)) / 0.02).exp();
    set(&mut s, "temperature", |[x, y, _]| [1.0 + spot(x, y)]);
    let centre = |s: &Simulation| {
        let places = s.world().body(0).points.position.iter();
        let (mut sum, mut moment) = (0.0, Vector3::zeros());
        for (x, t) in places.zip(values(s, "temperature")) {
            sum += t - 1.0;
            moment += (t - 1.0) * x;
        }
        (sum, moment / sum)
    };
    let before = centre(&s);
    to_the_end(&mut s);
    let after = centre(&s);
    let way = after.1 - before.1;
    // the speed of the gradient of a smooth spot is exact to a few per mille
    assert!((way - Vector3::x() * 0.25).norm() < 2e-3, "{way}");
    // the flow is uniform, so that heat is also that of the volume
    assert!(
        (after.0 / before.0 - 1.0).abs() < 1e-10,
        "{after:?} {before:?}"
    );
}

/// A shear flow whose points change neighbours, warmer on the left.
fn sheared(thermal: &str, end: f64) -> Simulation {
    let material = "density = 2\nviscosity = 0.05\nspecific_heat = 3\nconductivity = 0.1";
    let fluid = "form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3";
    let mut s = flow_with_heat(periodic(16, material), fluid, thermal, end);
    set(&mut s, "velocity", |[x, y, _]| {
        [0.5 + 0.4 * (TAU * y).sin(), 0.2 * (TAU * x).sin(), 0.0]
    });
    set(&mut s, "temperature", |[x, _, _]| {
        [300.0 + 50.0 * (TAU * x).cos()]
    });
    s
}

#[test]
fn a_moving_fluid_keeps_its_heat_to_rounding() {
    for (keys, tolerance) in [
        // rounding of 256 enthalpies over some hundred steps
        ("", 1e-12),
        ("solver = 'rkl2'", 1e-12),
        // accuracy of Newton's method
        ("solver = 'implicit'", 1e-10),
    ] {
        let mut s = sheared(keys, 0.4);
        let first = values(&s, "temperature");
        to_the_end(&mut s);
        let now = s.world().configuration(0);
        let reference = &s.world().body(0).points;
        let farthest = now.positions().iter().zip(&reference.position);
        let farthest = farthest
            .map(|(x, start)| (x - start).norm())
            .fold(0.0, f64::max);
        assert!(farthest > 0.1, "points move: {farthest}");
        assert!(now.volumes() != &*reference.volume, "volumes change");
        let last = values(&s, "temperature");
        let spread = |t: &[f64]| t.iter().map(|t| (t - 300.0).powi(2)).sum::<f64>();
        assert!(spread(&last) < 0.9 * spread(&first), "heat flows");
        let balances = s.balances();
        let heat = &balances[1].1[0];
        assert_eq!((heat.quantity.as_str(), heat.supplied), ("heat", 0.0));
        assert!(
            heat.error().abs() < tolerance * heat.stored,
            "{keys}: {heat:?}"
        );
    }
}

#[test]
fn the_conductivity_of_a_fluid_is_corrected_unless_it_is_asked_not_to() {
    // decay of a wave in a fluid at rest
    let rate = |keys: &str| {
        let material = "density = 2\nviscosity = 1e-9\nspecific_heat = 1\nconductivity = 0.1";
        let fluid = "form = 'conservative'\nstate.tait.sound_speed = 20";
        let heat = format!("horizon = 2\n{keys}");
        let end = 0.25;
        let mut s = flow_with_heat(periodic(32, material), fluid, &heat, end);
        set(&mut s, "velocity", |_| [0.0; 3]);
        set(&mut s, "temperature", |[x, ..]| {
            [300.0 + 50.0 * (TAU * x).cos()]
        });
        to_the_end(&mut s);
        let hottest = values(&s, "temperature").into_iter().fold(0.0, f64::max);
        let start = 50.0 * (TAU / 64.0).cos();
        (start / (hottest - 300.0)).ln() / (0.05 * TAU * TAU * end)
    };
    let [corrected, plain] = ["", "correction = 'none'"].map(rate);
    assert!((corrected - 1.0).abs() < 0.01, "{corrected}");
    assert!(plain < 0.9, "{plain}: two spacings hold too few bonds");
}

#[test]
fn heat_flows_between_current_neighbours() {
    // two streams that pass each other: points next to the interface meet others than at the start
    let material = "density = 2\nviscosity = 1e-9\nspecific_heat = 1\nconductivity = 1e-3";
    let body = || periodic(16, material);
    let fluid = "form = 'conservative'\nstate.tait.sound_speed = 20\nstep = 1e-3";
    let passing = |speed: f64| {
        let mut s = flow_with_heat(body(), fluid, "horizon = 2\nstep = 1e-3", 0.5);
        set(&mut s, "velocity", |[_, y, _]| {
            [if y < 0.5 { speed } else { 0.0 }, 0.0, 0.0]
        });
        // hot in the lower left quarter
        set(&mut s, "temperature", |[x, y, _]| {
            [if x < 0.5 && y < 0.5 { 400.0 } else { 300.0 }]
        });
        to_the_end(&mut s);
        let places = s.world().body(0).points.position.to_vec();
        let above = |from: f64, to: f64| {
            let points = places.iter().zip(values(&s, "temperature"));
            let next = |x: &Vector3<f64>| x.y > 0.5 && x.y < 0.5625 && x.x > from && x.x < to;
            let points = points.filter(|(x, _)| next(x));
            points.map(|(_, t)| t - 300.0).sum::<f64>() / 8.0
        };
        [above(0.0, 0.5), above(0.5, 1.0)]
    };
    let [left, right] = passing(0.0);
    assert!(
        left > 5.0 * right,
        "at rest only the left is heated: {left} {right}"
    );
    // the hot quarter ends up to the right
    let [left, right] = passing(1.0);
    assert!(
        (left / right - 1.0).abs() < 0.3,
        "both were passed: {left} {right}"
    );
}

#[test]
fn hot_walls_heat_a_moving_fluid_by_what_is_supplied() {
    let material = "density = 2\nviscosity = 0.05\nspecific_heat = 3\nconductivity = 0.02";
    let mut body = block([16, 16, 1], 2, 1.0 / 16.0, Store::Lattice, material);
    body.repeat(&[Axis::X]).expect("it fills its box");
    let fluid: Fluid = read("form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3");
    let thermal: Thermal = read("");
    let hot = HotFloor::default();
    let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
    let mut s = simulation(body, physics, vec![Box::new(hot)], 0.4);
    set(&mut s, "velocity", |[x, y, _]| {
        [0.5 + 0.2 * (TAU * y).sin(), 0.1 * (TAU * x).sin(), 0.0]
    });
    set(&mut s, "temperature", |_| [300.0]);
    to_the_end(&mut s);
    let balances = s.balances();
    let heat = &balances[1].1[0];
    assert!(heat.supplied > 0.1, "{heat:?}");
    // rounding of the stored heat
    assert!(heat.error().abs() < 1e-12 * heat.stored, "{heat:?}");
}

/// Slip walls below and above; the lower one is hot.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
struct HotFloor {
    #[serde(skip)]
    layers: Vec<(perimelt_core::world::LayerHandle, [f64; 3], f64)>,
}

#[typetag::serialize(name = "hot floor of a test")]
impl perimelt_core::Coupler for HotFloor {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, perimelt_core::SetupError> {
        use perimelt_core::{Face, keys};
        for face in [Face::YMin, Face::YMax] {
            let slip = setup.layer(0, &keys::VELOCITY, face, LayerRole::Free)?;
            self.layers.push((slip, [1.0, -1.0, 1.0], 0.0));
        }
        let hot = setup.layer(0, &keys::TEMPERATURE, Face::YMin, LayerRole::Prescribed)?;
        self.layers.push((hot, [-1.0; 3], 800.0));
        Ok(self)
    }
}

impl RunningCoupler for HotFloor {
    fn apply(&mut self, world: &World, _: perimelt_core::Step) -> Result<(), RunError> {
        for (layer, scale, offset) in &self.layers {
            world.set_layer(*layer, *scale, [*offset; 3]);
        }
        Ok(())
    }
}

#[test]
fn friction_counts_the_work_that_the_flow_loses() {
    let material = "density = 1\nviscosity = 0.1\nspecific_heat = 1\nconductivity = 1";
    for (keys, n, tolerance) in [
        // squares of gradients and the Laplacian are two sums, each with an error of second order
        ("description = 'eulerian'", 40, 0.02),
        // the flow compresses a little, and steps are forward ones
        ("form = 'conservative'", 32, 2e-3),
    ] {
        let keys = format!("{keys}\nstate.tait.sound_speed = 10\nstep = 5e-5");
        let fluid: Fluid = read(&keys);
        let thermal: Thermal = read("step = 5e-5");
        let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
        let work = WorkToHeat::default();
        let mut s = simulation(periodic(n, material), physics, vec![Box::new(work)], 0.05);
        set(&mut s, "velocity", |[_, y, _]| [(TAU * y).sin(), 0.0, 0.0]);
        set(&mut s, "temperature", |_| [300.0]);
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / (n * n) as f64;
        let kinetic =
            |s: &Simulation| mean(values(s, "velocity").iter().map(|v| 0.5 * v * v).collect());
        let before = kinetic(&s);
        run(&mut s);
        let heat = mean(values(&s, "temperature")) - 300.0;
        let lost = before - kinetic(&s);
        assert!(
            lost > 0.05 && (heat / lost - 1.0).abs() < tolerance,
            "{keys}: {heat} {lost}"
        );
    }
}

#[test]
fn friction_of_a_fluid_that_shrinks_refers_to_its_volume_at_the_start() {
    let material = "density = 1\nviscosity = 0.02\nspecific_heat = 1\nconductivity = 1e-9";
    let body = block([16, 16, 1], 2, 1.0 / 16.0, Store::Lattice, material);
    let (sound, end) = (0.06_f64, 0.3);
    let fluid: Fluid = read(&format!(
        "form = 'conservative'\nstate.tait = {{ sound_speed = {sound}, exponent = 1 }}\nstep = 1e-4"
    ));
    let thermal: Thermal = read("step = 1e-4");
    let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
    let work = WorkToHeat::default();
    let mut s = simulation(body, physics, vec![Box::new(work)], end);
    set(&mut s, "velocity", |[x, y, _]| [0.5 - x, 0.5 - y, 0.0]);
    set(&mut s, "temperature", |_| [300.0]);
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / 256.0;
    let kinetic =
        |s: &Simulation| mean(values(s, "velocity").iter().map(|v| 0.5 * v * v).collect());
    let before = kinetic(&s);
    run(&mut s);
    let density = values(&s, "density");
    assert!(mean(density.clone()) > 1.3, "it shrinks: {density:?}");
    // of the pressure c^2 (rho - 1)
    let compression = density
        .iter()
        .map(|rho| sound * sound * (rho.ln() + 1.0 / rho - 1.0));
    let lost = before - kinetic(&s) - mean(compression.collect());
    let friction = mean(values(&s, "viscous_work"));
    // forward steps leave 2e-5
    assert!(
        friction > 0.1 * before && (friction / lost - 1.0).abs() < 1e-4,
        "{friction} {lost} {before}"
    );
}

/// Viscous heating as by the coupler `viscous_heat`, which is not available in this crate.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
struct WorkToHeat {
    #[serde(skip)]
    fields: Option<(perimelt_core::Read<f64>, perimelt_core::Write<f64>)>,
    #[serde(skip)]
    seen: Vec<f64>,
}

#[typetag::serialize(name = "work to heat of a test")]
impl perimelt_core::Coupler for WorkToHeat {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, perimelt_core::SetupError> {
        use perimelt_core::keys;
        let work = setup.read(0, &keys::VISCOUS_WORK)?;
        self.fields = Some((work, setup.add(0, &keys::HEAT_SOURCE)?));
        Ok(self)
    }
}

impl RunningCoupler for WorkToHeat {
    fn apply(&mut self, world: &World, step: perimelt_core::Step) -> Result<(), RunError> {
        let (work, source) = self.fields.expect("prepared");
        let work = world.read(work);
        self.seen.resize(work.len(), 0.0);
        let mut source = world.write(source);
        for ((q, now), seen) in source.iter_mut().zip(&*work).zip(&mut self.seen) {
            if step.size > 0.0 {
                *q += (now - *seen) / step.size;
            }
            *seen = *now;
        }
        Ok(())
    }
}

#[test]
fn heat_in_a_flow_is_explicit_and_of_bonds() {
    let refusal = |mut fluid: Fluid, thermal: Thermal| -> Result<(), SetupError> {
        let material = "density = 1\nviscosity = 1\nspecific_heat = 1\nconductivity = 1";
        let mut world = World::new(vec![periodic(8, material)]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("water");
        fluid.publish(&mut setup)?;
        Box::new(fluid).prepare(&mut setup)?;
        setup.next_plugin("warmth");
        Box::new(thermal).prepare(&mut setup)?;
        Ok(())
    };
    let updated = "state.tait.sound_speed = 1";
    let eulerian = "state.tait.sound_speed = 1\ndescription = 'eulerian'";
    for (fluid, thermal, key) in [
        (eulerian, "solver = 'implicit'", "solver"),
        (updated, "form = 'second_derivatives'", "form"),
        (updated, "correction = 'point'", "correction"),
        (updated, "", ""),
        (eulerian, "", ""),
    ] {
        let refused = refusal(read(fluid), read(thermal)).err();
        assert_eq!(refused.map_or(String::new(), |e| e.key), key);
    }
}

#[test]
fn a_run_with_heat_that_is_resumed_comes_to_the_same_bits() {
    for keys in ["", "solver = 'rkl2'"] {
        let mut whole = sheared(keys, 0.4);
        whole.start().expect("starts");
        let mut half = None;
        while !whole.is_finished() {
            whole.step().expect("steps");
            if half.is_none() && whole.time() > 0.2 {
                half = Some(whole.save().expect("it can be saved"));
            }
        }
        let mut resumed = sheared(keys, 0.4);
        resumed.load(&half.expect("it was saved")).expect("its own");
        while !resumed.is_finished() {
            resumed.step().expect("steps");
        }
        for field in ["velocity", "displacement", "density", "temperature"] {
            assert_eq!(
                values(&resumed, field),
                values(&whole, field),
                "{keys} {field}"
            );
        }
    }
}
