//! A run that several processes share has the bits of a run of one process. Here processes are threads of the test.

mod divided;

use divided::build::{BUILD, JET, LAP, MOVING_BAR, POOL, keyhole, solid};
use divided::cases::{
    BRACKET, CRACK, PERIODIC, QUENCH, WELD, cooled, correspondence, dissimilar, formulated, free,
    heated, jittered, layered, ordinary, shrunk, steady, still, struck, torn, weld_by,
    with_heat_of_deformation, zoned,
};
use divided::collision::COLLISION;
use divided::{assert_goes_on, assert_shared, run_alone};
use perimelt::case::Case;
use perimelt_tests::{in_processes, root};

#[test]
fn heat_has_the_same_bits_for_any_number_of_processes() {
    for (horizon, counts) in [("1", [3, 7]), ("3", [2, 4])] {
        let text = WELD.replace("HORIZON", horizon);
        let alone = run_alone(&text);
        assert!(alone.steps > 10 && !alone.numbers.is_empty() && alone.fields.len() >= 3);
        assert_shared(&text, &alone, &counts, horizon);
    }
}

#[test]
fn implicit_heat_has_the_same_bits_for_any_number_of_processes() {
    let all = [
        ("implicit", weld_by("implicit"), &[5][..]),
        ("crank_nicolson", weld_by("crank_nicolson"), &[3]),
        ("rkl2", weld_by("rkl2"), &[2]),
        ("steady", steady(false), &[2, 3]),
        ("steady and insulated", steady(true), &[3]),
    ];
    for (solver, text, counts) in all {
        let alone = run_alone(&text);
        assert!(alone.fields.len() >= 2, "{solver}");
        assert_shared(&text, &alone, counts, solver);
    }
}

/// Two metals, and forms of conduction in which the heat flow of a bond depends on more than its ends.
#[test]
fn all_forms_of_conduction_have_the_same_bits_for_any_number_of_processes() {
    let table = "{ temperature = [300, 900], value = [60, 40] }";
    let weld = |horizon: &str| {
        WELD.replace("spacing = 5e-4", "spacing = 1e-3")
            .replace("HORIZON", horizon)
    };
    let form = |form: &str| weld(&format!("3\nform = \"{form}\""));
    let all = [
        ("two metals", dissimilar(&weld("3"), "60"), &[3][..]),
        ("with tables", dissimilar(&weld_by("implicit"), table), &[3]),
        ("ordinary", form("ordinary"), &[3]),
        (
            "ordinary, two metals",
            dissimilar(&form("ordinary"), table),
            &[2],
        ),
        (
            "second derivatives",
            dissimilar(&form("second_derivatives"), table),
            &[3],
        ),
    ];
    for (name, text, counts) in all {
        let alone = run_alone(&text);
        assert!(alone.steps > 10 && alone.fields.len() >= 3, "{name}");
        assert_shared(&text, &alone, counts, name);
    }
}

#[test]
fn implicit_heat_goes_on_with_another_number_of_processes() {
    assert_goes_on(&weld_by("implicit"), 0.3, &[(1, 3), (3, 1), (2, 5)]);
}

#[test]
fn motion_has_the_same_bits_for_any_number_of_processes() {
    let all = [
        ("linear", BRACKET.into(), &[5][..]),
        ("finite", BRACKET.into(), &[3]),
        ("linear", ordinary(BRACKET), &[3]),
        ("finite", ordinary(BRACKET), &[2]),
        ("finite", with_heat_of_deformation(), &[3]),
        ("finite", correspondence(BRACKET), &[2]),
        ("linear", formulated(BRACKET, "staggered"), &[3]),
        ("finite", layered(&formulated(BRACKET, "staggered")), &[5]),
    ];
    for (kinematics, text, counts) in all {
        let text = text.replace("KINEMATICS", kinematics);
        let alone = run_alone(&text);
        assert!(alone.steps > 10 && alone.fields.len() >= 4);
        for name in [
            "section.middle.x",
            "force.z",
            "energy.kinetic",
            "stress.over_yield",
        ] {
            assert!(alone.number(name) != 0.0, "{name}");
        }
        assert_shared(&text, &alone, counts, kinematics);
    }
}

#[test]
fn fracture_has_the_same_bits_for_any_number_of_processes() {
    let all = [
        (torn("linear", "energy"), &[5][..]),
        (torn("finite", "stretch"), &[3]),
        (ordinary(&torn("finite", "energy")), &[3]),
        (correspondence(&torn("finite", "stretch")), &[2]),
    ];
    for (text, counts) in all {
        let alone = run_alone(&text);
        let broken = alone.number("bonds.broken");
        assert!(broken > 1000.0, "{broken} bonds");
        assert_shared(&text, &alone, counts, "fracture");
    }
}

/// Bodies without a lattice: their points have bonds of their own.
#[test]
fn clouds_have_the_same_bits_for_any_number_of_processes() {
    let newton = still(".quasi_static = {}");
    let linear = newton.replace("KINEMATICS", "linear");
    let all = [
        ("motion", BRACKET.replace("KINEMATICS", "finite"), &[2][..]),
        ("fracture", torn("finite", "energy"), &[3]),
        (
            "correspondence",
            correspondence(&torn("finite", "stretch")),
            &[2],
        ),
        ("equilibrium", linear.clone(), &[2]),
        ("ordinary", ordinary(&linear), &[3]),
        ("heat", cooled(), &[5]),
        ("sources", heated(), &[3]),
    ];
    for (name, text, counts) in all {
        let text = jittered(&text);
        let alone = run_alone(&text);
        assert!(alone.steps > 3 && alone.fields.len() >= 3, "{name}");
        if text.contains("fracture = ") {
            assert!(alone.number("bonds.broken") > 100.0, "{name}");
        }
        if name == "sources" {
            for source in ["torch", "beam", "flame"] {
                assert!(
                    alone.number(&format!("{source} energy.deposited")) > 0.0,
                    "{source}"
                );
            }
        }
        assert_shared(&text, &alone, counts, name);
    }
    let torn = jittered(&torn("finite", "energy"));
    assert_goes_on(&torn, 3e-6, &[(3, 2)]);
}

/// A pulse on a face, the cells of which belong to several processes, on a lattice and on points of two spacings.
#[test]
fn pulses_have_the_same_bits_for_any_number_of_processes() {
    for name in ["dhpd-4.4-film-plate", "dhpd-4.4-film-zones"] {
        let file = root().join(format!("cases/verification/{name}.toml"));
        let text = std::fs::read_to_string(file).expect("readable");
        let text = text.replace("end = 1e-12", "end = 4e-15");
        // parts of a body are not balanced alone
        let text = text.replace("\"balanced\"", "\"point\"");
        let text = text.split("[[verify]]").next().expect("a case");
        let alone = run_alone(text);
        assert!(alone.number("energy.deposited") > 0.0);
        assert_shared(text, &alone, &[2, 3], name);
    }
}

/// Bodies whose points are finer in one half.
#[test]
fn zones_have_the_same_bits_for_any_number_of_processes() {
    let newton = still(".quasi_static = {}");
    let all = [
        ("motion", BRACKET.replace("KINEMATICS", "finite"), &[2][..]),
        ("fracture", torn("finite", "energy"), &[3]),
        (
            "correspondence",
            correspondence(&torn("finite", "stretch")),
            &[2],
        ),
        ("equilibrium", newton.replace("KINEMATICS", "linear"), &[3]),
    ];
    for (name, text, counts) in all {
        let text = zoned(&text);
        let alone = run_alone(&text);
        assert!(alone.steps > 3 && alone.fields.len() >= 3, "{name}");
        assert_shared(&text, &alone, counts, name);
    }
    let torn = zoned(&torn("finite", "energy"));
    assert_goes_on(&torn, 3e-6, &[(3, 2)]);
}

/// A ball and a wave that strike a bracket, and a crack that is given.
#[test]
fn impacts_and_given_cracks_have_the_same_bits_for_any_number_of_processes() {
    let struck = struck();
    let alone = run_alone(&struck);
    assert!(alone.number("impactor force.z") != 0.0 && alone.number("undex force.x") != 0.0);
    assert!(alone.number("undex cavitation.start") > 0.0);
    assert_shared(&struck, &alone, &[3], "struck");
    let alone = run_alone(CRACK);
    assert!(alone.number("growing_crack length") > 0.02);
    assert_shared(CRACK, &alone, &[2], "crack");
    assert_goes_on(CRACK, 5e-6, &[(3, 2)]);
}

/// Fragments, deformable bodies and a rigid one that meet points of other processes.
#[test]
fn collisions_have_the_same_bits_for_any_number_of_processes() {
    let alone = run_alone(COLLISION);
    assert!(alone.number("on plate points") > 10.0);
    for pair in ["contact on block", "contact on hammer"] {
        let force = ["x", "z"].map(|axis| alone.number(&format!("{pair} force.{axis}")));
        assert!(force.iter().all(|force| *force != 0.0), "{pair} {force:?}");
    }
    assert_shared(COLLISION, &alone, &[2, 5], "collision");
    assert_goes_on(COLLISION, 8e-6, &[(3, 2)]);
}

#[test]
fn equilibrium_has_the_same_bits_for_any_number_of_processes() {
    let newton = still(".quasi_static = {}");
    let linear = newton.replace("KINEMATICS", "linear");
    let finite = newton.replace("KINEMATICS", "finite");
    let relaxed = still(".relaxation = { relative_tolerance = 1e-4 }");
    let all = [
        ("linear", linear.clone(), &[5][..]),
        ("finite", finite.clone(), &[3]),
        ("layers", layered(&linear), &[2]),
        ("layers, ordinary", layered(&ordinary(&linear)), &[3]),
        (
            "layers, correspondence",
            correspondence(&layered(&finite)),
            &[3],
        ),
        ("ordinary, linear", ordinary(&linear), &[3]),
        ("ordinary, finite", ordinary(&finite), &[2]),
        ("free", free().replace("KINEMATICS", "linear"), &[5]),
        ("relaxed", relaxed.replace("KINEMATICS", "finite"), &[3]),
    ];
    for (name, text, counts) in all {
        let alone = run_alone(&text);
        assert!(alone.steps > 3 && alone.fields.len() >= 3, "{name}");
        assert_shared(&text, &alone, counts, name);
    }
}

#[test]
fn a_quench_has_the_same_bits_for_any_number_of_processes() {
    let all = [
        ("correspondence", "finite", QUENCH.into(), &[5][..]),
        ("correspondence", "linear", shrunk(), &[3]),
        ("staggered", "finite", QUENCH.into(), &[5]),
        ("staggered", "linear", shrunk(), &[3]),
        ("ordinary", "finite", QUENCH.into(), &[2]),
        ("ordinary", "linear", shrunk(), &[3]),
    ];
    for (formulation, kinematics, text, counts) in all {
        let text = text.replace("FORMULATION", formulation);
        let text = text.replace("KINEMATICS", kinematics);
        let alone = run_alone(&text);
        assert!(alone.number("largest share of austenite") > 0.0);
        let largest = |field: &str| {
            let found = alone.fields.iter().find(|(name, _)| name == field);
            let values = found.expect("a field").1.iter();
            values.fold(0.0f64, |m, bits| m.max(f64::from_bits(*bits)))
        };
        for field in [
            "equivalent_plastic_strain",
            "martensite",
            "thermal_gradient",
        ] {
            assert!(largest(field) > 0.0, "{field}");
        }
        assert_shared(&text, &alone, counts, formulation);
    }
}

#[test]
fn a_quench_goes_on_with_another_number_of_processes() {
    let text = QUENCH.replace("KINEMATICS", "finite");
    let staggered = text.replace("FORMULATION", "staggered");
    assert_goes_on(&staggered, 0.2, &[(3, 2)]);
    let correspondence = text.replace("FORMULATION", "correspondence");
    assert_goes_on(&correspondence, 0.2, &[(2, 3)]);
}

/// The film of a jet lifts off somewhere along a row of cells, from where on all processes have it.
#[test]
fn water_jets_have_the_same_bits_for_any_number_of_processes() {
    let alone = run_alone(JET);
    assert!(alone.number("film.lifted_off") > 0.0 && alone.number("film.wet") > 0.0);
    assert_shared(JET, &alone, &[3, 5], "jet");
}

/// A pool moves over the cuts between processes.
#[test]
fn melt_flow_has_the_same_bits_for_any_number_of_processes() {
    let alone = run_alone(POOL);
    for name in [
        "speed.max",
        "liquid.volume",
        "boundary_layer.points",
        "momentum_to_solid.x",
    ] {
        assert!(alone.number(name) != 0.0, "{name}");
    }
    assert_shared(POOL, &alone, &[2, 5], "pool");
    assert_goes_on(POOL, 0.15, &[(3, 2)]);
}

/// The columns of a keyhole lie in several processes, and its walls reflect from one to another.
#[test]
fn keyholes_have_the_same_bits_for_any_number_of_processes() {
    let alone = run_alone(&keyhole());
    assert!(alone.number("torch depth") > 2e-3 && alone.number("torch absorptivity") > 0.5);
    assert_shared(&keyhole(), &alone, &[2, 3, 5], "keyhole");
}

/// Bodies that touch: cells of one that cover those of another may belong to another process.
#[test]
fn bodies_that_touch_have_the_same_bits_for_any_number_of_processes() {
    let alone = run_alone(LAP);
    // 6 mm of the lower plate lie below the upper one
    assert!((alone.number("on upper area") / 6e-5 - 1.0).abs() < 1e-12);
    assert!(alone.number("on upper power into the body") < 0.0);
    assert_shared(LAP, &alone, &[2, 3, 5], "lap");
    assert_goes_on(LAP, 0.15, &[(2, 3)]);
}

/// Bodies that grow and are cut off.
#[test]
fn growing_bodies_have_the_same_bits_for_any_number_of_processes() {
    let log = "update = \"log\"\nsolver.quasi_static = {}";
    let all = [
        ("heat", BUILD.replace("HORIZON", "1"), &[5][..]),
        ("heat", BUILD.replace("HORIZON", "2"), &[3]),
        ("staggered", solid("staggered", log), &[2, 3]),
        ("correspondence", solid("correspondence", log), &[3]),
        (
            "moving",
            MOVING_BAR.replace("FORMULATION", "staggered"),
            &[2, 3],
        ),
        (
            "moving",
            MOVING_BAR.replace("FORMULATION", "correspondence"),
            &[3],
        ),
    ];
    for (name, text, counts) in all {
        let alone = run_alone(&text);
        assert!(alone.number("deposit points") > 100.0, "{name}");
        assert_shared(&text, &alone, counts, name);
    }
}

#[test]
fn growth_goes_on_with_another_number_of_processes() {
    let log = "update = \"log\"\nsolver.quasi_static = {}";
    assert_goes_on(&solid("staggered", log), 0.9, &[(3, 2)]);
    assert_goes_on(&solid("correspondence", log), 0.9, &[(2, 3)]);
    let bar = MOVING_BAR.replace("FORMULATION", "staggered");
    assert_goes_on(&bar, 1.2e-5, &[(3, 2)]);
}

/// A bracket in equilibrium that breaks while its end is pulled.
#[test]
fn slow_fracture_has_the_same_bits_for_any_number_of_processes() {
    let pulled = still(".quasi_static = {}");
    let fracture =
        "fracture = { criterion = \"stretch\", no_fail = [\"foot\"], once = true }\nkinematics";
    let text = pulled.replace("kinematics", fracture).replace("2e4", "2e2");
    let text = text.replace("spacing = 1e-3", "spacing = 1.5e-3");
    let text = text.replace("KINEMATICS", "linear");
    let pull = r#"[[couplers]]
type = "prescribed_displacement"
name = "pull"
region = "end"
x = { time = [0, 0.02], value = [0, 5e-6] }

[time]"#;
    let text = text.replace("[time]", pull);
    let alone = run_alone(&text);
    let broken = alone.number("bonds.broken");
    assert!(broken > 10.0, "{broken} bonds");
    assert_shared(&text, &alone, &[2, 3], "slow fracture");
}

#[test]
fn equilibrium_goes_on_with_another_number_of_processes() {
    let text = still(".quasi_static = {}").replace("KINEMATICS", "finite");
    assert_goes_on(&text, 0.015, &[(3, 1), (2, 4)]);
}

#[test]
fn fracture_goes_on_with_another_number_of_processes() {
    assert_goes_on(&torn("finite", "energy"), 3e-6, &[(1, 3), (2, 4)]);
}

#[test]
fn a_motion_goes_on_with_another_number_of_processes() {
    let text = BRACKET.replace("KINEMATICS", "finite");
    assert_goes_on(&text, 3e-6, &[(3, 1), (2, 4)]);
}

#[test]
fn a_run_goes_on_with_another_number_of_processes() {
    let text = WELD.replace("HORIZON", "1");
    assert_goes_on(&text, 0.3, &[(1, 3), (3, 1), (2, 5)]);
}

/// Plugins and solvers that processes cannot share are refused by name.
#[test]
fn what_processes_cannot_share_is_refused() {
    let refusal = |text: &str| {
        let told = in_processes(2, |processes| {
            let case = Case::parse("case.toml", text.into(), ".".as_ref()).expect("valid");
            let composed = case.compose_shared(processes);
            composed.err().expect("refused").render(false)
        });
        assert_eq!(told[0], told[1], "a mistake of all");
        told[0].clone()
    };
    let weld = WELD.replace("HORIZON", "1");
    let changed = |right: &str, wrong: &str| {
        assert!(weld.contains(right));
        refusal(&weld.replace(right, wrong))
    };
    let bracket = BRACKET.replace("KINEMATICS", "finite");
    let moving = |right: &str, wrong: &str| {
        assert!(bracket.contains(right));
        refusal(&bracket.replace(right, wrong))
    };
    let all = [
        moving(
            "kinematics",
            "surface_stress = \"extrapolated\"\nkinematics",
        ),
        moving("region = \"foot\"", "face = \"x-\""),
        changed("spacing = 5e-4", "spacing = 1e-2"),
        refusal(PERIODIC),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
}
