//! Case files: from TOML text to a composed [`Simulation`](perimelt_core::Simulation), with mistakes shown at their
//! lines.
//!
//! 1. [`Case::read`] parses the text and reads every section but the plugins.
//! 2. [`Case::compose`] fills bodies with points, builds plugins through their registrations,
//!    lets them prepare, and sets initial fields.
//! 3. [`Case::start`] completes the initial state and checks the step sizes.
//!
//! Each step returns a [`CaseError`] that shows file, line, key, what was expected and the
//! nearest valid name.

mod bodies;
pub mod change;
mod compose;
mod error;
mod initial;
mod locate;
mod reword;
pub mod schema;
pub mod sections;
mod warnings;
mod whole_schema;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use perimelt_core::error::nearest;
use perimelt_core::material::MaterialSection;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

pub use compose::StartError;
pub(crate) use compose::plugin_names;
pub use error::{CaseError, CaseFile};
pub use whole_schema::{NAME as PLUGIN_NAME, whole_schema};

use locate::{TomlTable, TomlValue};
use reword::Section;
use sections::{BodySection, CaseSection, LogSection, ProbeSection, TimeSection};

/// A case file that could be read.
#[derive(Debug)]
pub struct Case {
    /// Name and text.
    pub file: Arc<CaseFile>,
    /// Where relative paths start.
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

type Result<T> = std::result::Result<T, Box<CaseError>>;

impl Case {
    /// Reads the case file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or the first mistake in it.
    pub fn read(path: &Path) -> Result<Case> {
        let name = path.display().to_string();
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(source) => {
                let file = Arc::new(CaseFile {
                    name,
                    text: String::new(),
                });
                let message = format!("the case file cannot be read: {source}");
                return Err(CaseError::of_file(&file, message));
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
    /// The first mistake.
    pub fn parse(name: &str, text: String, folder: &Path) -> Result<Case> {
        let name = name.to_string();
        let file = Arc::new(CaseFile { name, text });
        let table = parse(&file)?;

        if let Some(key) = table.keys().find(|k| !SECTIONS.contains(&&**k.get_ref())) {
            let error = CaseError::new(
                &file,
                format!("unknown section `{}`", key.get_ref()),
                key.span(),
            );
            let error = match nearest(key.get_ref(), SECTIONS) {
                Some(close) => error.expected(format!("did you mean `{close}`?")),
                None => error.expected("no such section"),
            };
            return Err(error.help(format!(
                "sections are, in this order: {}",
                SECTIONS.join(", ")
            )));
        }
        let reader = Reader {
            file: &file,
            table: &table,
        };
        reader.check_plugin_names()?;
        let mut named = Vec::new();
        for (key, value) in reader.named("bodies")? {
            let body: BodySection = reader.section(&format!("[bodies.{key}]"), value)?;
            named.push((key, body));
        }
        if named.is_empty() {
            let error = CaseError::of_file(&file, "the case has no body");
            return Err(error
                .help("add a section `[bodies.<name>]` with `shape`, `spacing` and `material`"));
        }
        let mut materials = BTreeMap::new();
        for (key, value) in reader.named("materials")? {
            let material: MaterialSection = reader.section(&format!("[materials.{key}]"), value)?;
            materials.insert(key, material);
        }
        let mut probes = Vec::new();
        for value in reader.list("probes")? {
            probes.push(reader.section("[[probes]]", value)?);
        }
        reader.list("verify")?;
        let missing = || {
            let error = CaseError::of_file(&file, "section `[time]` is missing");
            error.help("add `[time]` with `end`, the end of the simulated time in s")
        };
        let case = Case {
            case: reader.optional("case")?.unwrap_or_default(),
            time: reader.optional("time")?.ok_or_else(missing)?,
            log: reader.optional("log")?.unwrap_or_default(),
            folder: folder.to_path_buf(),
            file: file.clone(),
            bodies: named,
            materials,
            probes,
        };
        case.check_times()?;
        Ok(case)
    }

    /// Simulated time between logged states, s.
    pub fn log_interval(&self) -> f64 {
        self.log.interval.unwrap_or(self.time.end / 100.0)
    }

    /// Simulated time between checkpoints, s.
    pub fn checkpoint_interval(&self) -> f64 {
        self.log.checkpoint.unwrap_or(self.time.end / 10.0)
    }

    /// The `[[verify]]` tables, read as `T`.
    ///
    /// # Errors
    /// The first mistake in them.
    pub fn verify_entries<T: DeserializeOwned + JsonSchema>(&self) -> Result<Vec<T>> {
        let table = self.table();
        let reader = Reader {
            file: &self.file,
            table: &table,
        };
        let entries = reader.list("verify")?;
        entries
            .into_iter()
            .map(|v| reader.section("[[verify]]", v))
            .collect()
    }

    fn check_times(&self) -> Result<()> {
        let positive = [
            ("time.end", Some(self.time.end)),
            ("log.interval", self.log.interval),
            ("log.checkpoint", self.log.checkpoint),
        ];
        for (key, value) in positive {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(self.error_at(
                    key,
                    format!("`{key}` cannot be {value}"),
                    "expected a time above 0 s",
                ));
            }
        }
        let mut last = 0.0;
        for stage in &self.time.stages {
            // a NaN is refused, too
            if !(stage.from > last && stage.from < self.time.end) {
                let message = format!("a stage of `time.stages` cannot start at {} s", stage.from);
                let expected = "expected starts above 0 s and below the end, in the order of time";
                return Err(self.error_at("time.stages", message, expected));
            }
            last = stage.from;
        }
        let safety = self.time.safety;
        if !(safety > 0.0 && safety <= 1.0) {
            let message = format!("`time.safety` cannot be {safety}");
            return Err(self.error_at(
                "time.safety",
                message,
                "expected a number above 0 and up to 1",
            ));
        }
        Ok(())
    }

    /// A mistake at a dotted key of the whole file.
    fn error_at(&self, key: &str, message: impl Into<String>, expected: &str) -> Box<CaseError> {
        let path: Vec<&str> = key.split('.').collect();
        let span = self.place(&path).unwrap_or(0..0);
        CaseError::new(&self.file, message, span).expected(expected)
    }

    /// Place of the value at `path`, or of the deepest part that is there.
    fn place(&self, path: &[&str]) -> Option<Range<usize>> {
        locate::find(&self.table(), path).map(|place| place.value)
    }

    /// The parsed text: parsed anew, because it borrows from the text.
    fn table(&self) -> TomlTable<'_> {
        parse(&self.file).unwrap_or_default()
    }
}

fn parse(file: &Arc<CaseFile>) -> Result<TomlTable<'_>> {
    let parsed = DeTable::parse(&file.text).map_err(|e| {
        let message = format!("this is not valid TOML: {}", e.message());
        CaseError::new(file, message, e.span().unwrap_or(0..0))
    })?;
    Ok(parsed.into_inner())
}

/// Reads sections out of a parsed file.
struct Reader<'a, 'i> {
    file: &'a Arc<CaseFile>,
    table: &'a TomlTable<'i>,
}

impl<'a, 'i> Reader<'a, 'i> {
    /// Reads one section as `T`.
    fn section<T: DeserializeOwned + JsonSchema>(
        &self,
        name: &str,
        value: &TomlValue<'i>,
    ) -> Result<T> {
        let Some(table) = value.get_ref().as_table() else {
            let message = format!("`{name}` is not a table");
            return Err(CaseError::new(self.file, message, value.span())
                .expected(format!("expected a section headed `{name}`")));
        };
        T::deserialize(ValueDeserializer::from(value.clone())).map_err(|e| {
            let section = Section {
                file: self.file,
                name: name.to_string(),
                header: value.span(),
                table,
                schema: schemars::schema_for!(T).to_value(),
            };
            section.reword(&e)
        })
    }

    fn optional<T: DeserializeOwned + JsonSchema>(&self, key: &str) -> Result<Option<T>> {
        let value = self.table.get(key);
        value
            .map(|v| self.section(&format!("[{key}]"), v))
            .transpose()
    }

    /// The tables `[key.<name>]`, in file order.
    fn named(&self, key: &str) -> Result<Vec<(String, &'a TomlValue<'i>)>> {
        let Some(value) = self.table.get(key) else {
            return Ok(Vec::new());
        };
        let Some(table) = value.get_ref().as_table() else {
            return Err(
                CaseError::new(self.file, format!("`{key}` is not a table"), value.span())
                    .expected(format!("expected sections headed `[{key}.<name>]`")),
            );
        };
        let mut all: Vec<_> = table.iter().collect();
        all.sort_by_key(|(name, _)| name.span().start);
        Ok(all
            .into_iter()
            .map(|(name, v)| (name.get_ref().to_string(), v))
            .collect())
    }

    /// The tables `[[key]]`.
    fn list(&self, key: &str) -> Result<Vec<&'a TomlValue<'i>>> {
        let Some(value) = self.table.get(key) else {
            return Ok(Vec::new());
        };
        let tables = value
            .get_ref()
            .as_array()
            .map(|a| a.iter().collect::<Vec<_>>());
        match tables {
            Some(tables) if tables.iter().all(|v| v.get_ref().is_table()) => Ok(tables),
            _ => Err(CaseError::new(
                self.file,
                format!("`{key}` is not a list of tables"),
                value.span(),
            )
            .expected(format!(
                "expected sections headed `[[{key}]]`, in double brackets"
            ))),
        }
    }
}

/// The table of a plugin without its `type` and `name`, for its constructor.
fn own_keys<'i>(value: &TomlValue<'i>) -> TomlValue<'i> {
    let mut table = value.get_ref().as_table().cloned().unwrap_or_default();
    table.remove("type");
    table.remove("name");
    Spanned::new(value.span(), DeValue::Table(table))
}
