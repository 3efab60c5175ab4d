use std::f64::consts::{PI, TAU};

use perimelt_core::body::{Body, Store};
use perimelt_core::{Axis, Simulation};

use super::Fluid;
use crate::testing::{block, read, run, set, simulation, values};

/// A square of 1 m, periodic along both axes, with `n` points along each.
fn periodic(n: usize, material: &str) -> Body {
    let mut body = block([n, n, 1], 2, 1.0 / n as f64, Store::Lattice, material);
    body.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    body
}

fn flow(body: Body, keys: &str, end: f64) -> Simulation {
    let fluid: Fluid = read(keys);
    simulation(body, vec![Box::new(fluid)], Vec::new(), end)
}

fn taylor_green([x, y, _]: [f64; 3]) -> [f64; 3] {
    let v = 0.04;
    [
        -v * (TAU * x).cos() * (TAU * y).sin(),
        v * (TAU * x).sin() * (TAU * y).cos(),
        0.0,
    ]
}

/// Spec 05, gao-5.5.4: the discrete operator lets vortices of 40 points a side decay at 0.985262 times
/// the rate 8 pi^2.
#[test]
fn vortices_decay_at_the_rate_of_the_discrete_operator() {
    for (description, tolerance) in [
        ("total_lagrangian", 2e-4),
        ("eulerian", 2e-3),
        ("updated_lagrangian", 4e-3),
    ] {
        let keys =
            format!("description = '{description}'\nstate.tait.sound_speed = 0.4\nstep = 5e-5");
        let body = periodic(40, "density = 1\nviscosity = 1");
        let mut s = flow(body, &keys, 0.01);
        set(&mut s, "velocity", taylor_green);
        let before = values(&s, "velocity");
        run(&mut s);
        let after = values(&s, "velocity");
        // forward steps
        let steps = 200;
        let expected = (1.0 - 0.985262 * 8.0 * PI * PI * 0.01 / f64::from(steps)).powi(steps);
        for (v0, v) in before.iter().zip(&after) {
            // convection and its pressure are left over in the Eulerian description, and the way of the points
            // in the updated Lagrangian one
            assert!(
                (v - expected * v0).abs() < tolerance * 0.04,
                "{description}: {v} {v0}"
            );
        }
    }
}

/// Energy of sound over its energy at the start, after 20 periods of a standing wave.
fn ringing(scheme: &str) -> f64 {
    let keys = format!(
        "description = 'eulerian'\nscheme = '{scheme}'\nstate.tait = {{ sound_speed = 1, exponent = 1 }}\nstep = 0.01"
    );
    let mut s = flow(periodic(16, "density = 1\nviscosity = 1e-9"), &keys, 20.0);
    let amplitude = 1e-6;
    set(
        &mut s,
        "pressure",
        |[x, _, _]| [amplitude * (TAU * x).cos()],
    );
    run(&mut s);
    let square = |field: &str| values(&s, field).iter().map(|v| v * v).sum::<f64>();
    (square("pressure") + square("velocity")) / (0.5 * 256.0 * amplitude * amplitude)
}

#[test]
fn sound_keeps_its_energy_but_in_the_published_scheme() {
    for scheme in ["symplectic", "kick_drift_kick"] {
        let energy = ringing(scheme);
        // the energy of a symplectic scheme swings by w dt
        assert!((energy - 1.0).abs() < 0.1, "{scheme}: {energy}");
    }
    // 1 + (w dt)^2 in each step of energy: over 2000 steps
    assert!(ringing("published") > 10.0);
}

#[test]
fn mass_in_a_periodic_box_is_kept_to_rounding() {
    let keys = "description = 'eulerian'\nstate.tait.sound_speed = 0.4\ndensity_diffusion = 0.1\nstep = 1e-3";
    let mut s = flow(periodic(12, "density = 1000\nviscosity = 1"), keys, 0.1);
    set(&mut s, "velocity", |[x, y, _]| {
        [0.03 * (TAU * x).sin(), 0.02 * (TAU * (x + y)).cos(), 0.0]
    });
    run(&mut s);
    let mass = values(&s, "density").iter().sum::<f64>() / 144.0;
    let spread = values(&s, "density")
        .iter()
        .fold(0.0_f64, |m, rho| m.max((rho - 1000.0).abs()));
    assert!((mass - 1000.0).abs() < 1e-11 * 1000.0, "{mass}");
    assert!(spread > 1.0, "it was compressed: {spread}");
}

#[test]
fn temperature_is_carried_along_and_conducted() {
    let material = "density = 1\nviscosity = 1\nspecific_heat = 1\nconductivity = 0.05";
    let (end, v) = (0.25, 1.0);
    for (description, carried) in [("eulerian", true), ("total_lagrangian", false)] {
        let keys = format!(
            "description = '{description}'\nstate.tait.sound_speed = 10\nenergy = {{}}\nstep = 1e-4"
        );
        let mut s = flow(periodic(40, material), &keys, end);
        set(&mut s, "velocity", |_| [v, 0.0, 0.0]);
        set(&mut s, "temperature", |[x, _, _]| [2.0 + (TAU * x).sin()]);
        run(&mut s);
        let places = s.world().body(0).points.position.clone();
        let decay = (-0.05 * TAU * TAU * end).exp();
        for (x, t) in places.iter().zip(values(&s, "temperature")) {
            let moved = if carried { v * end } else { 0.0 };
            let exact = 2.0 + decay * (TAU * (x.x - moved)).sin();
            // 1.5 % of the rate at 40 points, and a phase error of the gradient
            assert!(
                (t - exact).abs() < 0.03,
                "{description} at {x}: {t} {exact}"
            );
        }
    }
}

#[test]
fn friction_heats_by_what_the_flow_loses() {
    let material = "density = 1\nviscosity = 0.1\nspecific_heat = 1\nconductivity = 1";
    let keys = "description = 'eulerian'\nstate.tait.sound_speed = 10\nenergy.dissipation = true\nstep = 5e-5";
    let mut s = flow(periodic(40, material), keys, 0.05);
    set(&mut s, "velocity", |[_, y, _]| [(TAU * y).sin(), 0.0, 0.0]);
    set(&mut s, "temperature", |_| [300.0]);
    let kinetic = |s: &Simulation| {
        values(s, "velocity")
            .iter()
            .map(|v| 0.5 * v * v)
            .sum::<f64>()
            / 1600.0
    };
    let before = kinetic(&s);
    run(&mut s);
    let heat = values(&s, "temperature")
        .iter()
        .map(|t| t - 300.0)
        .sum::<f64>()
        / 1600.0;
    let lost = before - kinetic(&s);
    // squares of gradients and the Laplacian are two sums, each with an error of second order
    assert!(
        lost > 0.05 && (heat / lost - 1.0).abs() < 0.02,
        "{heat} {lost}"
    );
}

#[test]
fn viscosity_that_falls_with_temperature_makes_an_uneven_shear() {
    // mu v' is constant where v does not change: with mu = 1 + sin, force-free
    let material = "density = 1\nviscosity = { temperature = [1, 3], value = [0.5, 1.5] }\nspecific_heat = 1e6\nconductivity = 1e-6";
    let keys = "description = 'eulerian'\nstate.tait.sound_speed = 10\nenergy = {}\nstep = 1e-5";
    let mut s = flow(periodic(40, material), keys, 1e-5);
    set(&mut s, "temperature", |[_, y, _]| [2.0 + (TAU * y).sin()]);
    set(&mut s, "velocity", |[_, y, _]| {
        [1e-3 * (TAU * y).cos(), 0.0, 0.0]
    });
    let before = values(&s, "velocity");
    run(&mut s);
    let places = s.world().body(0).points.position.clone();
    let after = values(&s, "velocity");
    for (i, x) in places.iter().enumerate() {
        let rate = (after[3 * i] - before[3 * i]) / 1e-5;
        // (mu v')' with mu = 1 + 0.5 sin(2 pi y)
        let exact = -1e-3
            * TAU
            * TAU
            * ((TAU * x.y).cos() * (1.0 + 0.5 * (TAU * x.y).sin())
                + 0.5 * (TAU * x.y).cos() * (TAU * x.y).sin());
        assert!(
            (rate - exact).abs() < 0.03 * 1e-3 * TAU * TAU * 1.5,
            "{rate} {exact}"
        );
    }
}

#[test]
fn a_face_without_a_wall_is_refused() {
    let mut body = block(
        [8, 8, 1],
        2,
        1.0,
        Store::Lattice,
        "density = 1\nviscosity = 1",
    );
    body.repeat(&[Axis::X]).expect("it fills its box");
    let mut world = perimelt_core::World::new(vec![body]);
    let mut setup = perimelt_core::Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("fluid");
    let mut fluid: Fluid = read("description = 'eulerian'\nstate.tait.sound_speed = 1");
    let error = perimelt_core::Physics::prepare(&mut fluid, &mut setup).expect_err("y is open");
    assert!(error.to_string().contains("`y-`"), "{error}");
}

/// Points of an updated Lagrangian fluid in a stream along x, with a disturbance, for `steps` of 2 ms.
fn stream(keys: &str, steps: u32) -> Simulation {
    let keys = format!("state.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
    let mut s = flow(
        periodic(16, "density = 2\nviscosity = 0.05"),
        &keys,
        f64::from(steps) * 2e-3,
    );
    set(&mut s, "velocity", |[x, y, _]| {
        [1.0 + 0.2 * (TAU * y).sin(), 0.2 * (TAU * x).sin(), 0.0]
    });
    s
}

#[test]
fn points_carry_their_mass_through_a_periodic_side() {
    let mut s = stream("shifting = 0.05", 400);
    run(&mut s);
    let places = s.world().body(0).points.position.clone();
    let displacement = values(&s, "displacement");
    let density = values(&s, "density");
    let momentum: f64 = values(&s, "velocity").iter().step_by(3).sum::<f64>() / 256.0;
    // a stream is uniform in the end, with the momentum of the start
    assert!((momentum - 1.0).abs() < 2e-3, "{momentum}");
    for (i, x) in places.iter().enumerate() {
        let now = x + nalgebra::Vector3::from_column_slice(&displacement[3 * i..3 * i + 3]);
        assert!(
            (0.0..=1.0).contains(&now.x) && (0.0..=1.0).contains(&now.y),
            "{now}"
        );
        assert!((density[i] / 2.0 - 1.0).abs() < 0.02, "{}", density[i]);
    }
    let [mass] = &s.balances()[0].1[..] else {
        panic!("one balance")
    };
    assert_eq!(mass.stored, mass.initial);
}

#[test]
fn shifting_keeps_points_apart() {
    let nearest = |keys: &str| {
        let mut s = stream(keys, 400);
        run(&mut s);
        let u = values(&s, "displacement");
        let places = &s.world().body(0).points.position;
        let now: Vec<_> = places
            .iter()
            .enumerate()
            .map(|(i, x)| x + nalgebra::Vector3::from_column_slice(&u[3 * i..3 * i + 3]))
            .collect();
        let mut nearest = f64::INFINITY;
        for (i, a) in now.iter().enumerate() {
            for b in &now[..i] {
                nearest = nearest.min((a - b).norm());
            }
        }
        16.0 * nearest
    };
    let (plain, shifted) = (nearest(""), nearest("shifting = 0.05"));
    assert!(
        shifted > 0.72 && shifted > plain + 0.02,
        "{shifted} {plain}"
    );
}
