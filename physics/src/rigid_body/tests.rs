use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use perimelt_core::body::Store;
use perimelt_core::solver::Reducer;
use perimelt_core::{
    Coupler, Physics, RunError, RunningCoupler, Setup, SetupError, Simulation, Step, World, Write,
    keys,
};
use serde::{Deserialize, Serialize};

use super::RigidBody;
use super::rotation::PrincipalInertia;
use crate::testing::{block, read, run, set, simulation, values};

const STEEL: &str = "density = 8000";

/// A uniform force per volume, and impulses that differ from point to point and from step to step.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Push {
    force: [f64; 3],
    impulse: f64,
    #[serde(skip)]
    sinks: Option<[Write<Vector3<f64>>; 2]>,
}

#[typetag::serialize(name = "test_rigid_push")]
impl Coupler for Push {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let force = setup.add(0, &keys::BODY_FORCE)?;
        self.sinks = Some([force, setup.add(0, &keys::IMPULSE)?]);
        Ok(self)
    }
}

impl RunningCoupler for Push {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let [force, impulse] = self.sinks.expect("prepared");
        for f in world.write(force).iter_mut() {
            *f += Vector3::from(self.force);
        }
        for (i, j) in world.write(impulse).iter_mut().enumerate() {
            let phase = 1.3 * i as f64 + 700.0 * step.start;
            let flat = if world.body(0).dimension == 2 {
                0.0
            } else {
                1.0
            };
            let push = Vector3::new(phase.sin(), (2.0 * phase).cos(), flat * (3.0 * phase).sin());
            *j += self.impulse * push;
        }
        Ok(())
    }
}

fn rigid(cells: [usize; 3], keys: &str, push: Push, end: f64) -> Simulation {
    let dimension = if cells[2] == 1 { 2 } else { 3 };
    let body = block(cells, dimension, 0.1, Store::Lattice, STEEL);
    let physics: RigidBody = read(keys);
    simulation(body, vec![Box::new(physics)], vec![Box::new(push)], end)
}

fn vectors(s: &Simulation, field: &str) -> Vec<Vector3<f64>> {
    let values = values(s, field);
    values
        .chunks_exact(3)
        .map(Vector3::from_column_slice)
        .collect()
}

fn report(s: &Simulation, name: &str) -> f64 {
    let reports = s.reports().into_iter().flat_map(|(_, reports)| reports);
    let mut found = reports.filter(|r| r.name == format!("block.{name}"));
    found.next().expect("reported").value
}

fn worst_balance(s: &Simulation) -> f64 {
    let balances = s.balances().into_iter().flat_map(|(_, balances)| balances);
    balances.map(|b| b.relative_error()).fold(0.0, f64::max)
}

fn refusal(cells: [usize; 3], dimension: usize, keys: &str) -> String {
    let mut world = World::new(vec![block(cells, dimension, 0.1, Store::Lattice, STEEL)]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("rigid_body");
    let physics: RigidBody = read(keys);
    let error = Box::new(physics).prepare(&mut setup);
    let error = error.err().expect(keys);
    format!("{}: {error}", error.key)
}

#[test]
fn free_fall_is_exact() {
    let weight = Push {
        force: [0.0, -8000.0 * 9.81, 0.0],
        ..Push::default()
    };
    let mut s = rigid([5, 3, 1], "step = 0.013", weight, 1.3);
    run(&mut s);
    for (u, v) in vectors(&s, "displacement")
        .iter()
        .zip(vectors(&s, "velocity"))
    {
        // a hundred rounded steps
        assert!(
            (u.y + 0.5 * 9.81 * 1.69).abs() < 1e-12 && u.x.abs() < 1e-12,
            "{u}"
        );
        assert!((v.y + 9.81 * 1.3).abs() < 1e-12 && v.x.abs() < 1e-12, "{v}");
    }
    assert!(worst_balance(&s) < 1e-13);
}

/// Displacement of a damped oscillator of 1 rad/s and damping ratio 0.1, let go at 0.02 m.
fn oscillator(time: f64) -> f64 {
    let (ratio, damped) = (0.1, 0.99f64.sqrt());
    let (sine, cosine) = (damped * time).sin_cos();
    0.02 * (-ratio * time).exp() * (cosine + ratio / damped * sine)
}

#[test]
fn a_damped_spring_swings_with_an_error_of_second_order() {
    // mass 0.4 * 0.2 * 0.1 * 8000 = 64 kg
    let error = |step: f64| {
        let keys = format!("step = {step}\nspring.x = 64\ndamping.x = 12.8");
        let mut s = rigid([4, 2, 1], &keys, Push::default(), 10.0);
        set(&mut s, "displacement", |_| [0.02, 0.0, 0.0]);
        run(&mut s);
        assert!(worst_balance(&s) < 1e-12);
        (report(&s, "displacement.x") - oscillator(10.0)).abs()
    };
    let (coarse, fine) = (error(0.1), error(0.05));
    assert!(coarse < 1e-4, "{coarse}");
    assert!((coarse / fine - 4.0).abs() < 0.2, "{coarse} / {fine}");
}

#[test]
fn an_automatic_step_is_that_of_the_stiffest_spring() {
    let keys = "spring = { x = 64, y = 6400 }";
    let mut s = rigid([4, 2, 1], keys, Push::default(), 1.0);
    s.start().expect("starts");
    // safety factor 0.9 of 2 / omega = 0.2 s
    assert!((s.macro_step() - 0.18).abs() < 1e-12);
}

#[test]
fn a_block_of_cells_has_the_inertia_of_the_block() {
    let body = block([4, 6, 10], 3, 0.1, Store::Lattice, STEEL);
    let density = vec![8000.0; body.points.len()];
    let properties = super::MassProperties::of_points(
        3,
        &body.points,
        &density,
        None,
        Reducer::alone(body.points.len()),
    );
    let (a, b, c) = (0.4f64, 0.6f64, 1.0f64);
    let mass = 8000.0 * a * b * c;
    let exact = Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b) * (mass / 12.0);
    let difference = properties.inertia - Matrix3::from_diagonal(&exact);
    assert!(difference.amax() < 1e-12 * exact.amax());
    assert!((properties.centre - Vector3::new(a, b, c) / 2.0).amax() < 1e-14);
}

/// `R' = [omega]x R` with `omega = R I^-1 R^T L` by Runge and Kutta's fourth-order rule.
fn integrate_rotation(inertia: &Matrix3<f64>, spin: &Vector3<f64>, time: f64) -> Matrix3<f64> {
    let inverse = inertia.try_inverse().expect("positive");
    let rate = |r: &Matrix3<f64>| (r * inverse * r.transpose() * spin).cross_matrix() * r;
    let (mut r, steps) = (Matrix3::identity(), 20_000);
    let h = time / f64::from(steps);
    for _ in 0..steps {
        let k1 = rate(&r);
        let k2 = rate(&(r + k1 * (0.5 * h)));
        let k3 = rate(&(r + k2 * (0.5 * h)));
        let k4 = rate(&(r + k3 * h));
        r += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
    }
    r
}

#[test]
fn free_rotation_converges_to_the_equations_of_euler() {
    let turn = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1).to_rotation_matrix();
    let principal = Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.5));
    let inertia = turn.matrix() * principal * turn.matrix().transpose();
    let inertia = (inertia + inertia.transpose()) * 0.5;
    let spin = Vector3::new(0.4, 2.0, -1.5);
    let reference = integrate_rotation(&inertia, &spin, 10.0);
    let error = |steps: u32| {
        let rotation = PrincipalInertia::new(&inertia);
        let mut orientation = UnitQuaternion::identity();
        for _ in 0..steps {
            orientation = rotation.rotate(orientation, &spin, 10.0 / f64::from(steps));
        }
        (orientation.to_rotation_matrix().matrix() - reference).amax()
    };
    let (coarse, fine) = (error(400), error(800));
    assert!(coarse < 5e-3, "{coarse}");
    assert!((coarse / fine - 4.0).abs() < 0.2, "{coarse} / {fine}");
}

#[test]
fn a_tumbling_box_keeps_angular_momentum_energy_and_shape_over_many_turns() {
    // close to the axis of the middle moment, where rotation is unstable; about 500 turns
    let keys = "step = 0.02\ninitial_angular_velocity = [3.0, 0.02, 0.01]\ninitial_velocity = [0.1, 0.2, -0.3]";
    let mut s = rigid([3, 5, 2], keys, Push::default(), 1000.0);
    s.start().expect("starts");
    let before = vectors(&s, "displacement");
    let energy = report(&s, "energy.kinetic");
    let (mut early, mut late) = (0.0f64, 0.0f64);
    while !s.is_finished() {
        s.step().expect("steps");
        let error = (report(&s, "energy.kinetic") / energy - 1.0).abs();
        match s.time() < 500.0 {
            true => early = early.max(error),
            false => late = late.max(error),
        }
    }
    // of second order in the angle of a step, 0.06, and bounded
    assert!(early < 1e-3 && late < 1.05 * early, "{early} {late}");
    // 50000 steps with an error of rounding each
    assert!(worst_balance(&s) < 1e-12);
    let positions = &s.world().body(0).points.position;
    let (last, after) = (before.len() - 1, vectors(&s, "displacement"));
    let distance = |u: &[Vector3<f64>]| (positions[last] + u[last] - positions[0] - u[0]).norm();
    // the box has travelled 374 m, where the displacements of its points are rounded by up to 3e-14 m each
    assert!((distance(&after) - distance(&before)).abs() < 3e-13);
    assert!((after[0] - before[0]).norm() > 100.0);
}

/// Momentum and angular momentum about the origin from positions and velocities of points, with what cells turn.
fn momenta_of_points(s: &Simulation) -> (Vector3<f64>, Vector3<f64>) {
    let body = s.world().body(0);
    let positions = s.world().positions(0);
    let velocity = vectors(s, "velocity");
    let (mut momentum, mut angular) = (Vector3::zeros(), Vector3::zeros());
    let axes = if body.dimension == 2 { 2..3 } else { 0..3 };
    let spin = axes.fold(Vector3::zeros(), |mut spin, axis| {
        spin[axis] = report(s, &format!("angular_velocity.{}", ["x", "y", "z"][axis]));
        spin
    });
    for point in 0..positions.len() {
        let mass = 8000.0 * body.points.volume[point];
        momentum += velocity[point] * mass;
        angular += positions[point].cross(&velocity[point]) * mass;
        angular += spin * (mass * 0.01 / 6.0);
    }
    (momentum, angular)
}

#[test]
fn what_impulses_give_the_points_have() {
    for cells in [[4, 3, 1], [3, 4, 2]] {
        let push = Push {
            impulse: 40.0,
            force: [300.0, -500.0, 0.0],
            ..Push::default()
        };
        let mut s = rigid(cells, "step = 0.01", push, 2.0);
        run(&mut s);
        let moved = vectors(&s, "displacement")[0].norm();
        assert!(moved > 0.01, "{moved}");
        assert!(worst_balance(&s) < 1e-13, "{}", worst_balance(&s));
        let (momentum, angular) = momenta_of_points(&s);
        for balance in s.balances().into_iter().flat_map(|(_, balances)| balances) {
            let (quantity, axis) = balance.quantity.split_once('.').expect("an axis");
            let axis = ["x", "y", "z"]
                .iter()
                .position(|a| *a == axis)
                .expect("known");
            let points = match quantity {
                "momentum" => momentum[axis],
                _ => angular[axis],
            };
            let expected = balance.initial + balance.supplied;
            assert!(
                (points - expected).abs() < 1e-12 * balance.size,
                "{balance:?}"
            );
        }
    }
}

#[test]
fn what_is_held_stays_and_its_holder_is_counted() {
    let push = || Push {
        impulse: 40.0,
        force: [300.0, -500.0, 0.0],
        ..Push::default()
    };
    for (cells, hold) in [
        ([4, 3, 1], "hold = ['x', 'rotation']"),
        ([3, 4, 2], "hold = ['x', 'rotation_x', 'rotation_y']"),
        ([3, 4, 2], "hold = ['x', 'rotation']"),
    ] {
        let mut s = rigid(cells, &format!("step = 0.01\n{hold}"), push(), 1.0);
        run(&mut s);
        assert_eq!(report(&s, "displacement.x"), 0.0);
        assert_eq!(report(&s, "rotation.z") == 0.0, hold.contains("'rotation'"));
        assert!(report(&s, "displacement.y") < -1e-3);
        assert!(worst_balance(&s) < 1e-12, "{hold}");
    }
}

#[test]
fn a_driven_body_has_the_displacement_and_velocity_prescribed() {
    let keys = "step = 0.01\n\
        driven.y.sine = { amplitude = 0.05, frequency = 1.5, phase = 0.25 }\n\
        driven.x.displacement = { time = [0, 0.5, 1], value = [0, 0.2, 0.1] }\n\
        driven.rotation.velocity = { time = [0, 1], value = [0, 3] }";
    let mut s = rigid(
        [4, 3, 1],
        keys,
        Push {
            impulse: 40.0,
            ..Push::default()
        },
        0.73,
    );
    s.start().expect("starts");
    assert_eq!(report(&s, "velocity.x"), 0.4);
    while !s.is_finished() {
        s.step().expect("steps");
    }
    let phase = std::f64::consts::TAU * 1.5 * 0.73 + 0.25;
    for (name, exact) in [
        ("displacement.y", 0.05 * phase.sin()),
        (
            "velocity.y",
            0.05 * std::f64::consts::TAU * 1.5 * phase.cos(),
        ),
        ("displacement.x", 0.2 - 0.2 * 0.23),
        ("velocity.x", -0.2),
        ("angular_velocity.z", 3.0 * 0.73),
        ("rotation.z", 1.5 * 0.73 * 0.73),
    ] {
        let value = report(&s, name);
        // times are sums of rounded steps
        assert!(
            (value - exact).abs() < 1e-11,
            "{name}: {value} instead of {exact}"
        );
    }
    assert!(worst_balance(&s) < 1e-12);
}

#[test]
fn the_initial_motion_is_fitted_to_the_initial_fields() {
    let mut s = rigid([4, 3, 1], "step = 0.1", Push::default(), 1.0);
    let centre = Vector3::new(0.2, 0.15, 0.0);
    let (sine, cosine) = 0.4f64.sin_cos();
    let turned = move |x: [f64; 3]| {
        let a = Vector3::from(x) - centre;
        Vector3::new(cosine * a.x - sine * a.y, sine * a.x + cosine * a.y, 0.0)
    };
    set(&mut s, "displacement", move |x| {
        let b = turned(x) + centre;
        [b.x - x[0] + 0.03, b.y - x[1], 0.0]
    });
    set(&mut s, "velocity", move |x| {
        let b = turned(x);
        [0.5 - 2.0 * b.y, 2.0 * b.x, 0.0]
    });
    s.start().expect("starts");
    for (name, exact) in [
        ("displacement.x", 0.03),
        ("rotation.z", 0.4),
        ("velocity.x", 0.5),
        ("velocity.y", 0.0),
        ("angular_velocity.z", 2.0),
    ] {
        assert!((report(&s, name) - exact).abs() < 1e-14, "{name}");
    }
    let mut s = rigid([4, 3, 1], "step = 0.1", Push::default(), 1.0);
    set(&mut s, "displacement", |x| [0.1 * x[0], 0.0, 0.0]);
    let error = s.start().expect_err("a stretch is not rigid").to_string();
    assert!(error.contains("is not rigid: point 0 lies"), "{error}");
}

#[test]
fn a_resumed_run_has_the_same_bits() {
    let keys = "step = 0.01\nspring.y = 500\ninitial_angular_velocity = [3.0, 0.2, 0.1]";
    let make = || {
        rigid(
            [3, 5, 2],
            keys,
            Push {
                impulse: 40.0,
                ..Push::default()
            },
            1.0,
        )
    };
    let mut straight = make();
    straight.start().expect("starts");
    let mut saved = Vec::new();
    while !straight.is_finished() {
        straight.step().expect("steps");
        if saved.is_empty() && straight.time() > 0.5 {
            saved = straight.save().expect("saves");
        }
    }
    let mut resumed = make();
    resumed.load(&saved).expect("loads");
    while !resumed.is_finished() {
        resumed.step().expect("steps");
    }
    for field in ["displacement", "velocity"] {
        assert_eq!(values(&straight, field), values(&resumed, field));
    }
    assert_eq!(straight.reports(), resumed.reports());
    assert_eq!(straight.balances(), resumed.balances());
}

#[test]
fn the_force_is_the_mean_between_logged_states() {
    let push = Push {
        impulse: 40.0,
        ..Push::default()
    };
    let mut s = rigid([4, 3, 1], "step = 0.01", push, 1.0);
    run(&mut s);
    let momentum = s.balances()[0].1[0].clone();
    assert_eq!(momentum.quantity, "momentum.x");
    assert!((report(&s, "force.x") - momentum.stored).abs() < 1e-12 * momentum.size);
}

#[test]
fn mistakes_are_explained() {
    let (flat, solid) = (([4, 3, 1], 2), ([4, 3, 2], 3));
    for ((cells, dimension), keys, message) in [
        (([4, 1, 1], 1), "", "body: a 1D body cannot move"),
        (flat, "mass = -1", "mass: `mass` is -1"),
        (
            flat,
            "inertia = [1, 2, 3]",
            "inertia: a 2D body rotates about z only",
        ),
        (solid, "inertia = 3", "inertia: one number does not give"),
        (
            solid,
            "inertia = [[1, 2, 0], [0, 1, 0], [0, 0, 1]]",
            "not symmetric",
        ),
        (
            solid,
            "inertia = [1, -1, 1]",
            "principal moment is not positive",
        ),
        (
            flat,
            "hold = ['z']",
            "hold: a 2D body has no degree of freedom Z",
        ),
        (solid, "hold = ['rotation_x']", "held about one axis only"),
        (
            flat,
            "hold = ['x']\ndriven.x.velocity = 1",
            "driven.x: the degree of freedom is held and driven",
        ),
        (
            solid,
            "driven.rotation.velocity = 1",
            "driven.rotation: a 3D body that rotates freely",
        ),
        (
            flat,
            "hold = ['x']\nspring.x = 1",
            "spring.x: a spring or dashpot has no effect",
        ),
        (flat, "damping.x = -1", "damping.x: `damping.x` is -1"),
        (
            flat,
            "spring.z = 1",
            "spring.z: a 2D body has no degree of freedom z",
        ),
        (
            flat,
            "hold = ['x']\ninitial_velocity = [1, 0, 0]",
            "initial_velocity: the body cannot move",
        ),
        (
            solid,
            "initial_angular_velocity = 1",
            "wrong number of components",
        ),
    ] {
        let refused = refusal(cells, dimension, keys);
        assert!(refused.contains(message), "{keys}: {refused}");
    }
}
