//! Case files with changes that nobody would write are composed, or refused with a message: no panic.
//!
//! The changes are the same in every run of the test. Nightly: `PERIMELT_MUTATIONS=5000 cargo test -p perimelt-tests --test
//! mutated_cases` makes as many. `fuzz` looks for others without end.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use perimelt::case::Case;
use perimelt::case::sections::BodySection;
use toml::{Table, Value};

const CASES: [(&str, &str); 3] = [
    ("weld", include_str!("cases/weld.toml")),
    ("wall", include_str!("cases/wall.toml")),
    ("passes", include_str!("cases/passes.toml")),
];

/// Cells up to which a case is composed; families of more of them take most of the time.
const MOST_CELLS: f64 = 3000.0;

/// A small generator: changes need to differ, not to be random.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % most.max(1)
    }
}

/// Paths of all values.
fn paths(value: &Value, path: &mut Vec<String>, found: &mut Vec<Vec<String>>) {
    let mut below = |name: String, value: &Value, found: &mut Vec<Vec<String>>| {
        path.push(name);
        found.push(path.clone());
        paths(value, path, found);
        path.pop();
    };
    match value {
        Value::Table(table) => {
            for (name, value) in table {
                below(name.clone(), value, found);
            }
        }
        Value::Array(list) => {
            for (index, value) in list.iter().enumerate() {
                below(index.to_string(), value, found);
            }
        }
        _ => {}
    }
}

fn at<'v>(value: &'v mut Value, path: &[String]) -> Option<&'v mut Value> {
    path.iter().try_fold(value, |value, name| match value {
        Value::Table(table) => table.get_mut(name),
        Value::Array(list) => list.get_mut(name.parse::<usize>().ok()?),
        _ => None,
    })
}

/// Another value in place of one.
fn replacement(numbers: &mut Numbers, old: &Value) -> Value {
    const EXTREMES: [f64; 16] = [
        0.0,
        -1.0,
        1.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e300,
        -1e300,
        1e-300,
        5e-324,
        1e9,
        1e-9,
        0.5,
        3.0,
        1e15,
        -0.0,
    ];
    match numbers.below(6) {
        0 => Value::Boolean(true),
        1 => Value::String("\u{1b}[2J é 温".into()),
        2 => Value::Array(Vec::new()),
        3 => Value::Table(Table::new()),
        4 => Value::Integer([0, -1, i64::MAX, i64::MIN][numbers.below(4)]),
        _ if old.is_table() => Value::Float(1.0),
        _ => Value::Float(EXTREMES[numbers.below(EXTREMES.len())]),
    }
}

/// One to three changes: a value is replaced, removed, or copied to another place.
fn changed(numbers: &mut Numbers, case: &str) -> String {
    let mut case = Value::Table(case.parse().expect("TOML"));
    for _ in 0..=numbers.below(3) {
        let mut all = Vec::new();
        paths(&case, &mut Vec::new(), &mut all);
        let path = all[numbers.below(all.len())].clone();
        let other = all[numbers.below(all.len())].clone();
        let old = at(&mut case, &path).expect("there").clone();
        let (name, parent) = path.split_last().expect("not empty");
        match numbers.below(6) {
            0 => match at(&mut case, parent) {
                Some(Value::Table(table)) => {
                    table.remove(name);
                }
                Some(Value::Array(list)) => {
                    list.remove(name.parse().expect("a position"));
                }
                _ => {}
            },
            // a value in itself would have no end
            1 if !other.starts_with(&path) && !path.starts_with(&other) => {
                *at(&mut case, &other).expect("there") = old;
            }
            2 => {
                if let Some(Value::Array(list)) = at(&mut case, parent) {
                    list.push(old);
                }
            }
            _ => *at(&mut case, &path).expect("there") = replacement(numbers, &old),
        }
    }
    toml::to_string(&case).expect("TOML")
}

fn cells(body: &BodySection) -> f64 {
    let (Some(spacing), Some((min, max))) = (body.spacing, body.shape.bounds()) else {
        return f64::INFINITY;
    };
    let extent = max - min;
    let along = extent.iter().take(body.dimension).map(|length| {
        let cells = (length / spacing).abs();
        // what is no number is refused before anything is filled
        if cells.is_nan() { 1.0 } else { cells.max(1.0) }
    });
    along.product()
}

/// Whether a case is so small that its families take no time.
fn is_small(case: &Case) -> bool {
    let table: Table = case.file.text.parse().unwrap_or_default();
    let physics = table.get("physics").and_then(Value::as_array);
    let mut horizons = physics
        .into_iter()
        .flatten()
        .filter_map(|p| p.get("horizon"));
    // a horizon of many spacings has all bonds of a body
    let is_wide =
        horizons.any(|h| h.as_float().is_some_and(|h| h > 6.0) || h.as_integer() > Some(6));
    !is_wide && case.bodies.iter().map(|(_, body)| cells(body)).sum::<f64>() < MOST_CELLS
}

fn compose(text: &str) {
    let case = match Case::parse("case.toml", text.into(), Path::new("")) {
        Ok(case) => case,
        Err(mistakes) => {
            assert!(!mistakes.render(true).is_empty());
            return;
        }
    };
    if !is_small(&case) {
        return;
    }
    match case.compose() {
        Ok(mut simulation) => {
            if case.start(&mut simulation).is_ok() {
                let _ = case.warnings(&simulation);
            }
        }
        Err(mistakes) => assert!(!mistakes.render(false).is_empty()),
    }
}

#[test]
fn changed_cases_are_composed_or_refused() {
    let count = std::env::var("PERIMELT_MUTATIONS").map_or(60, |n| n.parse().expect("a number"));
    let mut numbers = Numbers(0x9e37_79b9_7f4a_7c15);
    for number in 0..count {
        let (name, case) = CASES[number % CASES.len()];
        // coarser points: what is tested does not depend on their number
        let text = changed(&mut numbers, case);
        let result = catch_unwind(AssertUnwindSafe(|| compose(&text)));
        assert!(result.is_ok(), "change {number} of {name}:\n{text}");
    }
}

/// A case of many bodies with a temperature, of which the first one has a thermal physics; `spacing` is a line.
fn bodies(count: usize, spacing: &str) -> String {
    let head = "[time]\nend = 1\n\n[materials.m]\ndensity = 1\nspecific_heat = 1\nconductivity = 1\n\n\
                [[physics]]\ntype = \"thermal\"\nbody = \"b0\"\n";
    let body = |body: usize| {
        format!(
            "\n[bodies.b{body}]\nshape.box = {{ min = [0, 0, 0], max = [1, 1, 1] }}\n{spacing}\nmaterial = \"m\"\n\
             initial.temperature = 300\n"
        )
    };
    std::iter::once(head.into())
        .chain((0..count).map(body))
        .collect()
}

/// A thousand mistakes take as long to find as one.
#[test]
fn a_thousand_bodies_with_a_wrong_key_are_refused_at_once() {
    let text = bodies(1000, "spacng = 1");
    let started = std::time::Instant::now();
    let refused = Case::parse("case.toml", text, Path::new("")).expect_err("a wrong key");
    assert!(refused.mistakes().len() >= 1000);
    refused.render(false);
    // it was 14 s in an optimised program; the bound leaves room for a busy machine
    let seconds = started.elapsed().as_secs_f64();
    assert!(seconds < 5.0, "{seconds} s");
}

/// Initial fields that nothing provides are told of all bodies, as wrong keys are.
#[test]
fn initial_fields_of_many_bodies_that_no_physics_provides_are_told_together() {
    let case = bodies(100, "spacing = 0.5");
    let case = Case::parse("case.toml", case, Path::new("")).expect("the keys are right");
    let refused = case
        .compose()
        .map(drop)
        .expect_err("99 bodies have no temperature");
    assert_eq!(refused.mistakes().len(), 99);
}
