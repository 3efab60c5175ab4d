//! The tables of plugins, and the plugins that are built from them.

use std::sync::Arc;

use perimelt_core::plugin::{Registration, registered};
use perimelt_core::simulation::Named;
use perimelt_core::{Body, Coupler, Physics};
use toml::Spanned;
use toml::de::DeValue;

use super::bodies::suggest;
use super::error::{CaseFile, Mistake};
use super::locate::{self, TomlValue};
use super::reader::Reader;
use super::{Case, CaseError, Result};

/// A `[[physics]]` or `[[couplers]]` table.
pub(super) struct PluginTable<'a> {
    section: &'static str,
    pub(super) kind: String,
    pub(super) value: TomlValue<'a>,
}

/// A plugin with its table.
type Built<'i, P> = (Named<P>, PluginTable<'i>);

/// The plugins of a case, each with its table.
pub(super) struct Plugins<'i> {
    pub(super) couplers: Vec<Built<'i, dyn Coupler>>,
    pub(super) physics: Vec<Built<'i, dyn Physics>>,
}

impl Case {
    /// The tables of a section of plugins.
    pub(super) fn plugin_tables(
        &self,
        section: &'static str,
    ) -> Result<Vec<PluginTable<'_>>, CaseError> {
        let table = self.table();
        let mut reader = Reader::new(&self.file, &table);
        let tables = reader.plugin_tables(section);
        reader.finish(tables)
    }
}

impl<'i> Reader<'_, 'i> {
    /// The tables of a section of plugins.
    pub(super) fn plugin_tables(&mut self, section: &'static str) -> Vec<PluginTable<'i>> {
        let tables = self.tables(section).into_iter();
        tables
            .filter_map(|value| {
                let kind = self.plugin_type(section, value);
                Some(PluginTable {
                    section,
                    kind: self.mistakes.collect(kind)?,
                    value: value.clone(),
                })
            })
            .collect()
    }

    /// The `type` of a plugin.
    fn plugin_type(&self, section: &'static str, value: &TomlValue<'_>) -> Result<String> {
        let Some(kind) = value.get_ref().as_table().and_then(|t| t.get("type")) else {
            let message = format!("key `type` is missing in [[{section}]]");
            return Err(Mistake::new(self.file, message, value.span())
                .expected("needs `type = \"...\"`")
                .help(format!("known here: {}", plugin_names(section).join(", "))));
        };
        let text = kind.get_ref().as_str().map(String::from);
        text.ok_or_else(|| {
            Mistake::new(self.file, "`type` is not text", kind.span())
                .expected("expected a name in quotes")
        })
    }

    /// Whether this program has all plugins of the case. It refuses others.
    pub(super) fn has_known_plugins(&mut self) -> bool {
        let mut are_known = true;
        for section in ["physics", "couplers"] {
            let known = plugin_names(section);
            for table in self.plugin_tables(section) {
                if !known.contains(&table.kind.as_str()) {
                    are_known = false;
                    let unknown = unknown_plugin(self.file, &table);
                    self.mistakes.add(unknown);
                }
            }
        }
        are_known
    }

    /// Builds all plugins.
    pub(super) fn plugins(&mut self) -> Plugins<'i> {
        Plugins {
            couplers: self.build("couplers"),
            physics: self.build("physics"),
        }
    }

    /// Builds the plugins of one section, with labels that differ.
    fn build<P: ?Sized + 'static>(&mut self, section: &'static str) -> Vec<Built<'i, P>>
    where
        Registration<P>: inventory::Collect,
    {
        let known = registered::<P>();
        let mut plugins: Vec<Built<'i, P>> = Vec::new();
        for table in self.plugin_tables(section) {
            let found = known.iter().find(|r| r.name == table.kind);
            let found = found.ok_or_else(|| unknown_plugin(self.file, &table));
            let Some(found) = self.mistakes.collect(found) else {
                continue;
            };
            let own_keys = own_keys(&table.value);
            let plugin = self.keys(&table.title(), &own_keys, found.schema, found.from_toml);
            let label = table.label(self.file, |label| {
                plugins.iter().any(|(p, _)| p.label == label)
            });
            if let (Some(plugin), Some(label)) = (plugin, self.mistakes.collect(label)) {
                plugins.push((Named { label, plugin }, table));
            }
        }
        plugins
    }
}

fn unknown_plugin(file: &Arc<CaseFile>, table: &PluginTable<'_>) -> Box<Mistake> {
    let (kind, other) = match table.section {
        "physics" => ("physics", "couplers"),
        _ => ("coupler", "physics"),
    };
    let span = table.at("type");
    let message = format!("no {kind} is called `{}`", table.kind);
    let error = Mistake::new(file, message, span).expected("no such type");
    if plugin_names(other).contains(&table.kind.as_str()) {
        return error.help(format!(
            "`{}` belongs to a section headed `[[{other}]]`",
            table.kind
        ));
    }
    suggest(error, &table.kind, &plugin_names(table.section))
}

impl PluginTable<'_> {
    /// The `name` of a plugin, or its type and body with a number where several are alike.
    fn label(&self, file: &Arc<CaseFile>, is_taken: impl Fn(&str) -> bool) -> Result<String> {
        let keys = self.value.get_ref().as_table();
        if let Some(name) = keys.and_then(|t| t.get("name")) {
            let error = |message: String, expected: &str| {
                Err(Mistake::new(file, message, name.span()).expected(expected))
            };
            return match name.get_ref().as_str() {
                Some("") | None => error("`name` is not text".into(), "expected a name in quotes"),
                Some(taken) if is_taken(taken) => {
                    let section = self.section;
                    let message = format!("another table of {section} is called `{taken}`");
                    error(message, "expected a name of its own")
                }
                Some(name) => Ok(name.to_string()),
            };
        }
        let base = match self.body() {
            Some(body) => format!("{} on {body}", self.kind),
            None => self.kind.clone(),
        };
        let mut label = base.clone();
        let mut number = 2;
        while is_taken(&label) {
            label = format!("{base} ({number})");
            number += 1;
        }
        Ok(label)
    }

    pub(super) fn title(&self) -> String {
        format!("[[{}]] `{}`", self.section, self.kind)
    }

    /// The text of a key.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.value.get_ref().get(key)?.get_ref().as_str()
    }

    /// Name of the body, where the table gives it.
    pub(super) fn body(&self) -> Option<&str> {
        self.text("body")
    }

    /// Number of the body, the first one where the table gives none.
    pub(super) fn body_index(&self, bodies: &[Body]) -> Option<usize> {
        let place = |name| bodies.iter().position(|b| b.name == name);
        self.body().map_or(Some(0), place)
    }

    /// Place of a dotted key's value, or of the header when it is not written.
    pub(super) fn at(&self, key: &str) -> std::ops::Range<usize> {
        let path: Vec<&str> = key.split('.').collect();
        let table = self.value.get_ref().as_table();
        let place = table.and_then(|t| locate::find(t, &path));
        place.map_or(self.value.span(), |p| p.value)
    }
}

/// The table of a plugin without its `type` and `name`, for its constructor.
fn own_keys<'i>(value: &TomlValue<'i>) -> TomlValue<'i> {
    let mut table = value.get_ref().as_table().cloned().unwrap_or_default();
    table.remove("type");
    table.remove("name");
    Spanned::new(value.span(), DeValue::Table(table))
}

/// Registered types of a section.
pub(crate) fn plugin_names(section: &str) -> Vec<&'static str> {
    if section == "physics" {
        registered::<dyn Physics>().iter().map(|r| r.name).collect()
    } else {
        registered::<dyn Coupler>().iter().map(|r| r.name).collect()
    }
}
