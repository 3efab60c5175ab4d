//! Stable steps, diffusion of the density, and values that are no longer a flow.

use std::f64::consts::TAU;

use perimelt_core::body::Store;
use perimelt_core::{Axis, FactRule, Physics, RunError, Setup, Simulation, Wall, World};

use super::Fluid;
use super::run::FluidRun;
use super::tests::{flow, periodic, ringing};
use crate::testing::{block, read, set};

/// Stable step of a channel between bodies that are walls of this density, at a speed of sound of 1 m/s.
fn step_between_walls(wall_density: f64) -> f64 {
    let mut fluid_body = block(
        [12, 8, 1],
        2,
        0.1,
        Store::Lattice,
        "density = 2\nviscosity = 1e-12",
    );
    fluid_body.repeat(&[Axis::X]).expect("it fills its box");
    let wall = |name: &str, y: f64| {
        let material = format!("density = {wall_density}");
        let mut wall = block([12, 4, 1], 2, 0.1, Store::Lattice, &material);
        wall.name = name.into();
        wall.points.position.iter_mut().for_each(|x| x.y += y);
        wall
    };
    let bodies = vec![fluid_body, wall("floor", -0.4), wall("ceiling", 0.8)];
    let mut world = World::new(bodies);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("walls");
    for other in [1, 2] {
        let unread = FactRule {
            key: "fluid",
            message: "no walls",
            expected: "a fluid",
        };
        let wall = Wall {
            other,
            slip: false,
            unread,
        };
        setup.publish(0, wall).expect("free");
    }
    setup.next_plugin("fluid");
    let mut fluid: Fluid = read(
        "body = 'block'\ndescription = 'eulerian'\nconvection = 'central'\nform = 'conservative'\nstate.tait.sound_speed = 1",
    );
    fluid.publish(&mut setup).expect("the only fluid");
    let fluid = FluidRun::prepare(fluid, &mut setup).expect("walls all around");
    fluid.find_stable_step(&world)
}

#[test]
fn light_walls_shorten_the_stable_step() {
    // next to a wall that moves freely, sound is faster by the square root of 1 + rho_fluid / rho_wall
    let heavy = step_between_walls(2e12);
    for (density, ratio) in [(2.0, 1.0), (0.5, 4.0)] {
        let found = heavy / step_between_walls(density);
        let expected = f64::sqrt(1.0 + ratio);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
}

fn stable_step(n: usize, material: &str, keys: &str) -> f64 {
    let mut s = flow(periodic(n, material), keys, 1.0);
    s.start().expect("starts");
    s.stable_steps()[0].expect("a fluid has one")
}

/// Where the surface is free, derivatives on one-sided families respond more strongly: the largest frequency of 12 rows with
/// two free surfaces and 12 points along them, from the eigenvalues of the discrete divergence of the gradient.
#[test]
fn a_free_surface_shortens_the_stable_step() {
    for (horizon, frequency) in [(3.015, 1.0019), (3.6, 0.8895)] {
        let material = "density = 2\nviscosity = 1e-12";
        let mut body = block([12, 12, 1], 2, 0.1, Store::Lattice, material);
        body.repeat(&[Axis::X]).expect("it fills its box");
        let keys =
            format!("surface = 'zero_pressure'\nhorizon = {horizon}\nstate.tait.sound_speed = 30");
        let mut s = flow(body, &keys, 1.0);
        s.start().expect("starts");
        let step = s.stable_steps()[0].expect("a fluid has one");
        let found = 2.0 * 0.1 / (30.0 * step);
        assert!(
            (found / frequency - 1.0).abs() < 5e-3,
            "{horizon}: {found} {frequency}"
        );
    }
}

#[test]
fn density_diffusion_shortens_the_step_as_the_same_diffusivity_of_momentum() {
    for form in ["differences", "conservative"] {
        let step = |viscosity: f64, diffusion: f64| {
            let keys = format!(
                "form = '{form}'\nstate.tait.sound_speed = 30\ndensity_diffusion = {diffusion}"
            );
            stable_step(16, &format!("density = 2\nviscosity = {viscosity}"), &keys)
        };
        // 0.2 times the spacing and the speed of sound, m²/s
        let diffusivity = 0.2 * 30.0 / 16.0;
        let (diffused, viscous) = (step(1.0, 0.2), step(1.0 + 2.0 * diffusivity, 0.0));
        assert!(
            (diffused / viscous - 1.0).abs() < 1e-12,
            "{form}: {diffused} {viscous}"
        );
        assert!(diffused < 0.9 * step(1.0, 0.0), "{form}: {diffused}");
    }
}

#[test]
fn without_viscosity_the_stable_step_is_in_proportion_to_spacing_over_sound() {
    for keys in [
        "description = 'total_lagrangian'",
        "form = 'conservative'",
        "description = 'eulerian'\nconvection = 'central'",
        "description = 'eulerian'\nconvection = 'central'\nform = 'conservative'",
    ] {
        let step = |n: usize, sound: f64| {
            let keys = format!("{keys}\nstate.tait.sound_speed = {sound}");
            // so little viscosity that it does not count
            stable_step(n, "density = 2\nviscosity = 1e-12", &keys)
        };
        let reference = step(16, 10.0);
        for (n, sound, factor) in [(32, 10.0, 0.5), (16, 40.0, 0.25)] {
            let found = step(n, sound) / reference;
            assert!((found / factor - 1.0).abs() < 1e-9, "{keys}: {found}");
        }
    }
}

#[test]
fn density_diffusion_damps_sound_by_its_diffusivity() {
    for keys in [
        "description = 'eulerian'",
        "form = 'conservative'",
        "form = 'conservative'\ndescription = 'eulerian'",
    ] {
        let diffused = ringing(&format!("{keys}\ndensity_diffusion = 0.05"));
        // the energy of a wave falls at D k^2
        let rate = (ringing(keys) / diffused).ln() / 20.0;
        let exact = 0.05 / 16.0 * TAU * TAU;
        // the discrete Laplacian lacks 1 to 2.5 % at 16 points for a wave
        assert!((0.97..1.0).contains(&(rate / exact)), "{keys}: {rate}");
    }
}

/// A periodic fluid with the same speed (in speeds of sound) and density (in those at rest) everywhere, for a step.
fn uniform(speed: f64, density: f64) -> Result<(), RunError> {
    let (sound, rest) = (2.0, 5.0);
    let keys = format!(
        "description = 'total_lagrangian'\nstate.tait = {{ sound_speed = {sound}, exponent = 1 }}\nstep = 1e-6"
    );
    let material = format!("density = {rest}\nviscosity = 0.1");
    let mut s: Simulation = flow(periodic(12, &material), &keys, 1e-6);
    set(&mut s, "velocity", |_| [0.0, -speed * sound, 0.0]);
    set(&mut s, "pressure", |_| {
        [(density - 1.0) * sound * sound * rest]
    });
    s.start()?;
    s.step().map(|_| ())
}

#[test]
fn ten_times_the_speed_of_sound_or_the_density_at_rest_is_a_blow_up() {
    uniform(9.9, 9.9).expect("a flow, though an odd one");
    for (speed, density, blown, value) in [
        (10.1, 1.0, "velocity", -10.1 * 2.0),
        (1.0, 10.1, "density", 10.1 * 5.0),
    ] {
        let error = uniform(speed, density).expect_err("beyond the limit");
        let RunError::BlowUp {
            field, value: at, ..
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!(field, blown);
        assert!((at / value - 1.0).abs() < 1e-9, "{error}");
    }
}
