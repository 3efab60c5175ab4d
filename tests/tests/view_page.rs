//! What a browser makes of the page of `perimelt view`, by its element `status`. Skipped without a Chromium.

mod program;
mod running;
#[allow(dead_code, reason = "the tests of the server use the rest")]
mod window;

use std::path::{Path, PathBuf};

use perimelt_core::log::Log;
use program::command;
use serde_json::{Value, json};
use window::{View, WELD, chromium, folder, logged, numbers, status_of_page};

/// A page in a browser.
struct Page<'a> {
    chromium: PathBuf,
    view: &'a View,
}

impl Page<'_> {
    /// The page of a program; `None` without a browser.
    fn of(view: &View) -> Option<Page<'_>> {
        let chromium = chromium();
        if chromium.is_none() {
            eprintln!("skipped: no Chromium; `PERIMELT_CHROMIUM` names one");
        }
        Some(Page {
            chromium: chromium?,
            view,
        })
    }

    /// What the page tells of itself with these settings in its address.
    fn status(&self, settings: &str) -> Value {
        let address = format!("http://127.0.0.1:{}/#{settings}", self.view.port);
        let status = status_of_page(&self.chromium, &address);
        assert_eq!(status["ready"], true, "{status}");
        assert_eq!(status["errors"], json!([]), "{status}");
        status
    }
}

/// The number at a place of a JSON value.
fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// The state in which a field peaks.
fn peak(view: &View, field: &str) -> Value {
    view.get(&format!("/range/plate/{field}")).json()["peak"].clone()
}

/// Runs a case in a folder.
fn run(folder: &Path, case: &str, arguments: &[&str]) {
    std::fs::write(folder.join("weld.toml"), case).expect("writable");
    let arguments = [&["run", "weld.toml", "--quiet"], arguments].concat();
    let status = command(folder, &arguments).status();
    assert!(status.expect("it starts").success());
}

#[test]
fn a_browser_draws_the_log() {
    let folder = logged();
    let log = Log::open(folder.path().join("weld.mcap")).expect("a log");
    let states = log.times("plate").len();
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    // 20 x 10 x 4 cells: the faces of their surface, the edges of a box
    let status = page.status("");
    assert_eq!(status["states"], states);
    let drawn = &status["drawn"][0];
    assert_eq!(drawn["form"], "cells");
    assert_eq!(drawn["count"], 2 * (20 * 10 + 20 * 4 + 10 * 4));
    assert_eq!(drawn["edges"], 4 * (20 + 10 + 4));
    assert_eq!(status["field"], "temperature");
    let range = view.get("/range/plate/temperature").json();
    assert_eq!(numbers(&status["range"]), numbers(&range["range"]));
    assert_eq!(status["live"], "complete");
    assert!(status["curves"].as_u64() > Some(2), "{status}");
    // at the hottest state, from above, where the torch is
    assert_eq!(status["index"], peak(&view, "temperature"));
    assert!(number(&status["camera"]["pitch"]) > 0.3, "{status}");
    let torch = &status["torches"][0][0];
    let along = 0.004 + 0.01 * number(&status["time"]);
    assert!(
        (number(&torch["position"][0]) - along).abs() < 1e-9,
        "{torch}"
    );
    // half of it, seen at the last time
    let status = page.status("cut=y0.5&time=9");
    assert_eq!(status["drawn"][0]["count"], 2 * (20 * 5 + 20 * 4 + 5 * 4));
    assert_eq!(status["drawn"][0]["edges"], 4 * (20 + 5 + 4));
    assert_eq!(status["index"], states - 1);
    // as points
    let status = page.status("form=points&field=liquid_fraction");
    assert_eq!(status["drawn"][0]["form"], "points");
    assert_eq!(status["drawn"][0]["count"], 800);
    assert_eq!(status["field"], "liquid_fraction");
}

#[test]
fn an_oblique_cut_divides_cells() {
    let folder = logged();
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    // x + y > 15 cells: 105 squares above and below, 5 + 15 + 10 columns at the sides, 10 at the cut
    let status = page.status("cut=n45,0,0.5");
    let count = 2 * 105 + (5 + 15 + 10 + 10) * 4;
    assert_eq!(status["drawn"][0]["count"], count);
    // the other side is its mirror image
    let status = page.status("cut=n45,0,0.5f");
    assert_eq!(status["drawn"][0]["count"], count);
}

#[test]
fn the_torch_decides_from_which_side_the_body_is_seen() {
    let folder = folder(0.04);
    // half a plate, whose plane of symmetry is its far side, heated from below
    let case = WELD
        .replace("end = 1.5", "end = 0.04")
        .replace("0.005, 0.004]", "0.01, 0]")
        .replace(
            "type = \"goldak\"",
            "type = \"goldak\"\nheated_surface = { face = \"z-\" }",
        );
    run(folder.path(), &case, &[]);
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    let camera = page.status("")["camera"].clone();
    assert!(number(&camera["pitch"]) < -0.3, "{camera}");
    // the viewer is at the far side
    assert!(-number(&camera["yaw"]).cos() > 0.5, "{camera}");
}

#[test]
fn what_remains_is_shown_at_the_end_with_colours_of_that_time() {
    let folder = folder(0.1);
    let mechanics = "[[physics]]\ntype = \"mechanical\"\nhorizon = 2\nupdate = \"log\"\n\
         solver.quasi_static = { tolerance = 1e-4 }\n\n[[couplers]]\ntype = \"thermal_expansion\"\n\
         reference_temperature = 300\n\n[[couplers]]\ntype = \"clamp\"\nregion = \"base\"\n\n[time]\nend = 0.1";
    let case = WELD.replace("[time]\nend = 1.5", mechanics).replace(
        "thermal_expansion = 1.2e-5",
        "thermal_expansion = 1.2e-5\nyoungs_modulus = 2e11\npoissons_ratio = 0.25",
    );
    run(folder.path(), &case, &[]);
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    let status = page.status("field=stress&celsius=yes");
    let last = number(&status["states"]) as usize - 1;
    assert_eq!(status["coverage"], "now");
    assert_eq!(status["index"], last);
    let field = view.get(&format!("/field/plate/stress/{last}"));
    let range = field.header("X-Range").expect("a range").to_owned();
    let range: Vec<f64> = range
        .split(' ')
        .map(|x| x.parse().expect("a number"))
        .collect();
    assert_eq!(numbers(&status["range"]), range);
    assert_eq!(status["bar"]["unit"], "MPa");
    // temperatures are those of the whole run, and in degrees Celsius
    let status = page.status("celsius=yes");
    assert_eq!(status["coverage"], "run");
    assert_eq!(status["bar"]["unit"], "°C");
    for end in 0..2 {
        let shown = number(&status["bar"]["range"][end]) - number(&status["range"][end]);
        assert!((shown + 273.15).abs() < 1e-9, "{shown}");
    }
}

#[test]
fn a_link_shows_the_same_picture() {
    let folder = logged();
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    let asked = "field=liquid_fraction&time=0.04&view=0.7,0.3,0.1,0,-0.1,0.8&cut=n30,-20,0.4f&range=0.1,0.9\
         &map=viridis&smooth=no&lines=no&celsius=yes&edges=no&torch=no&perspective=no&scale=20&point=plate:0.0035,0.0065,0.0005\
         &ruler=0,0,0,0,0,0,0.003,0.004,0,0.003,0.004,0&picture=900&theme=light";
    let first = page.status(asked);
    assert_eq!(numbers(&first["range"]), [0.1, 0.9]);
    assert_eq!(number(&first["camera"]["yaw"]), 0.7);
    assert_eq!(first["ruler"], "5 mm (x 3, y 4, z 0)");
    assert_eq!(
        first["points"],
        json!([{ "key": "plate", "place": [0.0035, 0.0065, 0.0005] }])
    );
    let link = first["address"].as_str().expect("an address");
    let second = page.status(link);
    for what in [
        "address", "camera", "range", "drawn", "index", "field", "ruler", "points", "curves",
    ] {
        assert_eq!(first[what], second[what], "{what} of {link}");
    }
    // settings that make no sense are those without
    let status = page.status(
        "field=pressure&time=soon&view=behind&cut=w1&range=2,1&map=pink&point=plate&ruler=1,2",
    );
    assert_eq!(status["field"], "temperature");
    assert_eq!(status["points"], json!([]));
}

#[test]
fn clicks_give_curves_of_points_and_lengths() {
    let folder = logged();
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    let before = page.status("view=top");
    let status = page.status("view=top&click=0.45,0.5&click=0.5,0.5");
    assert_eq!(
        status["points"].as_array().map(Vec::len),
        Some(2),
        "{status}"
    );
    assert_eq!(number(&status["curves"]), number(&before["curves"]) + 1.0);
    // a second click takes the curve away
    let status = page.status("view=top&click=0.45,0.5&click=0.45,0.5");
    assert_eq!(status["points"], json!([]));
    // a length on the upper side, where 2 reaches are the height of the picture
    let status = page.status("view=top&perspective=no&ruler=on&click=0.4,0.5&click=0.5,0.5");
    let ruler = status["ruler"].as_str().expect("a length");
    let length: f64 = ruler
        .split(' ')
        .next()
        .and_then(|x| x.parse().ok())
        .expect("a number");
    let window = numbers(&status["window"]);
    let pixel = 2.0 * number(&status["camera"]["reach"]) * number(&status["radius"]) / window[1];
    let expected = 1e3 * 0.1 * window[0] * pixel;
    // a click hits a pixel
    assert!(
        (length - expected).abs() < 1.5e3 * pixel,
        "{ruler}: expected {expected} mm"
    );
    assert!(ruler.contains("mm") && ruler.ends_with("z 0)"), "{ruler}");
}

#[test]
fn pictures_have_any_size() {
    let folder = logged();
    let view = View::of(folder.path());
    let Some(page) = Page::of(&view) else { return };
    // larger than what is drawn at once
    let status = page.status("take&picture=5000");
    let window = numbers(&status["window"]);
    assert_eq!(status["taken"]["width"], 5000);
    let height = number(&status["taken"]["height"]);
    // the page tells its size in whole pixels
    let ratio = height / 5000.0 * window[0] / window[1];
    assert!((ratio - 1.0).abs() < 2e-3, "{status}");
    assert!(
        status["taken"]["bytes"].as_u64() > Some(100_000),
        "{status}"
    );
}

#[test]
fn a_run_that_was_stopped_is_not_complete_and_stands_beside_another() {
    let folder = logged();
    let case = std::fs::read_to_string(folder.path().join("weld.toml")).expect("a case");
    let other = folder.path().join("stopped");
    std::fs::create_dir(&other).expect("writable");
    run(&other, &case, &["--until", "0.05"]);
    let file = "stopped/weld.mcap";
    let stopped = View::of_file(folder.path(), file);
    assert_eq!(stopped.get("/run.json").json()["stopped"], true);
    let view = View::with(folder.path(), &["weld.mcap", file, "--celsius"]);
    assert_eq!(view.get("/run.json").json()["stopped"], false);
    assert_eq!(view.get("/log/1/run.json").json()["stopped"], true);
    assert_eq!(view.get("/log/2/run.json").status, 404);
    let Some(page) = Page::of(&view) else { return };
    let both = page.status("");
    assert_eq!(both["live"], "complete | stopped");
    assert_eq!(both["bar"]["unit"], "°C");
    let bodies: Vec<&str> = both["drawn"]
        .as_array()
        .expect("bodies")
        .iter()
        .filter_map(|d| d["body"].as_str())
        .collect();
    assert_eq!(bodies, ["plate", "plate"]);
    // one range for both logs
    let ranges = ["/range/plate/temperature", "/log/1/range/plate/temperature"]
        .map(|path| numbers(&view.get(path).json()["range"]));
    let range = [
        ranges[0][0].min(ranges[1][0]),
        ranges[0][1].max(ranges[1][1]),
    ];
    assert_eq!(numbers(&both["range"]), range);
    // a point of the second one
    let status = page.status("point=1/plate:0.0035,0.0065,0.0005");
    assert_eq!(number(&status["curves"]), number(&both["curves"]) + 1.0);
    let Some(page) = Page::of(&stopped) else {
        return;
    };
    assert_eq!(page.status("")["live"], "stopped");
}

/// Plies of a laminate lie apart, or one is shown alone.
#[test]
fn plies_of_a_laminate_are_chosen_and_drawn_apart() {
    let folder = tempfile::tempdir().expect("a folder");
    let case = std::fs::read_to_string(
        perimelt_tests::root().join("cases/verification/lam-warp-0-90.toml"),
    );
    let case = case.expect("readable");
    run(
        folder.path(),
        &case.replace("spacing = 0.004", "spacing = 0.01"),
        &[],
    );
    let view = View::of(folder.path());
    let run = view.get("/run.json").json();
    assert_eq!(run["bodies"][0]["plies"].as_array().map(Vec::len), Some(2));
    assert_eq!(run["bodies"][0]["plies"][1]["angle"], 90.0);
    let Some(page) = Page::of(&view) else { return };
    // 2 plies of 2 stations
    assert_eq!(page.status("")["drawn"][0]["count"], 4 * 10 * 10);
    // seen from the front, a laminate whose plies lie apart is higher
    let height = |settings: &str| {
        let status = page.status(&format!("view=front&field=ply&{settings}"));
        assert_eq!(status["errors"], json!([]));
        number(&status["box"][1][2]) - number(&status["box"][0][2])
    };
    let [whole, apart, one] = ["", "apart=50", "ply=2"].map(height);
    assert!(apart > whole + 0.04, "{whole} {apart}");
    assert!(one < whole, "{whole} {one}");
}
