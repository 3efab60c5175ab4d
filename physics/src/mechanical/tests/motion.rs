//! Forces, kinematics and explicit motion of the three formulations.

use perimelt_core::body::Store;

use super::super::Mechanical;
use super::{CELLS, Evaluated, FORMULATIONS, STEEL, affine, evaluate, solid};
use crate::testing::{block, read, run, set, simulation, values};

const STAGGERED: &str = "formulation = 'staggered'";

/// Wang (2025), 4.3.4: a square bar that is released from a strain along its axis moves alike along y and z.
#[test]
fn a_square_bar_moves_alike_along_both_of_its_sides() {
    let cells = [12, 6, 6];
    for formulation in FORMULATIONS {
        let keys = format!("{formulation}\nsolver.explicit = {{}}\nkinematics = \"finite\"");
        let mut s = solid(cells, &keys, 0.0, 2e-6);
        set(&mut s, "displacement", |[x, ..]| [1e-3 * x, 0.0, 0.0]);
        run(&mut s);
        let u = values(&s, "displacement");
        let at = |i: usize, j: usize, k: usize| 3 * ((k * cells[1] + j) * cells[0] + i);
        let largest = u
            .iter()
            .skip(1)
            .step_by(3)
            .fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(largest > 1e-8, "it moves");
        for (i, j, k) in (0..12).flat_map(|i| (0..36).map(move |n| (i, n / 6, n % 6))) {
            let apart = (u[at(i, j, k) + 1] - u[at(i, k, j) + 2]).abs();
            // rounding of some hundred steps; the benchmark asks for 1e-9 m
            assert!(
                apart < 1e-10 * largest,
                "{formulation} {i} {j} {k}: {apart:e}"
            );
        }
    }
}

#[test]
fn a_rigid_rotation_meets_no_force_under_finite_kinematics() {
    let (sin, cos) = 0.7f64.sin_cos();
    let rotation = affine([[cos - 1.0, -sin, 0.0], [sin, cos - 1.0, 0.0], [0.0; 3]]);
    for cells in &CELLS[1..] {
        for formulation in FORMULATIONS.into_iter().chain([STAGGERED]) {
            let keys = format!("kinematics = \"finite\"\n{formulation}");
            let evaluated = evaluate(*cells, &keys, &rotation);
            // stress of a strain of one bit: 2e11 Pa 1e-16 over a spacing, and some bonds to sum
            let largest = evaluated.force.iter().fold(0.0f64, |s, f| s.max(f.abs()));
            assert!(
                largest < 2e11 * 1e-16 / 1e-3 * 300.0,
                "{cells:?} {keys}: {largest}"
            );
            // the energy of the modes without strain is a difference of sums: squares of strains
            assert!(
                evaluated.energy.iter().all(|[w, _]| *w < 1e-15 * 2e11),
                "{cells:?} {keys}"
            );
        }
    }
}

#[test]
fn both_kinematics_agree_for_small_strains() {
    let displacement = |[x, y, z]: [f64; 3]| [1e-9 * (300.0 * y).sin(), 2e-7 * x, 1e-7 * z * x];
    for formulation in FORMULATIONS.into_iter().chain([STAGGERED]) {
        let linear = evaluate(CELLS[2], formulation, displacement).force;
        let keys = format!("kinematics = \"finite\"\n{formulation}");
        let finite = evaluate(CELLS[2], &keys, displacement).force;
        let scale = linear.iter().fold(0.0f64, |s, f| s.max(f.abs()));
        // second order in strains of 1e-6
        let same = linear
            .iter()
            .zip(&finite)
            .all(|(l, f)| (l - f).abs() < 1e-5 * scale);
        assert!(same, "{formulation}");
    }
}

/// Force is minus the derivative of the energy, also at surfaces, so momentum and energy are kept.
#[test]
fn forces_are_the_derivative_of_the_energy_and_cancel() {
    let cells = [7, 6, 5];
    let displacement = |size: f64| {
        move |[x, y, z]: [f64; 3]| {
            [
                1e-6 * (900.0 * y).sin() + size * (2000.0 * x).cos(),
                2e-4 * x + size * (1500.0 * z).sin(),
                0.1 * z * x,
            ]
        }
    };
    for formulation in FORMULATIONS {
        for kinematics in ["linear", "finite"] {
            let keys = format!("{formulation}\nkinematics = \"{kinematics}\"\nhorizon = 2");
            let at = |size: f64| evaluate(cells, &keys, displacement(size));
            let total = |e: &Evaluated| e.energy.iter().map(|[w, _]| w).sum::<f64>();
            let (size, middle) = (1e-8, at(0.0));
            let slope = (total(&at(size)) - total(&at(-size))) / (2.0 * size);
            let body = block(cells, 3, 1e-3, Store::Lattice, STEEL);
            let power: f64 = body
                .points
                .position
                .iter()
                .zip(middle.force.chunks_exact(3))
                .map(|(x, f)| f[0] * (2000.0 * x.x).cos() + f[1] * (1500.0 * x.z).sin())
                .sum();
            // third order in the size for finite kinematics, rounding of the difference
            let error = (slope + power).abs() / power.abs();
            assert!(error < 1e-6, "{keys}: {slope} {power}");
            let scale: f64 = middle.force.iter().map(|f| f.abs()).sum();
            for axis in 0..3 {
                let sum: f64 = middle.force.iter().skip(axis).step_by(3).sum();
                assert!(sum.abs() < 1e-13 * scale, "{keys}: momentum along {axis}");
            }
        }
    }
}

#[test]
fn free_vibration_keeps_momentum_and_energy_and_has_the_classical_wave_speed() {
    for formulation in ["bond", "staggered"] {
        free_vibration(&format!("formulation = '{formulation}'"));
    }
}

fn free_vibration(formulation: &str) {
    let length = 0.1;
    let body = block([100, 1, 1], 1, 1e-3, Store::Lattice, STEEL);
    let wave_speed = (2e11f64 / 8000.0).sqrt();
    let period = 2.0 * length / wave_speed;
    let keys = format!("{formulation}\nsolver.explicit = {{}}\nstep = 2e-8");
    let mut s = simulation(
        body,
        vec![Box::new(read::<Mechanical>(&keys))],
        vec![],
        period,
    );
    set(&mut s, "displacement", |[x, ..]| {
        [1e-6 * (std::f64::consts::PI * x / length).cos(), 0.0, 0.0]
    });
    run(&mut s);
    let u = values(&s, "displacement");
    // after a period of the first free-free mode the bar is back; the mode is nearly at rest
    // there, so an error of 1 % in speed shows as (2 pi 0.01)^2 / 2 in amplitude
    assert!((u[0] / 1e-6 - 1.0).abs() < 0.01, "{}", u[0]);
    let velocity = values(&s, "velocity");
    // an error in speed by d leaves a velocity of amplitude * omega * 2 pi d
    let omega = 2.0 * std::f64::consts::PI / period;
    assert!(
        velocity[0].abs() < 1e-6 * omega * 2.0 * std::f64::consts::PI * 0.02,
        "{}",
        velocity[0]
    );
    let momentum = &s.balances()[0].1[0];
    let scale = 8000.0 * 1e-6 * omega * length * 0.1;
    assert!(momentum.stored.abs() < 1e-10 * scale, "{momentum:?}");
}

#[test]
fn the_stable_step_is_stable_and_not_much_too_small() {
    let formulations = FORMULATIONS.into_iter().chain([STAGGERED]);
    for (cells, formulation) in formulations.flat_map(|f| CELLS.map(|c| (c, f))) {
        for factor in [1.0, 2.2] {
            let keys = format!("solver.explicit = {{}}\n{formulation}");
            let mut s = solid(cells, &keys, 1e-4, 1.0);
            s.start().expect("starts");
            let stable = s.stable_steps()[0].expect("explicit motion has a limit");
            let keys = format!("{keys}\nstep = {}", factor * stable);
            let mut s = solid(cells, &keys, 1e-4, 2000.0 * stable);
            s.start().expect("starts");
            let mut outcome = Ok(false);
            while outcome.is_ok() && !s.is_finished() {
                outcome = s.step();
            }
            assert_eq!(
                outcome.is_ok(),
                factor == 1.0,
                "{cells:?} {formulation} {factor}"
            );
            if let Err(error) = outcome {
                assert!(error.to_string().contains("blew up"), "{error}");
            }
        }
    }
}
