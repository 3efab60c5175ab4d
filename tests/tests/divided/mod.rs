//! Cases that processes share, and runs of them that must end alike.

pub mod build;
pub mod cases;
pub mod collision;
#[cfg(feature = "mpi")]
mod launched;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use perimelt::case::Case;
use perimelt_core::transport::Processes;
use perimelt_tests::in_processes;

/// What a run ends with: fields of the whole body, balances and reports, as bits, and a checkpoint.
pub struct End {
    pub fields: Vec<(String, Vec<u64>)>,
    pub numbers: Vec<(String, u64)>,
    pub steps: u64,
    checkpoint: Vec<u8>,
}

impl End {
    /// The number whose name ends so.
    pub fn number(&self, name: &str) -> f64 {
        let found = self.numbers.iter().find(|(n, _)| n.ends_with(name));
        let names = || {
            self.numbers
                .iter()
                .map(|(name, _)| name)
                .collect::<Vec<_>>()
        };
        f64::from_bits(found.unwrap_or_else(|| panic!("{name}: {:?}", names())).1)
    }
}

/// Runs the case to a time (s), from a checkpoint where there is one, as one of some processes; `None` in all but the first.
fn run(text: &str, until: f64, start: Option<&[u8]>, processes: Processes) -> Option<End> {
    let case = Case::parse("case.toml", text.into(), ".".as_ref()).expect("valid");
    let mut simulation = case.compose_shared(processes.clone()).expect("valid");
    match start {
        Some(checkpoint) => simulation
            .load(checkpoint)
            .expect("a checkpoint of the case"),
        None => case.start(&mut simulation).expect("a state"),
    }
    while !simulation.is_finished() && simulation.time() < until {
        simulation.step().expect("a step");
    }
    let mut fields = Vec::new();
    for field in simulation.lasting() {
        let data = field.data();
        let bits = data.flat().iter().map(|value| value.to_bits());
        fields.push((field.name.clone(), bits.collect()));
    }
    let mut numbers = Vec::new();
    for (label, balances) in simulation.balances() {
        for b in balances {
            let parts = [b.stored, b.initial, b.supplied, b.size];
            numbers.extend(parts.map(|part| (format!("{label} {}", b.quantity), part.to_bits())));
        }
    }
    // as in a run, where one process alone reports
    let is_first = processes.rank() == 0;
    let reports = is_first.then(|| simulation.reports());
    for (label, reports) in reports.into_iter().flatten() {
        let bits = reports
            .iter()
            .map(|r| (format!("{label} {}", r.name), r.value.to_bits()));
        numbers.extend(bits);
    }
    let steps = simulation.progress().sub_steps.iter().sum();
    let checkpoint = simulation.save().expect("a checkpoint");
    (processes.rank() == 0).then_some(End {
        fields,
        numbers,
        steps,
        checkpoint,
    })
}

/// Asserts that two runs end in the same bits, and tells what differs.
fn assert_same(one: &End, other: &End, run: &str) {
    fn names<T>(list: &[(String, T)]) -> Vec<&String> {
        list.iter().map(|(name, _)| name).collect()
    }
    assert_eq!(names(&one.fields), names(&other.fields), "{run}");
    assert_eq!(names(&one.numbers), names(&other.numbers), "{run}");
    let mut found = Vec::new();
    for ((name, a), (_, b)) in one.fields.iter().zip(&other.fields) {
        let count = a.iter().zip(b).filter(|(a, b)| a != b).count();
        if count > 0 || a.len() != b.len() {
            found.push(format!("{count} values of {name}"));
        }
    }
    for ((name, a), (_, b)) in one.numbers.iter().zip(&other.numbers) {
        if a != b {
            let [a, b] = [a, b].map(|bits| f64::from_bits(*bits));
            found.push(format!("{name}: {a} {b}"));
        }
    }
    let same = [one.steps == other.steps, one.checkpoint == other.checkpoint];
    for (same, name) in same.into_iter().zip(["steps", "checkpoint"]) {
        if !same {
            found.push(name.into());
        }
    }
    assert!(found.is_empty(), "{run}: {found:?}");
}

/// A whole run in one process, with which several tests compare others.
pub fn run_alone(text: &str) -> Arc<End> {
    static ENDS: Mutex<BTreeMap<String, Arc<End>>> = Mutex::new(BTreeMap::new());
    let ends = || ENDS.lock().unwrap_or_else(PoisonError::into_inner);
    let found = ends().get(text).cloned();
    found.unwrap_or_else(|| {
        let end = Arc::new(run_in(1, text, f64::INFINITY, None));
        ends().insert(text.into(), end.clone());
        end
    })
}

/// [`run`] in some threads.
pub fn run_in(count: usize, text: &str, until: f64, start: Option<&[u8]>) -> End {
    let ends = in_processes(count, |processes| run(text, until, start, processes));
    ends.into_iter()
        .flatten()
        .next()
        .expect("the first process")
}

/// Asserts that runs of these numbers of processes end as that of one.
pub fn assert_shared(text: &str, alone: &End, counts: &[usize], what: &str) {
    for &count in counts {
        let shared = run_in(count, text, f64::INFINITY, None);
        assert_same(&shared, alone, &format!("{what}, {count} processes"));
    }
}

/// Stops a run at a time (s), and lets it go on with other numbers of processes.
pub fn assert_goes_on(text: &str, stop: f64, counts: &[(usize, usize)]) {
    let whole = run_alone(text);
    for &(before, after) in counts {
        let half = run_in(before, text, stop, None);
        assert!(half.steps < whole.steps);
        let end = run_in(after, text, f64::INFINITY, Some(&half.checkpoint));
        assert_same(&end, &whole, &format!("{before}, then {after} processes"));
    }
}
