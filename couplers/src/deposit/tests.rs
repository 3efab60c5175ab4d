use super::*;
use crate::testing::{STEEL, block, prepare, read, refusal, values};
use nalgebra::Vector3;
use perimelt_core::Body;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::solver::Reducer;
use perimelt_core::world::SymmetryPlane;

/// A block of unit cells whose region `top` begins at this coordinate along its last axis.
fn part(cells: [usize; 3], dimension: usize, from: f64) -> Body {
    let mut body = block(cells, dimension, STEEL);
    let mut min = [0.0; 3];
    min[dimension - 1] = from;
    let max = cells.map(|c| c as f64);
    let top = Shape::Box(BoxShape { min, max });
    body.regions.insert("top".into(), body.points_in(&top));
    body
}

/// The positions of active points after a step that ends at a time (s).
fn active(world: &World) -> Vec<Vector3<f64>> {
    let active = values(world, &keys::ACTIVE);
    let positions = &world.body(0).points.position;
    let there = active.iter().zip(positions).filter(|(a, _)| **a > 0.5);
    there.map(|(_, x)| *x).collect()
}

fn deposit(world: &mut World, table: &str) -> Box<dyn RunningCoupler> {
    let coupler: Deposit = read(table);
    prepare(world, coupler, |_| ()).expect("valid").0
}

fn apply(world: &World, coupler: &mut dyn RunningCoupler, step: Step) {
    coupler.apply(world, step).expect("it applies");
}

#[test]
fn layers_come_one_after_the_other_and_several_at_once_where_asked() {
    for (at_once, expected) in [(1, [0, 1, 2, 3, 4]), (2, [0, 2, 2, 4, 4])] {
        let mut world = World::new(vec![part([3, 2, 6], 3, 2.0)]);
        let table = format!(
            "region = 'top'\ntemperature = {{ time = [0, 40], value = [1000, 1400] }}
             layers = {{ height = 1, interval = 10, first = 5, at_once = {at_once} }}"
        );
        let mut coupler = deposit(&mut world, &table);
        apply(&world, &mut *coupler, Step::new(0.0, 0.0));
        let mut events = Vec::new();
        let next = |after: f64| coupler.step_limits(after).next_event;
        while let Some(event) = next(events.last().copied().unwrap_or(0.0)) {
            events.push(event);
        }
        let layers: Vec<f64> = (0..4 / at_once)
            .map(|n| 5.0 + 10.0 * f64::from(n * at_once))
            .collect();
        assert_eq!(events, layers);
        for (index, layers) in expected.into_iter().enumerate() {
            // the steps that end and begin at the event
            let start = 10.0 * index as f64 - 5.0;
            apply(&world, &mut *coupler, Step::new(start, 10.0));
            assert_eq!(active(&world).len(), 6 * (2 + layers), "{at_once}");
        }
        let birth = values(&world, &keys::BIRTH_TEMPERATURE);
        assert_eq!((birth[0], birth[12]), (0.0, 1050.0));
        let [points, volume, mass] = [0, 1, 2].map(|i| coupler.report()[i].value);
        assert_eq!([points, volume, mass], [24.0, 24.0, 24.0 * 8000.0]);
    }
}

#[test]
fn a_bead_covers_what_lies_within_its_cross_section() {
    let mut world = World::new(vec![part([20, 9, 5], 3, 1.0)]);
    let table = "region = 'top'\ntemperature = 1900\nbead = { width = 4, height = 2 }
         toolpath.polyline = { start = [5, 4, 3], speed = 2, segments = [{ to = [15, 4, 3] }, \
         { to = [15, 4, 5], power = 0 }, { to = [5, 4, 5] }] }";
    let mut coupler = deposit(&mut world, table);
    let before = active(&world).len();
    assert_eq!(before, 180);
    let mut until = 0.0;
    let mut count = before;
    while until < 11.0 {
        apply(&world, &mut *coupler, Step::new(until, 0.25));
        until += 0.25;
        let now = active(&world);
        let front = 5.0 + 2.0 * until.min(5.0) + 2.0;
        let is_inside = |x: &Vector3<f64>| {
            let across = x.y - 4.0;
            let along = (5.0 - x.x).max(x.x - front + 2.0).max(0.0);
            x.z < 1.0 || x.z < 5.0 && across.hypot(along) <= 2.0 + 1e-6
        };
        assert!(now.iter().all(is_inside), "{until}");
        // nothing while the toolpath has no power
        if (5.5..=6.0).contains(&until) {
            assert_eq!(now.len(), count);
        }
        count = now.len();
    }
    // 4 by 2 along the seam of 10, and rounded ends
    let volume = coupler.report()[1].value;
    let exact = 2.0 * 2.0 * (4.0 * 10.0 + std::f64::consts::PI * 4.0);
    assert!((volume / exact - 1.0).abs() < 0.05, "{volume} {exact}");
    assert_eq!(coupler.step_limits(until).longest, None, "all is deposited");
    assert_eq!(
        coupler.step_limits(0.1).next_event,
        Some(6.0),
        "the second bead"
    );
}

#[test]
fn a_restored_coupler_goes_on_and_counts_the_same() {
    let table = "region = 'top'\ntemperature = 900\nlayers = { height = 1, interval = 1 }";
    let mut world = World::new(vec![part([4, 3, 8], 3, 3.0)]);
    let mut first = deposit(&mut world, table);
    for step in 0..3 {
        apply(&world, &mut *first, Step::new(f64::from(step), 1.0));
    }
    let mut other = World::new(vec![part([4, 3, 8], 3, 3.0)]);
    let mut second = deposit(&mut other, table);
    for key in [&keys::ACTIVE, &keys::BIRTH_TEMPERATURE] {
        let saved = values(&world, key);
        crate::testing::set(&mut other, key, |point| saved[point]);
    }
    for (world, coupler) in [(&world, &mut first), (&other, &mut second)] {
        apply(world, &mut **coupler, Step::new(3.0, 1.0));
    }
    assert_eq!(first.report(), second.report());
    assert_eq!(values(&world, &keys::ACTIVE), values(&other, &keys::ACTIVE));
}

#[test]
fn plates_and_rods_are_built_up_along_their_last_axis() {
    for dimension in [1, 2] {
        let mut world = World::new(vec![part([6, 6, 1], dimension, 2.0)]);
        let table = "region = 'top'\ntemperature = 900\nlayers = { height = 1, interval = 1 }";
        let mut coupler = deposit(&mut world, table);
        apply(&world, &mut *coupler, Step::new(0.9, 0.9));
        let highest = active(&world)
            .iter()
            .map(|x| x[dimension - 1])
            .fold(0.0, f64::max);
        assert_eq!(highest, 3.5);
    }
}

#[test]
fn mistakes_are_told_with_their_key() {
    let base = "region = 'top'\ntemperature = 1000\n";
    for (table, key, words) in [
        (
            "region = 'tip'\ntemperature = 1\nlayers = { height = 1, interval = 1 }",
            "region",
            "`top`",
        ),
        (
            "region = 'top'\ntemperature = -5\nlayers = { height = 1, interval = 1 }",
            "temperature",
            "above 0 K",
        ),
        (base, "", "`layers`"),
        (
            &format!("{base}layers = {{ height = 0.4, interval = 1 }}"),
            "layers.height",
            "at_once",
        ),
        (
            &format!("{base}layers = {{ height = 1, interval = -1 }}"),
            "layers.interval",
            "0 s or more",
        ),
        (
            &format!(
                "{base}toolpath.line = {{ start = [0, 0, 3], direction = [1, 0, 0], speed = 1 }}"
            ),
            "toolpath",
            "`bead`",
        ),
        (
            &format!(
                "{base}bead = {{ width = 0, height = 1 }}\ntoolpath.line = {{ start = [0, 0, 3], direction = [1, 0, 0], speed = 1 }}"
            ),
            "bead.width",
            "above 0 m",
        ),
        (
            &format!(
                "{base}bead = {{ width = 1, height = 1 }}\ntoolpath.line = {{ start = [0, 0, 30], direction = [1, 0, 0], speed = 1 }}"
            ),
            "toolpath",
            "covers no point",
        ),
        (
            &format!("{base}up = 'z+'\nlayers = {{ height = 1, interval = 1 }}"),
            "up",
            "2D",
        ),
    ] {
        let dimension = if key == "up" { 2 } else { 3 };
        let mut world = World::new(vec![part([4, 3, 5], dimension, 2.0)]);
        let coupler: Deposit = read(table);
        let message = refusal(&mut world, coupler);
        assert!(message.starts_with(&format!("{key}: ")), "{message}");
        assert!(message.contains(words), "{message}");
    }
}

/// A deposit that follows a path of two passes, the second of which waits, and the path.
fn following(world: &mut World) -> (Box<dyn RunningCoupler>, Rc<TimedPath>) {
    let toolpath: Toolpath = toml::from_str(
        "sequence = { passes = [
            { toolpath.line = { start = [5, 4, 3], end = [15, 4, 3], speed = 2 } },
            { toolpath.line = { start = [5, 4, 5], end = [15, 4, 5], speed = 2 }, wait_until = { temperature = 400 } } ] }",
    )
    .expect("well formed");
    let track = toolpath.track(Some(100.0), std::path::Path::new(""));
    let path = Rc::new(TimedPath::new(track.expect("valid")));
    let coupler: Deposit = read(
        "region = 'top'\nsource = 'torch'\nbead = { width = 4, height = 2 }
         temperature = { time = [0, 100], value = [1000, 2000] }",
    );
    let mut setup = Setup::new(world, std::path::Path::new("."));
    setup.next_plugin("torch");
    setup.share(path.clone());
    path.prepare(&mut setup, 0)
        .expect("a body with a temperature");
    setup.next_plugin("the deposit");
    let running = Box::new(coupler).prepare(&mut setup);
    (running.expect("it follows the torch"), path)
}

#[test]
fn the_deposit_of_a_source_waits_with_it() {
    let mut world = World::new(vec![part([20, 9, 5], 3, 1.0)]);
    let (mut coupler, path) = following(&mut world);
    crate::testing::set(&mut world, &keys::TEMPERATURE, |_| 500.0);
    path.begin_step(&world, 0.0);
    assert!(
        coupler.step_limits(0.0).longest.is_some(),
        "the bead begins at once"
    );
    for step in 0..20 {
        apply(
            &world,
            &mut *coupler,
            Step::new(0.25 * f64::from(step), 0.25),
        );
    }
    let first = active(&world).len();
    path.begin_step(&world, 5.0);
    apply(&world, &mut *coupler, Step::new(5.0, 35.0));
    path.begin_step(&world, 40.0);
    assert_eq!(
        active(&world).len(),
        first,
        "nothing is deposited during the wait"
    );
    assert_eq!(coupler.step_limits(40.0), StepLimits::default());

    crate::testing::set(&mut world, &keys::TEMPERATURE, |_| 399.0);
    path.begin_step(&world, 40.0);
    assert!(coupler.step_limits(40.0).longest.is_some());
    apply(&world, &mut *coupler, Step::new(40.0, 0.25));
    assert!(active(&world).len() > first);
    let birth = values(&world, &keys::BIRTH_TEMPERATURE);
    let hottest = birth.iter().copied().fold(0.0, f64::max);
    assert!(
        (hottest - 1400.0).abs() < 2.5,
        "at the time of the run: {hottest}"
    );
}

#[test]
fn sources_that_a_deposit_cannot_follow_are_told() {
    let bead = "region = 'top'\ntemperature = 1900\nbead = { width = 1, height = 1 }";
    let line = "toolpath.line = { start = [0, 0, 3], direction = [1, 0, 0], speed = 1 }";
    let sequence = "toolpath.sequence.passes = [{ toolpath.line = { start = [0, 0, 3], end = [3, 0, 3], speed = 1 },
        wait_until = { temperature = 400 } }]";
    for (keys, key, words) in [
        (
            "source = 'arc'".to_string(),
            "source",
            "no heat source is called `arc`",
        ),
        (
            format!("source = 'arc'\n{line}"),
            "source",
            "both `source` and a toolpath",
        ),
        (
            sequence.to_string(),
            "toolpath",
            "waits belongs to a heat source",
        ),
    ] {
        let mut world = World::new(vec![part([4, 3, 5], 3, 2.0)]);
        let coupler: Deposit = read(&format!("{bead}\n{keys}"));
        let message = refusal(&mut world, coupler);
        assert!(message.starts_with(&format!("{key}: ")), "{message}");
        assert!(message.contains(words), "{message}");
    }
}

/// The bead of an inclined torch lies along its axis, whether the source or the pass gives it.
#[test]
fn a_bead_follows_the_axis_of_an_inclined_torch() {
    let axis = Vector3::new(0.0, -1.0, -1.0).normalize();
    let bead = Bead {
        width: 4.0,
        height: 3.0,
    };
    let body = part([20, 12, 12], 3, 0.0);
    let line = "line = { start = [4, 6, 6], end = [16, 6, 6], speed = 2 }";
    let pass = format!("sequence = {{ passes = [{{ toolpath.{line}, torch = [0, -1, -1] }}] }}");
    for (toolpath, torch) in [(line, Some(axis)), (&pass, None)] {
        let toolpath: Toolpath = toml::from_str(toolpath).expect("well formed");
        let track = toolpath.track(Some(1.0), std::path::Path::new(""));
        let placed = BuildRegion {
            body: &body,
            points: &body.regions["top"].points,
            up: Face::ZMax,
            reducer: Reducer::alone(body.points.len()),
        };
        let births = placed.by_bead(&track.expect("valid"), &bead, torch);
        let mut covered = vec![false; body.points.len()];
        births.iter().for_each(|b| covered[b.point as usize] = true);
        for (point, at) in body.points.position.iter().enumerate() {
            let from = at - Vector3::new(at.x.clamp(4.0, 16.0), 6.0, 6.0);
            let depth = from.dot(&axis);
            let across = (from - axis * depth).norm();
            let expected = (-1e-6..3.0).contains(&depth) && across < 2.0;
            // along the seam beads advance by samples of an eighth of a spacing
            if (across - 2.0).abs() > 0.1 {
                assert_eq!(covered[point], expected, "{at}");
            }
        }
    }
}

const BEAD: &str =
    "region = 'top'\nsource = 'torch'\nbead = { width = 3, height = 2 }\ntemperature = 900";

/// What a torch asked for (J) and the points that were deposited, at these times of a run (s).
fn weld(path: &str, keys: &str, is_half: bool, times: &[f64]) -> Vec<[f64; 2]> {
    let shape = "power = 2e11\nefficiency = 0.8\nhalf_length = 2\nhalf_width = 2\ndepth = 2";
    let mut world = World::new(vec![part([20, 9, 5], 3, 3.0)]);
    let mut torch: crate::heat_source::EllipsoidSource = read(&format!("{shape}\n{path}"));
    let coupler: Deposit = read(&format!("{BEAD}\n{keys}"));
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    if is_half {
        setup.publish(0, SymmetryPlane(Face::YMin)).expect("free");
    }
    setup.next_plugin("torch");
    torch.publish(&mut setup).expect("valid");
    let mut torch = Box::new(torch).prepare(&mut setup).expect("valid");
    setup.next_plugin("the deposit");
    let mut coupler = Box::new(coupler).prepare(&mut setup).expect("valid");
    setup.next_plugin("the physics");
    setup.consume(0, &keys::HEAT_SOURCE).expect("free");
    setup.finish().expect("complete");
    let mut at = 0.0;
    let state = |until: &f64| {
        while at < *until {
            coupler.begin_step(&world, at);
            torch.begin_step(&world, at);
            let end = torch
                .step_limits(at)
                .next_event
                .unwrap_or(*until)
                .min(*until);
            let step = Step::new(at, end.min(at + 0.25) - at);
            torch.apply(&world, step).expect("applies");
            apply(&world, &mut *coupler, step);
            at = step.end();
        }
        let reports = torch.report();
        let asked = reports.iter().find(|r| r.name == "energy.asked");
        [asked.expect("reported").value, coupler.report()[0].value]
    };
    times.iter().map(state).collect()
}

/// Source and droplets together bring the energy of the source.
#[test]
fn heat_of_the_material_is_taken_out_of_that_of_the_source() {
    let line = |y: f64| {
        format!("toolpath.line = {{ start = [4.5, {y}, 5], end = [14.5, {y}, 5], speed = 2 }}")
    };
    // with the path in the middle of the body, or on a plane of symmetry, behind which there is as much material
    for (keys, pulse, feed, is_half) in [
        ("", "", None, false),
        ("heat = 'added'", "", None, false),
        ("heat = 'from_source'", "", Some(293.15), false),
        ("heat = 'from_source'", "", Some(293.15), true),
        (
            "heat = 'from_source'\nfeed_temperature = 400",
            "",
            Some(400.0),
            false,
        ),
        (
            "heat = 'from_source'",
            "pulse = { frequency = 1, duty = 0.5 }",
            Some(293.15),
            false,
        ),
    ] {
        let line = line(if is_half { 0.0 } else { 4.5 });
        // the last material comes in the step after the end of the path
        let states = weld(&format!("{pulse}\n{line}"), keys, is_half, &[5.5]);
        let [asked, points] = states[0];
        let least = if is_half { 20.0 } else { 50.0 };
        assert!(points > least, "{points}");
        // 8000 kg/m³ and 500 J/(kg K) of a cubic metre each
        let copies = if is_half { 2.0 } else { 1.0 };
        let droplets = feed.map_or(0.0, |feed| copies * points * 4e6 * (900.0 - feed));
        let duty = if pulse.is_empty() { 1.0 } else { 0.5 };
        let whole = 0.8 * 2e11 * 5.0 * duty;
        assert!(
            ((asked + droplets) / whole - 1.0).abs() < 1e-9,
            "{keys} {pulse}: {asked} + {droplets} of {whole}"
        );
    }
    let line = line(4.5);
    for (keys, key) in [
        (format!("heat = 'from_source'\n{line}"), "heat"),
        (format!("feed_temperature = -3\n{line}"), "feed_temperature"),
    ] {
        let bead = BEAD.replace("source = 'torch'\n", "");
        let mut world = World::new(vec![part([20, 9, 5], 3, 3.0)]);
        let message = refusal(&mut world, read::<Deposit>(&format!("{bead}\n{keys}")));
        assert!(message.starts_with(&format!("{key}: ")), "{message}");
    }
}

/// Passes that leave much metal, none and little each bring their energy; slopes of the power belong to their pass.
#[test]
fn each_pass_brings_its_energy_whatever_metal_it_leaves() {
    let pass = |y: f64, keys: &str| {
        format!(
            "{{ toolpath.line = {{ start = [4.5, {y}, 5], end = [14.5, {y}, 5], speed = 2{keys} }} }}"
        )
    };
    let later = ", start_time = 1";
    let first = "{ toolpath.line = { start = [4.5, 4.5, 5], end = [5.5, 4.5, 5], speed = 2, power = 1e10 } },
        { toolpath.line = { start = [5.5, 4.5, 5], end = [14.5, 4.5, 5], speed = 2 } }";
    for (first, energy) in [
        (pass(4.5, ""), 0.8 * 2e11 * 5.0),
        (first.into(), 0.8 * (2e11 * 4.5 + 1e10 * 0.5)),
    ] {
        let others = [pass(4.5, later), pass(3.0, later)].join(", ");
        let path = format!("toolpath.sequence.passes = [{first}, {others}]");
        let states = weld(&path, "heat = 'from_source'", false, &[5.75, 11.75, 17.5]);
        let mut before = [0.0; 2];
        let energies = [energy, 0.8 * 2e11 * 5.0, 0.8 * 2e11 * 5.0];
        for (k, (now, energy)) in states.into_iter().zip(energies).enumerate() {
            let [asked, points] = [0, 1].map(|i| now[i] - before[i]);
            assert_eq!(points > 0.0, k != 1, "{points}");
            let found = asked + points * 4e6 * (900.0 - 293.15);
            assert!((found / energy - 1.0).abs() < 1e-9, "{k}: {found} {energy}");
            before = now;
        }
    }
}
