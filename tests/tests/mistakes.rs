//! Ten mistakes that a user makes in a case file, and what the user is told.
//!
//! Each test changes one thing in a case that runs; the messages are in `snapshots/`.

use std::path::Path;

use perimelt::case::Case;
use perimelt::run::Failure;

const WELD: &str = include_str!("cases/weld.toml");

/// The case with `right` replaced by `wrong`.
fn changed(right: &str, wrong: &str) -> String {
    assert_eq!(WELD.matches(right).count(), 1, "`{right}` is there once");
    WELD.replace(right, wrong)
}

/// What is said about the case with `right` replaced by `wrong`.
fn message(right: &str, wrong: &str) -> String {
    match check(changed(right, wrong)) {
        Err(Failure::Case(mistake)) => mistake.render(false),
        Err(other) => panic!("not a mistake in the case file: {other}"),
        Ok(()) => panic!("`{wrong}` is accepted"),
    }
}

fn check(text: String) -> Result<(), Failure> {
    warnings(text).map(|_| ())
}

fn warnings(text: String) -> Result<Vec<String>, Failure> {
    let case = Case::parse("weld.toml", text, Path::new(""))?;
    let mut simulation = case.compose()?;
    case.start(&mut simulation)?;
    Ok(case.warnings(&simulation)?)
}

#[test]
fn the_case_itself_is_right() {
    let warnings = warnings(WELD.to_string()).expect("the unchanged case is valid");
    assert_eq!(warnings, [""; 0]);
}

/// What may be a mistake is told and does not stop the run.
#[test]
fn doubtful_numbers_are_told() {
    let steel = "[materials.steel]\ndensity = 7800";
    let doubtful = [
        ("initial.temperature = 300", "initial.temperature = 20"),
        ("ambient = 300", "ambient = 20"),
        ("spacing = 0.001\n", "spacing = 0.0007\n"),
        ("max = [0.02, 0.01, 0.004]", "max = [20, 0.01, 0.004]"),
        (steel, "[materials.steel]\ndensity = 7.8"),
        ("power = 2000", "power = 2e6"),
        ("half_width = 0.002", "half_width = 0.0002"),
        (
            "type = \"thermal\"",
            "type = \"mechanical\"\nformulation = \"correspondence\"\n[[physics]]\ntype = \"thermal\"",
        ),
    ];
    let mut told = String::new();
    for (right, wrong) in doubtful {
        let mut text = changed(right, wrong);
        if wrong.contains("[20,") {
            text = text
                .replace("spacing = 0.001\n", "spacing = 0.004\n")
                .replace("0.01, 0.001]", "0.01, 0.004]");
        }
        if wrong.contains("mechanical") {
            text = text.replace(
                steel,
                &format!("{steel}\nyoungs_modulus = 2e11\npoissons_ratio = 0.3"),
            );
        }
        let warnings = warnings(text).unwrap_or_else(|e| panic!("{wrong}: {e}"));
        told += &format!("{}\n    {}\n", wrong.trim(), warnings.join("\n    "));
    }
    insta::assert_snapshot!(told);
}

macro_rules! mistakes {
    ($($name:ident: $right:literal => $wrong:literal;)*) => {
        $(#[test]
        fn $name() {
            insta::assert_snapshot!(message($right, $wrong));
        })*
    };
}

mistakes! {
    unknown_key: "half_width = 0.002" => "half_with = 0.002";
    missing_key: "rear_length = 0.004\n" => "";
    wrong_type: "speed = 0.01" => "speed = \"fast\"";
    unknown_plugin: "type = \"goldak\"" => "type = \"goldack\"";
    unknown_material_property: "conductivity = {" => "conductivty = {";
    region_without_points: "max = [0.02, 0.01, 0.001]" => "max = [0.02, 0.01, 0.0001]";
    source_off_the_body: "start = [0.004, 0.005, 0.004], end = [0.016, 0.005, 0.004]" => "start = [4, 5, 4], end = [16, 5, 4]";
    field_nobody_provides: "type = \"phase_change\"" => "type = \"deformation_heat\"";
    fixed_step_above_the_stable_one: "horizon = 2\n" => "horizon = 2\nstep = 1.0\n";
    table_not_increasing: "temperature = [300, 1000]" => "temperature = [1000, 300]";
    // and some more
    unknown_section: "[time]" => "[tme]";
    physics_as_coupler: "type = \"goldak\"" => "type = \"mechanical\"";
    unknown_region: "region = \"base\"" => "region = \"bas\"";
    unknown_material: "material = \"steel\"" => "material = \"steal\"";
    missing_property: "specific_heat = 500\n" => "";
    probe_off_the_body: "kind.region = { name = \"base\", statistic = \"mean\" }" => "kind.point = [1, 2, 3]";
    name_of_a_series_that_there_is: "name = \"base\"\nfield" => "name = \"reports\"\nfield";
    initial_field_nobody_provides: "initial.temperature = 300" => "initial.temperatur = 300";
    not_toml: "end = 1.5" => "end = 1.5.2";
    zones_that_overlap: "spacing = 0.001\n" => "zones = [
    { min = [0, 0, 0], max = [0.01, 0.01, 0.004], spacing = 0.001 },
    { min = [0.008, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.002 },
]\n";
    zone_outside_the_shape: "spacing = 0.001\n" => "zones = [
    { min = [0, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.001 },
    { min = [0.02, 0, 0], max = [0.03, 0.01, 0.004], spacing = 0.002 },
]\n";
    zone_that_cells_do_not_fill: "spacing = 0.001\n" => "zones = [{ min = [0, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.003 }]\n";
    zones_that_leave_out_a_part: "spacing = 0.001\n" => "zones = [{ min = [0, 0, 0], max = [0.01, 0.01, 0.004], spacing = 0.001 }]\n";
    spacing_beside_zones: "spacing = 0.001\n" => "spacing = 0.001\nzones = [{ min = [0, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.001 }]\n";
    tank_that_does_not_hold_the_body: "spacing = 0.001\n" => "spacing = 0.001\ntank = { min = [0, 0, 0], max = [0.03, 0.005, 0.004] }\n";
    body_in_a_tank_that_stays: "spacing = 0.001\n" => "spacing = 0.001\ntank = { min = [0, 0, 0], max = [0.03, 0.02, 0.01] }\n";
    moving_source_on_zones: "spacing = 0.001\n" => "zones = [{ min = [0, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.001 }]\n";
    horizon_that_reaches_nobody: "horizon = 2\n" => "horizon = { length = 0.0005 }\n";
    temperature_below_zero: "initial.temperature = 300" => "initial.temperature = -5";
    surroundings_below_zero: "ambient = 300" => "ambient = -5";
    horizon_in_words: "horizon = 2\n" => "horizon = \"wide\"\n";
}
