//! What the command line tells of case files: templates, explanations, completions.

mod program;

use std::path::Path;
use std::process::Stdio;

use perimelt_core::log::Log;
use program::command;

/// Whether it succeeded, and what it printed, or said where errors go.
fn told(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = command(folder, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let text = match output.status.success() {
        true => output.stdout,
        false => output.stderr,
    };
    (
        output.status.success(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

#[test]
fn a_new_case_can_be_checked_and_is_not_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (done, templates) = told(folder, &["new"]);
    assert!(done && templates.contains("bead_on_plate"), "{templates}");
    for template in templates.lines() {
        let name = template.split_whitespace().next().expect("a name");
        let (done, told_of) = told(folder, &["new", name]);
        assert!(done && told_of.contains("perimelt run"), "{told_of}");
    }
    let (done, message) = told(folder, &["check", "haz_hardness.toml"]);
    assert!(done, "{message}");
    let (done, message) = told(folder, &["new", "haz_hardness"]);
    assert!(!done && message.contains("exists"), "{message}");
    let (done, message) = told(folder, &["new", "haz_hardnes", "--out", "other.toml"]);
    assert!(
        !done && message.contains("did you mean `haz_hardness`?"),
        "{message}"
    );
}

#[test]
fn everything_that_a_case_can_name_is_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for (name, expected) in [
        ("goldak", "half_width"),
        ("goldak.toolpath.polyline", "segments"),
        ("goldak.toolpath.polyline.segments.dwell_power", "W"),
        ("polyline", "segments"),
        ("hatch", "also: "),
        ("box", "max"),
        ("extrusion", "polygon"),
        ("stl", "scale"),
        ("melt_pool", "probes.kind.melt_pool"),
        ("S355", "EN 10025-2"),
        ("solidus", "[K]"),
        ("hardness", "Vickers"),
        ("time.step", "auto"),
        ("verify", "quantity"),
        ("physics", "thermal_history"),
        ("couplers", "goldak"),
        ("type", "perimelt list"),
        ("rkl2", "thermal.solver = \"rkl2\"\n    Stabilised explicit"),
        ("thermal.solver.rkl2", "Runge-Kutta-Legendre"),
        ("correspondence", "mechanical.formulation"),
        ("balanced", "also: "),
        ("couplers.goldak.power", "W"),
        ("spot", "gaussian_source.sigma"),
        ("HAZ", "thermal_history"),
        ("heat input", "goldak.efficiency"),
        ("penetration", "super_gaussian.penetration"),
    ] {
        let (done, text) = told(folder, &["explain", name]);
        assert!(done && text.contains(expected), "{name}: {text}");
    }
    for (name, nearest) in [
        ("goldack", "goldak"),
        ("goldak.toolpath.polylin", "polyline"),
        ("hardnes", "hardness"),
        ("S35", "S355"),
        ("coupler", "couplers"),
    ] {
        let (done, message) = told(folder, &["explain", name]);
        let hint = format!("did you mean `{nearest}`?");
        assert!(!done && message.contains(&hint), "{message}");
    }
    for (text, found) in [
        ("t8/5", "mentioned by `cooling_time`"),
        ("melt pool", "`probes.kind.melt_pool`"),
    ] {
        let (done, message) = told(folder, &["explain", text]);
        assert!(!done && message.contains(found), "{message}");
    }
    let (done, message) = told(folder, &["explain", "a"]);
    assert!(!done && !message.contains("mentioned"), "{message}");
    for name in ["bed", "mode"] {
        let (done, message) = told(folder, &["explain", name]);
        assert!(!done && !message.contains("did you mean"), "{message}");
    }
}

#[test]
fn every_shell_has_completions() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (done, script) = told(folder.path(), &["completions", shell]);
        assert!(done && script.contains("resume"), "{shell}");
    }
}

/// Runs `weld.toml` of the folder with two powers. 0.1 s of 1000 and 2000 W are 100 and 200 J.
fn a_sweep_of_one_number_is_drawn_with_formulas(folder: &Path) {
    let sweep = |compare: &[&str]| {
        let power = "couplers.torch.power=[2000, 1000]";
        let arguments = ["sweep", "weld.toml", "--out", "powers", "--set", power];
        told(folder, &[&arguments[..], compare].concat())
    };
    let picture = || std::fs::read_to_string(folder.join("powers/sweep.svg")).expect("a picture");
    let (done, text) = sweep(&[]);
    assert!(done && text.contains("sweep.svg"), "{text}");
    let all = picture();
    assert!(all.contains("highest temperature at the end") && all.contains("energy asked"));

    let formula = ["--compare", "energy asked=0.1 * x"];
    let (done, text) = sweep(&formula);
    assert!(done, "{text}");
    let compared = picture();
    assert!(compared.contains("0.1 * x") && !compared.contains("highest temperature"));
    // both curves, of the runs and of the formula, have the same points
    let curves: Vec<&str> = compared
        .lines()
        .filter(|line| line.contains("stroke-width=\"8\""))
        .filter_map(|line| line.split("points=").nth(1))
        .take(2)
        .collect();
    assert!(curves.len() == 2 && curves[0] == curves[1], "{curves:?}");

    for (compare, expected) in [
        ("energy asked", "there is no `=`"),
        ("energy asked=0.1 * power", "`power`"),
        ("enrgy=x", "no number with this name"),
    ] {
        let (done, message) = sweep(&["--compare", compare]);
        assert!(!done && message.contains(expected), "{compare}: {message}");
    }
}

#[test]
fn a_sweep_runs_all_combinations_and_goes_on_where_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let case = include_str!("cases/weld.toml").replace("end = 1.5", "end = 0.1");
    let case = case.replace("type = \"goldak\"", "type = \"goldak\"\nname = \"torch\"");
    std::fs::write(folder.join("weld.toml"), case).expect("writable");
    let sweep = [
        "sweep",
        "weld.toml",
        "--set",
        "couplers.torch.power=[1000, 2000]",
        "--set",
        "couplers.torch.depth=[0.001, 0.002]",
    ];
    let (done, text) = told(folder, &sweep);
    assert!(done, "{text}");
    assert!(text.contains("couplers.torch.power"), "{text}");
    let rows = std::fs::read_to_string(folder.join("weld-sweep/sweep.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = rows.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 5);
    assert_eq!(rows[3][..3], ["3", "2000", "0.001"]);
    let column = |name: &str| {
        let found = rows[0].iter().position(|n| n.contains(name));
        found.unwrap_or_else(|| panic!("{name} in {:?}", rows[0]))
    };
    let number =
        |row: usize, name: &str| -> f64 { rows[row][column(name)].parse().expect("a number") };
    let energy = "torch: energy asked";
    assert!((number(3, energy) / number(1, energy) - 2.0).abs() < 1e-9);
    let peak = "highest temperature at the end";
    assert!(number(3, peak) > number(1, peak) && number(1, peak) > number(2, peak));

    // finished runs are kept, one that is missing is run
    let modified = |run: &str| {
        let log = folder.join("weld-sweep").join(run);
        let meta = std::fs::metadata(log).expect("a log");
        meta.modified().expect("a time")
    };
    let before = modified("1.mcap");
    std::fs::remove_file(folder.join("weld-sweep/4.mcap")).expect("removable");
    let (done, text) = told(folder, &sweep);
    assert!(done, "{text}");
    assert_eq!(modified("1.mcap"), before);
    assert!(folder.join("weld-sweep/4.mcap").exists());

    // one that ended early goes on, though its log was closed
    let early = [
        "run",
        "weld-sweep/2.toml",
        "--until",
        "0.04",
        "--force",
        "--quiet",
    ];
    let (done, message) = told(
        folder,
        &[&early[..], &["--out", "weld-sweep/2.mcap"]].concat(),
    );
    assert!(done, "{message}");
    let times = || {
        let log = Log::open(folder.join("weld-sweep/2.mcap")).expect("a log");
        log.times("plate").to_vec()
    };
    assert_eq!(times().last().map(|t| (t * 1e3).round()), Some(40.0));
    let (done, text) = told(folder, &sweep);
    assert!(done && !text.contains("reached its end"), "{text}");
    assert_eq!(times().last().map(|t| (t * 1e3).round()), Some(100.0));

    for (set, expected) in [
        ("couplers.torch.powr=[1]", "did you mean `power`?"),
        ("couplers.torch.power=5", "no list"),
        ("couplers.torch.power=[-5]", "power"),
        ("couplers.torch.power", "no `=`"),
        ("couplers.torch.power=[3000]", "other cases"),
    ] {
        let (done, message) = told(folder, &["sweep", "weld.toml", "--set", set]);
        assert!(!done && message.contains(expected), "{set}: {message}");
    }
    // two keys vary: a line for each value of the second
    assert!(folder.join("weld-sweep/sweep.svg").exists());
    a_sweep_of_one_number_is_drawn_with_formulas(folder);

    let run = ["run", "weld.toml", "--set", "time.end=0.04", "--quiet"];
    let (done, message) = told(folder, &run);
    assert!(done, "{message}");
    let log = Log::open(folder.join("weld.mcap")).expect("a log");
    assert_eq!(log.times("plate").last(), Some(&0.04));
}
