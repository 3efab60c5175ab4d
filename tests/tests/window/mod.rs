//! `perimelt view` and a browser for tests.
//!
//! `PERIMELT_CHROMIUM` names a Chromium; else one is looked for in `PATH`. Without one, tests that need it are skipped.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::program::command;
use crate::running::Running;

pub const WELD: &str = include_str!("../cases/weld.toml");

/// A folder with the case, which ends at `end` s.
pub fn folder(end: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let case = WELD.replace("end = 1.5", &format!("end = {end}"));
    std::fs::write(folder.path().join("weld.toml"), case).expect("writable");
    folder
}

/// A folder with the case and its log.
pub fn logged() -> tempfile::TempDir {
    let folder = folder(0.1);
    let status = command(folder.path(), &["run", "weld.toml", "--quiet"]).status();
    assert!(status.expect("it starts").success());
    folder
}

/// `perimelt view` of the log in a folder.
pub struct View {
    pub port: u16,
    _running: Running,
}

pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.body).expect("text")
    }

    pub fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{}", self.text());
        serde_json::from_slice(&self.body).expect("JSON")
    }

    pub fn singles(&self) -> Vec<f32> {
        assert_eq!(self.status, 200, "{}", self.text());
        let chunks = self.body.chunks_exact(4);
        chunks
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect()
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| {
            let (found, value) = line.split_once(": ")?;
            found.eq_ignore_ascii_case(name).then_some(value)
        })
    }
}

impl View {
    pub fn of(folder: &Path) -> View {
        View::of_file(folder, "weld.mcap")
    }

    pub fn of_file(folder: &Path, file: &str) -> View {
        View::with(folder, &[file])
    }

    /// With these arguments.
    pub fn with(folder: &Path, arguments: &[&str]) -> View {
        let mut child = command(folder, &[&["view", "--no-open"], arguments].concat())
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

    pub fn ask(&self, request: &str, headers: &str) -> Answer {
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

    pub fn get(&self, path: &str) -> Answer {
        let host = format!("Host: 127.0.0.1:{}\r\n", self.port);
        self.ask(&format!("GET {path}"), &host)
    }
}

pub fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().expect("an array").iter();
    values.map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
}

/// The Chromium to test with.
pub fn chromium() -> Option<PathBuf> {
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
pub fn status_of_page(chromium: &Path, address: &str) -> Value {
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
    let status = status
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    serde_json::from_str(&status).unwrap_or_else(|e| panic!("{e}: {status}"))
}
