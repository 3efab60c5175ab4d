//! Fields of a log that another run reads: scalars, vectors and tensors, at any time.

use std::path::Path;

use tempfile::TempDir;

use super::*;
use crate::testing::{block, simulation, values};
use perimelt_core::Body;
use perimelt_core::body::Store;
use perimelt_core::log::{
    BodyInfo, CloudView, Coordinates, FieldInfo, FieldView, Precision, RunInfo, Writer,
};

fn body() -> Body {
    block([3, 2, 1], 2, 1.0, Store::Lattice, "density = 1")
}

/// Fields of the log and their components.
const FIELDS: [(&str, usize); 3] = [("temperature", 1), ("velocity", 3), ("stress", 9)];

/// Value of a component at a point of a state.
fn logged(base: f64, point: usize, component: usize) -> f64 {
    base + point as f64 + 100.0 * component as f64
}

/// A log of body `old`, of the points of [`body`] moved by `offset`, with states at these times and of these values.
fn log(states: &[(f64, f64)], offset: f64) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("first.mcap");
    let positions = body().points.position;
    let positions = positions.iter().map(|x| [x.x + offset, x.y, x.z]);
    let positions: Vec<[f64; 3]> = positions.collect();
    let field = |(name, components): (&str, usize)| FieldInfo {
        name: name.into(),
        unit: "K".into(),
        components,
    };
    let info = BodyInfo {
        name: "old".into(),
        dimension: 2,
        spacing: 1.0,
        thickness: 0.1,
        points: 6,
        symmetry: Vec::new(),
        lattice: None,
        plies: Vec::new(),
        fields: FIELDS.map(field).into(),
    };
    let run = RunInfo {
        inputs: Vec::new(),
        version: "test".into(),
        threads: 1,
        started: 0,
        case_folder: String::new(),
        bodies: vec![info],
        plugins: serde_json::Value::Null,
    };
    let mut writer = Writer::create(&path, &run, "case.toml", "").expect("writes");
    for &(time, base) in states {
        let values = FIELDS.map(|(_, components)| {
            let all = (0..6).flat_map(|p| (0..components).map(move |c| logged(base, p, c)));
            all.collect::<Vec<f64>>()
        });
        let fields: Vec<FieldView<'_>> = FIELDS
            .iter()
            .zip(&values)
            .map(|((name, components), values)| FieldView {
                name,
                components: *components,
                values,
            })
            .collect();
        let cloud = CloudView {
            time,
            positions: Coordinates::Listed(&positions),
            fields: &fields,
        };
        writer
            .points("old", Precision::F64, &cloud)
            .expect("writes");
    }
    writer.finish().expect("writes");
    (folder, path)
}

fn ready(replay: Replay, setup: &mut Setup<'_>) -> Result<Box<dyn RunningPhysics>, SetupError> {
    Box::new(replay).prepare(setup)
}

fn replay(path: &Path, fields: &[&str]) -> Replay {
    Replay {
        log: Some(path.into()),
        body: None,
        logged_body: Some("old".into()),
        fields: fields.iter().map(|f| (*f).into()).collect(),
        values: BTreeMap::new(),
    }
}

#[test]
fn a_logged_field_is_interpolated_in_time_and_kept_after_the_end() {
    let (_folder, path) = log(&[(0.0, 300.0), (0.5, 400.0), (1.0, 900.0)], 0.0);
    let replay = replay(&path, &["temperature"]);
    let mut s = simulation(body(), vec![Box::new(replay)], vec![], 1.6);
    s.start().expect("starts");
    for (time, base) in [(0.0, 300.0), (0.5, 400.0), (1.0, 900.0), (1.6, 900.0)] {
        assert_eq!(s.time(), time, "steps end on logged times");
        assert_eq!(values(&s, "temperature")[5], base + 5.0);
        if !s.is_finished() {
            s.step().expect("steps");
        }
    }
}

/// Values at any time, in any order, of logs of one state and of three.
#[test]
fn all_kinds_of_fields_are_linear_between_two_states() {
    for (states, at) in [
        (
            &[(0.2, 300.0), (0.5, 400.0), (1.0, 900.0)][..],
            &[
                (0.0, 300.0),
                (0.2, 300.0),
                (0.35, 350.0),
                (0.5, 400.0),
                (0.75, 650.0),
                (1.0, 900.0),
                (7.0, 900.0),
                // back to a state that is no longer held
                (0.35, 350.0),
                (0.0, 300.0),
                (7.0, 900.0),
            ][..],
        ),
        (&[(0.5, 400.0)], &[(0.0, 400.0), (0.5, 400.0), (1.0, 400.0)]),
    ] {
        let (_folder, path) = log(states, 0.0);
        let mut world = World::new(vec![body()]);
        let replay = replay(&path, &["stress", "temperature", "velocity"]);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("replay");
        let mut replay = ready(replay, &mut setup).expect("the same points");
        setup.finish().expect("complete");
        assert_eq!(replay.step_limits(0.0).next_event, Some(states[0].0));
        assert_eq!(
            replay.step_limits(states[0].0).next_event,
            states.get(1).map(|s| s.0)
        );
        assert_eq!(replay.step_limits(1.0).next_event, None);
        for &(time, base) in at {
            let step = Step::new(time - 0.1, 0.1);
            replay.advance(&world, step).expect("reads");
            for (name, components) in FIELDS {
                let fields = world.fields();
                let field = fields.field(fields.find(0, name).expect("owned"));
                assert_eq!(field.unit, "K");
                let data = field.data();
                assert_eq!(data.components(), components);
                for (i, found) in data.flat().iter().enumerate() {
                    let expected = logged(base, i / components, i % components);
                    assert!((found - expected).abs() < 1e-9, "{name} at {time}: {found}");
                }
            }
        }
    }
}

fn of_keys(keys: &str) -> Replay {
    toml::from_str(keys).expect(keys)
}

/// Files `a.csv` and `b.csv` of a temperature that is linear in x and y, at other points than those of the body.
fn files() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, base) in [("a.csv", 300.0), ("b.csv", 500.0)] {
        let corners = [(0.0, 0.0), (3.0, 0.0), (0.0, 2.0), (3.0, 2.0)];
        let line = |(x, y): (f64, f64)| format!("{x},{y},{}\n", base + 10.0 * x - 5.0 * y);
        let text: String = corners.map(line).concat();
        std::fs::write(folder.path().join(name), format!("x,y,T\n{text}")).expect("written");
    }
    folder
}

/// Six points at x = 0.5, 1.5, 2.5 m and y = 0.5, 1.5 m.
#[test]
fn fields_come_from_files_by_time_or_formulas() {
    let folder = files();
    for (keys, times) in [
        (
            "values.temperature = { time = [0.5, 1.0], file = ['a.csv', 'b.csv'] }",
            vec![Some(0.5), Some(1.0), None],
        ),
        (
            "values.temperature = '300 + 10 * x - 5 * y + 400 * (max(min(t, 1), 0.5) - 0.5)'",
            vec![None],
        ),
    ] {
        let mut world = World::new(vec![body()]);
        let replay = of_keys(keys);
        let mut setup = Setup::new(&mut world, folder.path());
        setup.next_plugin("replay");
        let mut replay = ready(replay, &mut setup).expect("valid");
        setup.finish().expect("complete");
        let mut after = 0.0;
        for time in times {
            assert_eq!(replay.step_limits(after).next_event, time);
            after = time.unwrap_or(after);
        }
        for (time, base) in [
            (0.1, 300.0),
            (0.5, 300.0),
            (0.75, 400.0),
            (1.0, 500.0),
            (3.0, 500.0),
            (0.2, 300.0),
        ] {
            replay
                .advance(&world, Step::new(time - 0.1, 0.1))
                .expect("reads");
            let fields = world.fields();
            let field = fields.field(fields.find(0, "temperature").expect("owned"));
            let data = field.data();
            for (value, at) in data.flat().iter().zip(&world.body(0).points.position) {
                let expected = base + 10.0 * at.x - 5.0 * at.y;
                assert!(
                    (value - expected).abs() < 1e-9,
                    "{keys} at {time} s: {value} {expected}"
                );
            }
        }
    }
}

#[test]
fn wrong_values_are_refused() {
    let folder = files();
    for (keys, message) in [
        ("values.temprature = 1", "did you mean `temperature`?"),
        (
            "values.temperature = { file = 'no.csv' }",
            "no.csv: the file cannot be read",
        ),
        (
            "values.temperature = { time = [0, 1], file = ['a.csv', 'no.csv'] }",
            "no.csv: the file cannot be read",
        ),
        (
            "values.temperature = 1\nlog = 'a.mcap'",
            "either `log` with `fields`, or `values`",
        ),
        ("log = 'a.mcap'", "no field is read from the log"),
        ("", "either `log` with `fields`, or `values`"),
    ] {
        let mut world = World::new(vec![body()]);
        let mut setup = Setup::new(&mut world, folder.path());
        setup.next_plugin("replay");
        let error = ready(of_keys(keys), &mut setup)
            .err()
            .expect(keys)
            .to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn a_log_of_another_body_is_refused() {
    let (_folder, path) = log(&[(0.0, 300.0)], 0.0);
    let (_far, moved) = log(&[(0.0, 300.0)], 0.3);
    let (_near, displaced) = log(&[(0.0, 300.0)], 0.2);
    let (_none, empty) = log(&[], 0.0);
    let other = block([3, 3, 1], 2, 1.0, Store::Lattice, "density = 1");
    let of = |body: Option<&str>, path: &Path| Replay {
        logged_body: body.map(Into::into),
        ..replay(path, &["temperature"])
    };
    for (here, replay, expected) in [
        (body(), of(Some("old"), &path), None),
        (body(), of(Some("old"), &displaced), None),
        (
            body(),
            of(Some("old"), &moved),
            Some(("log", "point 0 lies at [0.8, 0.5")),
        ),
        (
            other,
            of(Some("old"), &path),
            Some(("log", "6 points, this one 9")),
        ),
        (
            body(),
            of(Some("new"), &path),
            Some(("logged_body", "no logged body is called `new`")),
        ),
        // the name of the body here
        (
            body(),
            of(None, &path),
            Some(("log", "no logged body is called `block`")),
        ),
        (
            body(),
            of(Some("old"), &empty),
            Some(("log", "has no states")),
        ),
        (
            body(),
            replay(&path, &["temprature"]),
            Some(("fields", "did you mean `temperature`?")),
        ),
    ] {
        let mut world = World::new(vec![here]);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("replay");
        let refused = ready(replay, &mut setup).err();
        let refused = refused.map(|e| (e.key.clone(), e.to_string()));
        match (&refused, expected) {
            (None, None) => {}
            (Some((key, message)), Some((wanted, part))) => {
                assert!(key == wanted && message.contains(part), "{key}: {message}");
            }
            _ => panic!("{refused:?} {expected:?}"),
        }
    }
}
