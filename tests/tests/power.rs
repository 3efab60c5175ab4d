//! The power of every source arrives in the heat of a body, through the whole of a run: what is
//! asked for is deposited or, over an edge, booked as lost.

use std::path::Path;

use perimelt::case::Case;

/// Every moving source with its keys, and the share of the power that it asks for.
const SOURCES: &[(&str, &str, f64)] = &[
    ("point_source", "", 1.0),
    (
        "gaussian_source",
        "sigma = 4e-4\neffective_depth = 1e-3",
        1.0,
    ),
    (
        "ellipsoid",
        "half_length = 5e-4\nhalf_width = 1e-3\ndepth = 1e-3",
        1.0,
    ),
    (
        "goldak",
        "front_length = 5e-4\nrear_length = 1e-3\nhalf_width = 8e-4\ndepth = 6e-4\nefficiency = 0.8",
        0.8,
    ),
    (
        "super_gaussian",
        "absorptivity = 0.35\nradius = 8e-4\norder = 6\npenetration_depth = 1e-4",
        0.35,
    ),
    (
        "profile_source",
        "profile = 'exp(-2 * r^2 / 8e-4^2) * (1 - z / 1e-3)'\nreach = 1.6e-3\ndepth = 1e-3\nefficiency = 0.4",
        0.4,
    ),
];

const POWER: f64 = 100.0;
const END: f64 = 0.1;

/// Heat asked for, deposited and lost by the source, and supplied to the body, J.
fn heat(source: &str, keys: &str, start: f64, spacing: f64) -> [f64; 4] {
    let text = format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = [0.014, 0.01, 0.006] }}
        spacing = {spacing}
        material = \"steel\"
        initial.temperature = 300
        [materials.steel]
        density = 7800
        specific_heat = 500
        conductivity = 30
        [[physics]]
        type = \"thermal\"
        horizon = 1
        [[couplers]]
        type = \"{source}\"
        power = {POWER}
        toolpath.line = {{ start = [{start}, 0.0051, 0.006], direction = [1, 0, 0], speed = 0.04 }}
        {keys}
        [time]
        end = {END}"
    );
    let case = Case::parse("power.toml", text, Path::new("")).expect("a valid case");
    let mut simulation = case
        .compose()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    case.start(&mut simulation).expect("it starts");
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    let (_, reports) = simulation.reports().remove(0);
    let [asked, deposited, lost] = ["asked", "deposited", "lost"].map(|what| {
        let name = format!("energy.{what}");
        reports
            .iter()
            .find(|r| r.name == name)
            .expect("it is reported")
            .value
    });
    let (_, balances) = simulation.balances().remove(0);
    let balance = &balances[0];
    assert!(balance.relative_error() < 1e-10, "{source}: {balance:?}");
    [asked, deposited, lost, balance.supplied]
}

#[test]
fn every_source_heats_the_body_by_what_was_asked_for() {
    for &(source, keys, share) in SOURCES {
        let expected = share * POWER * END;
        // well inside; crossing the edge x = 0 at some moment of the run
        for (start, spacing) in [(0.005, 1e-3), (0.0053, 7e-4), (-0.0015, 1e-3)] {
            let [asked, deposited, lost, supplied] = heat(source, keys, start, spacing);
            println!("{source} from {start} m: {deposited} + {lost} of {asked} J");
            let agree = |a: f64, b: f64| (a - b).abs() < 1e-10 * expected;
            assert!(
                agree(asked, expected),
                "{source}: {asked} J of {expected} J"
            );
            assert!(
                agree(deposited + lost, asked),
                "{source}: {deposited} + {lost} J"
            );
            assert!(
                agree(supplied, deposited),
                "{source}: {supplied} J of {deposited} J"
            );
            if start > 0.0 {
                assert!(agree(lost, 0.0), "{source}: {lost} J lost inside");
            } else {
                assert!(
                    lost > 0.1 * asked && deposited > 0.1 * asked,
                    "{source}: {lost} J lost"
                );
            }
        }
    }
}
