//! Reads the sections of a parsed case file, each on its own, and collects their mistakes.

use std::sync::Arc;

use perimelt_core::error::nearest;
use schemars::{JsonSchema, Schema, schema_for};
use serde::de::DeserializeOwned;
use toml::de::{DeValue, ValueDeserializer};

use super::SECTIONS;
use super::contradictions::{WrongNumber, wrong_numbers};
use super::error::{CaseError, CaseFile, Mistake, Mistakes};
use super::locate::{self, TomlTable, TomlValue};
use super::reword::SectionContext;
use super::sections::{LogSection, TimeSection};

/// Reads sections out of a parsed file.
pub(super) struct Reader<'a, 'i> {
    pub(super) file: &'a Arc<CaseFile>,
    table: &'a TomlTable<'i>,
    pub(super) mistakes: Mistakes,
}

impl<'a, 'i> Reader<'a, 'i> {
    pub(super) fn new(file: &'a Arc<CaseFile>, table: &'a TomlTable<'i>) -> Self {
        Reader {
            file,
            table,
            mistakes: Mistakes::default(),
        }
    }

    /// Whether there is no mistake.
    pub(super) fn is_right(&self) -> bool {
        self.mistakes.is_empty()
    }

    /// The value read, if there is no mistake.
    ///
    /// # Errors
    /// The mistakes.
    pub(super) fn finish<T>(self, value: T) -> std::result::Result<T, CaseError> {
        self.mistakes.finish(value)
    }

    fn add(&mut self, mistake: Box<Mistake>) {
        self.mistakes.add(mistake);
    }

    /// Whether the file has no table or list `key`, or an empty one.
    fn is_empty(&self, key: &str) -> bool {
        let value = self.table.get(key).map(|value| value.get_ref());
        value.is_none_or(|value| match value {
            DeValue::Table(table) => table.is_empty(),
            DeValue::Array(list) => list.is_empty(),
            _ => false,
        })
    }

    /// Refuses numbers that are not finite, or so large or small that no quantity in SI units has them, wherever they are.
    pub(super) fn check_numbers(&mut self) {
        let mut wrong = Vec::new();
        for (key, value) in self.table.iter() {
            wrong_numbers(value.get_ref(), key.get_ref(), value.span(), &mut wrong);
        }
        for WrongNumber { path, number, span } in wrong {
            let expected = match number.is_finite() {
                true => "expected zero, or a magnitude from 1e-100 to 1e100, in SI units",
                false => "expected a finite number",
            };
            let message = format!("`{path}` is {}", perimelt_core::text::number(number, 6));
            let mistake = Mistake::new(self.file, message, span);
            self.add(mistake.expected(expected));
        }
    }

    /// Refuses unknown sections, and a case without a body, a physics or a time. A section that is misspelt is not missing.
    pub(super) fn check_sections(&mut self) {
        let unknown = self
            .table
            .keys()
            .filter(|k| !SECTIONS.contains(&&**k.get_ref()));
        for key in unknown {
            let message = format!("unknown section `{}`", key.get_ref());
            let mistake = Mistake::new(self.file, message, key.span());
            let mistake = match nearest(key.get_ref(), SECTIONS) {
                Some(close) => mistake.expected(format!("did you mean `{close}`?")),
                None => mistake.expected("no such section"),
            };
            let known = SECTIONS.join(", ");
            self.add(mistake.help(format!("sections are, in this order: {known}")));
        }
        if !self.is_right() {
            return;
        }
        if self.is_empty("bodies") {
            let mistake = Mistake::of_file(self.file, "the case has no body");
            self.add(
                mistake
                    .help("add a section `[bodies.<name>]` with `shape`, `spacing` and `material`"),
            );
        }
        if self.is_empty("physics") {
            let mistake = Mistake::of_file(self.file, "the case has no physics");
            self.add(
                mistake.help("add a section `[[physics]]` with a `type`, see `perimelt list`"),
            );
        }
        if !self.table.contains_key("time") {
            let mistake = Mistake::of_file(self.file, "section `[time]` is missing");
            self.add(mistake.help("add `[time]` with `end`, the end of the simulated time in s"));
        }
    }

    /// Refuses times that cannot be simulated.
    pub(super) fn check_times(&mut self, time: Option<&TimeSection>, log: Option<&LogSection>) {
        let positive = [
            ("time.end", time.map(|time| time.end)),
            ("log.interval", log.and_then(|log| log.interval)),
            ("log.checkpoint", log.and_then(|log| log.checkpoint)),
        ];
        for (key, value) in positive {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                let message = format!("`{key}` cannot be {value}");
                self.add(self.mistake_at(key, message, "expected a time above 0 s"));
            }
        }
        let Some(time) = time else { return };
        let mut last = 0.0;
        for stage in &time.stages {
            // a NaN is refused, too
            if !(stage.from > last && stage.from < time.end) {
                let message = format!("a stage of `time.stages` cannot start at {} s", stage.from);
                let expected = "expected starts above 0 s and below the end, in the order of time";
                self.add(self.mistake_at("time.stages", message, expected));
                break;
            }
            last = stage.from;
        }
        let mut last = 0.0;
        for stage in log.map_or(&[][..], |log| &log.stages) {
            let at = "log.stages";
            if !(stage.until > last && stage.until.is_finite()) {
                let message = format!("a stage of `{at}` cannot last until {} s", stage.until);
                let expected = "expected ends above 0 s, in the order of time";
                self.add(self.mistake_at(at, message, expected));
                break;
            }
            if !(stage.interval > 0.0 && stage.interval.is_finite()) {
                let interval = stage.interval;
                let message = format!("the interval of a stage of `{at}` cannot be {interval}");
                self.add(self.mistake_at(at, message, "expected a time above 0 s"));
                break;
            }
            last = stage.until;
        }
        let safety = time.safety;
        if !(safety > 0.0 && safety <= 1.0) {
            let message = format!("`time.safety` cannot be {safety}");
            let expected = "expected a number above 0 and up to 1";
            self.add(self.mistake_at("time.safety", message, expected));
        }
        let Some(iteration) = time.iteration else {
            return;
        };
        let tolerance = iteration.tolerance;
        if !(tolerance > 0.0 && tolerance < 1.0) {
            let message = format!("`time.iteration.tolerance` cannot be {tolerance}");
            let expected = "expected a number above 0 and below 1";
            self.add(self.mistake_at("time.iteration.tolerance", message, expected));
        }
        if iteration.passes < 2 {
            let message = format!("`time.iteration.passes` cannot be {}", iteration.passes);
            let expected = "expected 2 or more: the states of two passes are compared";
            self.add(self.mistake_at("time.iteration.passes", message, expected));
        }
    }

    /// A mistake at a dotted key of the whole file.
    pub(super) fn mistake_at(
        &self,
        key: &str,
        message: impl Into<String>,
        expected: &str,
    ) -> Box<Mistake> {
        let path: Vec<&str> = key.split('.').collect();
        let span = locate::find(self.table, &path).map_or(0..0, |place| place.value);
        Mistake::new(self.file, message, span).expected(expected)
    }

    /// The section `[key]`, where the file has it.
    pub(super) fn optional<T: DeserializeOwned + JsonSchema>(&mut self, key: &str) -> Option<T> {
        let value = self.table.get(key)?;
        self.section(&format!("[{key}]"), value)
    }

    /// The tables `[key.<name>]`, in file order.
    pub(super) fn named<T: DeserializeOwned + JsonSchema>(
        &mut self,
        key: &str,
    ) -> Vec<(String, T)> {
        let Some(value) = self.table.get(key) else {
            return Vec::new();
        };
        let Some(table) = value.get_ref().as_table() else {
            let message = format!("`{key}` is not a table");
            let expected = format!("expected sections headed `[{key}.<name>]`");
            self.add(Mistake::new(self.file, message, value.span()).expected(expected));
            return Vec::new();
        };
        let mut all: Vec<_> = table.iter().collect();
        all.sort_by_key(|(name, _)| name.span().start);
        let read = all.into_iter().filter_map(|(name, value)| {
            let section = self.section(&format!("[{key}.{}]", name.get_ref()), value)?;
            Some((name.get_ref().to_string(), section))
        });
        read.collect()
    }

    /// The tables `[[key]]`, read as `T`.
    pub(super) fn list<T: DeserializeOwned + JsonSchema>(&mut self, key: &str) -> Vec<T> {
        let tables = self.tables(key).into_iter();
        tables
            .filter_map(|value| self.section(&format!("[[{key}]]"), value))
            .collect()
    }

    /// The tables `[[key]]`.
    pub(super) fn tables(&mut self, key: &str) -> Vec<&'a TomlValue<'i>> {
        let Some(value) = self.table.get(key) else {
            return Vec::new();
        };
        match value.get_ref().as_array() {
            Some(tables) if tables.iter().all(|v| v.get_ref().is_table()) => {
                tables.iter().collect()
            }
            _ => {
                let message = format!("`{key}` is not a list of tables");
                let expected = format!("expected sections headed `[[{key}]]`, in double brackets");
                self.add(Mistake::new(self.file, message, value.span()).expected(expected));
                Vec::new()
            }
        }
    }

    /// Reads one section as `T`.
    fn section<T: DeserializeOwned + JsonSchema>(
        &mut self,
        name: &str,
        value: &TomlValue<'i>,
    ) -> Option<T> {
        let read = |keys: ValueDeserializer<'_>| T::deserialize(keys);
        self.keys(name, value, || schema_for!(T), read)
    }

    /// Reads the keys of a section. Reading ends at the first mistake, so it is repeated without the key at fault; a
    /// key that is then missing, or any other mistake of the section as a whole, may come from that.
    pub(super) fn keys<T>(
        &mut self,
        name: &str,
        value: &TomlValue<'i>,
        schema: impl Fn() -> Schema,
        read: impl Fn(ValueDeserializer<'i>) -> std::result::Result<T, toml::de::Error>,
    ) -> Option<T> {
        let Some(table) = value.get_ref().as_table() else {
            let mistake = Mistake::new(self.file, format!("`{name}` is not a table"), value.span());
            self.add(mistake.expected(format!("expected a section headed `{name}`")));
            return None;
        };
        let mut rest = value.clone();
        let mut is_first = true;
        loop {
            let error = match read(ValueDeserializer::from(rest.clone())) {
                Ok(result) => return is_first.then_some(result),
                Err(error) => error,
            };
            let section = SectionContext {
                file: self.file,
                name: name.to_string(),
                header: value.span(),
                table,
                schema: schema().to_value(),
            };
            let at_fault = section.path(&error).into_iter().next();
            if is_first || at_fault.is_some() {
                self.add(section.reword(&error));
            }
            if is_first {
                let others = section.others_missing(&error);
                others
                    .into_iter()
                    .for_each(|mistake| self.add(Box::new(mistake)));
            }
            is_first = false;
            let mut without = rest.get_ref().as_table()?.clone();
            without.remove(at_fault?.as_str())?;
            rest = TomlValue::new(value.span(), DeValue::Table(without));
        }
    }
}
