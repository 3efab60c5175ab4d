use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use perimelt_core::body::{Body, Store};
use perimelt_core::family::{ByRules, Curved, LayerRule};
use perimelt_core::{
    Axis, Derivatives, Face, Family, FamilySpec, Horizon, Pddo, Physics, RunError, Simulation,
    SlotField,
};

use super::Fluid;
use super::rates::{LargestSums, Stability};
use super::treatments::{CompleteFamily, Treatments};
use crate::testing::{block, read, run, set, simulation, values};
use crate::thermal::Thermal;

/// A square of 1 m, periodic along both axes, with `n` points along each.
pub(super) fn periodic(n: usize, material: &str) -> Body {
    let mut body = block([n, n, 1], 2, 1.0 / n as f64, Store::Lattice, material);
    body.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    body
}

pub(super) fn flow(body: Body, keys: &str, end: f64) -> Simulation {
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
        let keys = format!(
            "description = '{description}'\nhorizon = 3.015\nstate.tait.sound_speed = 0.4\nstep = 5e-5"
        );
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
pub(super) fn ringing(keys: &str) -> f64 {
    ringing_in_a_stream(&format!("{keys}\nstep = 0.01"), 0.0)
}

/// The same in a fluid that flows with this speed, m/s.
fn ringing_in_a_stream(keys: &str, speed: f64) -> f64 {
    let keys = format!("{keys}\nstate.tait = {{ sound_speed = 1, exponent = 1 }}");
    let mut s = flow(periodic(16, "density = 1\nviscosity = 1e-9"), &keys, 20.0);
    let amplitude = 1e-6;
    set(
        &mut s,
        "pressure",
        |[x, _, _]| [amplitude * (TAU * x).cos()],
    );
    set(&mut s, "velocity", |_| [speed, 0.0, 0.0]);
    s.start().expect("starts");
    while !s.is_finished() {
        s.step().expect("steps");
    }
    let pressure = values(&s, "pressure");
    let velocity = values(&s, "velocity");
    let along = velocity.iter().step_by(3).map(|v| (v - speed).powi(2));
    let square = pressure.iter().map(|p| p * p).chain(along).sum::<f64>();
    square / (0.5 * 256.0 * amplitude * amplitude)
}

#[test]
fn a_stream_neither_amplifies_nor_damps_sound_at_the_automatic_step() {
    let schemes = ["symplectic", "kick_drift_kick"];
    let forms = ["differences", "conservative"];
    for (scheme, form) in schemes.into_iter().flat_map(|s| forms.map(|f| (s, f))) {
        let keys = format!(
            "description = 'eulerian'\nconvection = 'central'\nscheme = '{scheme}'\nform = '{form}'"
        );
        let energy = ringing_in_a_stream(&keys, 0.1);
        // values at the start of the step: more than 2
        assert!((energy - 1.0).abs() < 0.2, "{scheme}, {form}: {energy}");
    }
}

#[test]
fn sound_keeps_its_energy_but_in_the_published_scheme() {
    for keys in [
        "description = 'eulerian'",
        "description = 'eulerian'\nscheme = 'kick_drift_kick'",
        "form = 'conservative'",
        "form = 'conservative'\nscheme = 'kick_drift_kick'",
        "form = 'conservative'\ndescription = 'eulerian'",
    ] {
        let energy = ringing(keys);
        // the energy of a symplectic scheme swings by w dt
        assert!((energy - 1.0).abs() < 0.1, "{keys}: {energy}");
    }
    // 1 + (w dt)^2 in each step of energy: over 2000 steps
    assert!(ringing("description = 'eulerian'\nscheme = 'published'") > 10.0);
}

#[test]
fn an_eulerian_fluid_keeps_mass_and_momentum_in_a_periodic_box_to_rounding() {
    for form in ["differences", "conservative"] {
        let keys = format!(
            "description = 'eulerian'\nform = '{form}'\nstate.tait.sound_speed = 0.4\ndensity_diffusion = 0.1\nstep = 1e-3"
        );
        let mut s = flow(periodic(12, "density = 1000\nviscosity = 1"), &keys, 0.1);
        set(&mut s, "velocity", |[x, y, _]| {
            [0.03 * (TAU * x).sin(), 0.02 * (TAU * (x + y)).cos(), 0.0]
        });
        run(&mut s);
        let spread = values(&s, "density")
            .iter()
            .fold(0.0_f64, |m, rho| m.max((rho - 1000.0).abs()));
        assert!(spread > 1.0, "it was compressed: {spread}");
        for balance in &s.balances()[0].1 {
            assert!(balance.relative_error() < 1e-12, "{form}: {balance:?}");
        }
    }
}

#[test]
fn viscosity_that_falls_with_temperature_makes_an_uneven_shear() {
    // mu v' is constant where v does not change: with mu = 1 + sin, force-free
    let material = "density = 1\nviscosity = { temperature = [1, 3], value = [0.5, 1.5] }\nspecific_heat = 1e6\nconductivity = 1e-6";
    for form in [
        "description = 'eulerian'",
        "description = 'eulerian'\nform = 'conservative'",
        "description = 'updated_lagrangian'\nform = 'conservative'",
    ] {
        let keys = format!("{form}\nstate.tait.sound_speed = 10\nstep = 1e-5");
        let fluid: Fluid = read(&keys);
        let thermal: Thermal = read("step = 1e-5");
        let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
        let mut s = simulation(periodic(40, material), physics, Vec::new(), 1e-5);
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
                "{form}: {rate} {exact}"
            );
        }
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
        let now = x + Vector3::from_column_slice(&displacement[3 * i..3 * i + 3]);
        assert!(
            (0.0..=1.0).contains(&now.x) && (0.0..=1.0).contains(&now.y),
            "{now}"
        );
        assert!((density[i] / 2.0 - 1.0).abs() < 0.02, "{}", density[i]);
    }
    let mass = &s.balances()[0].1[0];
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
            .map(|(i, x)| x + Vector3::from_column_slice(&u[3 * i..3 * i + 3]))
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

fn positions(s: &Simulation) -> Vec<Vector3<f64>> {
    let displacement = values(s, "displacement");
    let reference = s.world().body(0).points.position.iter();
    let moved = reference.zip(displacement.chunks_exact(3));
    moved
        .map(|(x, u)| x + Vector3::from_column_slice(u))
        .collect()
}

fn velocities(s: &Simulation) -> Vec<Vector3<f64>> {
    let flat = values(s, "velocity");
    flat.chunks_exact(3)
        .map(Vector3::from_column_slice)
        .collect()
}

#[test]
fn the_conservative_form_keeps_momentum_to_rounding() {
    let keys = "form = 'conservative'\ndensity_diffusion = 0.1\nartificial_viscosity = 0.02";
    let mut s = stream(keys, 200);
    run(&mut s);
    let bent = velocities(&s).iter().map(|v| v.y.abs()).sum::<f64>() / 256.0;
    assert!(bent > 0.01, "the stream is disturbed: {bent}");
    let balances = &s.balances()[0].1;
    for balance in &balances[1..] {
        // rounding of 200 steps
        assert!(balance.relative_error() < 1e-13, "{balance:?}");
    }
}

/// A block of fluid in empty space, which turns and is pressed.
fn turning(dimension: usize, keys: &str) -> Simulation {
    let cells = [10, 8, if dimension == 3 { 6 } else { 1 }];
    let body = block(
        cells,
        dimension,
        0.1,
        Store::Lattice,
        "density = 2\nviscosity = 1e-18",
    );
    let keys = format!("form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
    let mut s = flow(body, &keys, 0.2);
    set(&mut s, "velocity", |[x, y, _]| {
        [0.3 - (y - 0.4), 0.2 + (x - 0.5), 0.0]
    });
    set(&mut s, "pressure", |[x, y, _]| [(3.0 * x).sin() + y]);
    s
}

#[test]
fn a_free_drop_keeps_momentum_and_spin_to_rounding() {
    for dimension in [2, 3] {
        let mut s = turning(
            dimension,
            "density_diffusion = 0.1\nartificial_viscosity = 0.02",
        );
        let mass: Vec<f64> = {
            s.start().expect("starts");
            let volume = &s.world().body(0).points.volume;
            let density = values(&s, "density");
            density.iter().zip(volume).map(|(rho, v)| rho * v).collect()
        };
        let totals = |s: &Simulation| {
            let points = positions(s).into_iter().zip(velocities(s)).zip(&mass);
            points.fold(
                (Vector3::zeros(), Vector3::zeros()),
                |(p, l), ((x, v), m)| (p + *m * v, l + *m * x.cross(&v)),
            )
        };
        let (before, shape) = (totals(&s), positions(&s));
        while !s.is_finished() {
            s.step().expect("steps");
        }
        let after = totals(&s);
        let distance = (positions(&s)[7] - positions(&s)[0]).norm();
        let change = (distance / (shape[7] - shape[0]).norm() - 1.0).abs();
        assert!(change > 1e-3, "it is pressed: {change}");
        // rounding of 100 steps; the size of both is 0.1
        assert!(
            (after.0 - before.0).norm() < 1e-14,
            "{dimension}D {before:?} {after:?}"
        );
        assert!(
            (after.1 - before.1).norm() < 1e-14,
            "{dimension}D {before:?} {after:?}"
        );
    }
}

#[test]
fn the_first_row_has_no_pressure_where_that_is_asked() {
    let mut s = turning(2, "surface = 'zero_pressure'");
    s.start().expect("starts");
    for _ in 0..5 {
        s.step().expect("steps");
        let (density, pressure) = (values(&s, "density"), values(&s, "pressure"));
        let mut largest = 0.0f64;
        for (i, x) in s.world().body(0).points.position.iter().enumerate() {
            if x.x < 0.1 || x.x > 0.9 || x.y < 0.1 || x.y > 0.7 {
                assert_eq!([density[i], pressure[i]], [2.0, 0.0], "at {x}");
            } else {
                largest = largest.max(pressure[i].abs());
            }
        }
        assert!(largest > 0.1, "{largest}");
    }
}

#[test]
fn a_thread_of_points_swings_along_itself() {
    // a family in a line does not tell how the fluid moves across it
    let material = "density = 2\nviscosity = 1e-18";
    let body = block([6, 1, 1], 2, 0.1, Store::Lattice, material);
    let keys = "form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3";
    let mut s = flow(body, keys, 2.0);
    set(&mut s, "velocity", |[x, _, _]| [0.5 * (x - 0.3), 0.0, 0.0]);
    s.start().expect("starts");
    let (mut longest, mut crossings, mut before) = (0.0_f64, 0, 0.0);
    while !s.is_finished() {
        s.step().expect("steps");
        let places = positions(&s);
        assert!(places.iter().all(|x| x.y == 0.05), "{places:?}");
        let stretch = (places[5].x - places[0].x) / 0.5 - 1.0;
        crossings += u32::from(stretch * before < 0.0);
        (longest, before) = (longest.max(stretch), stretch);
    }
    assert!(longest > 0.005 && longest < 0.05, "{longest}");
    assert!(
        crossings > 10,
        "it swings at the speed of sound: {crossings}"
    );
}

#[test]
fn vortices_of_the_conservative_form_decay() {
    let material = "density = 1\nviscosity = 0.1";
    let keys = "form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 5e-5";
    let mut s = flow(periodic(32, material), keys, 0.05);
    set(&mut s, "velocity", |x| taylor_green(x).map(|v| 25.0 * v));
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / 1024.0;
    let kinetic =
        |s: &Simulation| mean(values(s, "velocity").iter().map(|v| 0.5 * v * v).collect());
    let before = kinetic(&s);
    run(&mut s);
    let lost = before - kinetic(&s);
    // energy falls at 16 pi^2 nu
    let exact = before * (1.0 - (-16.0 * PI * PI * 0.1 * 0.05).exp());
    assert!((lost / exact - 1.0).abs() < 0.02, "{lost} {exact}");
}

#[test]
fn smoothing_leaves_linear_fields_as_they_are() {
    let body = block(
        [9, 7, 5],
        3,
        0.1,
        Store::Lattice,
        "density = 2\nviscosity = 1",
    );
    let spec = Pddo::spec(Horizon::Spacings(2.015));
    let family = Family::moving(&body, &spec).expect("valid");
    let complete = CompleteFamily::of(&body, &family);
    let mut treatments = Treatments::new(complete, 3);
    let place = &body.points.position;
    let linear = |x: &Vector3<f64>| 1.0 + x.x - 2.0 * x.y + 0.5 * x.z;
    let mut velocity: Vec<_> = place
        .iter()
        .map(|x| Vector3::new(linear(x), x.y, -x.x))
        .collect();
    let mut density: Vec<f64> = place.iter().map(linear).collect();
    let (v0, rho0) = (velocity.clone(), density.clone());
    let volume = &body.points.volume;
    treatments.smooth((&family, volume), &mut velocity, &mut density, |_, _| ());
    for i in 0..v0.len() {
        // rounding of a solution by four
        assert!((velocity[i] - v0[i]).norm() < 1e-12 && (density[i] - rho0[i]).abs() < 1e-12);
    }
    density[100] += 1.0;
    treatments.smooth((&family, volume), &mut velocity, &mut density, |_, _| ());
    assert!((density[100] - rho0[100]).abs() < 0.5, "a peak is smoothed");
}

/// Where all bonds have one length, its square is their mean square, whatever their weight.
#[test]
fn the_mean_square_of_nearest_neighbours_is_that_of_the_spacing() {
    for spacing in [0.1, 3.0] {
        let body = block(
            [9, 7, 1],
            2,
            spacing,
            Store::Lattice,
            "density = 2\nviscosity = 1",
        );
        let spec = Pddo::spec(Horizon::Spacings(1.015));
        let family = Family::moving(&body, &spec).expect("valid");
        let complete = CompleteFamily::of(&body, &family);
        let expected = spacing * spacing;
        assert!((complete.mean_square / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_free_surface_needs_the_conservative_form() {
    let body = block(
        [8, 8, 1],
        2,
        1.0,
        Store::Lattice,
        "density = 1\nviscosity = 1",
    );
    let mut world = perimelt_core::World::new(vec![body]);
    for (keys, key) in [
        (
            "description = 'eulerian'\nform = 'conservative'",
            "description",
        ),
        ("form = 'conservative'\nstress = 'compressible'", "stress"),
        ("description = 'eulerian'\nxsph = 0.5", "xsph"),
        ("convection = 'central'", "convection"),
        ("artificial_viscosity = -1", "artificial_viscosity"),
    ] {
        let mut setup = perimelt_core::Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("fluid");
        let mut fluid: Fluid = read(&format!("state.tait.sound_speed = 1\n{keys}"));
        let error = perimelt_core::Physics::prepare(&mut fluid, &mut setup).expect_err(keys);
        assert_eq!(error.key, key, "{error}");
    }
}

#[test]
fn a_restart_comes_to_the_same_steps() {
    let crowded = || {
        let keys = "form = 'conservative'\nstate.tait.sound_speed = 10";
        let body = periodic(16, "density = 2\nviscosity = 0.05");
        let mut s = flow(body, keys, 0.4);
        set(&mut s, "velocity", |[_, y, _]| {
            [0.5 * (TAU * y).sin(), 0.0, 0.0]
        });
        s
    };
    let mut whole = crowded();
    run(&mut whole);
    let mut resumed = crowded();
    resumed
        .load(&whole.save().expect("it can be saved"))
        .expect("its own");
    assert_eq!(resumed.stable_steps(), whole.stable_steps());
}

#[test]
fn convection_smooths_only_what_is_not_resolved() {
    let amplitude = |viscosity: f64, waves: f64, keys: &str| {
        let keys =
            format!("description = 'eulerian'\nstate.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
        let body = periodic(16, &format!("density = 1\nviscosity = {viscosity}"));
        let mut s = flow(body, &keys, 1.0);
        set(&mut s, "velocity", |[_, y, _]| {
            [
                1.0 + 0.01 * (waves * TAU * (y - 1.0 / 32.0)).cos(),
                0.0,
                0.0,
            ]
        });
        s.start().expect("starts");
        while !s.is_finished() {
            s.step().expect("steps");
        }
        let velocity = values(&s, "velocity");
        let along = velocity.iter().step_by(3).map(|v| (v - 1.0).abs() / 0.01);
        along.fold(0.0, f64::max)
    };
    let keys = ["", "convection = 'central'"];
    // speed times spacing is six times the viscosity
    let [hybrid, central] = keys.map(|keys| amplitude(0.01, 8.0, keys));
    assert_eq!(hybrid, central);
    // it is 62 times the viscosity; waves of two spacings, and of sixteen
    let [hybrid, central] = keys.map(|keys| amplitude(1e-3, 8.0, keys));
    assert!(hybrid < 0.1 && central > 0.3, "{hybrid} {central}");
    let [hybrid, central] = keys.map(|keys| amplitude(1e-3, 1.0, keys));
    assert!(
        hybrid > 0.99 * central && hybrid < central,
        "{hybrid} {central}"
    );
}

#[test]
fn a_run_that_blows_up_names_physics_field_and_point() {
    for keys in ["", "form = 'conservative'"] {
        let mut s = stream(keys, 100);
        let blown = |x: [f64; 3]| match x[0] < 0.1 && x[1] < 0.1 {
            true => [f64::INFINITY, 0.0, 0.0],
            false => [1.0, 0.0, 0.0],
        };
        set(&mut s, "velocity", blown);
        let mut result = s.start();
        while result.is_ok() && !s.is_finished() {
            result = s.step().map(|_| ());
        }
        let error = result.expect_err("nothing of it is finite");
        assert!(
            matches!(&error, RunError::BlowUp { physics, field, .. } if physics == "fluid" && field == "velocity"),
            "{keys}: {error}"
        );
    }
}

#[test]
fn the_stable_step_follows_the_arrangement_of_the_points() {
    let material = "density = 2\nviscosity = 0.05";
    let body = block([12, 12, 1], 2, 0.1, Store::Lattice, material);
    let points = body.points.len();
    let mut family = Family::moving(&body, &Pddo::spec(Horizon::Spacings(3.015))).expect("valid");
    let initial = LargestSums::of(&family, points, None);
    let stability = Stability {
        wave_number: 1.0,
        laplacian: 1.0,
    };
    // points that crowd without a change of their volumes, and points that spread
    for (scale, grows) in [(0.9, true), (1.1, false)] {
        let positions = body.points.position.iter().map(|x| x * scale);
        let positions: Vec<_> = positions.collect();
        family.follow(&positions, &body.points.volume);
        let now = stability.scaled(initial, LargestSums::of(&family, points, None));
        // the sum goes with the number of points in the horizon
        let expected = if grows { 1.1..1.35 } else { 1.0..1.0 + 1e-9 };
        assert!(expected.contains(&now.laplacian), "{scale}: {now:?}");
        assert!(
            now.wave_number >= 1.0 && grows == (now.wave_number > 1.01),
            "{now:?}"
        );
    }
}

#[test]
fn curved_layers_continue_a_parabola() {
    let material = "density = 2\nviscosity = 0.05";
    let body = block([12, 6, 1], 2, 0.1, Store::Lattice, material);
    let field = |x: f64| 1.0 + 2.0 * x + 3.0 * x * x;
    let ends = [Face::XMin, Face::XMax];
    let rule = |face| LayerRule {
        scale: [-1.0; 3],
        offset: [2.0 * field(body.face_position(face)); 3],
        ..LayerRule::even(face)
    };
    let rules = ends.map(rule);
    let spec = FamilySpec {
        layers: ends.to_vec(),
        ..Pddo::spec(Horizon::Spacings(3.015))
    };
    let family = std::sync::Arc::new(Family::build(&body, &spec).expect("valid"));
    let pddo = Pddo::build(&body, family.clone(), 2).expect("valid");
    let values: Vec<f64> = body.points.position.iter().map(|x| field(x.x)).collect();
    let (mut slots, mut laplacian) = (SlotField::default(), Vec::new());
    slots.load(&family, &values[..], Curved(ByRules(&rules, 0)));
    pddo.laplacian(&slots, &mut Derivatives::default(), &mut laplacian);
    assert!(
        laplacian.iter().all(|l| (l - 6.0).abs() < 1e-9),
        "{laplacian:?}"
    );
}
