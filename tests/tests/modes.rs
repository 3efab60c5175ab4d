//! A case file of each kind, coarse and short, in several modes that must agree: straight; stopped half
//! way and resumed; on one and two threads; shared by three processes, where its plugins can; with both stores; logged and replayed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use perimelt::case::Case;
use perimelt::run::{self, End, Options};
use perimelt_core::log::Log;
use perimelt_core::{RunError, Simulation};
use perimelt_tests::{in_processes, kind, last_checkpoint};
use toml::{Table, Value};

/// Bodies of more points than this, at the coarsest spacing that a case can have, are left out; a point of
/// a cloud counts for ten, as its sums are slow and its equilibria take many.
const POINTS: usize = 40_000;
/// Macro steps of a short run; a state is logged after every second one.
const STEPS: f64 = 8.0;
/// Most steps of the physics with the shortest ones: a step of heat can be ten thousand of waves.
const SUB_STEPS: f64 = 200.0;

/// Every so many kinds are shared by processes, which takes longer than all other modes together.
const SHARED: usize = 4;
/// Every so many kinds are run with both stores, to a tolerance that takes as long as the rest.
const STORES: usize = 3;

fn case_files() -> Vec<PathBuf> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cases");
    let cases = cases.canonicalize().expect("the cases are there");
    let mut found = Vec::new();
    for folder in std::fs::read_dir(&cases).expect("readable") {
        let folder = folder.expect("readable").path();
        if !folder.is_dir() || folder.ends_with("materials") || folder.ends_with("src") {
            continue;
        }
        let files = std::fs::read_dir(folder).expect("readable");
        let files = files.map(|f| f.expect("readable").path());
        found.extend(files.filter(|f| f.extension().is_some_and(|e| e == "toml")));
    }
    found.sort();
    found
}

/// Case files by their [`kind`].
fn kinds() -> Vec<Vec<PathBuf>> {
    let mut kinds: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for file in case_files() {
        let text = std::fs::read_to_string(&file).expect("readable");
        let case = text.parse().expect("TOML");
        kinds.entry(kind(&case)).or_default().push(file);
    }
    kinds.into_values().collect()
}

fn table<'a>(table: &'a mut Table, key: &str) -> &'a mut Table {
    let entry = table.entry(key).or_insert_with(|| Table::new().into());
    entry.as_table_mut().expect("a table")
}

fn number(value: &Value) -> f64 {
    value
        .as_float()
        .or(value.as_integer().map(|i| i as f64))
        .expect("a number")
}

fn parse(file: &Path, table: &Table) -> Case {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let folder = file.parent().expect("a file in a folder");
    let text = toml::to_string(table).expect("it was TOML before");
    Case::parse(&name, text, folder).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// The case with `factor` times its spacing, `STEPS` macro steps long.
fn short(file: &Path, factor: f64) -> Result<Table, String> {
    let text = std::fs::read_to_string(file).expect("readable");
    let mut whole: Table = text.parse().map_err(|e| format!("{e}"))?;
    whole.remove("verify");
    for (_, body) in table(&mut whole, "bodies").iter_mut() {
        let body = body.as_table_mut().expect("a table");
        let scale = |table: &mut Table| {
            if let Some(spacing) = table.get_mut("spacing") {
                *spacing = (factor * number(spacing)).into();
            }
        };
        scale(body);
        let zones = body.get_mut("zones").and_then(Value::as_array_mut);
        let zones = zones.into_iter().flatten();
        zones.filter_map(Value::as_table_mut).for_each(scale);
    }
    let mut simulation = parse(file, &whole).compose().map_err(|e| e.render(false))?;
    let points: usize = simulation
        .world()
        .bodies()
        .iter()
        .map(|b| b.points.len() * if b.lattice().is_some() { 1 } else { 10 })
        .sum();
    // a body that has become one point thick has no stiffness across
    let bodies = simulation.world().bodies().iter();
    if bodies
        .filter_map(|b| Some((b.dimension, b.lattice()?.cells)))
        .any(|(dimension, cells)| cells[..dimension].iter().any(|&c| c < 2))
        && factor > 1.0
    {
        return Err("too few points across".into());
    }
    if points > POINTS {
        return Err(format!("{points} points are too many"));
    }
    simulation.start().map_err(|e| e.to_string())?;
    let sub_steps = simulation.sub_steps().iter().copied();
    let end = simulation
        .options()
        .end
        .min(STEPS * simulation.macro_step())
        .min(SUB_STEPS * sub_steps.fold(f64::INFINITY, f64::min));
    let time = table(&mut whole, "time");
    time.insert("end".into(), end.into());
    time.remove("stages");
    let log = table(&mut whole, "log");
    log.insert("interval".into(), (end / 4.0).into());
    log.insert("checkpoint".into(), (end / 2.0).into());
    Ok(whole)
}

fn options(out: &Path, until: Option<f64>) -> Options {
    Options {
        out: out.into(),
        until,
        quiet: true,
        ..Options::default()
    }
}

fn on_threads(count: usize, case: &Case, out: &Path) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
    let run = || {
        run::run(case, &options(out, None))
            .map(drop)
            .expect("it runs")
    };
    pool.expect("threads").install(run);
    last_checkpoint(out)
}

/// The lasting fields at the end of a run.
fn final_fields(case: &Case) -> Result<Vec<(String, Vec<f64>)>, RunError> {
    let mut simulation: Simulation = case.compose().expect("it composed before");
    case.start(&mut simulation).expect("it started before");
    while !simulation.is_finished() {
        simulation.step()?;
    }
    let fields = simulation.lasting();
    let values = fields.map(|f| (f.name.clone(), f.data().flat().to_vec()));
    Ok(values.collect())
}

/// Lets every equilibrium be found to a tolerance.
fn set_tolerance(case_table: &mut Table, tolerance: f64) {
    let physics = case_table["physics"].as_array_mut().expect("a list");
    for plugin in physics.iter_mut().filter_map(Value::as_table_mut) {
        let solver = plugin.get_mut("solver").and_then(Value::as_table_mut);
        if let Some(Value::Table(solver)) = solver.and_then(|s| s.get_mut("quasi_static")) {
            solver.insert("tolerance".into(), tolerance.into());
        } else if plugin["type"].as_str() == Some("mechanical") && !plugin.contains_key("solver") {
            let solver: Table = format!("quasi_static = {{ tolerance = {tolerance:e} }}")
                .parse()
                .expect("TOML");
            plugin.insert("solver".into(), solver.into());
        }
    }
}

/// The last checkpoint of a run that three processes share; `None` where they cannot.
fn shared(case: &Case, out: &Path) -> Option<Vec<u8>> {
    let runs = in_processes(3, |processes| {
        case.compose_shared(processes.clone()).ok()?;
        let options = Options {
            processes,
            ..options(out, None)
        };
        run::run(case, &options).map(drop).expect("it runs");
        Some(())
    });
    runs.into_iter().collect::<Option<Vec<()>>>()?;
    Some(last_checkpoint(out))
}

/// Checks the case on threads, resumed and replayed, and shared by processes where it `is_shared`; whether they can share it.
fn check(file: &Path, case_table: &Table, folder: &Path, is_shared: bool) -> bool {
    let name = file.display();
    let case = parse(file, case_table);
    let at = |log: &str| folder.join(log);

    let straight = on_threads(2, &case, &at("straight.mcap"));
    assert!(
        on_threads(1, &case, &at("one.mcap")) == straight,
        "{name}: 1 and 2 threads differ"
    );

    let shared = is_shared
        .then(|| shared(&case, &at("shared.mcap")))
        .flatten();
    if let Some(shared) = &shared {
        assert!(*shared == straight, "{name}: 1 and 3 processes differ");
    }

    let half = options(&at("half.mcap"), Some(0.5 * case.time.end));
    let stopped = run::run(&case, &half).expect("it runs");
    assert_eq!(stopped.end, End::Until, "{name}");
    let half = at("half.mcap");
    let half = told(&["info", &half.to_string_lossy()]);
    assert!(
        half.contains("the run stopped before its end"),
        "{name}: {half}"
    );
    run::resume(&at("half.mcap"), None, &options(&at("half.mcap"), None)).expect("it resumes");
    assert!(
        last_checkpoint(&at("half.mcap")) == straight,
        "{name}: resumed, it ends elsewhere"
    );

    let log = Log::open(at("straight.mcap")).expect("the log opens");
    for body in log.bodies() {
        assert_eq!(
            log.times(body).len(),
            5,
            "{name}: the start and four intervals"
        );
    }
    let straight = at("straight.mcap");
    assert!(!told(&["info", &straight.to_string_lossy()]).contains("stopped before"));
    told(&["replay", &straight.to_string_lossy()]);
    shared.is_some()
}

/// Checks that a case ends in the same state with both stores.
fn check_stores(file: &Path, case_table: &mut Table) {
    let name = file.display();
    let couplers = case_table.get("couplers").and_then(|c| c.as_array());
    let changes_points = |c: &toml::Value| {
        let kind = c.get("type").and_then(|t| t.as_str());
        matches!(kind, Some("deposit" | "cut"))
    };
    if couplers.is_some_and(|c| c.iter().any(changes_points)) {
        return; // a body that grows or is cut has a lattice
    }
    // equilibrium only as good as the default would hide behind its tolerance; that of a slender body cannot be found more
    // exactly than its displacements are rounded
    let mut tolerances = [1e-12, 1e-10, 1e-9].into_iter();
    let lattice = loop {
        set_tolerance(case_table, tolerances.next().expect("it converges"));
        match final_fields(&parse(file, case_table)) {
            Ok(fields) => break fields,
            Err(error) => println!("{name}: {error}"),
        }
    };
    for (_, body) in table(case_table, "bodies").iter_mut() {
        body.as_table_mut()
            .expect("a table")
            .insert("store".into(), "list".into());
    }
    let list = final_fields(&parse(file, case_table)).expect("the lattice converged");
    for ((field, lattice), (_, list)) in lattice.iter().zip(&list) {
        let largest = lattice.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let apart = lattice
            .iter()
            .zip(list)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        // sums in one order differ by rounding; equilibrium is found to 1e-8 of the loads only
        let limit = match field.as_str() {
            "displacement" | "velocity" | "stress" | "conjugate_stress" => 1e-6,
            // flow, and `<law>.<state>`, of equilibria found to 1e-12, step after step
            name if name.contains("plastic") || name.contains('.') => 1e-10,
            _ => 1e-12,
        };
        assert!(
            apart <= limit * largest,
            "{name}: {field} by {:e} in the stores",
            apart / largest
        );
    }
}

// two tests, which run side by side

#[test]
fn every_second_kind_of_case_ends_in_the_same_state_in_all_modes() {
    check_kinds(kinds().into_iter().step_by(2));
}

#[test]
fn the_other_kinds_of_cases_end_in_the_same_state_in_all_modes() {
    check_kinds(kinds().into_iter().skip(1).step_by(2));
}

fn check_kinds(kinds: impl ExactSizeIterator<Item = Vec<PathBuf>>) {
    assert!(kinds.len() > 100, "the cases are found");
    let mut shared = 0;
    for (number, files) in kinds.enumerate() {
        let started = std::time::Instant::now();
        let Some((file, mut case)) = files
            .iter()
            .find_map(|file| Some((file, small_enough(file)?)))
        else {
            continue;
        };
        let folder = tempfile::tempdir().expect("a folder for logs");
        let is_shared = number % SHARED == 0;
        shared += usize::from(check(file, &case, folder.path(), is_shared));
        if number % STORES == 0 {
            check_stores(file, &mut case);
        }
        println!("{}: {:.1?}", file.display(), started.elapsed());
    }
    assert!(shared > 5, "processes share some of the cases: {shared}");
}

/// A short case with the coarsest spacing that its regions, sources and probes allow; `None` if these are too many points.
fn small_enough(file: &Path) -> Option<Table> {
    let mut reasons = Vec::new();
    for factor in [8.0, 4.0, 2.0, 1.0] {
        match short(file, factor) {
            Ok(case) => return Some(case),
            Err(reason) => reasons.push(reason),
        }
    }
    let too_large = reasons.iter().any(|r| r.contains("too many"));
    assert!(too_large, "{}: {}", file.display(), reasons.join("\n"));
    println!("{}: left out, {}", file.display(), reasons.join("; "));
    None
}

/// What the program prints.
fn told(arguments: &[&str]) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_perimelt-tests"));
    let output = program.args(arguments).output().expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success() && !text.is_empty(),
        "{arguments:?}: {errors}"
    );
    text
}
