//! Every number of the material library against its source, written here a second time: the formula of a source, evaluated,
//! or the rows of its table.
//!
//! There is no property without a source.

mod aluminium;
mod formulas;
mod nickel;
mod stainless;
mod structural;
mod titanium;
mod water;

use std::collections::{BTreeMap, BTreeSet};

use super::ENTRIES;

/// Values of a property in a source.
enum SourceData {
    Constant(f64),
    /// A constant between two values.
    Range(f64, f64),
    /// Rows (K, value); every row of the file is one of them.
    Rows(Vec<(f64, f64)>),
    /// A function of the temperature (K) within a range.
    Formula {
        from: f64,
        to: f64,
        value: Box<dyn Fn(f64) -> f64>,
        /// Largest relative difference between the straight lines of the file and the formula, halfway between rows.
        between: f64,
    },
}

/// A property of a file and its source.
struct PropertyCheck {
    /// Key in the file, with the phase: `conductivity.liquid`.
    property: &'static str,
    source: SourceData,
    /// Temperature (K) from which the rows of the file are `[floor]`: below 5 % of the first row.
    floor: f64,
}

impl PropertyCheck {
    /// Rows of the file from `temperature` (K) on are no longer the source's.
    fn floor(mut self, temperature: f64) -> Self {
        self.floor = temperature;
        self
    }

    /// Sets the largest relative deviation of the file's straight lines from the formula between rows.
    fn between(mut self, relative: f64) -> Self {
        if let SourceData::Formula { between, .. } = &mut self.source {
            *between = relative;
        }
        self
    }
}

fn check(property: &'static str, source: SourceData) -> PropertyCheck {
    PropertyCheck {
        property,
        source,
        floor: f64::INFINITY,
    }
}

fn constant(property: &'static str, value: f64) -> PropertyCheck {
    check(property, SourceData::Constant(value))
}

/// Rows (K, value).
fn rows(property: &'static str, rows: &[(f64, f64)]) -> PropertyCheck {
    check(property, SourceData::Rows(rows.to_vec()))
}

/// Rows (°C, factor of `unit`).
fn celsius(property: &'static str, unit: f64, rows: &[(f64, f64)]) -> PropertyCheck {
    let rows = rows.iter().map(|(t, v)| (t + 273.15, v * unit)).collect();
    check(property, SourceData::Rows(rows))
}

/// A function of the temperature (K) between two temperatures.
fn formula(
    property: &'static str,
    from: f64,
    to: f64,
    value: impl Fn(f64) -> f64 + 'static,
) -> PropertyCheck {
    check(
        property,
        SourceData::Formula {
            from,
            to,
            value: Box::new(value),
            between: 0.05,
        },
    )
}

/// Poisson's ratio that keeps the bulk modulus of the first row, by rows of Young's modulus (K, any unit).
fn constant_bulk_modulus(
    ratio: f64,
    stiffness: impl IntoIterator<Item = (f64, f64)>,
) -> PropertyCheck {
    let stiffness: Vec<_> = stiffness.into_iter().collect();
    let first = stiffness.first().map_or(1.0, |row| row.1);
    let of_row = |(t, e): &(f64, f64)| (*t, 0.5 - (0.5 - ratio) * e / first);
    let ratios: Vec<_> = stiffness.iter().map(of_row).collect();
    rows("poissons_ratio", &ratios)
}

/// Rows (°C, value) as rows (K, value), with one more row.
fn kelvin<'a>(
    rows: &'a [(f64, f64)],
    last: (f64, f64),
) -> impl Iterator<Item = (f64, f64)> + use<'a> {
    let rows = rows
        .iter()
        .chain(std::iter::once(&last))
        .copied()
        .collect::<Vec<_>>();
    rows.into_iter().map(|(t, value)| (t + 273.15, value))
}

/// Checks of an entry.
fn checks(name: &str) -> Vec<PropertyCheck> {
    match name {
        "304L" => stainless::s304l(),
        "316L" => stainless::s316l(),
        "6061" => aluminium::a6061(),
        "AlSi10Mg" => aluminium::alsi10mg(),
        "IN625" => nickel::in625(),
        "IN718" => nickel::in718(),
        "S355" => structural::s355(),
        "Ti-6Al-4V" => titanium::ti_6al_4v(),
        "water" => water::water(),
        other => panic!("{other}: add its sources here"),
    }
}

/// Properties taken from another metal. Their numbers are checked against its source.
const OTHER: &[(&str, &str)] = &[
    ("304L", "conductivity.liquid"),
    ("304L", "viscosity"),
    ("304L", "surface_tension"),
    ("6061", "specific_heat.liquid"),
    ("6061", "conductivity.liquid"),
    ("6061", "boiling_temperature"),
    ("6061", "vaporisation_heat"),
    ("6061", "molar_mass"),
    ("6061", "absorptivity"),
    ("6061", "viscosity"),
    ("6061", "surface_tension"),
    ("AlSi10Mg", "conductivity.liquid"),
    ("AlSi10Mg", "boiling_temperature"),
    ("AlSi10Mg", "vaporisation_heat"),
    ("AlSi10Mg", "molar_mass"),
    ("AlSi10Mg", "absorptivity"),
    ("AlSi10Mg", "viscosity"),
    ("AlSi10Mg", "surface_tension"),
    ("IN625", "yield_stress"),
    ("IN625", "emissivity"),
    ("IN625", "surface_tension"),
    ("IN718", "surface_tension"),
    ("S355", "specific_heat.liquid"),
    ("S355", "conductivity.liquid"),
    ("S355", "latent_heat"),
    ("S355", "boiling_temperature"),
    ("S355", "vaporisation_heat"),
    ("S355", "molar_mass"),
    ("S355", "poissons_ratio"),
    ("S355", "absorptivity"),
    ("S355", "viscosity"),
    ("S355", "surface_tension"),
    ("Ti-6Al-4V", "molar_mass"),
    ("Ti-6Al-4V", "absorptivity"),
    ("Ti-6Al-4V", "surface_tension"),
];

const MARKS: &[&str] = &["seen", "computed", "other", "floor"];

/// Rows (K, value) of every property of a file; a constant is one row without a temperature.
fn properties(text: &str) -> BTreeMap<String, Vec<(Option<f64>, f64)>> {
    fn number(value: &toml::Value) -> Option<f64> {
        value
            .as_float()
            .or_else(|| value.as_integer().map(|v| v as f64))
    }
    fn column(table: &toml::Table, key: &str) -> Option<Vec<f64>> {
        table.get(key)?.as_array()?.iter().map(number).collect()
    }
    fn collect(
        key: &str,
        value: &toml::Value,
        into: &mut BTreeMap<String, Vec<(Option<f64>, f64)>>,
    ) {
        if let Some(value) = number(value) {
            into.insert(key.to_string(), vec![(None, value)]);
        } else if let Some(table) = value.as_table() {
            if let (Some(x), Some(y)) = (column(table, "temperature"), column(table, "value")) {
                assert_eq!(x.len(), y.len(), "{key}");
                into.insert(key.to_string(), x.into_iter().map(Some).zip(y).collect());
            } else {
                for (inner, value) in table {
                    collect(&format!("{key}.{inner}"), value, into);
                }
            }
        }
    }
    let mut found = BTreeMap::new();
    for (key, value) in &text.parse::<toml::Table>().expect("TOML") {
        collect(key, value, &mut found);
    }
    found
}

/// The marks in the comments of every property: those of its lines and those of the block of comments above its first line.
fn marks(text: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut block = String::new();
    for line in text.lines() {
        let (code, comment) = line.split_once('#').unwrap_or((line, ""));
        let Some((key, _)) = code.split_once(" = ") else {
            match comment {
                "" => block.clear(),
                comment => block.push_str(comment),
            }
            continue;
        };
        let key = key.trim();
        let key = key
            .strip_suffix(".temperature")
            .or_else(|| key.strip_suffix(".value"))
            .unwrap_or(key);
        let marks = found.entry(key.to_string()).or_default();
        for part in format!("{block} {comment}").split('[').skip(1) {
            let word = part.split(|c: char| !c.is_alphabetic()).next();
            marks.extend(word.map(String::from));
        }
        block.clear();
    }
    found.remove("description");
    found
}

/// Half a unit of the last digit of a number, of which at least three count.
fn rounding(value: f64) -> f64 {
    let text = format!("{value:e}");
    let (mantissa, exponent) = text.split_once('e').expect("has an exponent");
    let digits = mantissa.chars().filter(char::is_ascii_digit).count().max(3);
    let exponent: i32 = exponent.parse().expect("an integer");
    0.5 * 10f64.powi(exponent + 1 - digits as i32)
}

/// Differences between the rows of a file and its source.
fn differences(name: &str, check: &PropertyCheck, file: &[(Option<f64>, f64)]) -> Vec<String> {
    let property = check.property;
    let first = file.first().map_or(0.0, |row| row.1);
    let is_floor = |t: f64| t >= check.floor;
    let mut found = Vec::new();
    for &(temperature, value) in file {
        let expected = match (&check.source, temperature) {
            (_, Some(t)) if is_floor(t) => {
                if value > 0.05 * first {
                    found.push(format!("{name}: {property}: {value} is no floor"));
                }
                continue;
            }
            (SourceData::Constant(source), None) => Some(*source),
            (SourceData::Range(low, high), None) => Some(value.clamp(*low, *high)),
            (SourceData::Rows(rows), Some(t)) => {
                let row = rows.iter().find(|row| (row.0 - t).abs() < 0.1);
                row.map(|row| row.1)
            }
            (
                SourceData::Formula {
                    from, to, value, ..
                },
                Some(t),
            ) => (*from..=*to).contains(&t).then(|| value(t)),
            _ => None,
        };
        let at = temperature.map_or(String::new(), |t| format!(" at {t} K"));
        match expected {
            None => found.push(format!(
                "{name}: {property}{at}: its source has no such row"
            )),
            Some(source) if (value - source).abs() > 1.001 * rounding(value) => found.push(
                format!("{name}: {property}{at}: the file has {value}, its source {source}"),
            ),
            Some(_) => {}
        }
    }
    if let SourceData::Formula { value, between, .. } = &check.source {
        for pair in file.windows(2) {
            let (Some(a), Some(b)) = (pair[0].0, pair[1].0) else {
                continue;
            };
            // rows close together are a jump of the property
            if is_floor(b) || b - a < 2.0 {
                continue;
            }
            let source = value(0.5 * (a + b));
            let line = 0.5 * (pair[0].1 + pair[1].1);
            if (line / source - 1.0).abs() > *between {
                found.push(format!(
                    "{name}: {property} between {a} and {b} K: {line}, its source {source}"
                ));
            }
        }
    }
    found
}

#[test]
fn every_property_is_that_of_its_source() {
    let mut found = Vec::new();
    for (name, text) in ENTRIES {
        let properties = properties(text);
        let checks = checks(name);
        for check in &checks {
            let file = properties.get(check.property);
            let file = file.unwrap_or_else(|| panic!("{name}: no {}", check.property));
            found.extend(differences(name, check, file));
        }
        for property in properties.keys() {
            let checked = checks.iter().filter(|c| c.property == property).count();
            assert_eq!(
                checked, 1,
                "{name}: {property}: one check against its source"
            );
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// With a constant ratio the volume of soft metal is compressed, and a weld has a pressure of GPa after cooling.
#[test]
fn soft_metal_keeps_its_bulk_modulus() {
    for (name, _) in ENTRIES {
        let material = super::find(name).expect("listed");
        let of = |key: &str| material.get(key).expect("given to every entry");
        let (stiffness, ratio) = (of("youngs_modulus"), of("poissons_ratio"));
        let bulk = |t: f64| stiffness.at(t, 0.0) / (3.0 - 6.0 * ratio.at(t, 0.0));
        let room = bulk(293.15);
        for t in stiffness.temperatures() {
            // the digits of the ratio, and the measured ends of IN625
            let change = bulk(t) / room - 1.0;
            assert!(change.abs() < 0.06, "{name} at {t} K: {change}");
        }
    }
}

#[test]
fn the_files_mark_what_the_list_has() {
    let mut counted = 0;
    for (name, text) in ENTRIES {
        let marks = marks(text);
        let keys: BTreeSet<_> = properties(text).into_keys().collect();
        assert_eq!(keys, marks.keys().cloned().collect(), "{name}");
        for (property, marks) in &marks {
            for mark in marks {
                assert!(
                    MARKS.contains(&mark.as_str()),
                    "{name}: {property}: [{mark}]"
                );
            }
            let has = |mark: &str| marks.contains(mark);
            assert!(
                ["seen", "computed", "other"].into_iter().any(has),
                "{name}: {property} names no source"
            );
            let listed = OTHER.contains(&(name, property));
            assert_eq!(has("other"), listed, "{name}: {property} and OTHER");
            counted += usize::from(listed);
        }
    }
    assert_eq!(counted, OTHER.len(), "the list names what no file has");
}

#[test]
fn a_value_counts_as_rounded_with_three_digits_at_least() {
    assert!((rounding(2e11) - 5e8).abs() < 1.0);
    assert!((rounding(0.3) - 5e-4).abs() < 1e-12);
    assert!((rounding(53.33) - 5e-3).abs() < 1e-12);
}

#[test]
fn a_wrong_number_and_a_row_of_no_source_are_found() {
    let source = || {
        celsius(
            "viscosity",
            1.0,
            &[(100.0, 5.0), (200.0, 4.0), (300.0, 0.0)],
        )
    };
    let compare = |check: &PropertyCheck, text: &str| {
        let text = text.replace("T =", "viscosity.temperature =");
        let file = properties(&text.replace("V =", "viscosity.value ="));
        differences("test", check, &file["viscosity"]).len()
    };
    let good = "T = [373.15, 473.15, 573.15]\nV = [5, 4, 0.1]";
    assert_eq!(compare(&source().floor(573.0), good), 0);
    assert_eq!(compare(&source(), good), 1);
    assert_eq!(compare(&source().floor(473.0), good), 1);
    assert_eq!(compare(&source(), "T = [373.15, 450]\nV = [5.02, 4]"), 2);
    let line = || formula("viscosity", 300.0, 600.0, |t| t * t);
    let coarse = "T = [300, 600]\nV = [9e4, 3.6e5]";
    assert_eq!(compare(&line(), coarse), 1);
    assert_eq!(compare(&line().between(0.2), coarse), 0);
}

#[test]
fn marks_are_those_of_the_lines_of_a_property_and_of_the_block_above() {
    let found = marks(
        "# [seen]\na.value = [1] # x\na.temperature = [2] # [floor]\nb = 3 # [other: x]\n\nc = 4",
    );
    let of = |key: &str| found[key].iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(of("a"), ["floor", "seen"]);
    assert_eq!(of("b"), ["other"]);
    assert!(of("c").is_empty());
}
