//! Case files: from TOML text to a composed [`Simulation`](perimelt_core::Simulation), with mistakes shown at their
//! lines.
//!
//! 1. [`Case::read`] parses the text and reads every section but the plugins.
//! 2. [`Case::compose`] fills bodies with points, builds plugins through their registrations,
//!    lets them prepare, and sets initial fields.
//! 3. [`Case::start`] completes the initial state and checks the step sizes.
//!
//! Each step returns a [`CaseError`] with the mistakes of all parts that it can read on their own: each with file, line,
//! key, what was expected and the nearest valid name. Parts that depend on others are read once these are right.

mod bodies;
pub mod change;
mod compose;
mod contradictions;
mod error;
mod initial;
mod initial_fields;
mod locate;
mod log_intervals;
mod memory;
pub mod of_log;
mod plugins;
mod reader;
mod reword;
pub mod schema;
pub mod sections;
mod touching;
mod units;
mod volumes;
mod warnings;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use perimelt_core::folder;
use perimelt_core::input;
use perimelt_core::material::MaterialSection;
use perimelt_core::simulation::LogTimes;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use toml::de::DeTable;

pub use compose::StartError;
pub use error::{CaseError, CaseFile, Mistake};
pub(crate) use plugins::plugin_names;
#[cfg(test)]
pub(crate) use units::tests::DROP;
pub(crate) use warnings::provides;

use crate::probe::ProbeSection;
use locate::{Places, TomlTable};
use reader::Reader;
use sections::{BodySection, CaseSection, LogSection, TimeSection};

/// A case file that could be read.
#[derive(Debug)]
pub struct Case {
    /// Name and text.
    pub file: Arc<CaseFile>,
    /// Folder of relative paths.
    pub folder: PathBuf,
    /// `[case]`.
    pub case: CaseSection,
    /// `[bodies.<name>]`, in file order.
    pub bodies: Vec<(String, BodySection)>,
    /// `[materials.<name>]`.
    pub materials: BTreeMap<String, MaterialSection>,
    /// `[time]`.
    pub time: TimeSection,
    /// `[[probes]]`.
    pub probes: Vec<ProbeSection>,
    /// `[log]`.
    pub log: LogSection,
    /// Memory that bodies may take, bytes; that of the machine, where it is known. `None` for any.
    pub memory: Option<f64>,
    /// Places of the keys, filled at the first mistake.
    places: OnceLock<Places>,
}

/// The sections of a case file, in the order in which they are written.
pub const SECTIONS: [&str; 9] = [
    "case",
    "bodies",
    "materials",
    "physics",
    "couplers",
    "time",
    "probes",
    "log",
    "verify",
];

type Result<T, E = Box<Mistake>> = std::result::Result<T, E>;

impl Case {
    /// Reads the case file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or the mistakes in it.
    pub fn read(path: &Path) -> Result<Case, CaseError> {
        let name = path.display().to_string();
        let text = match input::read_utf8(path, input::LIMIT) {
            Ok(text) => text,
            Err(source) => {
                let file = Arc::new(CaseFile {
                    name,
                    text: String::new(),
                });
                let message = format!("the case file cannot be read: {source}");
                return Err(Mistake::of_file(&file, message).into());
            }
        };
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Case::parse(&name, text, &folder)
    }

    /// Name of the file without its folder.
    pub fn file_name(&self) -> std::borrow::Cow<'_, str> {
        let name = Path::new(&self.file.name).file_name();
        name.unwrap_or_default().to_string_lossy()
    }

    /// Reads the `text` of a case called `name`, whose relative paths start from `folder`.
    ///
    /// # Errors
    /// The mistakes of all sections.
    pub fn parse(name: &str, text: String, folder: &Path) -> Result<Case, CaseError> {
        let name = name.to_string();
        let file = Arc::new(CaseFile { name, text });
        let table = parse(&file)?;
        let mut reader = Reader::new(&file, &table);
        reader.check_numbers();
        if !reader.is_right() {
            return Err(reader.mistakes.into());
        }
        reader.check_sections();
        // without its plugins a case has other mistakes that are none, such as unknown material properties
        let materials = match reader.has_known_plugins() {
            true => reader.named("materials"),
            false => Vec::new(),
        };
        let bodies = reader.named("bodies");
        let probes = reader.list("probes");
        reader.tables("verify");
        let case = reader.optional("case");
        let time = reader.optional("time");
        let log = reader.optional("log");
        reader.check_times(time.as_ref(), log.as_ref());
        if !reader.is_right() {
            folder::within(folder, || reader.plugins());
        }
        let time = reader.finish(time)?;
        Ok(Case {
            case: case.unwrap_or_default(),
            time: time.expect("a case without `[time]` is refused"),
            log: log.unwrap_or_default(),
            folder: folder.to_path_buf(),
            file: file.clone(),
            bodies,
            materials: materials.into_iter().collect(),
            probes,
            memory: memory::available(),
            places: OnceLock::new(),
        })
    }

    /// Times of logged states.
    pub fn log_times(&self) -> LogTimes {
        LogTimes {
            stages: self.log.stages.clone(),
            interval: self.log.interval.unwrap_or(self.time.end / 100.0),
        }
    }

    /// Simulated time between checkpoints, s.
    pub fn checkpoint_interval(&self) -> f64 {
        self.log.checkpoint.unwrap_or(self.time.end / 10.0)
    }

    /// The `[[verify]]` tables, read as `T`.
    ///
    /// # Errors
    /// The mistakes in them.
    pub fn verify_entries<T: DeserializeOwned + JsonSchema>(&self) -> Result<Vec<T>, CaseError> {
        let table = self.table();
        let mut reader = Reader::new(&self.file, &table);
        let entries = reader.list("verify");
        reader.finish(entries)
    }

    /// A mistake at a dotted key of the whole file.
    fn error_at(&self, key: &str, message: impl Into<String>, expected: &str) -> Box<Mistake> {
        Reader::new(&self.file, &self.table()).mistake_at(key, message, expected)
    }

    /// Place of the value at `path`, or of the deepest part that is there.
    fn place(&self, path: &[&str]) -> Option<Range<usize>> {
        self.places().find(path).map(|place| place.value)
    }

    /// Places of all keys: a thousand mistakes do not parse the text a thousand times.
    fn places(&self) -> &Places {
        self.places.get_or_init(|| Places::of(&self.table()))
    }

    /// The parsed text: parsed on each call, because it borrows from the text.
    fn table(&self) -> TomlTable<'_> {
        parse(&self.file).unwrap_or_default()
    }
}

fn parse(file: &Arc<CaseFile>) -> Result<TomlTable<'_>> {
    let parsed = DeTable::parse(&file.text).map_err(|e| {
        let message = format!("this is not valid TOML: {}", e.message());
        Mistake::new(file, message, e.span().unwrap_or(0..0))
    })?;
    Ok(parsed.into_inner())
}
