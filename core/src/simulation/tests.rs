//! The clock with plugins that do next to nothing.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use serde::Serialize;

use super::*;
use crate::body::Body;
use crate::field::{Key, Read, Write};
use std::path::Path;

use crate::error::SetupError;
use crate::plugin::{Coupler, Physics};
use crate::setup::Access;
use crate::setup::Setup;
use crate::shape::{BoxShape, Shape};
use crate::stepping::{StepLimits, Update, Work};

mod clock;

/// A physics whose field has the values of a rule.
#[derive(Serialize)]
struct Ruled {
    field: &'static str,
    /// value at a point after a step
    #[serde(skip)]
    rule: Box<dyn FnMut(usize, Step) -> f64>,
    #[serde(skip)]
    own: Option<Write<f64>>,
    /// what others add
    #[serde(skip)]
    sink: Option<Read<f64>>,
    /// whether the field is the sum of what others add, and of what kind that is
    sums: Option<Added>,
    clock_step: StepSize,
    update: Update,
    /// whether a coupler reads the field
    #[serde(skip)]
    is_read: Rc<Cell<bool>>,
    stable: Option<f64>,
    /// stable step from a time on
    changed: Option<(f64, f64)>,
    /// largest macro step from a time on
    limit: Option<(f64, f64)>,
    plausible: Option<f64>,
    event: Option<f64>,
    time: f64,
}

/// What is added into a sink.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
enum Added {
    Amount,
    Rate,
}

fn ruled(field: &'static str, rule: impl FnMut(usize, Step) -> f64 + 'static) -> Ruled {
    Ruled {
        field,
        rule: Box::new(rule),
        own: None,
        sink: None,
        sums: None,
        clock_step: StepSize::Auto,
        update: Update::Step,
        is_read: Rc::default(),
        stable: None,
        changed: None,
        limit: None,
        plausible: None,
        event: None,
        time: 0.0,
    }
}

fn key(name: &'static str) -> Key<f64> {
    Key::new(name, "1", "a number")
}

/// Index of the body that has a field.
fn body_of(field: &str) -> usize {
    usize::from(field == "y")
}

fn sink_of(field: &str) -> Key<f64> {
    match field {
        "x" => Key::new("x_added", "1/s", "added to x"),
        _ => Key::new("y_added", "1/s", "added to y"),
    }
}

#[typetag::serialize(name = "test_ruled")]
impl Physics for Ruled {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningPhysics>, SetupError> {
        self.own = Some(setup.own(body_of(self.field), &key(self.field))?);
        let (body, sink) = (body_of(self.field), sink_of(self.field));
        self.sink = match self.sums {
            Some(Added::Rate) => Some(setup.consume(body, &sink)?),
            _ => setup.take_if_added(body, &sink)?,
        };
        self.is_read
            .set(setup.is_declared(body_of(self.field), &key(self.field), Access::Read));
        setup.stepping(Stepping {
            step: self.clock_step,
            update: self.update,
            ..Stepping::default()
        });
        Ok(self)
    }
}

impl RunningPhysics for Ruled {
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        let changed = self.changed.filter(|(from, _)| self.time >= *from);
        changed.map(|(_, step)| step).or(self.stable)
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let limit = self.limit.filter(|(from, _)| time >= *from);
        StepLimits {
            next_event: self.event.filter(|event| *event > time),
            longest: limit.map(|(_, step)| step),
        }
    }

    fn find_blow_up(&mut self, world: &World, _field: &str, largest: f64) -> Option<usize> {
        let limit = self.plausible.filter(|limit| largest > *limit)?;
        world.first_beyond(Read::from(self.own?), limit)
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let mut own = world.write(self.own.expect("prepared"));
        let added = self.sink.map(|sink| world.read(sink));
        for (i, x) in own.iter_mut().enumerate() {
            *x = match (self.sums, &added) {
                (Some(Added::Amount), Some(added)) => *x + added[i],
                (Some(Added::Rate), Some(added)) => *x + added[i] * step.size,
                _ => (self.rule)(i, step),
            };
        }
        self.time = step.end();
        Ok(Work {
            iterations: 3,
            evaluations: 2,
        })
    }
}

/// A coupler that reads fields, adds to others or writes some, and keeps the steps that it sees.
#[derive(Default, Serialize)]
struct Seen {
    reads: Vec<&'static str>,
    adds: Vec<&'static str>,
    writes: Vec<&'static str>,
    warnings: Vec<&'static str>,
    stable: Option<f64>,
    event: Option<f64>,
    /// largest macro step
    limit: Option<f64>,
    /// what it adds to each sink
    amount: f64,
    is_steady: bool,
    #[serde(skip)]
    sinks: Vec<Write<f64>>,
    #[serde(skip)]
    steps: Rc<RefCell<Vec<Step>>>,
}

#[typetag::serialize(name = "test_seen")]
impl Coupler for Seen {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        for name in &self.reads {
            setup.read(body_of(name), &key(name))?;
        }
        for name in &self.adds {
            self.sinks.push(setup.add(body_of(name), &sink_of(name))?);
        }
        for name in &self.writes {
            setup.write(body_of(name), &key(name))?;
        }
        for warning in &self.warnings {
            setup.warn(*warning);
        }
        setup.stepping(Stepping {
            is_steady: self.is_steady,
            ..Stepping::default()
        });
        Ok(self)
    }
}

impl RunningCoupler for Seen {
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        self.stable
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.event.filter(|event| *event > time),
            longest: self.limit,
        }
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        for sink in &self.sinks {
            world
                .write(*sink)
                .iter_mut()
                .for_each(|v| *v += self.amount);
        }
        self.steps.borrow_mut().push(step);
        Ok(())
    }
}

/// A second in steps of a quarter.
fn quarters() -> TimeOptions {
    TimeOptions {
        end: 1.0,
        step: StepSize::Fixed(0.25),
        stages: Vec::new(),
        safety: 0.5,
        log: LogTimes::every(1.0),
        iteration: None,
    }
}

fn prepared(
    physics: Vec<Ruled>,
    couplers: Vec<Seen>,
    options: TimeOptions,
) -> Result<Simulation, Faults> {
    let (min, max) = ([0.0; 3], [8.0, 1.0, 0.0]);
    let shape = Shape::Box(BoxShape { min, max });
    let body = |name| Body::fill(name, &shape, 2, 1.0, 1.0).expect("a valid body");
    let physics = physics.into_iter().map(|p| Named {
        label: format!("the physics of {}", p.field),
        plugin: Box::new(p) as Box<dyn Physics>,
    });
    let couplers = couplers.into_iter().enumerate().map(|(i, c)| Named {
        label: format!("coupler {i}"),
        plugin: Box::new(c) as Box<dyn Coupler>,
    });
    let world = World::new(vec![body("row"), body("other")]);
    Simulation::prepare(
        world,
        couplers.collect(),
        physics.collect(),
        options,
        Path::new("."),
    )
}

fn valid(physics: Vec<Ruled>, couplers: Vec<Seen>, options: TimeOptions) -> Simulation {
    let simulation = prepared(physics, couplers, options);
    simulation.expect("a valid composition")
}

/// Runs to the end.
fn run(
    physics: Vec<Ruled>,
    couplers: Vec<Seen>,
    options: TimeOptions,
) -> Result<Progress, RunError> {
    let mut simulation = valid(physics, couplers, options);
    simulation.start()?;
    while !simulation.is_finished() {
        simulation.step()?;
    }
    Ok(simulation.progress().clone())
}

#[test]
fn couplers_that_feed_nobody_see_each_macro_step() {
    let watcher = Seen {
        reads: vec!["x"],
        writes: vec!["seen"],
        ..Seen::default()
    };
    let steps = watcher.steps.clone();
    run(vec![ruled("x", |_, _| 1.0)], vec![watcher], quarters()).expect("it runs");
    let expected: Vec<Step> = [
        (0.0, 0.0),
        (0.0, 0.25),
        (0.25, 0.25),
        (0.5, 0.25),
        (0.75, 0.25),
    ]
    .map(|(start, size)| Step::new(start, size))
    .into();
    assert_eq!(*steps.borrow(), expected);
}

#[test]
fn the_work_of_all_sub_steps_is_counted() {
    let mut physics = ruled("x", |_, _| 1.0);
    physics.stable = Some(0.2); // half of it is safe: three sub-steps in a quarter
    let progress = run(vec![physics], vec![], quarters()).expect("it runs");
    assert_eq!(progress.macro_steps, 4);
    assert_eq!(progress.sub_steps, [12]);
    assert_eq!(progress.iterations, [36]);
    assert_eq!(progress.evaluations, [24]);
    assert_eq!((progress.passes, progress.last_step), (4, 0.25));
}

#[test]
fn a_blow_up_is_told_with_its_place() {
    for (bad, plausible) in [(f64::NAN, None), (-20.0, Some(10.0))] {
        let mut physics = ruled("x", move |i, step| match i {
            5 if step.start >= 0.5 => bad,
            _ => 1.0,
        });
        physics.plausible = plausible;
        let failed = run(vec![physics], vec![], quarters()).expect_err("it blows up");
        let RunError::BlowUp {
            physics,
            field,
            body,
            point,
            position,
            value,
            ..
        } = failed
        else {
            panic!("{failed}");
        };
        assert_eq!(
            [&*physics, &*field, &*body],
            ["the physics of x", "x", "row"]
        );
        assert_eq!((point, position), (5, [5.5, 0.5, 0.0]));
        assert!(value == bad || value.is_nan() && bad.is_nan());
    }
}

#[test]
fn passes_that_do_not_converge_are_counted() {
    let mut calls = 0.0;
    // restarting it does not bring back what it was
    let restless = ruled("x", move |i, _| {
        calls += f64::from(u8::from(i == 0));
        calls
    });
    let iteration = Iteration {
        tolerance: 1e-3,
        passes: 2,
        unconverged: Unconverged::Continue,
    };
    let progress = run(vec![restless], vec![], options_of(iteration)).expect("it goes on");
    assert_eq!((progress.passes, progress.unconverged), (8, 4));
    let progress = run(vec![ruled("x", |_, _| 1.0)], vec![], options_of(iteration));
    let progress = progress.expect("it converges");
    assert_eq!((progress.passes, progress.unconverged), (8, 0));
}

fn options_of(iteration: Iteration) -> TimeOptions {
    TimeOptions {
        iteration: Some(iteration),
        ..quarters()
    }
}

#[test]
fn a_circle_of_couplers_is_blamed_on_one_of_them() {
    let coupler = |reads, writes| Seen {
        reads: vec![reads],
        writes: vec![writes],
        ..Seen::default()
    };
    let couplers = vec![coupler("x", "seen"), coupler("a", "b"), coupler("b", "a")];
    let refused = prepared(vec![ruled("x", |_, _| 1.0)], couplers, quarters());
    let refused = refused.err().expect("they wait for each other");
    let [(culprit, error)] = &refused[..] else {
        panic!("{refused:?}");
    };
    assert!(
        matches!(culprit, Culprit::Coupler(1 | 2)),
        "{culprit:?}: {error}"
    );
}

#[test]
fn warnings_are_kept_once_with_their_plugin() {
    let doubtful = |warnings| Seen {
        writes: vec!["seen"],
        warnings,
        ..Seen::default()
    };
    let watcher = doubtful(vec!["the weld is cold", "the weld is cold", "it is thin"]);
    let simulation = valid(vec![ruled("x", |_, _| 1.0)], vec![watcher], quarters());
    let warning = |message: &str| Warning {
        plugin: "coupler 0".into(),
        message: message.into(),
    };
    let expected = ["the weld is cold", "it is thin"].map(warning);
    assert_eq!(simulation.warnings(), expected);
}

#[test]
fn a_physics_knows_whether_a_coupler_reads_its_field() {
    let (x, y) = (ruled("x", |_, _| 1.0), ruled("y", |_, _| 1.0));
    let is_read = [&x, &y].map(|physics| physics.is_read.clone());
    let watcher = Seen {
        reads: vec!["x"],
        writes: vec!["seen"],
        ..Seen::default()
    };
    valid(vec![x, y], vec![watcher], quarters());
    assert_eq!(is_read.map(|flag| flag.get()), [true, false]);
}

#[test]
fn a_field_that_nobody_provides_is_refused_with_those_of_its_body() {
    let watcher = Seen {
        reads: vec!["z"],
        writes: vec!["seen"],
        ..Seen::default()
    };
    let physics = vec![ruled("x", |_, _| 1.0), ruled("y", |_, _| 1.0)];
    let refused = prepared(physics, vec![watcher], quarters()).err();
    let mut refused = refused.expect("nobody has it").into_iter();
    let (Some((Culprit::Coupler(0), error)), None) = (refused.next(), refused.next()) else {
        panic!("the coupler alone is to blame");
    };
    let Problem::NobodyProvides {
        field,
        body,
        plugin,
        provided,
    } = error.problem
    else {
        panic!("{error}");
    };
    assert_eq!([&*field, &*body, &*plugin], ["z", "row", "coupler 0"]);
    assert_eq!(provided, ["seen", "x"]);
}

#[test]
fn a_checkpoint_of_other_plugins_is_refused() {
    let with = |physics: &[&'static str], couplers| {
        let physics = physics.iter().map(|field| ruled(field, |_, _| 1.0));
        let watcher = || Seen {
            reads: vec!["x"],
            ..Seen::default()
        };
        let couplers = (0..couplers).map(|_| watcher()).collect();
        valid(physics.collect(), couplers, quarters())
    };
    let mut saved = with(&["x"], 1);
    saved.start().expect("it starts");
    let checkpoint = saved.save().expect("it is saved");
    for mut other in [with(&["x"], 2), with(&["x", "y"], 1)] {
        let refused = other.load(&checkpoint).expect_err("it has other plugins");
        assert!(refused.to_string().contains("other plugins"), "{refused}");
    }
    with(&["x"], 1).load(&checkpoint).expect("the same plugins");
}

#[test]
fn the_composition_has_the_keys_of_all_plugins() {
    let seen = Seen {
        reads: vec!["x"],
        ..Seen::default()
    };
    let composition = valid(vec![ruled("x", |_, _| 0.0)], vec![seen], quarters()).composition();
    assert_eq!(composition["physics"][0]["type"], "test_ruled");
    assert_eq!(composition["physics"][0]["field"], "x");
    assert_eq!(composition["couplers"][0]["type"], "test_seen");
    assert_eq!(composition["couplers"][0]["reads"][0], "x");
}
