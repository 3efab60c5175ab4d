//! Published benchmarks, from the case files that the program carries.
//!
//! The limits stand in the `[[verify]]` tables of `cases/verification/*.toml`, with their source.

use std::collections::BTreeMap;

use perimelt::case::Case;
use perimelt::verify::benchmarks::{self, BuiltIn};
use perimelt::verify::table::OutcomeTable;
use perimelt::verify::{VerifyArgs, verify};
use perimelt_core::Simulation;
use perimelt_core::material::REFERENCE_TEMPERATURE;
use perimelt_tests::kind;

#[test]
fn every_published_benchmark_is_met() {
    let outcomes = verify(&VerifyArgs::default()).expect("the cases of the program are valid");
    let failed: Vec<_> = outcomes.into_iter().filter(|o| !o.passed).collect();
    assert!(failed.is_empty(), "\n{}", OutcomeTable(&failed));
}

/// Rounding (K) of a uniform temperature in a run. Differences of equal temperatures are zero; the inverse of the enthalpy, which
/// counts from a reference temperature, rounds once, and in two fluids, whose heat follows their fraction, in each step.
fn rounding(simulation: &Simulation, temperature: f64) -> f64 {
    let size = temperature.max(REFERENCE_TEMPERATURE);
    let has_two_fluids = simulation
        .world()
        .fields()
        .find(0, "fluid_fraction")
        .is_some();
    let times = match has_two_fluids {
        true => simulation.progress().sub_steps[0] as f64,
        false => 1.0,
    };
    4.0 * f64::EPSILON * size * times
}

/// Steps of a body that show what happens in all of them.
const STEPS: u64 = 100;

/// The built-in case of each [`kind`] with the largest spacing.
fn coarsest_of_each_kind() -> Vec<&'static BuiltIn> {
    let mut kinds: BTreeMap<String, (f64, &BuiltIn)> = BTreeMap::new();
    for built_in in benchmarks::BENCHMARKS {
        let case: toml::Table = built_in.text.parse().expect("valid TOML");
        let bodies = case["bodies"].as_table().expect("bodies by name").values();
        let spacing = bodies.filter_map(|body| body.get("spacing")?.as_float());
        let spacing = spacing.fold(0.0, f64::max);
        let coarsest = kinds.entry(kind(&case)).or_insert((spacing, built_in));
        if spacing > coarsest.0 {
            *coarsest = (spacing, built_in);
        }
    }
    kinds.into_values().map(|(_, built_in)| built_in).collect()
}

/// docs/theory/heat_conduction.md, "Balance of heat": a case stripped of its sources and boundaries.
#[test]
fn a_uniform_temperature_stays_uniform() {
    // a flow needs its walls; what it carries is uniform, too
    let everything_else = [
        "phase_change",
        "thermal_expansion",
        "wall",
        "symmetry",
        "fluid_structure",
    ];
    let folder = tempfile::tempdir().expect("a folder");
    for built_in in coarsest_of_each_kind() {
        let BuiltIn { name, text, .. } = built_in;
        built_in
            .write_files(folder.path())
            .expect("an empty folder");
        let mut table: toml::Table = text.parse().expect("valid TOML");
        let physics = table["physics"].as_array().expect("a list");
        if physics
            .iter()
            .all(|p| p["type"].as_str() != Some("thermal"))
        {
            continue;
        }
        if let Some(couplers) = table.get_mut("couplers").and_then(|c| c.as_array_mut()) {
            couplers.retain(|c| everything_else.contains(&c["type"].as_str().expect("a name")));
        }
        for (_, body) in table["bodies"].as_table_mut().expect("bodies by name") {
            let Some(initial) = body.get_mut("initial").and_then(|i| i.as_table_mut()) else {
                continue;
            };
            // what is left may not use it
            initial.remove("orientation");
            if let Some(temperature) = initial.get_mut("temperature").filter(|t| t.is_str()) {
                // a formula
                *temperature = 1.0.into();
            }
        }
        table.remove("verify");
        // blocks of a million points take their time: a few steps show it as well as many
        let step = table["time"]
            .get("step")
            .and_then(toml::Value::as_float)
            .unwrap_or(0.05);
        let end = &table["time"]["end"];
        let end = end.as_float().or(end.as_integer().map(|e| e as f64));
        let end = (10.0 * step).min(0.05).min(0.05 * end.expect("a time"));
        table["time"]["end"] = end.into();
        let time = table["time"].as_table_mut().expect("a section");
        time.remove("stages");
        table.insert(
            "log".into(),
            toml::Table::from_iter([("interval".into(), end.into())]).into(),
        );

        let stripped = toml::to_string(&table).expect("it was TOML");
        let case = Case::parse(name, stripped, folder.path()).expect("still a valid case");
        let mut simulation = case.compose().expect("still a valid case");
        case.start(&mut simulation).expect("a stable step");
        let body = simulation.world().body(0).points.len();
        let index = simulation
            .world()
            .fields()
            .find(0, "temperature")
            .expect("a thermal case");
        let start = simulation.world().fields().field(index).data().flat()[0];
        while !simulation.is_finished() && simulation.progress().sub_steps[0] < STEPS {
            simulation.step().expect("nothing happens");
        }
        let data = simulation.world().fields().field(index).data();
        assert_eq!(data.flat().len(), body);
        let furthest = data
            .flat()
            .iter()
            .map(|t| (t - start).abs())
            .fold(0.0, f64::max);
        let allowed = rounding(&simulation, start);
        assert!(furthest <= allowed, "{name}: {furthest:e} K off {start} K");
    }
}
