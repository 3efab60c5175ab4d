use super::*;

#[test]
fn functions_of_two_arguments_stand_in_both_arguments_of_others() {
    for (text, value) in [
        ("min(1, max(0, t))", 0.5),
        ("min(max(0, t), 1)", 0.5),
        ("min(1, 2 + max(0, t))", 1.0),
        (
            "max( atan2 (t, 1) , min(-1,-max(2, t)) )",
            0.5_f64.atan2(1.0),
        ),
        ("2 * min(3, max(1, min(t, 7)))^2 + sin(max(0, 0 * t))", 2.0),
        ("-max(1, max(t, 2))^2", -4.0),
        ("min(sqrt(max(4, t)), 3)", 2.0),
    ] {
        let formula = Formula::new(text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(formula.at([0.0; 3], 0.5), value, "{text}");
    }
    for text in ["min(1)", "min(1, 2, 3)", "max(1, min(2)", "min 1, 2"] {
        assert!(Formula::new(text).is_err(), "{text}");
    }
}

#[test]
fn formulas_are_evaluated_at_a_place_and_time() {
    let formula = Formula::new("y^2 * exp(-t) + sin(PI * x) - 10e-1").expect("valid");
    let value = formula.at([0.5, 3.0, 7.0], 2.0);
    assert!((value - 9.0 * (-2.0f64).exp()).abs() < 1e-14);
    assert_eq!(Formula::new("4").expect("valid").at([0.0; 3], 0.0), 4.0);
}

#[test]
fn powers_bind_more_tightly_than_signs() {
    for (text, expected) in [
        ("-x^2", -9.0),
        ("(-x)^2", 9.0),
        ("exp(-(x - 1)^2)", (-4.0f64).exp()),
        ("1 + -x^2", -8.0),
        ("1 - -x^2", 10.0),
        ("2 * -x^2", -18.0),
        ("18 / -x^2", -2.0),
        ("x^-2", 1.0 / 9.0),
        ("-x^2 + x", -6.0),
        ("1e-2 * x^2", 0.09),
        ("atan2(0, -x^2)", std::f64::consts::PI),
    ] {
        let value = Formula::new(text).expect(text).at([3.0, 0.0, 0.0], 0.0);
        assert!((value - expected).abs() < 1e-14, "{text}: {value}");
    }
}

/// Values at x = 3, y = 2, z = 5, t = 4.
#[test]
fn operators_constants_and_functions_have_their_usual_meaning() {
    use std::f64::consts::{E, PI};
    for (text, expected) in [
        ("pi", PI),
        ("PI", PI),
        ("2*pi*x", 6.0 * PI),
        ("e", E),
        ("E", E),
        ("e^2", E * E),
        ("2*e-3", 2.0 * E - 3.0),
        ("1e-3", 1e-3),
        ("1E+3", 1e3),
        ("1.5e3*x", 4500.0),
        (".5*x", 1.5),
        ("2.*x", 6.0),
        ("x^-1e0", 1.0 / 3.0),
        ("400 + -(1000*x)^2", 400.0 - 9e6),
        ("-min(x, y)", -2.0),
        ("2*max(x, y)^2", 18.0),
        ("min(-x^2, -3)", -9.0),
        ("1 - max(x, y) - 1", -3.0),
        ("-sin(x)^2", -(3.0_f64.sin().powi(2))),
        ("x/y/z", 0.3),
        ("x/y*z", 7.5),
        ("x*y/z", 1.2),
        ("x - y - z", -4.0),
        ("x - y + z", 6.0),
        ("x + y - z", 0.0),
        ("+x^2", 9.0),
        ("(x^2)^3", 729.0),
        ("2^(x^2)", 512.0),
        ("x^2*y^3 - z^2", 47.0),
        ("atan2(y, x)", 2.0_f64.atan2(3.0)),
        ("log(x)", 3.0_f64.ln()),
        ("ln(x)", 3.0_f64.ln()),
        ("log10(x)", 3.0_f64.log10()),
        ("t * exp(-2 * t)", 4.0 * (-8.0_f64).exp()),
    ] {
        let formula = Formula::new(text).expect(text);
        let value = formula.at([3.0, 2.0, 5.0], 4.0);
        assert!(
            (value - expected).abs() < 1e-14 * expected.abs().max(1.0),
            "{text}: {value} {expected}"
        );
    }
    for function in FUNCTIONS {
        let two = ["atan2", "min", "max"].contains(&function);
        let text = format!("{function}({}x)", if two { "y, " } else { "" });
        assert!(Formula::new(&text).is_ok(), "{text}");
    }
}

#[test]
fn a_power_of_a_power_needs_parentheses() {
    for text in ["2^3^2", "2^-x^2", "exp(x^y^z)", "2^(x)^2"] {
        let error = Formula::new(text).expect_err(text).to_string();
        assert!(error.contains("two meanings"), "{error}");
    }
    for text in [
        "x^2 + y^2",
        "x^(y^2)",
        "x^2*y^2",
        "x^-2 - y^2",
        "max(x^2, y^2)",
        "(x^2)^2",
    ] {
        assert!(Formula::new(text).is_ok(), "{text}");
    }
}

#[test]
fn a_number_is_a_constant_formula() {
    #[derive(Deserialize)]
    struct Keys {
        all: [Formula; 4],
    }
    let keys: Keys = toml::from_str("all = [-2, 3.5, '2 * t', -1e-7]").expect("valid");
    let values = keys.all.map(|f| f.at([0.0; 3], 4.0));
    assert_eq!(values, [-2.0, 3.5, 8.0, -1e-7]);
    assert!(toml::from_str::<Keys>("all = [true, 0, 0, 0]").is_err());
}

#[test]
fn mistakes_are_named() {
    let unknown = Formula::new("2 * r").expect_err("r is unknown").to_string();
    assert!(unknown.contains("`r`"), "{unknown}");
    let misspelt = Formula::new("293 + fire_iso834(t)")
        .expect_err("iso_834")
        .to_string();
    assert!(
        misspelt.contains("did you mean `fire_iso_834`?"),
        "{misspelt}"
    );
    let broken = Formula::new("2 * (x")
        .expect_err("it does not end")
        .to_string();
    assert!(broken.contains("cannot be read"), "{broken}");
}
