use perimelt_core::body::Store;
use perimelt_core::simulation::Simulation;
use perimelt_core::{Coupler, RunError, Setup, SetupError, Step, World, Write, keys};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use super::bond::bulk_modulus;
use crate::testing::{block, read, run, set, simulation, values};

const STEEL: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.25";
const CELLS: [[usize; 3]; 3] = [[30, 1, 1], [22, 20, 1], [14, 13, 12]];

/// A uniform eigenstrain, such as a uniform temperature gives.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Swelling {
    strain: f64,
    #[serde(skip)]
    eigenstrain: Option<Write<f64>>,
}

#[typetag::serde(name = "test_swelling")]
impl Coupler for Swelling {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        self.eigenstrain = Some(setup.add(0, &keys::EIGENSTRAIN)?);
        Ok(())
    }

    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        let field = self.eigenstrain.expect("prepared");
        world
            .write(field)
            .iter_mut()
            .for_each(|e| *e += self.strain);
        Ok(())
    }
}

fn solid(cells: [usize; 3], keys: &str, strain: f64, end: f64) -> Simulation {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let body = block(cells, dimension, 1e-3, Store::Lattice, STEEL);
    let mechanical: Mechanical = read(keys);
    let swelling = Swelling {
        strain,
        ..Swelling::default()
    };
    simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(swelling)],
        end,
    )
}

/// The operator of a block, loaded with a displacement; forces and energies of all points.
fn evaluate(
    cells: [usize; 3],
    keys: &str,
    displacement: impl Fn([f64; 3]) -> [f64; 3],
) -> (Vec<f64>, Vec<[f64; 2]>, Vec<[f64; 6]>) {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let body = block(cells, dimension, 1e-3, Store::Lattice, STEEL);
    let mut mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    perimelt_core::Physics::prepare(&mut mechanical, &mut setup).expect("valid");
    let elastic = &mut mechanical.run.as_mut().expect("prepared").elastic;
    let points = &world.body(0).points;
    let u: Vec<f64> = points
        .position
        .iter()
        .flat_map(|x| displacement((*x).into()))
        .collect();
    elastic.set_displacement(&u, &[]);
    let mut force = vec![0.0; u.len()];
    elastic.force(&mut force);
    let energy = elastic.energy().to_vec();
    let stress = elastic.stress().to_vec();
    (force, energy, stress)
}

#[test]
fn isotropic_strain_reproduces_the_classical_energy_also_at_bare_surfaces() {
    for cells in CELLS {
        let dimension = cells.iter().filter(|c| **c > 1).count();
        for rule in ["none", "half", "full"] {
            let keys = format!("horizon = 2\npartial_volume = \"{rule}\"");
            let along = |axes: std::ops::Range<usize>| {
                move |x: [f64; 3]| {
                    std::array::from_fn(|a| if axes.contains(&a) { 1e-4 * x[a] } else { 0.0 })
                }
            };
            let (_, energy, stress) = evaluate(cells, &keys, along(0..dimension));
            let over_bulk = (dimension * dimension) as f64;
            let exact = 0.5 * over_bulk * bulk_modulus(dimension) * 2e11 * 1e-8;
            let middle = cells.map(|c| c / 2);
            let i = (middle[2] * cells[1] + middle[1]) * cells[0] + middle[0];
            let error = (energy[i][0] / exact - 1.0).abs();
            assert!(error < 1e-12, "inside, {cells:?} {rule}: {error}");
            let pressure = dimension as f64 * bulk_modulus(dimension) * 2e11 * 1e-4;
            for (component, sigma) in stress[i].iter().enumerate() {
                let exact = if component < dimension { pressure } else { 0.0 };
                let error = (sigma - exact).abs() / pressure;
                assert!(
                    error < 1e-12,
                    "stress {component}, {cells:?} {rule}: {error}"
                );
            }
            let worst = |energy: &[[f64; 2]]| {
                energy
                    .iter()
                    .map(|[w, _]| (w / exact - 1.0).abs())
                    .fold(0.0, f64::max)
            };
            // the mean of the factors at both ends of a bond repairs most, not all
            let bare = format!("{keys}\ncorrection = \"lattice\"");
            let (_, uncorrected, _) = evaluate(cells, &bare, along(0..dimension));
            let (worst, bare) = (worst(&energy), worst(&uncorrected));
            assert!(
                worst < 0.5 * bare,
                "surface, {cells:?} {rule}: {worst} {bare}"
            );
            // uniaxial strain is off by the anisotropy of the lattice: spec 02, 1.3, E_eff / E over
            // k_eff / k at two spacings
            let ratio = match (dimension, rule) {
                (1, _) => 1.0,
                (2, "none") => 1.18001 / 1.05382,
                (2, "half") => 0.86170 / 0.81508,
                (2, _) => 1.11718 / 1.09687,
                _ => continue,
            };
            let exact = 0.5 * [1.0, 9.0 / 8.0][dimension - 1] * 2e11 * 1e-8;
            for axis in 0..dimension {
                let (_, energy, _) = evaluate(cells, &keys, along(axis..axis + 1));
                let error = (energy[i][0] / exact / ratio - 1.0).abs();
                // the table has six digits
                assert!(error < 1e-5, "uniaxial, {cells:?} {rule}: {error}");
            }
        }
    }
}

#[test]
fn a_rigid_rotation_meets_no_force_under_finite_kinematics() {
    let (sin, cos) = 0.7f64.sin_cos();
    for cells in &CELLS[1..] {
        let (force, energy, _) = evaluate(*cells, "kinematics = \"finite\"", |[x, y, _]| {
            [cos * x - sin * y - x, sin * x + cos * y - y, 0.0]
        });
        // stress of a strain of one bit: 2e11 Pa 1e-16 over a spacing, and some bonds to sum
        assert!(force.iter().all(|f| f.abs() < 2e11 * 1e-16 / 1e-3 * 300.0));
        assert!(energy.iter().all(|[w, _]| *w < 1e-18 * 2e11));
    }
}

#[test]
fn both_kinematics_agree_for_small_strains() {
    let displacement = |[x, y, z]: [f64; 3]| [1e-9 * (300.0 * y).sin(), 2e-7 * x, 1e-7 * z * x];
    let (linear, ..) = evaluate(CELLS[2], "", displacement);
    let (finite, ..) = evaluate(CELLS[2], "kinematics = \"finite\"", displacement);
    let scale = linear.iter().fold(0.0f64, |s, f| s.max(f.abs()));
    // second order in strains of 1e-6
    assert!(
        linear
            .iter()
            .zip(&finite)
            .all(|(l, f)| (l - f).abs() < 1e-5 * scale)
    );
}

#[test]
fn a_free_body_swells_without_stress_by_every_solver() {
    let tight = "solver.relaxation = { relative_tolerance = 1e-12 }";
    for cells in CELLS {
        for keys in [
            "",
            "correction = \"none\"",
            "solver.quasi_static = { tolerance = 1e-12 }",
            tight,
        ] {
            let mut s = solid(cells, keys, 1e-3, 1.0);
            run(&mut s);
            let u = values(&s, "displacement");
            let positions = &s.world().body(0).points.position;
            let dimension = s.world().body(0).dimension;
            let last = positions.len() - 1;
            for axis in 0..dimension {
                let span = positions[last][axis] - positions[0][axis];
                let swelling = (u[3 * last + axis] - u[axis]) / span;
                assert!(
                    (swelling / 1e-3 - 1.0).abs() < 1e-6,
                    "{cells:?} {keys} {axis}: {swelling}"
                );
            }
            assert!(
                u.iter()
                    .enumerate()
                    .all(|(i, u)| i % 3 < dimension || *u == 0.0)
            );
            // against the stress of the same strain held back
            let stress = values(&s, "stress");
            assert!(stress.iter().all(|p| p.abs() < 1e-5 * 2e11 * 1e-3));
        }
    }
}

#[test]
fn a_block_one_point_thick_is_refused_in_words() {
    let body = block([8, 8, 1], 3, 1e-3, Store::Lattice, STEEL);
    let mechanical: Mechanical = read("");
    let swelling = Swelling {
        strain: 1e-3,
        ..Swelling::default()
    };
    let mut s = simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(swelling)],
        1.0,
    );
    let error = s.start().and_then(|()| s.step()).expect_err("it is loose");
    let message = error.to_string();
    assert!(
        message.contains("no bond of point 0 resists motion along z"),
        "{message}"
    );
}

#[test]
fn free_vibration_keeps_momentum_and_energy_and_has_the_classical_wave_speed() {
    let length = 0.1;
    let body = block([100, 1, 1], 1, 1e-3, Store::Lattice, STEEL);
    let wave_speed = (2e11f64 / 8000.0).sqrt();
    let period = 2.0 * length / wave_speed;
    let keys = "solver.explicit = {}\nstep = 2e-8";
    let mut s = simulation(
        body,
        vec![Box::new(read::<Mechanical>(keys))],
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
    for cells in CELLS {
        for factor in [1.0, 2.2] {
            let mut s = solid(cells, "solver.explicit = {}", 1e-4, 1.0);
            s.start().expect("starts");
            let stable = s.stable_steps()[0].expect("explicit motion has a limit");
            let keys = format!("solver.explicit = {{}}\nstep = {}", factor * stable);
            let mut s = solid(cells, &keys, 1e-4, 2000.0 * stable);
            s.start().expect("starts");
            let mut outcome = Ok(false);
            while outcome.is_ok() && !s.is_finished() {
                outcome = s.step();
            }
            assert_eq!(outcome.is_ok(), factor == 1.0, "{cells:?} {factor}");
            if let Err(error) = outcome {
                assert!(error.to_string().contains("blew up"), "{error}");
            }
        }
    }
}
