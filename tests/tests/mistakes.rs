//! Mistakes that a user makes in a case file, and what the user is told.
//!
//! Each test changes one thing in a case that runs; the messages are in `snapshots/`.

use std::path::Path;

use perimelt::case::Case;
use perimelt::run::Failure;
use perimelt_core::plugin::registered;
use perimelt_core::{Coupler, Physics};

const WELD: &str = include_str!("cases/weld.toml");

/// The case with `right` replaced by `wrong`.
fn changed(right: &str, wrong: &str) -> String {
    perimelt_tests::changed(WELD, right, wrong)
}

/// What is said about the case with `right` replaced by `wrong`.
fn message(right: &str, wrong: &str) -> String {
    perimelt_tests::message("weld.toml", changed(right, wrong))
}

fn check(text: String) -> Result<(), Failure> {
    warnings(text).map(|_| ())
}

fn warnings(text: String) -> Result<Vec<String>, Failure> {
    let (case, simulation) = perimelt_tests::start("weld.toml", text)?;
    Ok(case.warnings(&simulation)?)
}

#[test]
fn the_case_itself_is_right() {
    let warnings = warnings(WELD.to_string()).expect("the unchanged case is valid");
    assert_eq!(warnings, [""; 0]);
}

/// A body whose temperature nobody computes does not heat up, nor is it cold, whatever its material.
#[test]
fn pure_mechanics_is_not_told_to_expand() {
    const BODY: &str = "[bodies.bar]\nshape.box = { min = [0, 0, 0], max = [0.01, 0.004, 0.004] }\nspacing = 1e-3\nmaterial = \"S355\"\n";
    const MECHANICS: &str =
        "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\n";
    const WALL: &str = "[[couplers]]\ntype = \"symmetry\"\nface = \"x-\"\n[time]\nend = 1\nstep = 1\n[log]\ninterval = 1\n";
    let told = |physics: &str| {
        let text = format!("[case]\ntitle = \"bar\"\n{BODY}{physics}{WALL}");
        warnings(text).unwrap_or_else(|e| panic!("{physics}: {e}"))
    };
    assert_eq!(told(MECHANICS), [""; 0]);
    let heat = "initial.temperature = 300\n[[physics]]\ntype = \"thermal\"\n";
    let melting = "[[couplers]]\ntype = \"phase_change\"\n";
    let both = told(&format!("{heat}{MECHANICS}{melting}"));
    assert!(both[0].contains("does not expand"), "{both:?}");
    let expansion = "[[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = 473\n";
    assert_eq!(
        told(&format!("{heat}{MECHANICS}{melting}{expansion}")),
        [""; 0]
    );
}

/// Bodies between which no heat flows are told, also where the boxes around them touch.
#[test]
fn bodies_of_an_interface_that_do_not_touch_are_told() {
    for (lower, gap, touches) in [
        (0.01, "", true),
        (0.0104, "", true),
        (0.0106, "", false),
        (0.0106, "gap = 7e-4", true),
        (0.1, "", false),
    ] {
        let text = format!(
            "[bodies.one]
            shape.box = {{ min = [0, 0, 0], max = [0.02, 0.01, 0.001] }}
            dimension = 2
            spacing = 1e-3
            material = 'steel'
            initial.temperature = 300
            [bodies.two]
            shape.box = {{ min = [0, {lower}, 0], max = [0.02, {}, 0.001] }}
            dimension = 2
            spacing = 1e-3
            material = 'steel'
            initial.temperature = 400
            [materials.steel]
            density = 7800
            specific_heat = 600
            conductivity = 30
            [[physics]]
            type = 'thermal'
            body = 'one'
            [[physics]]
            type = 'thermal'
            body = 'two'
            [[couplers]]
            type = 'heat_interface'
            body = 'one'
            other = 'two'
            {gap}
            [time]
            end = 0.1
            [log]
            interval = 0.1",
            lower + 0.01
        );
        let told = warnings(text).unwrap_or_else(|e| panic!("{lower}: {e}"));
        let of_gap = told.iter().filter(|w| w.contains("exchange no heat"));
        assert_eq!(of_gap.count(), usize::from(!touches), "{lower}: {told:?}");
    }
}

/// Mean coefficients that count from an unknown temperature are told.
#[test]
fn mean_coefficients_without_their_reference_temperature_are_told() {
    let told = |property: &str| {
        let elastic = "youngs_modulus = 2e11\npoissons_ratio = 0.3";
        let text = changed(
            "thermal_expansion = 1.2e-5",
            &format!("{elastic}\n{property}"),
        );
        let plugins = "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\n[[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = 400\n[[physics]]\ntype = \"thermal\"";
        let text = text.replace("[[physics]]\ntype = \"thermal\"", plugins);
        warnings(text).unwrap_or_else(|e| panic!("{property}: {e}"))
    };
    let table = "thermal_expansion = { temperature = [300, 1300], value = [1e-5, 2e-5] }";
    let found = told(table);
    assert!(
        found[0].contains("give the temperature from which the table counts"),
        "{found:?}"
    );
    for property in [
        format!("{table}\nexpansion_reference = 293.15"),
        "thermal_expansion = 1e-5".to_string(),
        table.replace("thermal_expansion", "instantaneous_expansion"),
        table.replace("thermal_expansion", "thermal_elongation"),
    ] {
        assert_eq!(told(&property), [""; 0], "{property}");
    }
}

/// What may be a mistake is told and does not stop the run.
#[test]
fn doubtful_numbers_are_told() {
    let steel = "[materials.steel]\ndensity = 7800";
    let doubtful = [
        ("initial.temperature = 300", "initial.temperature = 20"),
        ("ambient = 300", "ambient = 20"),
        ("ambient = 300", "ambient = \"20 + fire_iso_834(t)\""),
        ("ambient = 300", "ambient = \"fire_iso_834(t)\""),
        ("spacing = 0.001\n", "spacing = 0.0007\n"),
        ("max = [0.02, 0.01, 0.004]", "max = [20, 0.01, 0.004]"),
        (steel, "[materials.steel]\ndensity = 7.8"),
        ("power = 2000", "power = 2e6"),
        (
            "type = \"thermal\"",
            "type = \"mechanical\"\nformulation = \"ordinary\"\nplasticity = { annealing_temperature = 100 }\n[[physics]]\ntype = \"thermal\"",
        ),
        ("half_width = 0.002", "half_width = 0.0002"),
        (
            "liquidus = 1750\nlatent_heat = 2.6e5\nthermal_expansion = 1.2e-5\n",
            "liquidus = 1950\nlatent_heat = 2.6e5\nviscosity = 5e-3\n\n[[physics]]\ntype = \"melt_flow\"\nsurface = { faces = [\"z+\"], tension.sulphur = 0.01 }\n",
        ),
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
                &format!(
                    "{steel}\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nyield_stress = 3e8"
                ),
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
    melt_flow_in_a_body_that_does_not_melt: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"melt_flow\"";
    melt_flow_without_viscosity: "horizon = 2\n" => "horizon = 2\n[[physics]]\ntype = \"melt_flow\"\n";
    melt_flow_without_heat: "thermal_expansion = 1.2e-5\n\n[[physics]]\ntype = \"thermal\"\nhorizon = 2\n" => "viscosity = 5e-3\n\n[[physics]]\ntype = \"melt_flow\"\n";
    melt_flow_with_apparent_latent_heat: "type = \"phase_change\"\n" => "type = \"phase_change\"\nform = \"apparent\"\n[[physics]]\ntype = \"melt_flow\"\n";
    melt_flow_beside_a_steady_state: "thermal_expansion = 1.2e-5\n\n[[physics]]\ntype = \"thermal\"\n" => "viscosity = 5e-3\n\n[[physics]]\ntype = \"melt_flow\"\n\n[[physics]]\ntype = \"thermal\"\nsolver = \"steady\"\n";
    melt_flow_along_no_face: "horizon = 2\n" => "horizon = 2\n[[physics]]\ntype = \"melt_flow\"\nsurface = { faces = [] }\n";
    melt_flow_with_too_much_sulphur: "horizon = 2\n" => "horizon = 2\n[[physics]]\ntype = \"melt_flow\"\nsurface = { faces = [\"z+\"], tension.sulphur = 3 }\n";
    melt_flow_that_nothing_is_liquid_enough_for: "horizon = 2\n" => "horizon = 2\n[[physics]]\ntype = \"melt_flow\"\nleast_liquid = 1\n";
    // and some more
    unknown_section: "[time]" => "[tme]";
    physics_as_coupler: "type = \"goldak\"" => "type = \"mechanical\"";
    unknown_region: "region = \"base\"" => "region = \"bas\"";
    unknown_material: "material = \"steel\"" => "material = \"steal\"";
    missing_property: "specific_heat = 500\n" => "";
    probe_off_the_body: "kind.region = { name = \"base\", statistic = \"mean\" }" => "kind.point = [1, 2, 3]";
    name_of_a_series_that_there_is: "name = \"base\"\nfield" => "name = \"reports\"\nfield";
    no_initial_temperature: "initial.temperature = 300\n" => "";
    initial_field_nobody_provides: "initial.temperature = 300" => "initial.temperatur = 300";
    initial_field_that_follows_from_others: "initial.temperature = 300" => "initial.temperature = 300\ninitial.enthalpy = 1e9";
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
    zone_with_a_horizon_of_zero: "spacing = 0.001\n" => "zones = [{ min = [0, 0, 0], max = [0.02, 0.01, 0.004], spacing = 0.001, horizon_factor = 0 }]\n";
    horizon_that_reaches_nobody: "horizon = 2\n" => "horizon = { length = 0.0005 }\n";
    temperature_below_zero: "initial.temperature = 300" => "initial.temperature = -5";
    surroundings_below_zero: "ambient = 300" => "ambient = -5";
    fire_that_is_unknown: "ambient = 300" => "ambient = \"293 + fire_iso834(t)\"";
    gas_that_is_unknown: "ambient = 300" => "ambient = { body = \"gas\" }";
    gas_around_itself: "ambient = 300" => "ambient = { body = \"plate\" }";
    gas_with_a_temperature_in_time: "ambient = 300" => "ambient = { body = \"gas\", time = [0], value = [300] }";
    exchange_that_is_unknown: "ambient = 300" => "ambient = { body = \"gas\", exchange = \"two_ways\" }";
    exchange_without_a_body: "ambient = 300" => "ambient = { exchange = \"two_way\" }";
    film_without_a_coefficient: "coefficient = 200\n" => "";
    formula_of_a_property_in_the_time: "value = [50, 30]" => "value = \"50 - 0.02 * t\"";
    formula_of_a_property_that_is_infinite: "value = [50, 30]" => "value = \"50 / (T - 300)\"";
    water_that_cavitates_under_pressure: "[[couplers]]\ntype = \"phase_change\"" => "[[couplers]]\ntype = \"undex\"\nfaces = [\"z-\"]\nincident = 1e6\ncavitation = 1e5\n[[couplers]]\ntype = \"phase_change\"";
    shock_wave_on_a_body_that_does_not_move: "[[couplers]]\ntype = \"phase_change\"" => "[[couplers]]\ntype = \"undex\"\nfaces = [\"z-\"]\nincident = 1e6\n[[couplers]]\ntype = \"phase_change\"";
    horizon_in_words: "horizon = 2\n" => "horizon = \"wide\"\n";
    name_that_another_has: "type = \"convection\"" => "type = \"radiation\"\nname = \"goldak\"\nambient = 300\n[[couplers]]\ntype = \"convection\"";
    name_that_is_no_text: "type = \"convection\"" => "type = \"convection\"\nname = 5";
    key_twice: "depth = 0.002" => "depth = 0.002\ndepth = 0.003";
    plugin_without_type: "type = \"convection\"\n" => "";
    single_brackets: "[[couplers]]\ntype = \"convection\"" => "[convection]\ntype = \"convection\"";
    density_of_zero: "density = 7800" => "density = 0";
    property_of_text: "specific_heat = 500" => "specific_heat = \"500 J/kg\"";
    table_without_values: "conductivity = { temperature = [300, 1000], value = [50, 30] }" => "conductivity = { temperature = [300, 1000] }";
    table_of_unequal_lengths: "value = [50, 30]" => "value = [50]";
    liquidus_below_solidus: "liquidus = 1750" => "liquidus = 1650";
    shape_that_is_unknown: "shape.box = { min = [0, 0, 0], max = [0.02, 0.01, 0.004] }" => "shape.cube = 0.02";
    box_inside_out: "max = [0.02, 0.01, 0.004]" => "max = [-0.02, 0.01, 0.004]";
    point_of_two_numbers: "max = [0.02, 0.01, 0.004]" => "max = [0.02, 0.01]";
    spacing_of_zero: "spacing = 0.001\n" => "spacing = 0\n";
    spacing_beyond_the_body: "spacing = 0.001\n" => "spacing = 1\n";
    spacing_beyond_memory: "spacing = 0.001\n" => "spacing = 1e-9\n";
    dimension_of_four: "spacing = 0.001\n" => "spacing = 0.001\ndimension = 4\n";
    end_before_start: "end = 1.5" => "end = -1";
    interval_of_zero: "interval = 0.02" => "interval = 0";
    log_stages_in_disorder: "interval = 0.02" => "interval = 0.02\nstages = [{ until = 1, interval = 0.1 }, { until = 0.5, interval = 0.2 }]";
    log_stage_without_an_interval: "interval = 0.02" => "interval = 0.02\nstages = [{ until = 1, interval = 0 }]";
    step_that_is_negative: "end = 1.5" => "end = 1.5\nstep = -0.1";
    power_that_is_negative: "power = 2000" => "power = -2000";
    width_of_zero: "half_width = 0.002" => "half_width = 0";
    coefficient_that_is_negative: "coefficient = 200" => "coefficient = -200";
    efficiency_above_one: "power = 2000" => "power = 2000\nefficiency = 1.2";
    toolpath_of_no_length: "end = [0.016, 0.005, 0.004]" => "end = [0.004, 0.005, 0.004]";
    two_toolpaths: "toolpath.line = " => "toolpath.circle = { centre = [0, 0, 0], radius = 1, speed = 1 }\ntoolpath.line = ";
    body_that_is_unknown: "type = \"goldak\"" => "type = \"goldak\"\nbody = \"plat\"";
    face_that_is_unknown: "region = \"base\"\ncoefficient" => "faces = [\"z\"]\ncoefficient";
    field_that_no_probe_can_read: "field = \"temperature\"" => "field = \"temprature\"";
    statistic_that_is_unknown: "statistic = \"mean\"" => "statistic = \"average\"";
    logged_field_that_is_unknown: "interval = 0.02" => "interval = 0.02\nfields = [\"temprature\"]";
    infinite_number: "depth = 0.002" => "depth = inf";
    solver_that_is_unknown: "horizon = 2\n" => "horizon = 2\nsolver.rkl3 = {}\n";
    key_of_a_choice_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nsolver.quasi_static = { toleranec = 1e-6 }\n[[couplers]]\ntype = \"phase_change\"";
    flow_law_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.johnson_cock = {}\n[[couplers]]\ntype = \"phase_change\"";
    flow_law_as_text: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow = \"j2\"\n[[couplers]]\ntype = \"phase_change\"";
    two_flow_laws: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow = { j2 = {}, norton = {} }\n[[couplers]]\ntype = \"phase_change\"";
    key_of_a_flow_law_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.johnson_cook = { reference_rat = 2 }\n[[couplers]]\ntype = \"phase_change\"";
    key_of_another_flow_law: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.norton = { reference_rate = 2 }\n[[couplers]]\ntype = \"phase_change\"";
    text_in_a_flow_law: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.j2 = { hardening = { plastic_strain = [0, \"much\"], factor = [1, 2] } }\n[[couplers]]\ntype = \"phase_change\"";
    flow_law_beside_plasticity: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.j2 = {}\nplasticity = {}\n[[couplers]]\ntype = \"phase_change\"";
    annealing_without_flow: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nannealing_temperature = 1300\n[[couplers]]\ntype = \"phase_change\"";
    flow_law_without_a_constant: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.chaboche = {}\n";
    flow_law_with_a_rate_of_zero: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nflow.johnson_cook = { reference_rate = 0 }\n";
    flow_law_of_a_bond_based_solid: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"bond\"\nflow.j2 = {}\n";
    state_law_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tate.sound_speed = 1\n[[couplers]]\ntype = \"phase_change\"";
    key_of_another_state_law: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.rate.sound_speed = 1\n[[couplers]]\ntype = \"phase_change\"";
    state_law_with_a_sound_speed_of_zero: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tait.sound_speed = 0\n[[couplers]]\ntype = \"phase_change\"";
    tolerance_of_the_pressure_of_zero: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = { tolerance = 0 }\n[[couplers]]\ntype = \"phase_change\"";
    speed_of_sound_of_a_fluid_without_sound: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = { sound_speed = 10 }\n[[couplers]]\ntype = \"phase_change\"";
    diffusion_of_the_density_of_a_fluid_without_sound: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\ndensity_diffusion = 0.1\n[[couplers]]\ntype = \"phase_change\"";
    points_that_move_in_a_fluid_without_sound: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nstate.incompressible = {}\n[[couplers]]\ntype = \"phase_change\"";
    two_fluids_with_sound: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.tait.sound_speed = 10\nfluids = [\"steel\", \"argon\"]\n[[couplers]]\ntype = \"phase_change\"";
    one_fluid_with_an_interface: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\ninterface = {}\n[[couplers]]\ntype = \"phase_change\"";
    contact_angle_beyond_half_a_turn: "[[couplers]]\ntype = \"phase_change\"" => "[[couplers]]\ntype = \"wall\"\nfaces = [\"z-\"]\ncontact_angle = 190\n[[couplers]]\ntype = \"phase_change\"";
    contact_angle_without_two_fluids: "thermal_expansion = 1.2e-5\n" => "viscosity = 5e-3\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\n\n[[couplers]]\ntype = \"wall\"\nfaces = [\"x-\", \"x+\", \"y-\", \"y+\", \"z-\", \"z+\"]\ncontact_angle = 60\n";
    three_fluids: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"a\", \"b\", \"c\"]\n[[couplers]]\ntype = \"phase_change\"";
    tension_along_a_wall_to_which_the_fluid_sticks: "[[couplers]]\ntype = \"phase_change\"" => "[[couplers]]\ntype = \"wall\"\nfaces = [\"z+\"]\ntension.slope = -1e-3\n[[couplers]]\ntype = \"phase_change\"";
    tension_along_a_wall_without_a_fluid: "[[couplers]]\ntype = \"phase_change\"" => "[[couplers]]\ntype = \"wall\"\nfaces = [\"z+\"]\nkind = \"slip\"\ntension.slope = -1e-3\n[[couplers]]\ntype = \"phase_change\"";
    tension_along_a_wall_without_heat: "thermal_expansion = 1.2e-5\n\n[[physics]]\ntype = \"thermal\"\nhorizon = 2\n" => "viscosity = 5e-3\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\n\n[[couplers]]\ntype = \"wall\"\nfaces = [\"x-\", \"x+\", \"y-\", \"y+\", \"z-\", \"z+\"]\nkind = \"slip\"\ntension.slope = -1e-3\n";
    tension_that_depends_on_an_unknown_temperature: "initial.temperature = 300\n\n[materials.steel]\ndensity = 7800\nspecific_heat = 500\nconductivity = { temperature = [300, 1000], value = [50, 30] }\nsolidus = 1700\nliquidus = 1750\nlatent_heat = 2.6e5\nthermal_expansion = 1.2e-5\n\n[[physics]]\ntype = \"thermal\"\nhorizon = 2\n\n[[couplers]]\ntype = \"phase_change\"\n" => "initial.temperature = 300\nmaterials = { base = \"argon\" }\n\n[materials.argon]\ndensity = 100\nspecific_heat = 500\nconductivity = 0.02\nviscosity = 1e-5\n\n[materials.steel]\ndensity = 7800\nviscosity = 5e-3\nsurface_tension = { temperature = [1800, 3000], value = [1.8, 1.3] }\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"steel\", \"argon\"]\n\n[[couplers]]\ntype = \"wall\"\nfaces = [\"x-\", \"x+\", \"y-\", \"y+\", \"z-\", \"z+\"]\n";
    two_fluids_with_too_different_heat: "initial.temperature = 300\n\n[materials.steel]\ndensity = 7800\nspecific_heat = 500\nconductivity = { temperature = [300, 1000], value = [50, 30] }\nsolidus = 1700\nliquidus = 1750\nlatent_heat = 2.6e5\nthermal_expansion = 1.2e-5\n\n[[physics]]\ntype = \"thermal\"\nhorizon = 2\n\n[[couplers]]\ntype = \"phase_change\"\n" => "initial.temperature = 300\nmaterials = { base = \"argon\" }\n\n[materials.argon]\ndensity = 0.1\nspecific_heat = 500\nconductivity = 0.02\nviscosity = 1e-5\n\n[materials.steel]\ndensity = 7800\nspecific_heat = 500\nconductivity = 30\nviscosity = 5e-3\nsurface_tension = 1.8\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"steel\", \"argon\"]\n\n[[physics]]\ntype = \"thermal\"\nhorizon = 2\n\n[[couplers]]\ntype = \"wall\"\nfaces = [\"x-\", \"x+\", \"y-\", \"y+\", \"z-\", \"z+\"]\n";
    tension_beside_its_value: "initial.temperature = 300\n\n[materials.steel]\n" => "initial.temperature = 300\nmaterials = { base = \"argon\" }\n\n[materials.argon]\ndensity = 100\nspecific_heat = 500\nconductivity = 0.02\nviscosity = 1e-5\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"steel\", \"argon\"]\ninterface = { surface_tension = 1.8, tension.sulphur = 0.01 }\n\n[materials.steel]\nviscosity = 5e-3\n";
    slope_of_a_tension_without_its_temperature: "initial.temperature = 300\n\n[materials.steel]\n" => "initial.temperature = 300\nmaterials = { base = \"argon\" }\n\n[materials.argon]\ndensity = 100\nspecific_heat = 500\nconductivity = 0.02\nviscosity = 1e-5\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"steel\", \"argon\"]\ninterface = { surface_tension = 1.8, tension.slope = -4e-4 }\n\n[materials.steel]\nviscosity = 5e-3\n";
    slope_of_a_tension_without_its_value: "initial.temperature = 300\n\n[materials.steel]\n" => "initial.temperature = 300\nmaterials = { base = \"argon\" }\n\n[materials.argon]\ndensity = 100\nspecific_heat = 500\nconductivity = 0.02\nviscosity = 1e-5\n\n[[physics]]\ntype = \"fluid\"\ndescription = \"eulerian\"\nform = \"conservative\"\nstate.incompressible = {}\nfluids = [\"steel\", \"argon\"]\ninterface = { tension.slope = -4e-4, reference_temperature = 1800 }\n\n[materials.steel]\nviscosity = 5e-3\nsurface_tension = { temperature = [1800, 3000], value = [1.8, 1.3] }\n";
    conductivity_with_directions_in_the_form_of_bonds: "conductivity = { temperature = [300, 1000], value = [50, 30] }" => "conductivity = { along = 30, across = 3 }";
    property_without_directions: "density = 7800" => "density = { along = 7800, across = 7000 }";
    conductivity_across_fibres_below_zero: "conductivity = { temperature = [300, 1000], value = [50, 30] }" => "conductivity = { along = 30, across = { temperature = [300, 1000], value = [3, -1] } }";
    angle_of_a_temperature: "initial.temperature = 300" => "initial.temperature.angle = 300";
    orientation_that_nothing_uses: "initial.temperature = 300" => "initial.temperature = 300\ninitial.orientation.angle = 30";
    conductivity_law_without_a_constant: "conductivity = { temperature = [300, 1000], value = [50, 30] }\n" => "";
    viscosity_law_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tait.sound_speed = 1\nviscosity.powerlaw = {}\n[[couplers]]\ntype = \"phase_change\"";
    viscosity_law_without_its_key: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tait.sound_speed = 1\nviscosity.power_law = {}\n[[couplers]]\ntype = \"phase_change\"";
    viscosity_law_without_a_constant: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tait.sound_speed = 1\nviscosity.herschel_bulkley = { largest = 100 }\n[[couplers]]\ntype = \"phase_change\"";
    viscosity_law_with_a_bound_of_zero: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"fluid\"\nform = \"conservative\"\nstate.tait.sound_speed = 1\nviscosity.power_law = { largest = 0 }\n[[couplers]]\ntype = \"phase_change\"";
    law_that_is_unknown: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nlaw.linaer = {}\n[[couplers]]\ntype = \"phase_change\"";
    key_of_a_law_without_keys: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nlaw.linear = { stiffness = 2 }\n[[couplers]]\ntype = \"phase_change\"";
    law_of_flow_as_law: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nlaw.j2 = {}\n[[couplers]]\ntype = \"phase_change\"";
    law_of_another_formulation: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nlaw.neo_hookean = {}\n";
    law_without_its_kinematics: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nlaw.neo_hookean = {}\n";
    law_beside_plastic_flow: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nkinematics = \"finite\"\nlaw.neo_hookean = {}\nflow.j2 = {}\n";
    law_with_a_stretch_of_zero: "thermal_expansion = 1.2e-5\n" => "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\n\n[[physics]]\ntype = \"mechanical\"\nformulation = \"correspondence\"\nkinematics = \"finite\"\nlaw.neo_hookean = { least_stretch = 0 }\n";
    horizon_of_zero: "horizon = 2\n" => "horizon = 0\n";
    steel_without_composition: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"metallurgy\"\n[[couplers]]\ntype = \"phase_change\"";
    two_physics_of_one_field: "[[couplers]]\ntype = \"phase_change\"" => "[[physics]]\ntype = \"thermal\"\n[[couplers]]\ntype = \"phase_change\"";
}

/// What is said about the case after several changes.
fn messages(changes: &[(&str, &str)]) -> String {
    let text = changes
        .iter()
        .fold(WELD.to_string(), |text, (right, wrong)| {
            perimelt_tests::changed(&text, right, wrong)
        });
    perimelt_tests::message("weld.toml", text)
}

/// All mistakes that do not depend on each other are told at once.
#[test]
fn mistakes_of_several_sections_are_told_together() {
    insta::assert_snapshot!(messages(&[
        ("spacing = 0.001\n", "spacng = 0.001\n"),
        ("half_width = 0.002", "half_with = 0.002"),
        ("interval = 0.02", "interval = 0"),
    ]));
}

/// A misspelt key is not missing, too.
#[test]
fn mistakes_of_one_section_are_told_together() {
    insta::assert_snapshot!(messages(&[
        ("half_width = 0.002", "half_with = 0.002"),
        ("depth = 0.002", "depth = \"deep\""),
        ("speed = 0.01", "sped = 0.01"),
    ]));
}

/// A section that lacks two keys is told so of both.
#[test]
fn several_missing_keys_of_one_section_are_told_together() {
    insta::assert_snapshot!(messages(&[
        ("rear_length = 0.004\n", ""),
        ("half_width = 0.002\n", ""),
        ("material = \"steel\"\n", ""),
        ("spacing = 0.001\n", ""),
    ]));
}

/// Mistakes that plugins find once bodies are there.
#[test]
fn mistakes_of_several_plugins_are_told_together() {
    insta::assert_snapshot!(messages(&[
        ("type = \"goldak\"", "type = \"goldak\"\nbody = \"plat\""),
        ("coefficient = 200", "coefficient = -200"),
        ("horizon = 2\n", "horizon = 0\n"),
    ]));
}

/// Each coupler that feeds nobody is named.
#[test]
fn what_nobody_provides_is_told_for_each_plugin() {
    let plugins = "[[couplers]]\ntype = \"deformation_heat\"\n[[couplers]]\ntype = \"thermal_expansion\"\nreference_temperature = 300";
    insta::assert_snapshot!(messages(&[(
        "[[couplers]]\ntype = \"phase_change\"",
        plugins
    )]));
}

/// Passes that cannot agree, a release before the start, sections of one name, and the heat of a rate in a steady state.
#[test]
fn what_cannot_happen_is_refused() {
    const BAR: &str = r#"[bodies.bar]
shape.box = { min = [0, 0, 0], max = [0.01, 0.004, 0.004] }
spacing = 1e-3
material = "steel"
regions.foot.box = { min = [0, 0, 0], max = [0.001, 1, 1] }
initial.temperature = 300

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 40
thermal_expansion = 1.2e-5
youngs_modulus = 2e11
poissons_ratio = 0.25

[[physics]]
type = "thermal"

[[physics]]
type = "mechanical"
sections = [{ name = "middle", axis = "x", at = 0.005 }, { name = "end", axis = "x", at = 0.007 }]

[[couplers]]
type = "clamp"
region = "foot"
until = 1

[[couplers]]
type = "deformation_heat"

[time]
end = 1
step = 0.1
iteration = { tolerance = 1e-6, passes = 20 }
"#;
    perimelt_tests::start("bar.toml", BAR.into()).expect("the case is valid");
    let all = [
        ("tolerance = 1e-6", "tolerance = 0.0"),
        ("passes = 20", "passes = 1"),
        ("until = 1", "until = -1"),
        ("name = \"end\"", "name = \"middle\""),
        (
            "type = \"thermal\"",
            "type = \"thermal\"\nsolver = \"steady\"",
        ),
    ];
    let told = all.map(|(right, wrong)| {
        let text = perimelt_tests::changed(BAR, right, wrong);
        perimelt_tests::message("bar.toml", text)
    });
    insta::assert_snapshot!(told.join("\n\n"));
}

/// Mistakes that only the composed case shows.
#[test]
fn mistakes_of_the_composed_case_are_told_together() {
    insta::assert_snapshot!(messages(&[
        ("initial.temperature = 300", "initial.temperature = -5"),
        (
            "interval = 0.02",
            "interval = 0.02\nfields = [\"temprature\"]"
        ),
        ("field = \"temperature\"", "field = \"temprature\""),
    ]));
}

/// A key with two letters exchanged, or one more or less; `None` where that is another key.
fn misspelt(key: &str, keys: &serde_json::Map<String, serde_json::Value>) -> Option<String> {
    let mut letters: Vec<char> = key.chars().collect();
    let last = letters.len() - 1;
    match letters.len() {
        // `x`, `y` and `z` are as near to each other as to what is misspelt
        0..=1 => return None,
        2..=3 => letters.push('x'),
        _ if letters[last] == letters[last - 1] => letters.truncate(last),
        _ => letters.swap(last, last - 1),
    }
    let misspelt: String = letters.into_iter().collect();
    (!keys.contains_key(&misspelt)).then_some(misspelt)
}

/// Key of a table that contains the next table in a list.
const LIST: &str = "[]";

/// The keys of a schema, each with the tables that contain it and its misspelling.
struct Misspelt<'a> {
    schema: &'a serde_json::Value,
    place: Vec<String>,
    /// Definitions that contain the present one: shapes contain shapes.
    within: Vec<&'a str>,
    found: Vec<(Vec<String>, String, String)>,
}

impl<'a> Misspelt<'a> {
    fn of(schema: &'a serde_json::Value) -> Vec<(Vec<String>, String, String)> {
        let mut keys = Misspelt {
            schema,
            place: Vec::new(),
            within: Vec::new(),
            found: Vec::new(),
        };
        keys.walk(schema);
        keys.found
    }

    fn walk(&mut self, node: &'a serde_json::Value) {
        if let Some(reference) = node["$ref"].as_str()
            && !self.within.contains(&reference)
        {
            self.within.push(reference);
            let definition = self.schema.pointer(&reference[1..]);
            self.walk(definition.expect("a definition"));
            self.within.pop();
        }
        for alternatives in ["allOf", "anyOf", "oneOf"] {
            let nodes = node[alternatives].as_array().into_iter().flatten();
            nodes.for_each(|node| self.walk(node));
        }
        for (key, value) in node["properties"].as_object().into_iter().flatten() {
            let keys = node["properties"].as_object().expect("a table");
            let found = misspelt(key, keys);
            let place = &self.place;
            self.found
                .extend(found.map(|misspelt| (place.clone(), key.clone(), misspelt)));
            self.step(key, value);
        }
        if node["items"].is_object() {
            self.step(LIST, &node["items"]);
        }
    }

    fn step(&mut self, key: &str, node: &'a serde_json::Value) {
        self.place.push(key.into());
        self.walk(node);
        self.place.pop();
    }
}

/// A key in its tables, as in a case file.
fn written(place: &[String], key: &str) -> String {
    match place {
        [] => format!("{key} = 1"),
        [table, list, rest @ ..] if list == LIST => {
            format!("{table} = [{{ {} }}]", written(rest, key))
        }
        [table, rest @ ..] => format!("{table} = {{ {} }}", written(rest, key)),
    }
}

/// A key of a plugin that is misspelt is answered with the right one, whatever the plugin, also in tables of the plugin.
#[test]
fn every_key_of_every_plugin_is_recognised_when_misspelt() {
    let mut wrong = Vec::new();
    let mut number = 0;
    let mut walk = |section: &str, kind: &str, schema: serde_json::Value| {
        for (place, key, misspelt) in Misspelt::of(&schema) {
            number += 1;
            let line = written(&place, &misspelt);
            let table = format!("\n[[{section}]]\ntype = \"{kind}\"\n{line}\n");
            let told = match check(format!("{WELD}{table}")) {
                Err(Failure::Case(mistake)) => mistake.render(false),
                other => format!("{other:?}"),
            };
            if !told.contains(&format!("did you mean `{key}`?")) {
                wrong.push(format!("{kind}: {line}: {told}"));
            }
        }
    };
    for plugin in registered::<dyn Physics>() {
        walk("physics", plugin.name, (plugin.schema)().to_value());
    }
    for plugin in registered::<dyn Coupler>() {
        walk("couplers", plugin.name, (plugin.schema)().to_value());
    }
    assert!(
        wrong.is_empty(),
        "{} of {number}:\n{}",
        wrong.len(),
        wrong.join("\n\n")
    );
    assert!(number > 1000, "{number} keys");
}

/// Numbers beyond the ranges of a schema, with the places of their keys in a table.
struct Beyond<'a> {
    schema: &'a serde_json::Value,
    place: Vec<String>,
    found: Vec<(Vec<String>, f64)>,
}

impl Beyond<'_> {
    fn walk(&mut self, node: &serde_json::Value, value: &toml::Value) {
        if let Some(reference) = node["$ref"].as_str() {
            let schema = self.schema;
            let node = schema.pointer(&reference[1..]).expect("a definition");
            self.walk(node, value);
        }
        for alternatives in ["allOf", "anyOf", "oneOf"] {
            let nodes = node[alternatives].as_array().into_iter().flatten();
            nodes.for_each(|node| self.walk(node, value));
        }
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    self.step(key, &node["properties"][key], value);
                }
            }
            toml::Value::Array(values) => {
                for (index, value) in values.iter().enumerate() {
                    self.step(&index.to_string(), &node["items"], value);
                }
            }
            toml::Value::Float(_) | toml::Value::Integer(_) => {
                let limit = |name: &str| node[name].as_f64();
                let beyond = [
                    limit("exclusiveMinimum"),
                    limit("minimum").map(|least| least - 1.0),
                    limit("maximum").map(|most| most + 1.0),
                ];
                let place = &self.place;
                let found = beyond.into_iter().flatten().map(|n| (place.clone(), n));
                self.found.extend(found);
            }
            _ => {}
        }
    }

    fn step(&mut self, key: &str, node: &serde_json::Value, value: &toml::Value) {
        self.place.push(key.into());
        self.walk(node, value);
        self.place.pop();
    }
}

/// The value at a place in a table.
fn value_at<'a>(table: &'a mut toml::Value, place: &[String]) -> &'a mut toml::Value {
    place.iter().fold(table, |value, key| match value {
        toml::Value::Array(values) => &mut values[key.parse::<usize>().expect("an index")],
        other => &mut other[key.as_str()],
    })
}

/// What the schema of a plugin refuses in an editor, the program refuses, too.
#[test]
fn numbers_beyond_the_ranges_of_the_schema_are_refused() {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../fuzz/corpus/case_file"
    ));
    let mut schemas = std::collections::BTreeMap::new();
    for plugin in registered::<dyn Physics>() {
        schemas.insert(("physics", plugin.name), (plugin.schema)().to_value());
    }
    for plugin in registered::<dyn Coupler>() {
        schemas.insert(("couplers", plugin.name), (plugin.schema)().to_value());
    }
    let mut tried = std::collections::BTreeSet::new();
    let mut accepted = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the corpus").flatten() {
        let text = std::fs::read_to_string(entry.path()).expect("a text");
        let mut case: toml::Value = toml::from_str(&text).expect("a case");
        for ((section, kind), schema) in &schemas {
            let number = case
                .get(section)
                .and_then(|s| s.as_array())
                .map_or(0, Vec::len);
            for index in 0..number {
                let place = [section.to_string(), index.to_string()];
                let plugin = value_at(&mut case, &place).clone();
                if plugin.get("type").and_then(|t| t.as_str()) != Some(kind) {
                    continue;
                }
                let mut beyond = Beyond {
                    schema,
                    place: place.to_vec(),
                    found: Vec::new(),
                };
                beyond.walk(schema, &plugin);
                for (place, number) in beyond.found {
                    let is_key = |key: &&String| key.parse::<usize>().is_err();
                    let key: Vec<_> = place.iter().filter(is_key).skip(1).cloned().collect();
                    let key = format!("{kind}.{} = {number}", key.join("."));
                    if !tried.insert(key.clone()) {
                        continue;
                    }
                    let mut changed = case.clone();
                    let value = value_at(&mut changed, &place);
                    *value = match value {
                        toml::Value::Integer(_) => toml::Value::Integer(number as i64),
                        _ => toml::Value::Float(number),
                    };
                    let text = toml::to_string(&changed).expect("TOML");
                    let case = Case::parse("changed.toml", text, folder);
                    if case.and_then(|case| case.compose().map(|_| ())).is_ok() {
                        accepted.push(format!("{}: {key}", entry.file_name().display()));
                    }
                }
            }
        }
    }
    assert!(accepted.is_empty(), "accepted:\n{}", accepted.join("\n"));
    assert!(tried.len() > 60, "only {}: {tried:?}", tried.len());
}

const DROP: &str = "
[case]
title = 'drop'

[bodies.tank]
shape.box = { min = [0, 0, 0], max = [1, 1, 0.1] }
dimension = 2
spacing = 0.1
material = 'water'
materials = { around = 'air' }
regions.around.box = { min = [0, 0, 0], max = [0.5, 1, 0.1] }
initial.fluid_fraction = '1 / (1 + exp((x - 0.5) / 0.075))'

[materials.water]
density = 1
viscosity = 0.01

[materials.air]
density = 0.001
viscosity = 1e-5

[[physics]]
type = 'fluid'
description = 'eulerian'
form = 'conservative'
state.incompressible = {}
fluids = ['water', 'air']
interface = { surface_tension = 1 }

[[couplers]]
type = 'wall'
faces = ['x-', 'x+', 'y-', 'y+']
contact_angle = 60

[time]
end = 1

[log]
interval = 1
";

/// What is said about two fluids that cannot be; a step above that of capillary waves is told with both numbers.
#[test]
fn mistakes_of_two_fluids() {
    let told = |right: &str, wrong: &str| {
        let failure = check(perimelt_tests::changed(DROP, right, wrong)).expect_err(wrong);
        match failure {
            Failure::Case(mistake) => mistake.render(false),
            other => other.to_string(),
        }
    };
    check(DROP.to_string()).expect("the unchanged case is valid");
    let all = [
        (
            "state.incompressible = {}\n",
            "state.incompressible = {}\nstep = 0.1\n",
        ),
        ("'1 / (1 + exp((x - 0.5) / 0.075))'", "'2 * x'"),
        ("interface = { surface_tension = 1 }\n", ""),
        (
            "interface = { surface_tension = 1 }",
            "interface = { surface_tension = 0 }",
        ),
        ("contact_angle = 60", "contact_angle = -1"),
        (
            "interface = { surface_tension = 1 }",
            "interface = { surface_tension = 1, width = 5 }",
        ),
        (
            "materials = { around = 'air' }\n",
            "materials = { around = 'air', other = 'S355' }\nregions.other.box = { min = [0.8, 0, 0], max = [1, 1, 0.1] }\n",
        ),
        (
            "contact_angle = 60",
            "kind = 'slip'\nvelocity = [0, 0, 1]",
        ),
    ]
    .map(|(right, wrong)| told(right, wrong));
    insta::assert_snapshot!(all.join("\n\n"));
}

const MOVING_DROP: &str = include_str!("../../cases/verification/wang-8.5.3-contact-angle-60.toml");

/// Two fluids whose points move and keep their material.
#[test]
fn mistakes_of_two_fluids_at_points_that_move() {
    let told = |right: &str, wrong: &str| {
        let changed = perimelt_tests::changed(MOVING_DROP, right, wrong);
        let failure = check(changed).expect_err(wrong);
        match failure {
            Failure::Case(mistake) => mistake.render(false),
            other => other.to_string(),
        }
    };
    let tension = "interface = { surface_tension = 0.07 }";
    let all = [
        (tension, "interface = { surface_tension = 0.07, width = 1 }"),
        (tension, ""),
        (
            tension,
            "interface = { tension.slope = -1e-4, surface_tension = 0.07, reference_temperature = 300 }",
        ),
        ("smoothing = 20", "density_diffusion = 0.1"),
        ("smoothing = 20", "form = \"conservative\""),
        (
            "material = \"gas\"",
            "material = \"gas\"\ninitial.fluid_fraction = 0.5",
        ),
    ]
    .map(|(right, wrong)| told(right, wrong));
    insta::assert_snapshot!(all.join("\n\n"));
}

const SPOT: &str = include_str!("../../cases/verification/laser-spot.toml");

/// Mistakes of a body of metal and gas: what is changed in a case that runs, and what is told.
#[test]
fn mistakes_of_metal_and_gas() {
    let melting = "library = \"316L\"\nviscosity = 5e-3";
    let gas = "density = 80\nspecific_heat = 1000";
    let fluids = "fluids = [\"steel\", \"argon\"]";
    let penetration = "penetration = \"interface\"";
    let mut told = String::new();
    for (name, right, wrong) in [
        ("no two fluids", fluids, ""),
        (
            "gas in front",
            fluids,
            "fluids = [\"argon\", \"steel\"]\ninterface = { surface_tension = 1.5 }",
        ),
        (
            "melting at one temperature",
            melting,
            "library = \"316L\"\nviscosity = 5e-3\nsolidus = 1700\nliquidus = 1700",
        ),
        ("light gas", gas, "density = 1.6\nspecific_heat = 520"),
        (
            "apparent heat",
            "type = \"phase_change\"",
            "type = \"phase_change\"\nform = \"apparent\"",
        ),
        (
            "no vapour",
            melting,
            "density = 7900\nspecific_heat = 700\nconductivity = 30\nviscosity = 5e-3\nsurface_tension = 1.5\nsolidus = 1658\nliquidus = 1723\nlatent_heat = 2.7e5\nboiling_temperature = 3090\nvaporisation_heat = 7e6",
        ),
        ("viscosity by temperature", melting, "library = \"316L\""),
        (
            "recoil above 1",
            "type = \"evaporation\"",
            "type = \"evaporation\"\nrecoil = 54",
        ),
        (
            "unknown key",
            "type = \"evaporation\"",
            "type = \"evaporation\"\nrecoil_pressure = 0.5",
        ),
        (
            "beam with a depth",
            penetration,
            "penetration = \"interface\"\npenetration_depth = 1e-5",
        ),
        (
            "beam without a depth",
            penetration,
            "penetration = \"uniform\"",
        ),
        (
            "inclined beam",
            "heated_surface.face = \"y+\"",
            "heated_surface = { face = \"y+\", direction = [1, -1, 0] }",
        ),
        (
            "step above that of capillary waves",
            fluids,
            "fluids = [\"steel\", \"argon\"]\nstep = 2e-7",
        ),
    ] {
        let message = match check(perimelt_tests::changed(SPOT, right, wrong)) {
            Err(Failure::Case(mistake)) => mistake.render(false),
            Err(other) => other.to_string(),
            Ok(()) => panic!("{name}: accepted"),
        };
        told += &format!("{name}\n{message}\n\n");
    }
    insta::assert_snapshot!(told);
}

const KEYHOLE: &str = include_str!("../../cases/verification/keyhole-moving-cylinder.toml");

#[test]
fn mistakes_of_a_keyhole() {
    let told = |(right, wrong): (&str, &str)| {
        perimelt_tests::message(
            "keyhole.toml",
            perimelt_tests::changed(KEYHOLE, right, wrong),
        )
    };
    let penetration = "penetration = \"keyhole\"";
    let all = [
        ("boiling_temperature = 3000", ""),
        (
            penetration,
            "penetration = \"keyhole\"\npenetration_depth = 1e-5",
        ),
        (
            penetration,
            "penetration = \"exponential\"\nreflections = true",
        ),
        (penetration, "penetration = \"keyhol\""),
        (
            penetration,
            "penetration = \"keyhole\"\nheated_surface.direction = [1, 0, -1]",
        ),
        ("spacing = 1.25e-5", "spacing = 1.25e-5\ndimension = 2"),
        (
            "spacing = 1.25e-5",
            "spacing = 1.25e-5\njitter = { amplitude = 0.1, seed = 1 }",
        ),
    ]
    .map(told);
    insta::assert_snapshot!(all.join("\n\n"));
}
