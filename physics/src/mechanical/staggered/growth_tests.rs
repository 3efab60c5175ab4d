//! Staggered solids that grow, and their state in a checkpoint.

use std::path::Path;

use nalgebra::Matrix3;
use perimelt_core::body::Store;
use perimelt_core::simulation::{LogTimes, Named, Simulation, TimeOptions};
use perimelt_core::{
    Change, Coupler, Physics, RunError, RunningCoupler, Setup, SetupError, Step, StepSize, World,
    Write, keys,
};
use serde::{Deserialize, Serialize};

use crate::mechanical::Mechanical;
use crate::testing::{block, read, set, values};

const STEEL: &str =
    "youngs_modulus = 2e11\npoissons_ratio = 0.3\nyield_stress = 2e8\nhardening_modulus = 1e9";

/// Strains points that are there from the start, unevenly, and gives the others material in an order without rule from a
/// time on; temperatures rise and fall.
#[derive(Debug, Serialize, Deserialize)]
struct Growth {
    strain: f64,
    /// Births begin, s.
    from: f64,
    /// Everything born is cut off, s.
    cut: f64,
    #[serde(skip)]
    state: Option<Fields>,
}

#[derive(Debug)]
struct Fields {
    order: Vec<u32>,
    active: Write<f64>,
    eigenstrain: Write<f64>,
    inherent: Write<Matrix3<f64>>,
    temperature: Write<f64>,
}

#[typetag::serialize(name = "test_growth")]
impl Coupler for Growth {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let points = setup.body(0).points.len() as u32;
        let mut order: Vec<u32> = (points / 2..points).collect();
        order.sort_by_key(|p| p.wrapping_mul(2_654_435_761));
        self.state = Some(Fields {
            active: setup.change_material(0, Change::Births, &order)?,
            eigenstrain: setup.add(0, &keys::EIGENSTRAIN)?,
            inherent: setup.add(0, &keys::EIGENSTRAIN_TENSOR)?,
            temperature: setup.write(0, &keys::TEMPERATURE)?,
            order,
        });
        Ok(self)
    }
}

impl RunningCoupler for Growth {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let fields = self.state.as_ref().expect("prepared");
        let load = self.strain * (3.0 * step.end()).min(1.0);
        let half = fields.order.len();
        let mut eigenstrain = world.write(fields.eigenstrain);
        for (point, e) in eigenstrain.iter_mut().enumerate().take(half) {
            *e += load * (point as f64 * 0.7).sin();
        }
        for inherent in world.write(fields.inherent).iter_mut().take(half / 2) {
            *inherent += Matrix3::from_diagonal(&[load, 0.0, -load].into());
        }
        let mut temperature = world.write(fields.temperature);
        for (point, t) in temperature.iter_mut().enumerate() {
            *t = 600.0 + 900.0 * (2.0 * step.end() + 0.1 * point as f64).sin();
        }
        let mut active = world.write(fields.active);
        let due = ((step.end() - self.from) / 0.5 * half as f64).clamp(0.0, half as f64);
        for &point in &fields.order[..due.ceil() as usize] {
            active[point as usize] = f64::from(u8::from(step.end() < self.cut));
        }
        Ok(())
    }
}

fn growing(
    strain: f64,
    from: f64,
    cut: f64,
    keys: &str,
    (cells, density): ([usize; 3], f64),
) -> Simulation {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let body = block(
        cells,
        dimension,
        1e-3,
        Store::Lattice,
        &format!("density = {density}\n{STEEL}"),
    );
    let mechanical: Mechanical = read(&format!("formulation = 'staggered'\n{keys}"));
    let plugin = Box::new(Growth {
        strain,
        from,
        cut,
        state: None,
    });
    let options = TimeOptions {
        end: 1.0,
        step: StepSize::Fixed(0.1),
        stages: Vec::new(),
        safety: 0.9,
        log: LogTimes::every(0.1),
        iteration: None,
    };
    let physics: Box<dyn Physics> = Box::new(mechanical);
    Simulation::prepare(
        World::new(vec![body]),
        vec![Named {
            label: "growth".into(),
            plugin,
        }],
        vec![Named {
            label: "mechanical".into(),
            plugin: physics,
        }],
        options,
        Path::new("."),
    )
    .expect("a valid composition")
}

fn run_until(s: &mut Simulation, steps: usize) {
    (0..steps).for_each(|_| {
        s.step().expect("steps");
    });
}

/// Neither births nor cuts change the stress of what is there, and what is born has none: nothing is born at the time of the
/// comparison but into the equilibrium before.
#[test]
fn births_change_no_stress() {
    for cells in [[6, 8, 1], [5, 4, 6]] {
        let mut s = growing(1e-3, 0.45, 2.0, "", (cells, 8e3));
        s.start().expect("starts");
        run_until(&mut s, 4);
        let before = values(&s, "stress");
        run_until(&mut s, 3);
        let (after, active) = (values(&s, "stress"), values(&s, "active"));
        let born = active[active.len() / 2..].iter().filter(|a| **a > 0.5);
        assert!(born.count() > 3, "some were born");
        let largest = before.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        assert!(largest > 5e7);
        for (before, after) in before.iter().zip(&after) {
            // the tolerance of equilibrium
            assert!((before - after).abs() < 1e-5 * largest, "{before} {after}");
        }
    }
}

/// Growing, yielding and annealed, or in motion, cut off in the end.
#[test]
fn a_resumed_run_has_the_same_bits_on_any_number_of_threads() {
    let equilibrium = "plasticity = { annealing_temperature = 1300 }\nplane = 'strain'\nsolver.quasi_static = { tolerance = 1e-6 }";
    // so heavy that a step of 0.01 s is stable
    let motion = "solver.explicit = {}\nstep = 0.01";
    for (cells, keys, strain, density) in [
        ([6, 8, 1], equilibrium, 4e-3, 8e3),
        ([5, 4, 6], equilibrium, 4e-3, 8e3),
        ([6, 8, 1], motion, 1e-3, 1e14),
        ([5, 4, 6], motion, 1e-3, 1e14),
    ] {
        let prepare = || growing(strain, 0.15, 0.85, keys, (cells, density));
        let whole = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().expect("a pool").install(|| {
                let mut s = prepare();
                s.start().expect("starts");
                run_until(&mut s, 10);
                s.save().expect("saved")
            })
        };
        let expected = whole(1);
        assert!(expected == whole(2), "1 and 2 threads");
        let mut first = prepare();
        first.start().expect("starts");
        run_until(&mut first, 5);
        let state = first.save().expect("saved");
        let mut second = prepare();
        second.load(&state).expect("loaded");
        run_until(&mut second, 5);
        assert!(expected == second.save().expect("saved"), "resumed");
    }
}

/// The momentum of what comes and goes is part of the balance, also where it shares corners with what stays.
#[test]
fn momentum_is_balanced_while_points_come_and_go() {
    for cells in [[6, 8, 1], [5, 4, 6]] {
        let keys = "solver.explicit = {}\nstep = 0.01";
        let mut s = growing(1e-3, 0.15, 0.85, keys, (cells, 1e14));
        set::<3>(&mut s, "velocity", |[x, y, _]| {
            [2e-4 - 0.1 * y, 0.1 * x, 0.0]
        });
        s.start().expect("starts");
        run_until(&mut s, 10);
        for balance in &s.balances()[0].1[..2] {
            assert!(balance.supplied.abs() > 1e-3 * balance.size, "{balance:?}");
            // rounding of some hundred steps
            assert!(balance.error().abs() < 1e-12 * balance.size, "{balance:?}");
        }
    }
}
