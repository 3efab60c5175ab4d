//! `perimelt view`: what the server answers, and to whom. What a browser makes of it is in `view_page.rs`.

mod program;
mod running;
#[allow(dead_code, reason = "the tests of the page use the rest")]
mod window;

use std::process::Stdio;
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;
use running::Running;
use serde_json::Value;
use window::{View, WELD, folder, logged, numbers};

#[test]
fn a_case_is_run_and_shown() {
    let folder = folder(0.1);
    let view = View::of_file(folder.path(), "weld.toml");
    let started = Instant::now();
    loop {
        let run = view.get("/run.json").json();
        let times = numbers(&run["bodies"][0]["times"]);
        if times.last() == Some(&0.1) {
            break;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{run}");
    }
    drop(view);
    // the run refuses to replace the log that exists now
    let viewed = command(folder.path(), &["view", "weld.toml", "--no-open"])
        .stderr(Stdio::piped())
        .output()
        .expect("it starts");
    let told = String::from_utf8_lossy(&viewed.stderr);
    assert!(!viewed.status.success());
    assert!(told.contains("weld.mcap exists"), "{told}");
    assert!(
        told.contains("there is nothing to show: the run of weld.toml has not begun"),
        "{told}"
    );
}

#[test]
fn the_server_answers_with_the_numbers_of_the_log() {
    let folder = logged();
    let log = Log::open(folder.path().join("weld.mcap")).expect("a log");
    let view = View::of(folder.path());
    let (state, cloud) = (3, log.cloud("plate", 3).expect("a state"));
    let singles = |values: &[f64]| -> Vec<f32> { values.iter().map(|x| *x as f32).collect() };
    let temperature = &cloud.fields.iter().find(|f| f.name == "temperature");
    let temperature = &temperature.expect("logged").values;

    let run = view.get("/run.json").json();
    let body = &run["bodies"][0];
    assert_eq!(run["title"], "A short weld on a small steel block");
    assert_eq!(
        (&run["finished"], &run["end"]),
        (&Value::Bool(true), &0.1.into())
    );
    assert_eq!(
        (&body["name"], &body["dimension"]),
        (&"plate".into(), &3.into())
    );
    assert_eq!(numbers(&body["times"]), log.times("plate"));
    assert_eq!(body["isotherms"][0]["temperature"], 1700.0);
    assert_eq!(body["fields"][0]["name"], "temperature");

    let points = view.get(&format!("/points/plate/{state}"));
    assert_eq!(points.singles(), singles(cloud.positions.as_flattened()));
    // what the page has is not sent again
    let tag = points.header("ETag").expect("a tag");
    let known = format!("Host: localhost:{}\r\nIf-None-Match: {tag}\r\n", view.port);
    let again = view.ask("GET /points/plate/4", &known);
    assert_eq!((again.status, again.body.len()), (304, 0));

    let field = view.get(&format!("/field/plate/temperature/{state}"));
    assert_eq!(field.singles(), singles(temperature));
    let [low, high] =
        [f64::min, f64::max].map(|f| temperature.iter().copied().reduce(f).expect("points"));
    let range = field.header("X-Range").expect("a range");
    let range: Vec<f64> = range
        .split(' ')
        .map(|x| x.parse().expect("a number"))
        .collect();
    assert_eq!(range, [low, high]);

    let hottest = |index: usize| {
        let cloud = log.cloud("plate", index).expect("a state");
        let field = cloud.fields.iter().find(|f| f.name == "temperature");
        field
            .expect("logged")
            .values
            .iter()
            .copied()
            .fold(0.0, f64::max)
    };
    let peaks: Vec<f64> = (0..log.times("plate").len()).map(hottest).collect();
    let whole = view.get("/range/plate/temperature").json();
    let peak = whole["peak"].as_u64().expect("a number") as usize;
    assert_eq!(numbers(&whole["range"])[1], peaks[peak]);
    assert!(peaks.iter().all(|x| *x <= peaks[peak]));
}

#[test]
fn the_server_answers_with_the_histories_of_the_log() {
    let folder = logged();
    let log = Log::open(folder.path().join("weld.mcap")).expect("a log");
    let view = View::of(folder.path());
    let (state, cloud) = (3, log.cloud("plate", 3).expect("a state"));
    let temperature = &cloud.fields.iter().find(|f| f.name == "temperature");
    let temperature = &temperature.expect("logged").values;

    let point = view.get(&format!("/point/plate/7/{state}")).json();
    assert_eq!(numbers(&point["position"]), cloud.positions[7]);
    assert_eq!(point["fields"][0]["value"], temperature[7]);

    let [x, y, z] = cloud.positions[7];
    let history = view.get(&format!("/history/plate/temperature/{x},{y},{z}"));
    let history = history.json();
    assert_eq!(numbers(&history["times"]), log.times("plate"));
    assert_eq!(numbers(&history["values"])[state], temperature[7]);
    // nothing is far from the body
    let beside = view.get("/history/plate/temperature/1,0,0").json();
    assert!(
        numbers(&beside["values"])
            .iter()
            .all(|value| value.is_nan())
    );
    // the source moves 10 mm/s along x, from x = 4 mm
    let sources = view.get("/sources.json").json();
    let row = &sources[state];
    assert_eq!(row["time"], cloud.time);
    let place = numbers(&row["sources"][0]["position"]);
    assert!((place[0] - 0.004 - 0.01 * cloud.time).abs() < 1e-9, "{row}");
    assert_eq!(numbers(&row["sources"][0]["beam"]), [0.0, 0.0, -1.0]);
    assert_eq!(row["sources"][0]["on"], true);

    let series = view.get("/series.json").json();
    let base = series
        .as_array()
        .expect("an array")
        .iter()
        .find(|s| s["name"] == "base");
    let base = base.expect("a probe");
    let logged = &log.probes()["base"];
    assert_eq!(numbers(&base["times"]), logged.times);
    assert_eq!(
        numbers(&base["columns"][0]["values"]),
        logged.columns[0].values
    );

    let pool = view.get("/melt-pool/plate").json();
    assert_eq!(numbers(&pool["times"]), log.times("plate"));
}

#[test]
fn only_the_page_itself_gets_answers() {
    let folder = logged();
    let view = View::of(folder.path());
    let page = view.get("/");
    assert!(page.status == 200 && page.text().contains("class=\"panel\""));
    // nothing is loaded from elsewhere
    let policy = page.header("Content-Security-Policy").expect("a policy");
    assert!(policy.starts_with("default-src 'none'"), "{policy}");
    for file in ["main.js", "style.css"] {
        assert_eq!(view.get(&format!("/page/{file}")).status, 200, "{file}");
    }
    // a name of another site that points to this machine
    for host in ["Host: evil.example\r\n", "Host: 127.0.0.1:1\r\n", ""] {
        let answer = view.ask("GET /run.json", host);
        assert!(
            matches!(answer.status, 400 | 403),
            "{host}: {}",
            answer.head
        );
        assert!(!answer.text().contains("plate"), "{host}");
    }
    let host = format!("Host: 127.0.0.1:{}\r\n", view.port);
    assert_eq!(view.ask("POST /run.json", &host).status, 405);
    for (path, why) in [
        ("/nothing", "there is nothing at /nothing"),
        ("/page/../../weld.toml", "there is nothing"),
        (
            "/page/..%2F..%2Fweld.toml",
            "the page has no file `../../weld.toml`",
        ),
        (
            "/points/gate/0",
            "the log has no body `gate`; it has `plate`",
        ),
        (
            "/points/plate/99",
            "number 99 (counted from 0) is not among them",
        ),
        ("/points/plate/-1", "`-1` is no number of a state"),
        (
            "/field/plate/pressure/0",
            "has no field `pressure` in the log; it has: temperature",
        ),
        (
            "/field/plate/temperature.x/0",
            "has no field `temperature.x`",
        ),
        ("/vector/plate/temperature/0", "has no field `temperature`"),
        ("/range/gate/temperature", "the log has no body `gate`"),
        ("/range/plate/pressure", "has no field `pressure`"),
        ("/melt-pool/gate", "the log has no body `gate`"),
        ("/point/plate/9999/0", "body `plate` has 800 points"),
        (
            "/history/plate/temperature/7",
            "`7` is no place: expected x,y,z in m",
        ),
        ("/history/plate/temperature/0,0,nan", "is no place"),
        ("/history/plate/pressure/0,0,0", "has no field `pressure`"),
        ("/log/1/run.json", "there is nothing at /log/1/run.json"),
        ("/log/0/nothing", "there is nothing at /log/0/nothing"),
    ] {
        let answer = view.get(path);
        assert_eq!(answer.status, 404, "{path}: {}", answer.text());
        assert!(answer.text().contains(why), "{path}: {}", answer.text());
    }
}

#[test]
fn a_faulty_case_and_a_missing_log_are_explained() {
    let folder = folder(0.1);
    let case = WELD.replace("[time]", "[tme]");
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    for (file, why) in [
        ("weld.toml", "did you mean `time`?"),
        ("weld.toml", "the run of weld.toml has not begun"),
        ("weld.mcap", "could not read the log weld.mcap"),
    ] {
        let output = command(folder.path(), &["view", file, "--no-open"])
            .stderr(Stdio::piped())
            .output()
            .expect("it starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && message.contains(why),
            "{message}"
        );
    }
}

#[test]
fn a_run_under_way_is_followed() {
    let folder = folder(1500.0);
    let run = command(folder.path(), &["run", "weld.toml", "--quiet"]).spawn();
    let _run = Running(run.expect("it starts"));
    let patient = Instant::now();
    let wait = || {
        assert!(patient.elapsed() < Duration::from_secs(120), "too slow");
        std::thread::sleep(Duration::from_millis(50));
    };
    while !folder.path().join("weld.mcap").exists() {
        wait();
    }
    let view = View::of(folder.path());
    let states = || {
        let run = view.get("/run.json").json();
        assert_eq!(run["finished"], false);
        run["bodies"][0]["times"]
            .as_array()
            .expect("an array")
            .len()
    };
    let before = states();
    while states() < before + 2 {
        wait();
    }
    let newest = view.get(&format!("/field/plate/temperature/{}", before + 1));
    assert_eq!(newest.singles().len(), 800);
}
