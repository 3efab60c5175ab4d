//! What toolpaths of every kind promise.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::io::Write;

use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;

fn read(toml: &str) -> Toolpath {
    toml::from_str(toml).expect("the toolpath of the test is well formed")
}

fn track(toml: &str) -> Track {
    read(toml)
        .track(Some(100.0), Path::new(""))
        .expect("the toolpath of the test is valid")
}

fn error(toml: &str) -> SetupError {
    read(toml)
        .track(None, Path::new(""))
        .expect_err("the toolpath of the test is wrong")
}

/// One of every kind, with pauses, jumps and power changes; the table comes apart, from a file.
const KINDS: &[&str] = &[
    "line = { start = [0, 0, 1], end = [3, 4, 1], speed = 2 }",
    "line = { start = [0, 0, 1], direction = [1, 1, 0], speed = 2, start_time = 1, end_time = 4 }",
    "polyline = { start = [0, 0, 0], speed = 1, segments = [
        { to = [2, 0, 0], dwell = 0.5 },
        { to = [2, 3, 0], power = 0 },
        { to = [2, 3, 0], dwell = 0.25, dwell_power = 70 },
        { to = [0, 3, 0], speed = 4, power = 30, dwell = 1, dwell_power = 0 } ] }",
    "circle = { centre = [1, 2, 3], radius = 2, speed = 0.5, turns = 1.7, start_angle = 0.3 }",
    "circle = { centre = [1, 2, 3], radius = 2, speed = 0.5, turns = 0.6, clockwise = true }",
    "weave = { start = [0, 0, 0], end = [4, 3, 0], speed = 1, amplitude = 0.2, wavelength = 0.7 }",
    "weave = { start = [0, 0, 0], end = [4, 3, 0], speed = 1, amplitude = 0.2, wavelength = 0.7,
        shape = 'zigzag' }",
    "hatch = { corner = [1, 1, 0], length = 2, width = 0.9, spacing = 0.3, speed = 1, angle = 0.4,
        turn_time = 0.1, layers = 3, layer_height = 0.05, layer_angle = 1.2, layer_time = 2 }",
];

fn events(track: &Track) -> Vec<f64> {
    let mut events = vec![track.start()];
    while let Some(next) = track.next_event(events[events.len() - 1]) {
        events.push(next);
    }
    events
}

#[test]
fn midpoint_sampling_between_events_gives_the_energy() {
    for kind in KINDS {
        let track = track(kind);
        let events = events(&track);
        let sampled: f64 = events
            .windows(2)
            .map(|pair| track.power(0.5 * (pair[0] + pair[1])) * (pair[1] - pair[0]))
            .sum();
        let energy = track.energy(-1.0, 1e3);
        assert!(energy > 0.0, "{kind}");
        // sums of a few dozen terms in different order
        assert!(
            (sampled - energy).abs() < 1e-12 * energy,
            "{kind}: {sampled} {energy}"
        );
        assert_eq!(events.last().copied(), track.end(), "{kind}");
    }
}

#[test]
fn energies_follow_from_lengths_speeds_and_dwells() {
    // length / speed × 100 W, plus dwells
    let expected = [
        250.0,
        300.0,
        200.0 + 50.0 + 17.5 + 0.5 * 30.0,
        1.7 * TAU * 4.0 * 100.0,
        0.6 * TAU * 4.0 * 100.0,
        500.0,
        500.0,
        3.0 * 4.0 * 2.0 * 100.0,
    ];
    for (kind, expected) in KINDS.iter().zip(expected) {
        let energy = track(kind).energy(-1.0, 1e3);
        assert!(
            (energy - expected).abs() < 1e-11 * expected,
            "{kind}: {energy} {expected}"
        );
    }
}

#[test]
fn position_is_continuous_and_its_rate_is_the_speed() {
    let after_a_line = |kind: &str| {
        let line = "line = { start = [0, 0, 0], end = [1, 2, 3], speed = 1 }";
        format!("sequence = {{ passes = [ {{ toolpath.{line} }}, {{ toolpath.{kind} }} ] }}")
    };
    let later = KINDS[2..].iter().map(|kind| after_a_line(kind));
    let kinds = KINDS.iter().map(|kind| (*kind).to_string()).chain(later);
    for kind in kinds {
        let track = track(&kind);
        let events = events(&track);
        for pair in events.windows(2) {
            let at = |part: f64| pair[0] + part * (pair[1] - pair[0]);
            for part in [0.21, 0.5, 0.83] {
                let h = 1e-6 * (pair[1] - pair[0]);
                let [a, b] = [at(part) - h, at(part) + h].map(|t| track.pose(t).position);
                let velocity = (b - a) / (2.0 * h);
                let pose = track.pose(at(part));
                // central difference with step 1e-6: rounding 1e-10 / speed dominates
                assert!(
                    (velocity.norm() - pose.speed).abs() < 1e-6,
                    "{kind} at {part}"
                );
                assert!((pose.direction.norm() - 1.0).abs() < 1e-12);
                if pose.speed > 0.0 && !kind.contains("weave") {
                    assert!(
                        (velocity - pose.direction * pose.speed).norm() < 1e-6,
                        "{kind}"
                    );
                }
            }
        }
        // a pass may start anywhere
        if kind.starts_with("sequence") {
            continue;
        }
        for &event in &events {
            let [before, after] = [-1e-9, 1e-9].map(|h| track.pose(event + h).position);
            // the fastest source moves 4 m/s
            assert!((after - before).norm() < 1e-8, "{kind} jumps at {event} s");
        }
    }
}

#[test]
fn source_is_off_before_the_start_and_after_the_end() {
    for kind in KINDS {
        let track = track(kind);
        let end = track.end().expect("all paths of the test end");
        assert_eq!(track.power(track.start() - 1e-9), 0.0);
        assert_eq!(track.power(end), 0.0);
        assert_eq!(track.next_event(end), None);
        assert_eq!(track.next_event(track.start() - 5.0), Some(track.start()));
    }
}

#[test]
fn line_without_end_goes_on_for_ever() {
    let track = track("line = { start = [0, 0, 0.005], direction = [5, 0, 0], speed = 0.005 }");
    let pose = track.pose(4.0);
    assert_eq!(pose.position, Vector3::new(0.02, 0.0, 0.005));
    assert_eq!((pose.power, pose.speed), (100.0, 0.005));
    assert_eq!((track.end(), track.next_event(0.0)), (None, None));
    assert_eq!(track.energy(0.0, 4.0), 400.0);
}

#[test]
fn direction_is_kept_while_the_source_dwells() {
    let track = track(
        "polyline = { start = [0, 0, 0], speed = 1, segments = [
            { to = [0, 0, 0], dwell = 1 }, { to = [0, 1, 0], dwell = 1 } ] }",
    );
    assert_eq!(track.pose(0.5).direction, Vector3::x());
    assert_eq!(track.pose(2.5).direction, Vector3::y());
    assert_eq!(track.pose(2.5).speed, 0.0);
}

#[test]
fn circle_closes_and_turns_the_way_it_is_told() {
    let [left, right] = ["false", "true"].map(|clockwise| {
        track(&format!(
            "circle = {{ centre = [0, 0, 0], radius = 1, speed = 1, clockwise = {clockwise} }}"
        ))
    });
    // a quarter turn in pi/2 s; rounding of sine and cosine
    assert!((left.pose(FRAC_PI_2).position - Vector3::y()).norm() < 1e-15);
    assert!((right.pose(FRAC_PI_2).position + Vector3::y()).norm() < 1e-15);
    assert!((right.pose(0.0).direction + Vector3::y()).norm() < 1e-15);
    assert!((left.pose(TAU).position - Vector3::x()).norm() < 1e-15);
}

#[test]
fn weaves_swing_by_their_amplitude_and_face_along_the_seam() {
    for (shape, wavelength) in [
        ("sine", 1.0),
        ("zigzag", 1.0),
        ("sine", 2.0),
        ("zigzag", 2.0),
    ] {
        let track = track(&format!(
            "weave = {{ start = [0, 0, 0], end = [4, 0, 0], speed = {}, amplitude = 0.3,
             wavelength = {wavelength}, shape = '{shape}' }}",
            2.0 * wavelength
        ));
        for (time, y) in [
            (0.0, 0.0),
            (0.25, 0.3),
            (0.5, 0.0),
            (0.75, -0.3),
            (1.25, 0.3),
        ] {
            // two wavelengths a second
            let pose = track.pose(0.5 * time);
            let expected = Vector3::new(wavelength * time, y, 0.0);
            assert!(
                (pose.position - expected).norm() < 1e-14,
                "{shape} {wavelength} {time}"
            );
            assert_eq!(pose.direction, Vector3::x());
            assert!(pose.speed > 1.98 * wavelength);
        }
    }
}

#[test]
fn hatch_lines_fill_the_rectangle() {
    let track = track(
        "hatch = { corner = [1, 1, 0], length = 2, width = 0.9, spacing = 0.3, speed = 1,
         turn_time = 0.5, layers = 2, layer_height = 0.1, layer_time = 3 }",
    );
    // four lines of 2 s with 0.5 s between; the second runs backwards; rounding only
    let at = |time: f64| track.pose(time).position;
    assert!((at(0.0) - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-14);
    assert!((at(3.0) - Vector3::new(2.5, 1.3, 0.0)).norm() < 1e-14);
    assert_eq!(track.power(2.25), 0.0);
    assert!((at(9.499) - Vector3::new(1.001, 1.9, 0.0)).norm() < 1e-14);
    // second layer after 9.5 + 3 s
    assert!((at(12.5) - Vector3::new(1.0, 1.0, 0.1)).norm() < 1e-14);
    assert!((track.end().expect("a hatch ends") - 22.0).abs() < 1e-13);
}

fn table(content: &str) -> Result<Track, SetupError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut file = std::fs::File::create(folder.path().join("path.csv")).expect("a file");
    file.write_all(content.as_bytes()).expect("a written file");
    read("table = { file = 'path.csv' }").track(Some(100.0), folder.path())
}

#[test]
fn table_is_linear_between_rows_and_jumps_at_equal_times() {
    let track = table(
        "# by hand\ntime, x, y, z, power\n1,0,0,0,0\n2,1,0,0,10\n2,1,0,0,50\n4,1,4,0,\n5,1,4,0,0\n",
    )
    .expect("a valid table");
    assert_eq!(track.pose(1.5).position, Vector3::new(0.5, 0.0, 0.0));
    assert_eq!(track.power(1.5), 5.0);
    assert_eq!(track.power(2.0), 50.0);
    // the empty entry takes the power of the source, 100 W
    assert_eq!((track.power(3.0), track.pose(3.0).speed), (75.0, 2.0));
    assert_eq!(track.pose(4.5).direction, Vector3::y());
    assert_eq!(events(&track), [1.0, 2.0, 4.0, 5.0]);
    assert_eq!(track.energy(0.0, 9.0), 5.0 + 150.0 + 50.0);
}

#[test]
fn table_mistakes_name_the_line() {
    let cases = [
        (
            "time,x,y,z,power\n0,0,0,0,1\n1,0,0,0,1\n0.5,0,0,0,1\n",
            "line 4",
        ),
        (
            "time,x,y,z,power\n0,0,0,0,1\n\n# note\n1,0,zero,0,1\n",
            "line 5",
        ),
        ("time,x,y,z,power\n0,0,0,0,1\n1,0,0\n", "line 3"),
        ("time,x,y,z,power\n0,0,0,0,1\n1,0,0,0,b", "line 3"),
        (
            "# note\ntime,x,y,z,power\r\nO,0,0,0,1\r\n1,0,0,0,1\r\n",
            "line 3",
        ),
        ("# note\n\ntime,x,z,power\n0,0,0,1\n", "line 3"),
        ("time,x,y,z,power\n0,0,0,0,1\n1,0,0,0,-2\n", "line 3"),
        ("time,x,y,z,power\n0,0,0,0,1\n1,inf,0,0,2\n", "line 3"),
        ("0,0,0,0,1\n1,0,0,0,1\n", "time,x,y,z,power"),
        ("time,x,y,z,powr\n0,0,0,0,1\n1,0,0,0,1\n", "powr"),
        ("time,x,y,z,power\n0,0,0,0,1\n", "1 rows"),
        ("", "0 rows"),
    ];
    for (content, expected) in cases {
        let message = table(content).expect_err("a faulty table").to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        assert!(message.contains("path.csv"), "{message}");
    }
    let missing = error("table = { file = 'none.csv' }").to_string();
    assert!(missing.starts_with("cannot read the toolpath table none.csv"));
}

#[test]
fn mistakes_name_the_key() {
    let cases = [
        ("line = { start = [0,0,0], end = [1,0,0], speed = 0, power = 1 }", "speed"),
        ("line = { start = [0,0,0], end = [1,0,0], speed = nan, power = 1 }", "speed"),
        ("line = { start = [0,0,0], end = [0,0,0], speed = 1, power = 1 }", "end"),
        ("line = { start = [0,0,0], speed = 1, power = 1 }", "start"),
        ("line = { start = [0,0,0], end = [1,0,0], speed = 1 }", "power"),
        ("line = { start = [0,0,0], end = [1,0,0], speed = 1, power = -1 }", "power"),
        ("line = { start = [0,0,0], direction = [1,0,0], speed = 1, power = 1, end_time = 0 }",
            "end_time"),
        ("line = { start = [0,0,0], end = [1,0,0], direction = [1,0,0], speed = 1, power = 1 }",
            "direction"),
        ("line = { start = [0,inf,0], end = [1,0,0], speed = 1, power = 1 }", "start"),
        ("polyline = { start = [0,0,0], power = 1, segments = [] }", "segments"),
        ("polyline = { start = [0,0,0], power = 1, speed = 1, segments = [
            { to = [1,0,0] }, { to = [2,0,0], dwell = -1 } ] }", "segments[1].dwell"),
        ("polyline = { start = [0,0,0], power = 1, segments = [{ to = [1,0,0] }] }",
            "segments[0].speed"),
        ("circle = { centre = [0,0,0], radius = -1, speed = 1, power = 1 }", "radius"),
        ("weave = { start = [0,0,0], end = [0,0,1], speed = 1, amplitude = 1, wavelength = 1,
            power = 1 }", "end"),
        ("weave = { start = [0,0,0], end = [1,0,0], speed = 1, amplitude = 1, wavelength = 1e-12,
            power = 1, shape = 'zigzag' }", "wavelength"),
        ("hatch = { corner = [0,0,0], length = 1, width = 1, spacing = 1e-12, speed = 1,
            power = 1 }", "spacing"),
    ];
    for (toml, key) in cases {
        let error = error(toml);
        assert_eq!(error.key, key, "{toml}: {error}");
    }
    let unknown = "line = { start = [0,0,0], end = [1,0,0], sped = 1 }";
    assert!(toml::from_str::<Toolpath>(unknown).is_err());
}

proptest! {
    #[test]
    fn polyline_energy_is_the_sum_over_its_segments(
        legs in prop::collection::vec((-1.0..1.0, -1.0..1.0, 0.1..3.0, 0.0..500.0, 0.0..2.0), 1..9),
    ) {
        let mut segments = Vec::new();
        let (mut at, mut energy, mut duration) = (Vector3::zeros(), 0.0, 0.0);
        for (dx, dy, speed, power, dwell) in legs {
            let to = at + Vector3::new(dx, dy, 0.0);
            let time = (to - at).norm() / speed + dwell;
            (energy, duration) = (energy + power * time, duration + time);
            at = to;
            segments.push(Segment {
                to: to.into(), speed: Some(speed), power: Some(power), dwell, dwell_power: None,
                wait_until: None,
            });
        }
        let path = Polyline { start: [0.0; 3], start_time: 0.0, speed: None, power: None, segments };
        let track = Toolpath::Polyline(path).track(None, Path::new("")).expect("a valid path");
        // a dozen roundings
        prop_assert!((track.energy(0.0, 1e6) - energy).abs() <= 1e-11 * (1.0 + energy));
        prop_assert!((track.end().expect("it ends") - duration).abs() <= 1e-12 * duration);
        prop_assert!((track.pose(duration + 1.0).position - at).norm() < 1e-12);
    }
}

/// A sequence of three passes of 2 m at 1 m/s, the last two of which wait.
const SEQUENCE: &str = "sequence = { wait_until = { temperature = 400 }, passes = [
    { toolpath.line = { start = [0, 0, 0], end = [2, 0, 0], speed = 1 } },
    { toolpath.line = { start = [0, 1, 0], end = [2, 1, 0], speed = 1, power = 50, start_time = 0.5 } },
    { toolpath.line = { start = [0, 2, 0], direction = [1, 0, 0], speed = 1 }, torch = [0, -1, -1],
      wait_until = { temperature = 350, when = 'above', at = [0, 0, 0] } } ] }";

#[test]
fn a_sequence_lays_its_passes_one_after_the_other() {
    let track = track(SEQUENCE);
    let starts: Vec<f64> = track.passes().iter().map(|p| p.time).collect();
    assert_eq!(starts, [0.0, 2.0, 4.5]);
    assert_eq!(events(&track), [0.0, 2.0, 2.5, 4.5]);
    assert_eq!(track.pose(2.25).power, 0.0);
    assert_eq!(track.pose(3.5).position, Vector3::new(1.0, 1.0, 0.0));
    assert_eq!(
        (track.pose(1.0).power, track.pose(3.0).power),
        (100.0, 50.0)
    );
    assert_eq!(track.pose(3.0).torch, None);
    let axis = track.pose(5.0).torch.expect("that of the pass");
    assert!((axis - Vector3::new(0.0, -1.0, -1.0).normalize()).norm() < 1e-15);
    assert_eq!(track.rest_before(2.0).position, Vector3::new(2.0, 0.0, 0.0));
    assert_eq!(track.rest_before(0.0).position, Vector3::zeros());
}

#[test]
fn mistakes_in_a_sequence_are_told_with_their_pass() {
    let key = |text: &str| {
        let error = read(text).track(Some(1.0), Path::new("")).expect_err(text);
        error.key
    };
    let line = "toolpath.line = { start = [0, 0, 0], direction = [1, 0, 0], speed";
    let passes = |passes: &str| key(&format!("sequence = {{ passes = [{passes}] }}"));
    assert_eq!(passes(""), "passes");
    assert_eq!(
        passes(&format!("{{ {line} = -1 }} }}")),
        "passes[0].toolpath.line.speed"
    );
    assert_eq!(
        passes(&format!("{{ {line} = 1 }} }}, {{ {line} = 1 }} }}")),
        "passes[0].toolpath"
    );
    assert_eq!(
        passes(&format!("{{ {line} = 1, start_time = -1 }} }}")),
        "passes[0].toolpath.line.start_time"
    );
    assert_eq!(
        passes(&format!("{{ {line} = 1 }}, torch = [0, 0, 0] }}")),
        "passes[0].torch"
    );
}

#[test]
fn waits_are_steps_of_polylines_hatches_tables_and_programs() {
    let starts = |track: &Track| -> Vec<(f64, bool)> {
        let passes = track.passes().iter();
        passes.map(|p| (p.time, p.wait.is_some())).collect()
    };
    let wait = "wait_until = { temperature = 400 }";
    let polyline = track(&format!(
        "polyline = {{ start = [0, 0, 0], speed = 1, segments = [{{ to = [1, 0, 0] }}, \
         {{ to = [2, 0, 0], {wait} }}, {{ to = [3, 0, 0] }}, {{ to = [4, 0, 0], {wait} }}] }}"
    ));
    let expected = [(0.0, false), (1.0, true), (3.0, true)];
    assert_eq!(starts(&polyline), expected);
    let hatch = track(&format!(
        "hatch = {{ corner = [0, 0, 0], length = 2, width = 0, spacing = 1, speed = 1, layers = 3, \
         layer_time = 1, {wait} }}"
    ));
    assert_eq!(starts(&hatch), [(0.0, false), (3.0, true), (6.0, true)]);
    let program = "F60000 M3\nG1 X1000\nM0\nX2000\nM1 (a stop)\nM5\nM0\nM30";
    let gcode = track(&format!("gcode = {{ program = '''{program}''', {wait} }}"));
    // the stops after the last move delay nothing
    assert_eq!(starts(&gcode), [(0.0, false), (1.0, true)]);
    let without = track(&format!("gcode = {{ program = '''{program}''' }}"));
    assert_eq!(starts(&without), []);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("path.csv");
    std::fs::write(&path, "time,x,y,z,wait\n0,0,0,0,\n1,1,0,0,1\n2,2,0,0,0\n").expect("written");
    let table = |keys: &str| {
        read(&format!("table = {{ file = 'path.csv'{keys} }}")).track(Some(1.0), folder.path())
    };
    let found = table(&format!(", {wait}")).expect("valid");
    assert_eq!(starts(&found), [(0.0, false), (1.0, true)]);
    let error = table("")
        .expect_err("a wait without its condition")
        .to_string();
    assert!(
        error.contains("line 3") && error.contains("wait_until"),
        "{error}"
    );
}

#[test]
fn a_circle_runs_about_any_axis_and_its_torch_points_to_the_centre() {
    let of = |axis: &str, angle: f64| {
        track(&format!(
            "circle = {{ centre = [1, 2, 3], radius = 2, speed = 2, axis = {axis}, torch = 'inward', start_angle = {angle} }}"
        ))
    };
    let centre = Vector3::new(1.0, 2.0, 3.0);
    for (axis, first, quarter) in [
        ("[1, 0, 0]", Vector3::y(), Vector3::z()),
        ("[0, 1, 0]", Vector3::x(), -Vector3::z()),
        ("[0, 0, 5]", Vector3::x(), Vector3::y()),
        ("[0, 0, -1]", Vector3::x(), -Vector3::y()),
    ] {
        let track = of(axis, 0.0);
        assert!(
            (track.pose(0.0).position - centre - first * 2.0).norm() < 1e-12,
            "{axis}"
        );
        let pose = track.pose(FRAC_PI_2);
        assert!(
            (pose.position - centre - quarter * 2.0).norm() < 1e-12,
            "{axis}"
        );
        assert!((pose.direction + first).norm() < 1e-12, "{axis}");
        let torch = pose.torch.expect("inward");
        assert!((torch + quarter).norm() < 1e-12, "{axis}");
        assert!((of(axis, FRAC_PI_2).pose(0.0).position - pose.position).norm() < 1e-12);
    }
}
