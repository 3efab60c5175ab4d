use super::*;
use crate::heat_source::{EllipsoidSource, PointSource};
use crate::testing::{STEEL, apply, block, prepare, refusal, total};
use perimelt_core::Coupler;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::SymmetryPlane;
use perimelt_core::{Body, Face, StepLimits, World};

const SHAPE: &str = "power = 100\nhalf_length = 0.5\nhalf_width = 2\ndepth = 1";

fn ellipsoid(toolpath: &str) -> EllipsoidSource {
    toml::from_str(&format!("{SHAPE}\ntoolpath.line = {toolpath}")).expect("valid")
}

fn value(source: &dyn RunningCoupler, name: &str) -> f64 {
    let reports = source.report();
    reports
        .iter()
        .find(|r| r.name == name)
        .expect("reported")
        .value
}

fn ready(source: impl Coupler + 'static) -> (World, Box<dyn RunningCoupler>) {
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    let (running, ()) = prepare(&mut world, source, |setup| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    })
    .expect("valid");
    (world, running)
}

#[test]
fn the_power_arrives_and_is_booked() {
    let source = ellipsoid("{ start = [5, 10, 8], end = [15, 10, 8], speed = 2 }");
    let (world, mut source) = ready(source);
    apply(&world, &mut *source, 0.0);
    apply(&world, &mut *source, 1.0);
    // two additions to the sink, of exact power; less is an error of a sum over 1e3 cells
    assert!((total(&world, &keys::HEAT_SOURCE) - 200.0).abs() < 1e-9);
    assert!((value(&*source, "energy.deposited") - 200.0).abs() < 1e-9);
    assert_eq!(value(&*source, "power.asked"), 100.0);
    assert_eq!(
        value(&*source, "position.x"),
        9.0,
        "at the end of the second step"
    );
    assert_eq!(source.step_limits(0.5).next_event, Some(5.0));
}

#[test]
fn power_beside_the_body_is_lost() {
    let source = ellipsoid("{ start = [-1, 10, 8], direction = [1, 0, 0], speed = 2 }");
    let (world, mut source) = ready(source);
    // half of the source is over the edge in the middle of the first second
    apply(&world, &mut *source, 0.0);
    assert!((value(&*source, "power.lost") - 50.0).abs() < 1e-9);
    assert!(
        (value(&*source, "energy.lost") + total(&world, &keys::HEAT_SOURCE) - 100.0).abs() < 1e-9
    );
}

/// A source on planes of symmetry heats the mirror images as well; what is lost is what misses the whole of them.
#[test]
fn the_part_beyond_a_plane_of_symmetry_heats_the_mirror_image() {
    let booked = |path: &str, planes: &[Face]| {
        let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
        let (mut source, ()) = prepare(&mut world, ellipsoid(path), |setup| {
            for &plane in planes {
                setup.publish(0, SymmetryPlane(plane)).expect("free");
            }
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *source, 0.0);
        ["asked", "deposited", "mirrored", "lost"]
            .map(|what| value(&*source, &format!("energy.{what}")))
    };
    let cases: [(&str, &[Face], [f64; 4]); 5] = [
        // in the middle of the step at x = 10
        (
            "{ start = [9, 0, 8], direction = [1, 0, 0], speed = 2 }",
            &[Face::YMin],
            [100.0, 50.0, 50.0, 0.0],
        ),
        (
            "{ start = [9, 20, 8], direction = [1, 0, 0], speed = 2 }",
            &[Face::YMax],
            [100.0, 50.0, 50.0, 0.0],
        ),
        // over the edge x = 0, which is no plane of symmetry
        (
            "{ start = [-1, 0, 8], direction = [1, 0, 0], speed = 2 }",
            &[Face::YMin],
            [100.0, 25.0, 25.0, 50.0],
        ),
        // a quarter
        (
            "{ start = [-1, 0, 8], direction = [1, 0, 0], speed = 2 }",
            &[Face::YMin, Face::XMin],
            [100.0, 25.0, 75.0, 0.0],
        ),
        // away from the plane
        (
            "{ start = [9, 10, 8], direction = [1, 0, 0], speed = 2 }",
            &[Face::YMin],
            [100.0, 100.0, 0.0, 0.0],
        ),
    ];
    for (path, planes, expected) in cases {
        let booked = booked(path, planes);
        for (part, expected) in booked.into_iter().zip(expected) {
            // sums over 1e3 cells
            assert!((part - expected).abs() < 1e-9, "{path}: {booked:?}");
        }
    }
}

#[test]
fn the_directions_of_travel_and_beam_are_reported() {
    let directions = |source: &dyn RunningCoupler| {
        ["travel", "beam"]
            .map(|what| ["x", "y", "z"].map(|axis| value(source, &format!("{what}.{axis}"))))
    };
    let tilt = "heated_surface.direction = [0, 3, -4]";
    let corner =
        "start = [5, 10, 8], segments = [{ to = [7, 10, 8] }, { to = [7, 14, 8] }], speed = 2";
    let source: EllipsoidSource = toml::from_str(&format!(
        "{SHAPE}\n{tilt}\ntoolpath.polyline = {{ {corner} }}"
    ))
    .expect("valid");
    let (world, mut source) = ready(source);
    let beam = [0.0, 0.6, -0.8];
    for (start, travel) in [(0.0, [1.0, 0.0, 0.0]), (1.0, [0.0, 1.0, 0.0])] {
        apply(&world, &mut *source, start);
        assert_eq!(directions(&*source), [travel, beam], "at {start} s");
    }
    // the end of the path: that of the last move
    apply(&world, &mut *source, 9.0);
    assert_eq!(directions(&*source)[0], [0.0, 1.0, 0.0]);
    let upright = ellipsoid("{ start = [5, 10, 8], direction = [0, -1, 0], speed = 2 }");
    let (_, upright) = ready(upright);
    assert_eq!(directions(&*upright), [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
}

#[test]
fn steps_are_short_while_the_source_is_on_only() {
    let source = ellipsoid("{ start = [5, 10, 8], end = [15, 10, 8], speed = 2, start_time = 3 }");
    let (world, mut source) = ready(source);
    apply(&world, &mut *source, 0.0);
    assert_eq!(source.step_limits(1.0).longest, None);
    apply(&world, &mut *source, 2.0);
    // a cell is longer than the source: a quarter of 1 m at 2 m/s
    assert_eq!(source.step_limits(3.0).longest, Some(0.125));
    apply(&world, &mut *source, 7.0);
    assert_eq!(source.step_limits(8.0).longest, None);
    // as it was, and as it will be
    assert_eq!(source.step_limits(3.0).longest, Some(0.125));
}

#[test]
fn energies_survive_a_save() {
    let source = || ellipsoid("{ start = [5, 10, 8], end = [15, 10, 8], speed = 2 }");
    let (world, mut first) = ready(source());
    apply(&world, &mut *first, 0.0);
    let saved = serde_json::to_string(&first.save(&world)).expect("serialises");
    let (other, mut resumed) = ready(source());
    let mut json = serde_json::Deserializer::from_str(&saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    resumed.load(&other, &mut erased).expect("reads");
    let again = serde_json::to_string(&resumed.save(&other)).expect("serialises");
    assert_eq!(again, saved);
    // powers, energies and path
    assert_eq!(resumed.report()[..10], first.report()[..10]);
}

#[test]
fn a_source_off_the_body_or_never_on_is_refused() {
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    for (toolpath, message) in [
        (
            "{ start = [-9, 10, 8], direction = [-1, 0, 0], speed = 2 }",
            "it is switched on at [-9, 10, 8] m, but body `block` spans [0, 0, 0]",
        ),
        (
            "{ start = [5, 10, 80], end = [15, 10, 80], speed = 2 }",
            "never heats the body",
        ),
        (
            "{ start = [5, 10, 8], end = [15, 10, 8], speed = 2, power = 0 }",
            "power of the source is zero at all times;",
        ),
    ] {
        let refused = refusal(&mut world, ellipsoid(toolpath));
        assert!(
            refused.starts_with("toolpath: ") && refused.contains(message),
            "{refused}"
        );
    }
    let refused = refusal(
        &mut world,
        ellipsoid("{ start = [5, 10, 8], end = [9, 9, 8], speed = -2 }"),
    );
    assert!(refused.starts_with("toolpath.line.speed: "), "{refused}");
    // an approach from outside is fine
    let approach = ellipsoid("{ start = [-90, 10, 8], direction = [1, 0, 0], speed = 2 }");
    ready(approach);
}

/// The power of a path 7 m above the body reaches it with a deep source only.
#[test]
fn a_beam_that_comes_through_another_body_is_accepted() {
    let path = "toolpath.line = { start = [5, 10, 15], end = [15, 10, 15], speed = 2 }";
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    let of_depth = |depth: f64| -> EllipsoidSource {
        let shape = SHAPE.replace("depth = 1", &format!("depth = {depth}"));
        assert!(shape.contains(&format!("depth = {depth}")));
        toml::from_str(&format!("{shape}\n{path}")).expect("valid")
    };
    let refused = refusal(&mut world, of_depth(1.0));
    assert!(refused.contains("never heats the body"), "{refused}");
    ready(of_depth(12.0));
}

/// A move without an end is followed as far as the body, wherever the body is.
#[test]
fn an_approach_from_far_beyond_the_origin_is_accepted() {
    let (min, max) = ([100.0, 0.0, 0.0], [104.0, 4.0, 4.0]);
    let shape = Shape::Box(BoxShape { min, max });
    let mut body = Body::fill("far", &shape, 3, 1.0, 1.0).expect("valid");
    body.materials = block([1, 1, 1], 3, STEEL).materials;
    let mut world = World::new(vec![body]);
    let approach = ellipsoid("{ start = [-100, 2, 4], direction = [1, 0, 0], speed = 2 }");
    let consume = |setup: &mut Setup<'_>| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    };
    prepare(&mut world, approach, consume).expect("it arrives after 100 s");
}

#[test]
fn keys_stand_side_by_side_and_mistakes_point_at_their_place() {
    let line = "toolpath.line = { start = [0, 0, 0], end = [1, 0, 0], speed = 1 }";
    let cases = [
        (
            format!("power = 1\nefficency = 1\n{line}"),
            "efficency",
            "unknown field",
        ),
        (format!("power = 'big'\n{line}"), "'big'", "invalid type"),
        (
            line.replace("speed = 1", "speed = true"),
            "true",
            "invalid type",
        ),
        (
            line.replace("speed", "sped"),
            "sped",
            "unknown field `sped`",
        ),
    ];
    for (text, place, message) in cases {
        let error = toml::from_str::<PointSource>(&text).err().expect(place);
        assert!(error.message().contains(message), "{error}");
        assert_eq!(&text[error.span().expect("has a place")], place, "{error}");
    }
    let error = toml::from_str::<PointSource>("power = 1")
        .err()
        .expect("no path");
    assert!(error.message().contains("missing field `toolpath`"));
}

#[test]
fn writing_and_reading_gives_the_same() {
    let source = ellipsoid("{ start = [5, 10, 8], end = [15, 10, 8], speed = 2 }");
    let boxed: Box<dyn Coupler> = Box::new(source);
    let json = serde_json::to_value(&boxed).expect("serialises");
    assert_eq!(json["type"], "ellipsoid");
    assert_eq!(
        (&json["power"], &json["toolpath"]["line"]["speed"]),
        (&100.0.into(), &2.0.into())
    );
    let mut keys = json.clone();
    keys.as_object_mut().expect("a table").remove("type");
    let again: Box<dyn Coupler> =
        Box::new(serde_json::from_value::<EllipsoidSource>(keys).expect("reads"));
    assert_eq!(serde_json::to_value(&again).expect("serialises"), json);
}

#[test]
fn the_schema_has_the_keys_of_the_shape_and_of_the_place() {
    let schema = schemars::schema_for!(EllipsoidSource).to_value();
    for key in ["body", "toolpath", "half_length", "power"] {
        assert!(
            schema["properties"][key]["description"].is_string(),
            "{key}"
        );
    }
    let required = schema["required"].as_array().expect("a list");
    assert!(required.contains(&"toolpath".into()) && !required.contains(&"body".into()));
}

/// A source of two passes, the second of which waits.
fn waiting() -> EllipsoidSource {
    let passes = "toolpath.sequence = { wait_until = { temperature = 400 }, passes = [
        { toolpath.line = { start = [5, 10, 8], end = [15, 10, 8], speed = 2 } },
        { toolpath.line = { start = [5, 10, 8], end = [15, 10, 8], speed = 2 } } ] }";
    toml::from_str(&format!("{SHAPE}\n{passes}")).expect("valid")
}

#[test]
fn a_source_that_waits_is_off_and_goes_on_after_a_resume_as_without() {
    let mut source = waiting();
    let path = source.timed_path(Path::new(".")).expect("valid");
    let (mut world, mut source) = ready_with_temperature(source);
    crate::testing::set(&mut world, &keys::TEMPERATURE, |_| 500.0);
    for time in 0..7 {
        source.begin_step(&world, f64::from(time));
        apply(&world, &mut *source, f64::from(time));
    }
    assert_eq!(value(&*source, "energy.deposited"), 500.0);
    source.begin_step(&world, 7.0);
    assert_eq!(source.step_limits(7.0), StepLimits::default());
    let longest = |time: f64| source.step_limits(time).longest;
    // the wait is foreseen to end at once, and the pass takes 5 s
    assert!(longest(7.5).is_some() && longest(11.9).is_some());
    assert_eq!(longest(12.1), None);
    assert!(path.programme(7.0).is_some_and(|p| p.waits.is_some()));
    let saved = serde_json::to_string(&source.save(&world)).expect("serialises");
    let (mut other, mut resumed) = ready_with_temperature(waiting());
    let mut json = serde_json::Deserializer::from_str(&saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    resumed.load(&other, &mut erased).expect("loads");
    for (world, source) in [(&mut world, &mut source), (&mut other, &mut resumed)] {
        crate::testing::set(world, &keys::TEMPERATURE, |_| 399.0);
        source.begin_step(world, 7.25);
        let limits = source.step_limits(7.25);
        assert!(limits.longest.is_some());
        assert_eq!(limits.next_event, Some(12.25));
        apply(world, &mut **source, 7.25);
        assert_eq!(value(&**source, "pass.2.start"), 7.25);
        assert_eq!(value(&**source, "energy.deposited"), 600.0);
    }
}

fn ready_with_temperature(source: EllipsoidSource) -> (World, Box<dyn RunningCoupler>) {
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    let (running, ()) = prepare(&mut world, source, |setup| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        setup.own(0, &keys::TEMPERATURE).expect("free");
    })
    .expect("valid");
    (world, running)
}

#[test]
fn the_absorptivity_is_that_of_the_material_unless_the_case_gives_one() {
    let beam = |keys: &str| -> MovingSource<crate::heat_source::shape::SuperGaussian> {
        let line = "toolpath.line = { start = [5, 10, 8], end = [15, 10, 8], speed = 2 }";
        toml::from_str(&format!(
            "power = 100\nradius = 2\npenetration_depth = 1\n{keys}\n{line}"
        ))
        .expect("valid")
    };
    let absorbed = |keys: &str, material: &str| {
        let mut world = World::new(vec![block([20, 20, 8], 3, material)]);
        let (mut source, ()) = prepare(&mut world, beam(keys), |setup| {
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .map_err(|e| e.to_string())?;
        apply(&world, &mut *source, 0.0);
        Ok(value(&*source, "power.asked"))
    };
    let dark = format!("{STEEL}\nabsorptivity = 0.3");
    assert_eq!(absorbed("", &dark), Ok(30.0));
    assert_eq!(absorbed("absorptivity = 0.8", &dark), Ok(80.0));
    assert_eq!(absorbed("wavelength = 1.07e-6", &dark), Ok(30.0));
    let refused = |keys: &str, material: &str| -> String { absorbed(keys, material).unwrap_err() };
    assert!(refused("", STEEL).contains("has no constant `absorptivity`"));
    assert!(refused("wavelength = 10.6e-6", &dark).contains("hold near 1 um"));
}

/// Whether a source of 3 m with these keys heats a block of 20 x 20 x 8 m.
fn heats(keys: &str) -> bool {
    let source: EllipsoidSource = toml::from_str(&format!(
        "power = 100\nhalf_length = 3\nhalf_width = 3\ndepth = 3\n{keys}"
    ))
    .expect("valid");
    let mut world = World::new(vec![block([20, 20, 8], 3, STEEL)]);
    let consumed = |setup: &mut Setup<'_>| {
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    };
    prepare(&mut world, source, consumed).is_ok()
}

#[test]
fn a_path_may_pass_beside_the_body_by_twice_the_size_of_the_source() {
    let passes = |distance: f64| {
        let y = 20.0 + distance;
        heats(&format!(
            "toolpath.line = {{ start = [0, {y}, 8], end = [20, {y}, 8], speed = 2 }}"
        ))
    };
    assert!(passes(5.9) && !passes(6.1));
}

#[test]
fn a_path_without_an_end_may_start_far_from_the_body() {
    for (speed, sign, expected) in [(0.01, 1, true), (50.0, 1, true), (0.01, -1, false)] {
        let keys = format!(
            "toolpath.line = {{ start = [-200, 10, 8], direction = [{sign}, 0, 0], speed = {speed} }}"
        );
        assert_eq!(heats(&keys), expected, "{keys}");
    }
    // the surface counts, at whatever height the path is
    let above = "toolpath.line = { start = [0, 10, 90], end = [20, 10, 90], speed = 1 }";
    assert!(!heats(above));
    assert!(heats(&format!("{above}\nheated_surface.level = 8")));
}
