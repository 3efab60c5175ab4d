//! `perimelt view`: what the server answers, to whom, and what a browser makes of it.
//!
//! `PERIMELT_CHROMIUM` names a Chromium for the last test; else one is looked for in `PATH`. Without one the test is skipped.

mod program;
mod running;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use perimelt_core::log::Log;
use program::command;
use running::Running;
use serde_json::Value;

const WELD: &str = include_str!("cases/weld.toml");

/// A folder with the case, which ends at `end` s.
fn folder(end: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let case = WELD.replace("end = 1.5", &format!("end = {end}"));
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    folder
}

/// A folder with the case and its log.
fn logged() -> tempfile::TempDir {
    let folder = folder(0.1);
    let status = command(folder.path(), &["run", "weld.toml", "--quiet"]).status();
    assert!(status.expect("it starts").success());
    folder
}

/// `perimelt view` of the log in a folder.
struct View {
    port: u16,
    _running: Running,
}

struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn text(&self) -> &str {
        std::str::from_utf8(&self.body).expect("text")
    }

    fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{}", self.text());
        serde_json::from_slice(&self.body).expect("JSON")
    }

    fn singles(&self) -> Vec<f32> {
        assert_eq!(self.status, 200, "{}", self.text());
        let chunks = self.body.chunks_exact(4);
        chunks
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect()
    }

    fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| {
            let (found, value) = line.split_once(": ")?;
            found.eq_ignore_ascii_case(name).then_some(value)
        })
    }
}

impl View {
    fn of(folder: &Path) -> View {
        View::of_file(folder, "weld.mcap")
    }

    fn of_file(folder: &Path, file: &str) -> View {
        let mut child = command(folder, &["view", file, "--no-open"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        let out = child.stdout.take().expect("piped");
        let running = Running(child);
        let mut line = String::new();
        BufReader::new(out).read_line(&mut line).expect("readable");
        let port = line
            .strip_prefix("http://127.0.0.1:")
            .and_then(|rest| rest.split_once('/'))
            .and_then(|(port, _)| port.parse().ok())
            .unwrap_or_else(|| panic!("no address in {line:?}"));
        View {
            port,
            _running: running,
        }
    }

    fn ask(&self, request: &str, headers: &str) -> Answer {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        write!(
            stream,
            "{request} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n"
        )
        .expect("sent");
        let mut all = Vec::new();
        stream.read_to_end(&mut all).expect("answered");
        let end = all.windows(4).position(|w| w == b"\r\n\r\n");
        let end = end.expect("a head and a body");
        let head = String::from_utf8(all[..end].to_vec()).expect("text");
        let status = head.split(' ').nth(1).and_then(|code| code.parse().ok());
        Answer {
            status: status.expect("a status"),
            body: all[end + 4..].to_vec(),
            head,
        }
    }

    fn get(&self, path: &str) -> Answer {
        let host = format!("Host: 127.0.0.1:{}\r\n", self.port);
        self.ask(&format!("GET {path}"), &host)
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().expect("an array").iter();
    values.map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
}

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

    let point = view.get(&format!("/point/plate/7/{state}")).json();
    assert_eq!(numbers(&point["position"]), cloud.positions[7]);
    assert_eq!(point["fields"][0]["value"], temperature[7]);

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
    assert!(page.status == 200 && page.text().contains("<canvas"));
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

/// The Chromium to test with.
fn chromium() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("PERIMELT_CHROMIUM") {
        return Some(path.into());
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .flat_map(|folder| {
            ["chromium", "chromium-browser", "google-chrome"].map(|name| folder.join(name))
        })
        .find(|path| path.is_file())
}

/// What the page tells of itself in its element `status`.
fn status_of_page(chromium: &Path, address: &str) -> Value {
    let profile = tempfile::tempdir().expect("a folder");
    // graphics by the processor, so that no graphics card is needed
    let output = Command::new(chromium)
        .args(["--headless=new", "--no-sandbox", "--disable-dev-shm-usage"])
        .args([
            "--use-gl=angle",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
        ])
        .args([
            "--window-size=1200,800",
            "--virtual-time-budget=8000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(address)
        .stderr(Stdio::null())
        .output()
        .expect("Chromium starts");
    let page = String::from_utf8_lossy(&output.stdout);
    let status = page
        .split_once("<output id=\"status\"")
        .and_then(|(_, rest)| rest.split_once('>'))
        .and_then(|(_, rest)| rest.split_once("</output>"));
    let (status, _) = status.unwrap_or_else(|| panic!("no status in {page}"));
    serde_json::from_str(status).unwrap_or_else(|e| panic!("{e}: {status}"))
}

#[test]
fn a_browser_draws_the_log() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: no Chromium; `PERIMELT_CHROMIUM` names one");
        return;
    };
    let folder = logged();
    let log = Log::open(folder.path().join("weld.mcap")).expect("a log");
    let states = log.times("plate").len();
    let view = View::of(folder.path());
    let page = |settings: &str| {
        let address = format!("http://127.0.0.1:{}/{settings}", view.port);
        let status = status_of_page(&chromium, &address);
        assert_eq!(status["ready"], true, "{status}");
        assert_eq!(status["errors"], serde_json::json!([]), "{status}");
        assert_eq!(status["states"], states, "{status}");
        status
    };
    // 20 x 10 x 4 cells: the faces of their surface
    let status = page("");
    assert_eq!(status["drawn"][0]["form"], "cells");
    assert_eq!(status["drawn"][0]["count"], 2 * (20 * 10 + 20 * 4 + 10 * 4));
    assert_eq!(status["field"], "temperature");
    let range = view.get("/range/plate/temperature").json();
    assert_eq!(numbers(&status["range"]), numbers(&range["range"]));
    assert_eq!(status["live"], "complete");
    assert!(status["curves"].as_u64() > Some(2), "{status}");
    // half of them, seen at the last time
    let status = page("#cut=y0.5&time=9");
    assert_eq!(status["drawn"][0]["count"], 2 * (20 * 5 + 20 * 4 + 5 * 4));
    assert_eq!(status["index"], states - 1);
    // as points
    let status = page("#form=points&field=liquid_fraction");
    assert_eq!(status["drawn"][0]["form"], "points");
    assert_eq!(status["drawn"][0]["count"], 800);
    assert_eq!(status["field"], "liquid_fraction");
}
