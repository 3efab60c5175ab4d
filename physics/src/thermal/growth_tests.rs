use super::Thermal;
use crate::testing::{block, read, set, simulation, values};
use perimelt_core::body::Store;
use perimelt_core::simulation::{LogTimes, Named, Simulation, TimeOptions};
use perimelt_core::{
    Change, Coupler, Physics, RunError, RunningCoupler, Setup, SetupError, Step, StepSize, World,
    Write, keys,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

const STEEL: &str = "density = 8000\nspecific_heat = 500\n\
    conductivity = { temperature = [0, 2000], value = [60, 20] }";

const SOLVERS: [&str; 3] = [
    "solver = 'explicit'",
    "solver = 'rkl2'\nstep = 0.05",
    "solver = 'implicit'\nstep = 0.05",
];

/// Gives the upper half of a body material in an order without rule, one point after the other, and heats all points.
#[derive(Debug, Serialize, Deserialize)]
struct Births {
    temperature: f64,
    heat: f64,
    /// all that was born is cut off at this time, s
    cut: f64,
    #[serde(skip)]
    state: Option<BirthsState>,
}

#[derive(Debug)]
struct BirthsState {
    order: Vec<u32>,
    active: Write<f64>,
    temperature: Write<f64>,
    heat: Write<f64>,
}

/// All births are over at this time, s.
const LAST: f64 = 0.4;

#[typetag::serialize(name = "births")]
impl Coupler for Births {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let points = setup.body(0).points.len() as u32;
        let mut order: Vec<u32> = (points / 2..points).collect();
        order.sort_by_key(|p| p.wrapping_mul(2_654_435_761));
        let active = setup.change_material(0, Change::Births, &order)?;
        let temperature = setup.write(0, &keys::BIRTH_TEMPERATURE)?;
        let heat = setup.add(0, &keys::HEAT_SOURCE)?;
        self.state = Some(BirthsState {
            order,
            active,
            temperature,
            heat,
        });
        Ok(self)
    }
}

impl RunningCoupler for Births {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let BirthsState {
            order,
            active,
            temperature,
            heat,
        } = self.state.as_ref().expect("prepared");
        world.write(*heat).fill(self.heat);
        let share = (step.start / LAST).min(1.0);
        let due = (share * order.len() as f64) as usize;
        let is_new = |p: &&u32| world.read::<f64>((*active).into())[**p as usize] == 0.0;
        let new: Vec<u32> = order[..due].iter().filter(is_new).copied().collect();
        if step.size > 0.0 && !new.is_empty() {
            let (mut active, mut at) = (world.write(*active), world.write(*temperature));
            for point in new {
                active[point as usize] = 1.0;
                at[point as usize] = self.temperature;
            }
        }
        if step.start >= self.cut {
            let mut active = world.write(*active);
            order.iter().for_each(|p| active[*p as usize] = 0.0);
        }
        Ok(())
    }
}

fn births(temperature: f64, heat: f64) -> Box<dyn Coupler> {
    Box::new(Births {
        temperature,
        heat,
        cut: f64::INFINITY,
        state: None,
    })
}

fn growing(keys: &str, temperature: f64, heat: f64) -> Simulation {
    deposited(keys, births(temperature, heat))
}

fn deposited(keys: &str, births: Box<dyn Coupler>) -> Simulation {
    let body = block([11, 7, 6], 3, 1e-3, Store::Lattice, STEEL);
    let thermal: Thermal = read(keys);
    let couplers = vec![births];
    let mut s = simulation(body, vec![Box::new(thermal)], couplers, 0.5);
    set(&mut s, "temperature", |[x, ..]| [300.0 + 2e4 * x]);
    s
}

fn finish(s: &mut Simulation) {
    while !s.is_finished() {
        s.step().expect("steps");
    }
}

#[test]
fn heat_and_mass_of_births_are_balanced_with_every_solver() {
    for keys in SOLVERS {
        let mut s = growing(keys, 1700.0, 1e7);
        assert_eq!(s.balances()[0].1.len(), 2, "also before the start");
        s.start().expect("starts");
        let volume = 1e-9 * 11.0 * 7.0 * 6.0;
        while !s.is_finished() {
            s.step().expect("steps");
            let (_, balances) = s.balances().remove(0);
            for b in &balances {
                // rounding of some hundred enthalpies and steps
                assert!(b.relative_error() < 1e-13, "{keys}: {b:?}");
            }
            assert!(balances[0].deposited.is_some());
        }
        let (_, balances) = s.balances().remove(0);
        let mass = &balances[1];
        assert!((mass.stored / (8000.0 * volume) - 1.0).abs() < 1e-12);
        // 4e6 J/(m³ K), and enthalpies that count from 20 °C
        let deposited = balances[0].deposited.expect("it grows");
        let of_birth = 4e6 * (1700.0 - 293.15) * 0.5 * volume;
        assert!(
            (deposited / of_birth - 1.0).abs() < 1e-9,
            "{deposited} {of_birth}"
        );
        // points without material received no heat
        let most = of_birth + 1e7 * 0.5 * volume;
        assert!(balances[0].supplied < most && balances[0].supplied > of_birth);
    }
}

#[test]
fn what_is_cut_off_takes_its_heat_and_mass_with_it() {
    let births = Births {
        temperature: 1200.0,
        heat: 0.0,
        cut: 0.45,
        state: None,
    };
    let mut s = deposited(SOLVERS[0], Box::new(births));
    s.start().expect("starts");
    let mut most: f64 = 0.0;
    while !s.is_finished() {
        s.step().expect("steps");
        let (_, balances) = s.balances().remove(0);
        assert!(
            balances.iter().all(|b| b.relative_error() < 1e-13),
            "{balances:?}"
        );
        most = most.max(balances[1].stored);
    }
    let (_, balances) = s.balances().remove(0);
    assert!((balances[1].stored / most - 0.5).abs() < 1e-12);
    let active = values(&s, "active");
    assert!(
        active
            .iter()
            .enumerate()
            .all(|(i, a)| *a == f64::from(u8::from(2 * i < active.len())))
    );
}

#[test]
fn a_body_that_has_grown_has_the_stable_step_of_one_that_is_whole() {
    let mut grown = growing(SOLVERS[0], 400.0, 0.0);
    grown.start().expect("starts");
    finish(&mut grown);
    let body = block([11, 7, 6], 3, 1e-3, Store::Lattice, STEEL);
    let thermal: Thermal = read(SOLVERS[0]);
    let mut whole = simulation(body, vec![Box::new(thermal)], Vec::new(), 0.5);
    set(&mut whole, "temperature", |_| [400.0]);
    whole.start().expect("starts");
    let [grown, whole] = [&grown, &whole].map(|s| s.stable_steps()[0].expect("explicit"));
    assert!((grown / whole - 1.0).abs() < 1e-9, "{grown} {whole}");
}

#[test]
fn material_of_the_same_temperature_changes_nothing() {
    for keys in SOLVERS {
        let mut s = growing(keys, 400.0, 0.0);
        set(&mut s, "temperature", |_| [400.0]);
        s.start().expect("starts");
        finish(&mut s);
        let temperature = values(&s, "temperature");
        assert!(
            temperature.iter().all(|t| (t - 400.0).abs() < 1e-9),
            "{keys}"
        );
        assert!(values(&s, "active").iter().all(|a| *a == 1.0));
    }
}

#[test]
fn a_run_is_resumed_in_the_middle_of_a_deposit_bit_by_bit_on_any_number_of_threads() {
    for keys in SOLVERS {
        let go = |threads: usize, stop: Option<f64>| {
            let pool = rayon::ThreadPoolBuilder::new();
            let pool = pool.num_threads(threads).build().expect("threads");
            pool.install(|| {
                let mut s = growing(keys, 1700.0, 1e7);
                s.start().expect("starts");
                if let Some(stop) = stop {
                    while s.time() < stop {
                        s.step().expect("steps");
                    }
                    let saved = s.save().expect("a checkpoint");
                    s = growing(keys, 1700.0, 1e7);
                    s.load(&saved).expect("the same case");
                }
                finish(&mut s);
                let numbers = s.balances().remove(0).1;
                let steps = s.progress().macro_steps;
                (values(&s, "enthalpy"), numbers, steps)
            })
        };
        let whole = go(1, None);
        assert_eq!(whole, go(2, None), "{keys}");
        assert_eq!(whole, go(2, Some(0.2)), "{keys}");
    }
}

#[test]
fn what_takes_all_points_for_material_is_refused() {
    let material = format!("{STEEL}\nyoungs_modulus = 2e11\npoissons_ratio = 0.3");
    let physics = |keys: &str, other: &str| -> Vec<Box<dyn Physics>> {
        let mut all: Vec<Box<dyn Physics>> = vec![Box::new(read::<Thermal>(keys))];
        if other == "mechanical" {
            all.push(Box::new(read::<crate::mechanical::Mechanical>("")));
        }
        all
    };
    for (keys, other, key, words) in [
        ("solver = 'steady'", "", "solver", "deposited"),
        ("form = 'second_derivatives'", "", "form", "deposited"),
        ("", "mechanical", "formulation", "deposited or cut off"),
    ] {
        let body = block([11, 7, 6], 3, 1e-3, Store::Lattice, &material);
        let options = TimeOptions {
            end: 1.0,
            step: StepSize::Auto,
            stages: Vec::new(),
            safety: 0.9,
            log: LogTimes::every(1.0),
            iteration: None,
        };
        let named = |plugin: Box<dyn Physics>| Named {
            label: plugin.typetag_name().into(),
            plugin,
        };
        let couplers = vec![Named {
            label: "deposit".into(),
            plugin: births(1000.0, 0.0),
        }];
        let physics = physics(keys, other).into_iter().map(named).collect();
        let world = World::new(vec![body]);
        let refused = Simulation::prepare(world, couplers, physics, options, Path::new("."));
        let mistakes = refused.err().expect("it is refused");
        let [(_, mistake)] = &mistakes[..] else {
            panic!("{mistakes:?}");
        };
        assert_eq!(mistake.key, key);
        assert!(mistake.to_string().contains(words), "{mistake}");
    }
}
