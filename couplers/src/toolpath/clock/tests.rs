//! Paths that wait.

use super::*;
use crate::testing::{STEEL, block, set};
use perimelt_core::World;
use std::path::Path;

/// A path of three passes on a block whose temperature the test sets, with waits before the last two.
fn path() -> (TimedPath, World) {
    let toolpath: crate::toolpath::Toolpath = toml::from_str(
        "sequence = { wait_until = { temperature = 400, region = 'left' }, passes = [
            { toolpath.line = { start = [0, 0, 0], end = [2, 0, 0], speed = 1 } },
            { toolpath.line = { start = [0, 0, 0], end = [3, 0, 0], speed = 1 } },
            { toolpath.line = { start = [1, 1, 0], end = [4, 1, 0], speed = 1 },
              wait_until = { temperature = 350, when = 'above', at = [3.2, 0.5, 0.5] } } ] }",
    )
    .expect("well formed");
    let track = toolpath.track(Some(100.0), Path::new("")).expect("valid");
    let path = TimedPath::new(track);
    let mut world = World::new(vec![block([4, 2, 2], 3, STEEL)]);
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("the torch");
    path.prepare(&mut setup, 0).expect("a region and a place");
    (path, world)
}

fn heat(world: &mut World, temperature: f64) {
    set(world, &keys::TEMPERATURE, |_| temperature);
}

#[test]
fn a_path_waits_for_its_temperature_and_goes_on_where_it_was() {
    let (path, mut world) = path();
    heat(&mut world, 500.0);
    path.begin_step(&world, 0.0);
    assert_eq!(path.next_event(0.0), Some(2.0));
    assert_eq!(path.pose(1.0).power, 100.0);
    path.begin_step(&world, 2.0);
    // the source is off at the end of its pass, and nothing is known to happen
    let pose = path.pose(2.5);
    assert_eq!((pose.power, pose.position.x), (0.0, 2.0));
    assert_eq!(path.next_event(2.0), None);
    assert!(!path.is_on_after(2.0));
    let told = path.unfinished(5.0).expect("it waits");
    assert!(
        told.contains("pass 2 of 3") && told.contains("at most 400 K in region `left`"),
        "{told}"
    );
    // a part of the region alone is not enough
    set(&mut world, &keys::TEMPERATURE, |point| {
        if point == 0 { 400.5 } else { 300.0 }
    });
    path.begin_step(&world, 5.0);
    assert_eq!(path.pose(5.1).power, 0.0);
    heat(&mut world, 399.0);
    path.begin_step(&world, 5.3);
    assert_eq!(path.pose(5.3 + 1.5).position.x, 1.5);
    assert!(path.is_on_after(5.3));
    let event = path.next_event(5.3).expect("the end of the pass");
    assert!((event - 8.3).abs() < 1e-14);
    assert!(path.unfinished(7.0).is_none());
    path.begin_step(&world, event);
    // pass 3 waits for nothing: it is hot enough
    let place = path.pose(event + 1.0).position;
    // rounding of times
    assert!((place - Vector3::new(2.0, 1.0, 0.0)).norm() < 1e-14);
    let report = path.report();
    let value = |name: &str| {
        report
            .iter()
            .find(|r| r.name == name)
            .expect("reported")
            .value
    };
    assert_eq!(value("pass.2.start"), 5.3);
    assert_eq!(value("pass.2.temperature"), 399.0);
    assert_eq!(value("pass.3.start"), event);
    assert_eq!(value("passes.begun"), 3.0);
    assert!((value("passes.waited") - 3.3).abs() < 1e-14);
}

#[test]
fn the_clock_of_a_waiting_path_is_restored() {
    let (path, mut world) = path();
    heat(&mut world, 500.0);
    for time in [0.0, 2.0, 3.0] {
        path.begin_step(&world, time);
    }
    let (resumed, _) = self::path();
    resumed.load(path.save());
    heat(&mut world, 300.0);
    for each in [&path, &resumed] {
        each.begin_step(&world, 4.1);
    }
    assert_eq!(path.save(), resumed.save());
    assert_eq!(path.next_event(4.1), resumed.next_event(4.1));
    // pass 3 waits, since the block is colder than what it needs
    path.begin_step(&world, path.next_event(4.1).expect("the end of the pass"));
    assert!(
        path.unfinished(9.0)
            .is_some_and(|told| told.contains("at least 350 K at"))
    );
}

#[test]
fn what_happens_at_the_beginning_of_a_pass_has_not_happened_while_it_waits() {
    assert!(TrackTime::Running(2.0).has_passed(2.0));
    assert!(!TrackTime::Waiting(2.0).has_passed(2.0));
    assert!(TrackTime::Waiting(2.0).has_passed(1.9));
}

#[test]
fn conditions_that_cannot_be_measured_are_refused() {
    for (wait, message) in [
        ("temperature = -3", "`wait_until.temperature` is -3"),
        (
            "temperature = 400, region = 'right'",
            "no region is called `right`",
        ),
        (
            "temperature = 400, at = [9, 0, 0]",
            "`wait_until.at` is [9, 0, 0] m",
        ),
        (
            "temperature = 400, at = [0, 0, 0], region = 'left'",
            "both `region` and `at`",
        ),
    ] {
        let toolpath: crate::toolpath::Toolpath = toml::from_str(&format!(
            "sequence.passes = [{{ toolpath.line = {{ start = [0, 0, 0], end = [2, 0, 0], speed = 1 }},
             wait_until = {{ {wait} }} }}]"
        ))
        .expect("well formed");
        let track = toolpath.track(Some(100.0), Path::new("")).expect("valid");
        let mut world = World::new(vec![block([4, 2, 2], 3, STEEL)]);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("the torch");
        let refused = TimedPath::new(track)
            .prepare(&mut setup, 0)
            .expect_err(wait);
        assert!(refused.to_string().contains(message), "{refused}");
    }
}
