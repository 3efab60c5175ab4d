//! Balances of momentum and angular momentum of explicit bodies.

use nalgebra::Vector3;
use perimelt_core::body::Store;
use perimelt_core::simulation::Simulation;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, Face, LayerRole, RunError, RunningCoupler, Setup, SetupError, Step, World, Write, keys,
};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use crate::testing::{block, read, run, set, simulation, values};

const FORMULATIONS: [&str; 4] = ["bond", "ordinary", "correspondence", "staggered"];
const CELLS: [[usize; 3]; 3] = [[20, 1, 1], [16, 6, 1], [8, 5, 4]];
const STEP: f64 = 2e-8;
const END: f64 = 300.0 * STEP;

/// What acts on a body from outside.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Surroundings {
    /// Gravity that grows.
    gravity: bool,
    /// Holds the left end, in the second third of the time along y only, and moves it.
    clamp: bool,
    /// Impulses on all points.
    impulses: bool,
    /// Tension on the right face.
    traction: bool,
    #[serde(skip)]
    fields: Option<SinkFields>,
}

#[derive(Clone, Copy, Debug)]
struct SinkFields {
    body_force: Write<Vector3<f64>>,
    impulse: Option<Write<Vector3<f64>>>,
    hold: Option<[Write<Vector3<f64>>; 2]>,
    layer: Option<LayerHandle>,
}

#[typetag::serialize(name = "test_surroundings")]
impl Coupler for Surroundings {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let mut hold = None;
        if self.clamp {
            let constraint = setup.add(0, &keys::CONSTRAINT)?;
            hold = Some([constraint, setup.add(0, &keys::HELD_DISPLACEMENT)?]);
        }
        self.fields = Some(SinkFields {
            hold,
            body_force: setup.add(0, &keys::BODY_FORCE)?,
            impulse: match self.impulses {
                true => Some(setup.add(0, &keys::IMPULSE)?),
                false => None,
            },
            layer: match self.traction {
                true => {
                    Some(setup.layer(0, &keys::DISPLACEMENT, Face::XMax, LayerRole::Prescribed)?)
                }
                false => None,
            },
        });
        Ok(self)
    }
}

impl RunningCoupler for Surroundings {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let fields = self.fields.expect("prepared");
        let dimension = world.body(0).dimension;
        let in_space =
            |v: [f64; 3]| Vector3::from_fn(|axis, _| if axis < dimension { v[axis] } else { 0.0 });
        let positions = &world.body(0).points.position;
        if self.gravity {
            let growth = 1.0 + step.start / END;
            let weight = in_space([3e6, -8e7, 1e7]) * growth;
            let mut force = world.write(fields.body_force);
            force.iter_mut().for_each(|b| *b += weight);
        }
        if let Some(impulse) = fields.impulse {
            let mut impulse = world.write(impulse);
            for (i, (j, x)) in impulse.iter_mut().zip(positions).enumerate() {
                *j += in_space([2.0, -3.0 * (i as f64).sin(), 1e3 * x.x]);
            }
        }
        if let Some(layer) = fields.layer {
            world.set_traction_layer(layer, [1e7, 0.0, 0.0]);
        }
        let Some([constraint, held]) = fields.hold else {
            return Ok(());
        };
        let (mut constraint, mut held) = (world.write(constraint), world.write(held));
        let is_middle = (END / 3.0..END / 1.5).contains(&step.start);
        for (i, x) in positions.iter().enumerate() {
            if x.x < 2e-3 {
                let components = if is_middle { [0.0, 1.0, 0.0] } else { [1.0; 3] };
                constraint[i] += Vector3::from(components);
                held[i] += in_space(components) * (1e-2 * step.end());
            }
        }
        Ok(())
    }
}

fn moving(cells: [usize; 3], keys: &str, surroundings: Surroundings) -> Simulation {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let material = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3";
    let body = block(cells, dimension, 1e-3, Store::Lattice, material);
    let mechanical: Mechanical = read(&format!("{keys}\nstep = {STEP}"));
    let mut s = simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(surroundings)],
        END,
    );
    set::<3>(&mut s, "velocity", |[x, y, _]| {
        let spin = [-1e3 * y, 1e3 * x, 2.0];
        std::array::from_fn(|axis| if axis < dimension { spin[axis] } else { 0.0 })
    });
    s
}

/// Names of the balances, after a check that they are closed.
fn closed_balances(s: &Simulation, case: &str) -> Vec<String> {
    let balances = &s.balances()[0].1;
    for balance in balances {
        let error = balance.error().abs() / balance.size;
        // rounding of some hundred steps
        assert!(error < 1e-12, "{case}: {balance:?}: {error}");
        assert!(balance.size > 0.0, "{case}: {balance:?}");
    }
    balances.iter().map(|b| b.quantity.clone()).collect()
}

fn names(dimension: usize, is_finite: bool) -> Vec<String> {
    let linear = ["momentum.x", "momentum.y", "momentum.z"];
    let angular = [
        "angular_momentum.x",
        "angular_momentum.y",
        "angular_momentum.z",
    ];
    let angular = match (is_finite, dimension) {
        (true, 2) => &angular[2..],
        (true, 3) => &angular[..],
        _ => &[],
    };
    let all = linear[..dimension].iter().chain(angular);
    all.map(|name| name.to_string()).collect()
}

#[test]
fn a_clamped_bar_under_gravity_keeps_its_balances() {
    for cells in CELLS {
        for formulation in FORMULATIONS {
            for kinematics in ["linear", "finite"] {
                for (damping, impulses) in [("", false), ("damping = 1e5", true)] {
                    let keys = format!(
                        "formulation = \"{formulation}\"\nkinematics = \"{kinematics}\"\n\
                        solver.explicit = {{ {damping} }}"
                    );
                    let surroundings = Surroundings {
                        gravity: true,
                        clamp: true,
                        impulses,
                        ..Surroundings::default()
                    };
                    let mut s = moving(cells, &keys, surroundings);
                    run(&mut s);
                    let case = format!("{cells:?} {keys}");
                    let dimension = cells.iter().filter(|c| **c > 1).count();
                    let found = closed_balances(&s, &case);
                    assert_eq!(found, names(dimension, kinematics == "finite"), "{case}");
                    // the reaction of the clamp is part of it
                    let momentum = &s.balances()[0].1[0];
                    assert!(momentum.supplied.abs() > 1e-3 * momentum.size, "{case}");
                }
            }
        }
    }
}

#[test]
fn a_free_spinning_body_keeps_its_angular_momentum() {
    for cells in &CELLS[1..] {
        for formulation in FORMULATIONS {
            for law in ["", "fracture = {}"] {
                if formulation == "staggered" && !law.is_empty() {
                    continue;
                }
                let keys = format!(
                    "formulation = \"{formulation}\"\nkinematics = \"finite\"\n{law}\n\
                    solver.explicit = {{}}"
                );
                let mut s = match law.is_empty() {
                    true => moving(*cells, &keys, Surroundings::default()),
                    false => breaking(*cells, &keys),
                };
                run(&mut s);
                let case = format!("{cells:?} {keys}");
                closed_balances(&s, &case);
                for balance in &s.balances()[0].1 {
                    assert_eq!(balance.supplied, 0.0, "{case}");
                }
                let displacement = values(&s, "displacement");
                assert!(displacement.iter().any(|u| u.abs() > 1e-6), "it moves");
            }
        }
    }
}

/// A spinning body whose halves are torn apart.
fn breaking(cells: [usize; 3], keys: &str) -> Simulation {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let material =
        "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\ncritical_stretch = 1e-3";
    let body = block(cells, dimension, 1e-3, Store::Lattice, material);
    let mechanical: Mechanical = read(&format!("{keys}\nstep = {STEP}"));
    let mut s = simulation(body, vec![Box::new(mechanical)], vec![], END);
    let middle = 0.5e-3 * cells[0] as f64;
    set::<3>(&mut s, "velocity", |[x, y, _]| {
        let apart = if x > middle { 20.0 } else { -20.0 };
        let spin = [apart - 1e3 * y, 1e3 * x, 2.0];
        std::array::from_fn(|axis| if axis < dimension { spin[axis] } else { 0.0 })
    });
    s
}

#[test]
fn forces_of_layers_are_part_of_the_balances() {
    for formulation in &FORMULATIONS[..3] {
        for kinematics in ["linear", "finite"] {
            let keys = format!(
                "formulation = \"{formulation}\"\nkinematics = \"{kinematics}\"\n\
                solver.explicit = {{}}"
            );
            let surroundings = Surroundings {
                traction: true,
                clamp: true,
                gravity: true,
                ..Surroundings::default()
            };
            let mut s = moving(CELLS[1], &keys, surroundings);
            run(&mut s);
            closed_balances(&s, &keys);
        }
    }
}
