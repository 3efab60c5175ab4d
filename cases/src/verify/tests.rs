//! Cases that stop, and values over time.

use super::*;

/// A bar of 8 points whose mean temperature rises by `flux` (W/m²) over 8000 in a second.
fn heated_bar(flux: f64, checks: &str) -> String {
    format!(
        r#"
        [bodies.bar]
        shape.box = {{ min = [0, 0, 0], max = [0.008, 1, 1] }}
        dimension = 1
        spacing = 0.001
        material = "m"
        initial.temperature = 300

        [materials.m]
        density = 1000
        conductivity = 1
        specific_heat = 1000

        [[physics]]
        type = "thermal"
        step = 0.1

        [[couplers]]
        type = "heat_flux"
        faces = ["x-"]
        flux = {flux:e}

        [time]
        end = 10
        step = 0.1

        [log]
        interval = 1

        {checks}
        "#
    )
}

const MEAN: &str = "statistic = { field = \"temperature\", statistic = \"mean\" }";

fn check(quantity: &str, measure: &str, reference: f64) -> String {
    format!(
        r#"
        [[verify]]
        quantity = "{quantity}"
        measure.{measure}
        reference = {reference}
        limit.absolute = 1e-9
        source = "closed form"
        "#
    )
}

/// Checks case files of a temporary folder.
fn outcomes(files: &[(&str, String)]) -> Vec<Outcome> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in files {
        let path = folder.path().join(format!("{name}.toml"));
        std::fs::write(path, text).expect("a writable folder");
    }
    let args = VerifyArgs {
        cases: Some(folder.path().into()),
        ..VerifyArgs::default()
    };
    verify(&args).expect("valid cases")
}

fn is_audit(outcome: &&Outcome) -> bool {
    outcome.quantity.starts_with("audit")
}

#[test]
fn a_run_that_stops_fails_its_checks_and_no_others() {
    // 10 K in 10 s
    let sound = check("end", MEAN, 310.0);
    let ratio = check("ratio", MEAN, 1.0).replace("reference", "of = \"a-blown-up\"\nreference");
    let early = "field = { field = \"temperature\", at = [[0.004, 0, 0]], time = 0.1 }";
    let history = "history = { field = \"temperature\", at = [0.004, 0, 0] }";
    let stopped = check("early", early, 1e14)
        + &check("history", history, 1.0).replace("reference = 1", "reference = [1, 2, 3, 4]");
    let unknown = check(
        "unknown",
        "field = { field = \"temperatur\", at = [[0, 0, 0]] }",
        1.0,
    );
    let all = outcomes(&[
        ("a-blown-up", heated_bar(1e25, &stopped)),
        ("b-sound", heated_bar(8000.0, &(sound + &ratio + &unknown))),
    ]);
    let all: Vec<_> = all.iter().filter(|o| !is_audit(o)).collect();
    assert_eq!(all.len(), 5, "{all:?}");
    for (outcome, reason) in [
        (all[0], "temperature"),
        (all[1], "temperature"),
        (all[3], "the run of a-blown-up stopped"),
        (all[4], "temperatur"),
    ] {
        let failure = outcome.failure.as_deref().unwrap_or_default();
        assert!(!outcome.passed && failure.contains(reason), "{outcome:?}");
    }
    assert!(all[2].passed, "{:?}", all[2]);
    let table = OutcomeTable(&all.iter().map(|o| (*o).clone()).collect::<Vec<_>>()).to_string();
    // each reason once
    assert_eq!(table.matches("the run of a-blown-up stopped").count(), 1);
}

#[test]
fn checks_compare_cases_by_ratio_difference_and_error() {
    // 10, 30 and 40 K in 10 s
    let compare = |quantity: &str, keys: &str, reference: f64| {
        let keys = format!("{keys}\nreference");
        check(quantity, MEAN, reference).replace("reference", &keys)
    };
    let checks = compare("ratio", "of = 'a'", 340.0 / 310.0)
        + &compare("difference", "minus = ['a', 'b']", 340.0 - 310.0 - 330.0)
        // errors of 35 and 5 K
        + &compare("error", "error_of = 'a'", 305.0).replace("absolute = 1e-9", "between = [6.999, 7.001]")
        + &compare("both", "of = 'a'\nminus = ['b']", 0.0);
    let all = outcomes(&[
        ("a", heated_bar(8000.0, "")),
        ("b", heated_bar(24000.0, "")),
        ("c", heated_bar(32000.0, &checks)),
    ]);
    let checks: Vec<_> = all.iter().filter(|o| !is_audit(o)).collect();
    assert_eq!(checks.len(), 4, "{all:?}");
    for outcome in &checks[..3] {
        assert!(outcome.passed, "{outcome:?}");
    }
    let reason = checks[3].failure.as_deref().unwrap_or_default();
    assert!(
        !checks[3].passed && reason.contains("give one of"),
        "{reason}"
    );
}

#[test]
fn values_over_time_are_of_the_states_that_are_asked_for() {
    // 1 K/s, logged every second
    let at = "field = \"temperature\", statistic = \"mean\"";
    let checks = [
        ("", 310.0),
        (", over_time = \"last\", time = 3", 303.0),
        (", over_time = \"max\"", 310.0),
        (", over_time = \"max\", time = 5", 305.0),
        (", over_time = \"min\"", 301.0),
        (", over_time = \"min\", since = 4", 304.0),
        (", over_time = \"mean\"", 305.5),
        (", since = 8", 309.0),
        (", over_time = \"mean\", since = 8, time = 9", 308.5),
    ];
    let checks: String = checks
        .map(|(keys, reference)| {
            check(
                keys.trim_matches(',').replace('"', "'").trim(),
                &format!("statistic = {{ {at}{keys} }}"),
                reference,
            )
        })
        .concat();
    for outcome in outcomes(&[("bar", heated_bar(8000.0, &checks))]) {
        assert!(outcome.passed, "{outcome:?}");
    }
    let mistaken = check(
        "q",
        &format!("statistic = {{ {at}, over_time = \"last\", since = 2 }}"),
        1.0,
    );
    let all = outcomes(&[("bar", heated_bar(8000.0, &mistaken))]);
    let failure = all[0].failure.as_deref().unwrap_or_default();
    assert!(
        failure.contains("`since` = 2 s has no effect on the last state"),
        "{failure}"
    );
}

/// Two points whose temperature is 300 K and falls by 1 K in a second.
fn cooling_bar(checks: &str) -> String {
    heated_bar(-4000.0, checks)
        .replace("spacing = 0.001", "spacing = 0.004")
        .replace("faces = [\"x-\"]", "faces = [\"x-\", \"x+\"]")
}

#[test]
fn fields_and_melt_pools_over_time_are_of_the_states_that_are_asked_for() {
    let at = "field = { field = 'temperature', at = [[0.002, 0, 0], [0.006, 0, 0]]";
    let pool = "melt_pool = { isotherm = 294.5, extent = 'length'";
    let checks = [
        (at, "", 290.0),
        (at, ", time = 3", 297.0),
        (at, ", over_time = 'max'", 299.0),
        (at, ", over_time = 'min'", 290.0),
        (at, ", over_time = 'min', time = 5", 295.0),
        (at, ", over_time = 'mean'", 294.5),
        (at, ", since = 8", 291.0),
        (at, ", over_time = 'max', since = 8, time = 9", 292.0),
        // the whole bar is above the isotherm until 5 s, then nothing of it
        (pool, ", time = 5", 0.008),
        (pool, ", over_time = 'max'", 0.008),
        (pool, ", over_time = 'mean'", 0.008),
    ];
    let checks: String = checks
        .map(|(measure, keys, reference)| {
            let quantity = format!("{}{keys}", &measure[..5]);
            check(&quantity, &format!("{measure}{keys} }}"), reference)
        })
        .concat();
    let cold = check("cold", &format!("{pool} }}"), 0.0)
        + &check(
            "late",
            &format!("{pool}, over_time = 'max', since = 6 }}"),
            0.0,
        );
    let all = outcomes(&[("bar", cooling_bar(&(checks + &cold)))]);
    let (all, audits): (Vec<_>, Vec<_>) = all.iter().partition(|o| !is_audit(o));
    assert_eq!((all.len(), audits.len()), (13, 1));
    for outcome in &all[..11] {
        assert!(outcome.passed, "{outcome:?}");
    }
    for outcome in &all[11..] {
        let reason = outcome.failure.as_deref().unwrap_or_default();
        assert!(reason.contains("no logged state"), "{outcome:?}");
    }
}

#[test]
fn tips_and_places_over_time_are_of_the_states_that_are_asked_for() {
    // heat enters at the left; what is hot at the right end cools
    let tip = "tip = { field = 'temperature', above = 310, along = [1, 0, 0]";
    let place = "place = { field = 'temperature', of = 'max'";
    let checks = [
        ("warm", tip, "", 0.0025),
        // no point is above 310 K after 1 s
        ("warm", tip, ", over_time = 'min'", 0.0005),
        ("warm", tip, ", over_time = 'max'", 0.0025),
        ("warm", tip, ", over_time = 'max', time = 3", 0.0005),
        ("spot", place, "", 0.0005),
        ("spot", place, ", over_time = 'max'", 0.0075),
        ("spot", place, ", over_time = 'min'", 0.0005),
        ("spot", place, ", over_time = 'max', since = 6", 0.0005),
    ];
    let of = |case: &str| -> String {
        let own = checks.iter().filter(|(name, ..)| *name == case);
        own.map(|(_, measure, keys, x)| {
            let references = format!("reference = [{x}, 0.5, 0.5]");
            check(keys, &format!("{measure}{keys} }}"), *x)
                .replace(&format!("reference = {x}"), &references)
        })
        .collect()
    };
    let spot = heated_bar(8000.0, &of("spot")).replace(
        "initial.temperature = 300",
        "initial.temperature = '300 + 20 * (0.5 + 0.5 * tanh((x - 0.007) / 1e-5))'",
    );
    // the tip at (2.5 mm, 0.5 m) lies above a start that is 2 m below it and 2 m to its left
    let angle = format!("{tip}, angle_from = [-1.9975, -1.5] }}");
    let warm = of("warm") + &check("angle", &angle, 45.0);
    let all = outcomes(&[("warm", heated_bar(8000.0, &warm)), ("spot", spot)]);
    let checks: Vec<_> = all.iter().filter(|o| !is_audit(o)).collect();
    assert_eq!(checks.len(), 9);
    for outcome in checks {
        assert!(outcome.passed, "{outcome:?}");
    }
}

#[test]
fn alternation_is_a_quarter_of_the_second_difference_from_row_to_row() {
    // a linear temperature does not alternate; the last row has a step of 40 K
    let alternating = "300 + 1e4 * x + 10 * sin(3141.592653589793 * x)";
    let step = "300 + 1e4 * x + 20 * signum(x - 0.007)";
    let of = |norm: &str, expected: f64| {
        let keys = format!("alternation = {{ field = 'temperature', norm = '{norm}' }}");
        check(norm, &keys, expected)
    };
    let bar = |initial: &str, checks: &str| {
        let initial = format!("initial.temperature = '{initial}'");
        heated_bar(0.0, checks)
            .replace("initial.temperature = 300", &initial)
            .replace("conductivity = 1\n", "conductivity = 1e-12\n")
    };
    let both = |rms: f64, largest: f64| of("l2", rms) + &of("largest", largest);
    let all = outcomes(&[
        ("alternating", bar(alternating, &both(10.0, 10.0))),
        // one of six rows of three
        ("step", bar(step, &both(10.0 / 6.0_f64.sqrt(), 10.0))),
    ]);
    let checks: Vec<_> = all.iter().filter(|o| !is_audit(o)).collect();
    assert_eq!(checks.len(), 4);
    for outcome in checks {
        assert!(outcome.passed, "{outcome:?}");
    }
}

#[test]
fn balances_are_audited_unless_the_case_checks_them() {
    let audits = |checks: &str| {
        let all = outcomes(&[("bar", heated_bar(8000.0, checks))]);
        all.into_iter().filter(|o| is_audit(&o)).collect::<Vec<_>>()
    };
    let mean = check("mean", MEAN, 310.0);
    let found = audits(&mean);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].passed && found[0].quantity == "audit of heat, thermal");
    assert!(found[0].error < 1e-12, "{:?}", found[0]);
    let own = check("own", "balance = { quantity = \"heat\" }", 0.0);
    assert!(audits(&(mean + &own)).is_empty());
}

#[test]
fn cases_are_found_by_name_and_otherwise_by_description() {
    let cases = benchmarks::load(None).expect("valid cases").cases;
    // the place where another publication has the problem
    let served = select(&cases, "[Wang2021] 4.1.1");
    assert!(served.contains(&"wang-6.4.1.1-n1"), "{served:?}");
    assert!(
        served.iter().all(|n| n.starts_with("wang-6.4.1.")),
        "{served:?}"
    );
    // where names match, descriptions do not count
    let named = select(&cases, "wang-6.4.1.1");
    assert!(named.iter().all(|n| n.contains("wang-6.4.1.1")) && !named.is_empty());
    assert!(select(&cases, "no such case").is_empty());
}
