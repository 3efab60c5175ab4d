//! A thermal run that was logged drives a mechanical one as the thermal physics itself does.

use std::path::Path;

use perimelt::case::Case;
use perimelt::run::{self, Options};
use perimelt_core::log::Log;

const WELD: &str = include_str!("cases/weld.toml");

const MECHANICAL: &str = "
[[physics]]
type = \"mechanical\"
horizon = 2
update = \"log\"
solver.quasi_static = { tolerance = 1e-10 }

[[couplers]]
type = \"thermal_expansion\"
reference_temperature = 300

[[couplers]]
type = \"clamp\"
region = \"base\"
";

fn finished(folder: &Path, name: &str, text: String) -> Log {
    let case = Case::parse(name, text, folder).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let options = Options {
        out: folder.join(name).with_extension("mcap"),
        quiet: true,
        ..Options::default()
    };
    run::run(&case, &options).expect("it runs");
    Log::open(&options.out).expect("the log opens")
}

#[test]
fn a_logged_thermal_run_drives_mechanics_like_the_coupled_run() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let modulus =
        "[materials.steel]\nyoungs_modulus = { temperature = [300, 1700], value = [2e11, 2e10] }";
    let weld = WELD
        .replace("[materials.steel]", modulus)
        .replace("end = 1.5", "end = 0.4");
    let coupled = finished(folder.path(), "coupled.toml", format!("{weld}{MECHANICAL}"));
    finished(folder.path(), "thermal.toml", weld.clone());

    // everything of the thermal case but its physics and couplers
    let physics = weld.find("[[physics]]").expect("there");
    let time = weld.find("[time]").expect("there");
    let replay =
        "[[physics]]\ntype = \"replay\"\nlog = \"thermal.mcap\"\nfields = [\"temperature\"]\n";
    let (body, rest) = (&weld[..physics], &weld[time..]);
    let body = body.replace("initial.temperature = 300\n", "");
    let rest = rest.replace("[[probes]]\nname = \"pool\"\nkind.melt_pool = {}\n", "");
    let driven = finished(
        folder.path(),
        "driven.toml",
        format!("{body}{replay}{MECHANICAL}{rest}"),
    );

    let times = coupled.times("plate");
    assert_eq!(times, driven.times("plate"));
    for (i, time) in times.iter().enumerate() {
        let displacement = |log: &Log| {
            let cloud = log.cloud("plate", i).expect("it reads");
            let field = cloud.fields.into_iter().find(|f| f.name == "displacement");
            field.expect("it is logged").values
        };
        let (coupled, driven) = (displacement(&coupled), displacement(&driven));
        let largest = coupled.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
        assert!(i == 0 || largest > 1e-7, "t = {time}: nothing moves");
        // logs hold seven digits of temperature and displacement
        for (a, b) in coupled.iter().zip(&driven) {
            assert!(
                (a - b).abs() <= 1e-6 * largest,
                "t = {time}: {a:e} and {b:e} m of {largest:e}"
            );
        }
    }
}
