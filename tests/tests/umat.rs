//! Material subroutines of users, `law.umat`: subroutines that are compiled from C here against the laws of the program.
//!
//! Without a compiler (`cc`) the tests say so and pass.
#![cfg(feature = "umat")]

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3};
use perimelt::case::Case;
use perimelt_physics::mechanical::moduli::{Moduli, Plane};
use perimelt_physics::mechanical::plasticity::{StressState, return_to_yield};
use perimelt_physics::mechanical::points::{LawPoint, PointLaw, StepStates, Umat};
use perimelt_tests::compile_subroutines;

const PROPERTIES: &str = "[200e9, 0.3, 250e6, 10e9]";
const COMPONENTS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];

/// The library of the subroutines in a folder that goes with the test; `None` without a compiler.
fn library() -> Option<(tempfile::TempDir, PathBuf)> {
    let folder = tempfile::tempdir().expect("a folder");
    let library = compile_subroutines(folder.path())?;
    Some((folder, library))
}

fn law(library: &Path, symbol: &str, keys: &str) -> Umat {
    let keys = format!("library = {library:?}\nsymbol = \"{symbol}\"\n{keys}");
    let mut law: Umat = toml::from_str(&keys).expect("valid keys");
    law.prepare().unwrap_or_else(|e| panic!("{symbol}: {e}"));
    law
}

fn point(finite: bool) -> LawPoint<'static> {
    let moduli = Moduli::new(200e9, 0.3, 3, Plane::Stress);
    LawPoint {
        constants: &[],
        temperature: Some(300.0),
        step: 0.25,
        shear_modulus: moduli.shear,
        bulk_modulus: moduli.bulk,
        finite,
        axes: Matrix3::identity(),
        number: 6,
        position: [0.1, 0.2, 0.3],
        spacing: 1e-3,
        start: 2.0,
    }
}

/// The state of a point at no strain.
fn rest(law: &Umat) -> Vec<f64> {
    vec![0.0; perimelt_core::law::StateVariable::width_of(law.state())]
}

/// A path of strains that is not proportional, with unloading.
fn path() -> Vec<Matrix3<f64>> {
    let corners = [
        [3.0, -1.0, -0.5, 0.0, 0.0, 0.0],
        [3.0, 1.0, -1.5, 2.5, -1.0, 0.5],
        [0.5, 1.0, -1.0, 2.0, 1.5, -1.0],
        [1.5, -2.0, 0.8, -1.5, 1.0, 2.0],
        [1.2, -1.8, 0.7, -1.3, 0.9, 1.8],
    ];
    let tensor = |[xx, yy, zz, xy, yz, zx]: [f64; 6]| {
        Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz) * 1e-3
    };
    let mut strains = vec![Matrix3::zeros()];
    for corner in corners {
        let before = *strains.last().expect("a strain");
        let change = (tensor(corner) - before) / 10.0;
        let steps = (1..=10).map(|step| before + change * f64::from(step));
        strains.extend(steps);
    }
    strains
}

/// Stresses and equivalent plastic strains of J2 plasticity by the return of the program.
fn built_in(strains: &[Matrix3<f64>], yield_stress: f64) -> Vec<(Matrix3<f64>, f64)> {
    let moduli = Moduli::new(200e9, 0.3, 3, Plane::Stress);
    let stress = |strain: Matrix3<f64>| {
        strain * (2.0 * moduli.shear) + Matrix3::identity() * (moduli.lame * strain.trace())
    };
    let (mut inelastic, mut equivalent) = (Matrix3::zeros(), 0.0);
    let step = |strain: &Matrix3<f64>| {
        let trial = stress(strain - inelastic);
        let flow_stress = |strain: perimelt_physics::mechanical::plasticity::EquivalentStrain| {
            yield_stress + 10e9 * strain.end
        };
        let trial = COMPONENTS.map(|at| trial[at]);
        let flow = return_to_yield(StressState::Full, &trial, &moduli, flow_stress, equivalent);
        if let Some((change, increment)) = flow {
            for (change, (a, b)) in change.iter().zip(COMPONENTS) {
                inelastic[(a, b)] += change;
                inelastic[(b, a)] = inelastic[(a, b)];
            }
            equivalent += increment;
        }
        (stress(strain - inelastic), equivalent)
    };
    strains.iter().map(step).collect()
}

#[test]
fn subroutines_have_the_stress_of_the_laws_of_the_program() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let strains = path();
    for (symbol, yield_stress) in [
        ("elastic_", 1e12),
        ("elastic_without_tangent_", 1e12),
        ("j2_", 250e6),
    ] {
        let keys = format!("properties = {PROPERTIES}\nstates = 1");
        let law = law(&library, symbol, &keys);
        let mut state = rest(&law);
        let mut has_flowed = false;
        for (strain, (expected, equivalent)) in strains.iter().zip(built_in(&strains, yield_stress))
        {
            law.evolve(&point(false), strain, &mut state);
            let stress = law.stress(&point(false), strain, &state);
            let error = (stress - expected).norm() / 250e6;
            assert!(error < 1e-10, "{symbol}: {error:e}");
            let error = (state[16] - equivalent).abs();
            assert!(error < 1e-10 * 3e-3, "{symbol}: {error:e}");
            has_flowed |= equivalent > 0.0;
            if symbol != "j2_" {
                let energy = law.energy(&point(false), strain, &state);
                let expected = 0.5 * expected.dot(strain);
                assert!((energy - expected).abs() <= 1e-10 * expected, "{energy}");
            }
        }
        assert_eq!(has_flowed, symbol == "j2_");
    }
}

/// The change of the stress with a change of the strain, by differences of steps from a state.
fn differences(
    law: &Umat,
    point: &LawPoint<'_>,
    strain: &Matrix3<f64>,
    start: &[f64],
    change: &Matrix3<f64>,
) -> Matrix3<f64> {
    let step = 1e-7;
    let [up, down] = [step, -step].map(|step| {
        let mut state = start.to_vec();
        let strain = strain + change * step;
        law.evolve(point, &strain, &mut state);
        law.stress(point, &strain, &state)
    });
    (up - down) / (2.0 * step)
}

#[test]
fn tangents_are_those_of_the_stress() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let keys = format!("properties = {PROPERTIES}\nstates = 1");
    let change = Matrix3::new(0.3, 0.8, -0.5, -0.2, 0.4, 0.9, 0.6, -0.7, 0.1);
    let deformed = Matrix3::new(1.1, 0.3, 0.0, -0.2, 0.9, 0.1, 0.05, 0.0, 1.05);
    for (symbol, finite) in [("j2_", false), ("elastic_", false), ("elastic_", true)] {
        let law = law(&library, symbol, &keys);
        let (mut start, point) = (rest(&law), point(finite));
        let (strain, change) = match finite {
            true => {
                law.evolve(&point, &deformed, &mut start);
                (deformed, change)
            }
            false => (path()[17], 0.5 * (change + change.transpose())),
        };
        let mut end = start.clone();
        law.evolve(&point, &strain, &mut end);
        let states = StepStates {
            start: &start,
            end: &end,
        };
        let tangent = law.tangent(&point, &strain, states, &change);
        let tangent = tangent.expect("the subroutine has one");
        let expected = differences(&law, &point, &strain, &start, &change);
        let error = (tangent - expected).norm() / expected.norm();
        assert!(error < 1e-6, "{symbol} {finite}: {error:e}");
    }
    let law = law(&library, "elastic_without_tangent_", &keys);
    let start = rest(&law);
    let states = StepStates {
        start: &start,
        end: &start,
    };
    let none = law.tangent(&point(false), &path()[3], states, &change);
    assert!(none.is_none());
}

/// In finite kinematics a stretch along the axes has the logarithmic strain, and a rotation turns the stress.
#[test]
fn stresses_follow_logarithmic_strains_and_turn_with_the_point() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let law = law(&library, "elastic_", &format!("properties = {PROPERTIES}"));
    let point = point(true);
    let mut state = rest(&law);
    let stretch = Matrix3::from_diagonal(&[1.2, 0.9, 1.05].into());
    law.evolve(&point, &stretch, &mut state);
    let strain = Matrix3::from_diagonal(&stretch.diagonal().map(f64::ln));
    let stress = strain * (2.0 * point.shear_modulus)
        + Matrix3::identity() * (point.lame() * strain.trace());
    let nominal = stress * stretch.try_inverse().expect("regular") * stretch.determinant();
    let error = (law.stress(&point, &stretch, &state) - nominal).norm() / nominal.norm();
    assert!(error < 1e-12, "{error:e}");

    let turn = Rotation3::from_euler_angles(0.4, 1.0, -0.3).into_inner();
    let turned = turn * stretch;
    let expected = turn * nominal;
    // by the subroutine, and by the elastic extrapolation from the state before
    let extrapolated = law.stress(&point, &turned, &state);
    law.evolve(&point, &turned, &mut state);
    for stress in [law.stress(&point, &turned, &state), extrapolated] {
        let error = (stress - expected).norm() / expected.norm();
        assert!(error < 1e-12, "{error:e}");
    }
}

#[test]
fn a_subroutine_is_told_about_its_point() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let keys = "properties = [5, 7]\nstates = 27\nmaterial = \"STEEL\"";
    let law = law(&library, "echo_", keys);
    let point = LawPoint {
        start: 0.0,
        ..point(true)
    };
    let mut state = rest(&law);
    let mut sheared = Matrix3::identity();
    sheared[(0, 1)] = 0.2;
    law.evolve(&point, &sheared, &mut state);
    let [letter, blank] = [b'S', b' '].map(f64::from);
    let told = &state[16..];
    let expected = [
        0.0, 0.0, 0.25, 300.0, 0.0, 3.0, 3.0, 6.0, 27.0, 2.0, 7.0, 0.1, 0.2, 0.3, 1e-3, 7.0, 1.0,
        1.0, 1.0, 80.0, letter, blank,
    ];
    assert_eq!(told[..22], expected);
    // F turns the x-axis backwards: the second entry of the first column is negative
    let (angle, shear) = (0.1f64.atan(), told[26]);
    assert!((told[22] + angle.sin()).abs() < 1e-12, "{}", told[22]);
    assert_eq!(told[23..26], [0.0, 0.2, 0.0]);
    assert!(shear > 0.19 && shear < 0.2, "{shear}");
    let later = LawPoint {
        start: 2.0,
        ..point
    };
    law.evolve(&later, &sheared, &mut state);
    let told = &state[16..];
    assert_eq!(told[..2], [2.0; 2]);
    assert_eq!([told[17], told[23], told[26]], [2.0, 0.2, 0.0]);
}

#[test]
fn a_subroutine_that_wants_a_shorter_step_has_not_converged() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let law = law(&library, "impatient_", "");
    let mut state = rest(&law);
    law.evolve(&point(false), &path()[1], &mut state);
    let stress = law.stress(&point(false), &path()[1], &state);
    assert!(stress.iter().all(|s| s.is_nan()), "{stress}");
}

#[test]
fn a_subroutine_is_called_by_one_thread_at_a_time() {
    let Some((_folder, library)) = library() else {
        return;
    };
    let law = law(&library, "alone_", "states = 1");
    let call = || {
        let mut state = rest(&law);
        (0..50).for_each(|_| law.evolve(&point(false), &Matrix3::zeros(), &mut state));
        state[16]
    };
    std::thread::scope(|scope| {
        let threads = [(); 4].map(|()| scope.spawn(call));
        for thread in threads {
            assert_eq!(thread.join().expect("no panic"), 0.0);
        }
    });
}

/// Values of fields after a run of the case with a law in a formulation.
fn run(formulation: &str, law: &str, folder: &Path, fields: &[&str]) -> Vec<Vec<f64>> {
    let text = include_str!("umat/bar.toml").replace("LAW", law);
    let text = text.replace("FORMULATION", formulation);
    let case = Case::parse("bar.toml", text, folder);
    let case = case.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    case.start(&mut simulation).expect("it starts");
    while !simulation.is_finished() {
        simulation.step().unwrap_or_else(|e| panic!("{e}"));
    }
    let known = simulation.world().fields();
    let values = |name: &&str| {
        let field = known.find(0, name).unwrap_or_else(|| panic!("no `{name}`"));
        known.field(field).data().flat().to_vec()
    };
    fields.iter().map(values).collect()
}

/// A path beside the case, as the guide has it.
#[test]
fn a_case_runs_with_a_subroutine_as_with_the_law_of_the_program() {
    let Some((folder, _)) = library() else {
        return;
    };
    let strains = ["umat.state_1", "equivalent_plastic_strain"];
    let both = [["displacement"; 2], ["stress"; 2], strains];
    for (formulation, symbol, keys, names) in [
        ("correspondence", "elastic_", "", &both[..2]),
        ("correspondence", "j2_", "flow.j2 = {}", &both),
        ("staggered", "elastic_", "", &both[..2]),
        ("staggered", "j2_", "flow.j2 = {}", &both),
    ] {
        let umat = format!(
            "law.umat = {{ library = \"materials.so\", symbol = \"{symbol}\", states = 1, properties = {PROPERTIES} }}"
        );
        let [own, other] = [0, 1].map(|n| names.iter().map(|pair| pair[n]).collect::<Vec<_>>());
        let own = run(formulation, &umat, folder.path(), &own);
        let other = run(formulation, keys, folder.path(), &other);
        for ((own, other), names) in own.iter().zip(&other).zip(names) {
            let largest = other.iter().fold(0.0f64, |l, v| l.max(v.abs()));
            let pairs = own.iter().zip(other);
            let error = pairs.fold(0.0f64, |e, (a, b)| e.max((a - b).abs())) / largest;
            // what the solver leaves unbalanced
            let is_small = largest > 0.0 && error < 1e-8;
            assert!(is_small, "{formulation} {symbol} {names:?}: {error:e}");
        }
    }
}

#[test]
fn a_library_that_is_missing_is_named() {
    let Some((_folder, library)) = library() else {
        return;
    };
    for (file, symbol, expected) in [
        (Path::new("missing.so"), "umat_", "missing.so"),
        (&*library, "umat_", "umat_"),
    ] {
        let keys = format!("library = {file:?}\nsymbol = \"{symbol}\"");
        let mut law: Umat = toml::from_str(&keys).expect("valid keys");
        let error = law.prepare().expect_err("refused").to_string();
        assert!(error.contains(expected), "{error}");
    }
}
