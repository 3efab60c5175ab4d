//! Sizes of steps, log times, events, and what is added over the sub-steps of a group.

use super::*;

#[test]
fn steps_end_at_events() {
    let watcher = Seen {
        reads: vec!["x"],
        writes: vec!["seen"],
        event: Some(0.3),
        ..Seen::default()
    };
    let steps = watcher.steps.clone();
    run(vec![ruled("x", |_, _| 1.0)], vec![watcher], quarters()).expect("it runs");
    let ends: Vec<f64> = steps.borrow().iter().map(Step::end).collect();
    // two steps to the event, three to the end
    let expected = [0.0, 0.15, 0.3, 0.3 + 0.7 / 3.0, 0.3 + 1.4 / 3.0, 1.0];
    assert_eq!(ends.len(), expected.len(), "{ends:?}");
    let off = ends.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12, "{ends:?}");
}

#[test]
fn sub_steps_are_told() {
    let mut physics = ruled("x", |_, _| 1.0);
    physics.stable = Some(0.25);
    let mut simulation = valid(vec![physics, ruled("y", |_, _| 1.0)], vec![], quarters());
    simulation.start().expect("it starts");
    assert_eq!(simulation.sub_steps(), [0.125, f64::INFINITY]);
}

#[test]
fn an_exchange_limits_the_steps_of_the_physics_that_it_connects() {
    let physics = |field| {
        let mut physics = ruled(field, |_, _| 1.0);
        physics.clock_step = StepSize::Fixed(0.25);
        physics
    };
    let exchange = Seen {
        reads: vec!["x", "y"],
        adds: vec!["x", "y"],
        stable: Some(0.25),
        ..Seen::default()
    };
    let steps = exchange.steps.clone();
    run(vec![physics("x"), physics("y")], vec![exchange], quarters()).expect("it runs");
    // half of its stable step, eight times; and the initial state
    let sizes: Vec<f64> = steps.borrow().iter().map(|step| step.size).collect();
    assert_eq!(sizes, [&[0.0][..], &[0.125; 8]].concat());
    let starts: Vec<f64> = steps.borrow().iter().map(|step| step.start).collect();
    let expected: Vec<f64> = (0..8).map(|s| 0.125 * s as f64).collect();
    assert_eq!(starts, [&[0.0][..], &expected].concat());
}

/// Bodies that exchange something advance together, by the longest step of both.
#[test]
fn a_stable_step_that_changes_changes_the_step_of_its_group() {
    let physics = |field| {
        let mut physics = ruled(field, |_, _| 1.0);
        physics.stable = Some(0.5);
        physics.changed = Some((0.5, 0.1));
        physics
    };
    let exchange = Seen {
        reads: vec!["x", "y"],
        adds: vec!["x", "y"],
        ..Seen::default()
    };
    let steps = exchange.steps.clone();
    run(vec![physics("x"), physics("y")], vec![exchange], quarters()).expect("it runs");
    let sizes: Vec<f64> = steps.borrow().iter().map(|step| step.size).collect();
    // half of the stable step: one in a quarter, then five
    let expected = [&[0.0, 0.25, 0.25][..], &[0.05; 10]].concat();
    assert_eq!(sizes.len(), expected.len(), "{sizes:?}");
    let off = sizes.iter().zip(&expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12, "{sizes:?}");
}

#[test]
fn steps_too_small_to_add_to_the_time_are_refused() {
    let mut physics = ruled("x", |_, _| 1.0);
    physics.limit = Some((0.5, 1e-20));
    let options = TimeOptions {
        step: StepSize::Auto,
        log: LogTimes::every(0.5),
        ..quarters()
    };
    let failed = run(vec![physics], vec![], options).expect_err("it never ends");
    let RunError::StepTooSmall { time, count, .. } = failed else {
        panic!("{failed}");
    };
    assert_eq!(time, 0.5);
    assert!((count - 0.5e20).abs() < 1e6, "{count}");
}

#[test]
fn a_physics_for_the_log_is_advanced_once_for_each_logged_state() {
    let mut physics = ruled("x", |_, _| 1.0);
    physics.update = Update::Log;
    let options = TimeOptions {
        log: LogTimes::every(0.5),
        ..quarters()
    };
    let progress = run(vec![physics], vec![], options).expect("it runs");
    assert_eq!((progress.macro_steps, progress.sub_steps), (4, vec![2]));
}

/// Ends of the macro steps of a run, by a coupler that feeds nobody.
fn ends(physics: Vec<Ruled>, watcher: Seen, options: TimeOptions) -> Vec<f64> {
    let watcher = Seen {
        reads: vec!["x"],
        writes: vec!["seen"],
        ..watcher
    };
    let steps = watcher.steps.clone();
    run(physics, vec![watcher], options).expect("it runs");
    steps.borrow().iter().skip(1).map(Step::end).collect()
}

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: {found:?}");
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12, "{what}: {found:?}");
}

#[test]
fn macro_steps_are_those_asked_for_or_the_longest_that_all_allow() {
    let x = || ruled("x", |_, _| 1.0);
    let stable = |stable: f64| Ruled {
        stable: Some(stable),
        ..x()
    };
    let auto = || TimeOptions {
        step: StepSize::Auto,
        log: LogTimes::every(0.5),
        ..quarters()
    };
    let limited = |limit| Seen {
        limit,
        ..Seen::default()
    };
    let stage = |from, step| Stage { from, step };
    let stages = |stages| TimeOptions {
        stages,
        ..quarters()
    };
    let free = || limited(None);
    // nothing limits the step: the log interval; half of the stable step; limits of a coupler and of a physics
    let found = ends(vec![x()], free(), auto());
    assert_close(&found, &[0.5, 1.0], "free");
    let found = ends(vec![stable(0.5)], free(), auto());
    assert_close(&found, &[0.25, 0.5, 0.75, 1.0], "stable");
    let found = ends(vec![stable(2.0)], limited(Some(0.25)), auto());
    assert_close(&found, &[0.25, 0.5, 0.75, 1.0], "limit of a coupler");
    let physics = Ruled {
        limit: Some((0.5, 0.25)),
        ..x()
    };
    let found = ends(vec![physics], free(), auto());
    assert_close(&found, &[0.5, 0.75, 1.0], "limit of a physics");
    // the longest of two stable steps; the other physics takes sub-steps
    let other = Ruled {
        stable: Some(0.1),
        ..ruled("y", |_, _| 1.0)
    };
    let found = ends(vec![stable(0.5), other], free(), auto());
    assert_close(&found, &[0.25, 0.5, 0.75, 1.0], "two physics");
    // a stage begins at its time, on which a step ends; the last one counts
    let found = ends(
        vec![x()],
        free(),
        stages(vec![
            stage(0.0, StepSize::Fixed(0.2)),
            stage(0.3, StepSize::Fixed(0.35)),
        ]),
    );
    assert_close(&found, &[0.15, 0.3, 0.65, 1.0], "stages");
    let found = ends(
        vec![stable(0.2)],
        free(),
        stages(vec![stage(0.5, StepSize::Auto)]),
    );
    let expected = [0.25, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
    assert_close(&found, &expected, "an automatic stage");
}

#[test]
fn an_event_within_rounding_of_a_step_or_of_a_log_time_adds_no_step() {
    let at = |event| Seen {
        event: Some(event),
        ..Seen::default()
    };
    for event in [0.25 + 1e-11, 1.0 - 1e-11] {
        let found = ends(vec![ruled("x", |_, _| 1.0)], at(event), quarters());
        assert_eq!(found.len(), 4, "{found:?}");
        assert_eq!(found[3], 1.0);
    }
    // events of physics count as those of couplers
    let physics = Ruled {
        event: Some(0.3),
        ..ruled("x", |_, _| 1.0)
    };
    let found = ends(vec![physics], at(0.9), quarters());
    let expected = [0.15, 0.3, 0.5, 0.7, 0.9, 1.0];
    assert_close(&found, &expected, "two events");
}

#[test]
fn log_times_are_counted_from_the_time() {
    let with = |interval, end| {
        let options = TimeOptions {
            log: LogTimes::every(interval),
            end,
            ..quarters()
        };
        valid(vec![ruled("x", |_, _| 1.0)], vec![], options)
    };
    // 0.6 / 0.2 is 2.9999999999999996
    for (time, interval, count) in [(0.6, 0.2, 3), (0.59, 0.2, 2), (0.0, 0.2, 0), (1.0, 0.3, 3)] {
        assert_eq!(with(interval, 1.0).logs_until(time), count, "{time}");
    }
    let mut simulation = with(0.25, 0.6);
    simulation.start().expect("it starts");
    let mut logged = Vec::new();
    while !simulation.is_finished() {
        logged.push(simulation.next_log());
        assert!(simulation.step().expect("it steps"));
    }
    assert_eq!(logged, [0.25, 0.5, 0.6]);
    // another interval from a checkpoint on
    let checkpoint = simulation.save().expect("it is saved");
    let mut resumed = with(0.2, 1.0);
    resumed.load(&checkpoint).expect("the same plugins");
    assert!((resumed.next_log() - 0.8).abs() < 1e-12);
}

#[test]
fn fixed_steps_above_the_stable_ones_are_refused() {
    let physics = |field, stable| Ruled {
        clock_step: StepSize::Fixed(0.25),
        stable,
        ..ruled(field, |_, _| 1.0)
    };
    let adding = |adds, stable| Seen {
        adds,
        stable,
        ..Seen::default()
    };
    let check = |stable, coupler: Seen| {
        let physics = vec![physics("x", None), physics("y", stable)];
        let mut simulation = valid(physics, vec![coupler], quarters());
        simulation.start().expect("it starts");
        simulation.check_steps()
    };
    for (stable, coupler) in [
        (None, adding(vec!["y"], None)),
        (Some(0.25), adding(vec!["y"], Some(0.25))),
        (Some(0.3), adding(vec!["x", "y"], Some(0.3))),
    ] {
        assert!(check(stable, coupler).is_ok());
    }
    let (culprit, error) = check(Some(0.24), adding(vec!["y"], None)).expect_err("too long");
    let Problem::UnstableStep { fixed, stable, .. } = error.problem else {
        panic!("{error}");
    };
    assert_eq!((culprit, fixed, stable), (Culprit::Physics(1), 0.25, 0.24));
    // a coupler before one physics, and an exchange of two
    for (adds, at_fault) in [(vec!["y"], 1), (vec!["x", "y"], 0)] {
        let refused = check(None, adding(adds, Some(0.24)));
        let (culprit, error) = refused.expect_err("too long");
        let Problem::UnstableExchange {
            coupler, stable, ..
        } = error.problem
        else {
            panic!("{error}");
        };
        assert_eq!(culprit, Culprit::Physics(at_fault));
        assert_eq!((&*coupler, stable), ("coupler 0", 0.24));
    }
}

#[test]
fn sub_steps_without_number_are_refused_with_their_physics() {
    let physics = Ruled {
        stable: Some(1e-14),
        ..ruled("x", |_, _| 1.0)
    };
    let failed = run(vec![physics], vec![], quarters()).expect_err("it never ends");
    let RunError::StepTooSmall {
        physics,
        step,
        time,
        count,
    } = failed
    else {
        panic!("{failed}");
    };
    assert_eq!((&*physics, step, time), ("the physics of x", 5e-15, 0.0));
    assert!((count / 5e13 - 1.0).abs() < 1e-6, "{count}");
}

#[test]
fn a_changed_stable_step_does_not_exceed_that_of_the_couplers() {
    let physics = Ruled {
        changed: Some((0.0, 0.4)),
        ..ruled("x", |_, _| 1.0)
    };
    let coupler = Seen {
        adds: vec!["x"],
        stable: Some(0.2),
        ..Seen::default()
    };
    // half of 0.2 s: three sub-steps in a quarter
    let progress = run(vec![physics], vec![coupler], quarters()).expect("it runs");
    assert_eq!(progress.sub_steps, [12]);
}

/// A coupler of one body is applied before each sub-step, a steady one once for all sub-steps of a macro step, and one that
/// adds to two bodies once for each step of both. A rate holds over all sub-steps; an amount is taken up once.
#[test]
fn rates_hold_over_sub_steps_and_amounts_are_taken_up_once() {
    for (adds, is_steady, added, expected) in [
        (&["x"][..], false, Added::Rate, 2.0),
        (&["x"], true, Added::Rate, 2.0),
        (&["x", "y"], false, Added::Rate, 2.0),
        (&["x"], false, Added::Amount, 24.0),
        (&["x"], true, Added::Amount, 8.0),
        (&["x", "y"], false, Added::Amount, 8.0),
    ] {
        let physics = |field, stable| Ruled {
            sums: Some(added),
            stable: Some(stable),
            ..ruled(field, |_, _| 0.0)
        };
        let coupler = Seen {
            adds: adds.to_vec(),
            amount: 2.0,
            is_steady,
            ..Seen::default()
        };
        // three sub-steps of x in each quarter, one of y
        let physics = vec![physics("x", 0.2), physics("y", 0.5)];
        let mut simulation = valid(physics, vec![coupler], quarters());
        simulation.start().expect("it starts");
        while !simulation.is_finished() {
            simulation.step().expect("it steps");
        }
        assert_eq!(simulation.progress().sub_steps, [12, 4]);
        let fields = &simulation.world().fields;
        let x = fields.find(0, "x").expect("a field");
        let found = fields.field(x).data().flat()[0];
        let what = format!("{adds:?} {is_steady} {added:?}");
        assert_close(&[found], &[expected], &what);
    }
}

#[test]
fn physics_of_a_group_are_not_advanced_for_the_log_only() {
    let mut y = ruled("y", |_, _| 1.0);
    y.update = Update::Log;
    let exchange = Seen {
        adds: vec!["x", "y"],
        ..Seen::default()
    };
    let physics = vec![ruled("x", |_, _| 1.0), y];
    let mut refused = prepared(physics, vec![exchange], quarters())
        .err()
        .expect("both advance together");
    let (culprit, error) = refused.remove(0);
    assert_eq!((culprit, &*error.key), (Culprit::Physics(1), "update"));
}
