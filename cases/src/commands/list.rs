//! `perimelt list`: everything that a case file can name.

use std::io::Write;

use perimelt_core::field::keys;
use perimelt_core::law::{Law, LawKind, LawRegistration};
use perimelt_core::material::known_properties;
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Change, Coupler, Physics};
use perimelt_physics::fluid::state::StateLaw;
use perimelt_physics::fluid::viscosity::ViscositySweep;
use perimelt_physics::mechanical::law::ElasticLaw;
use perimelt_physics::mechanical::plasticity::FlowSweep;
use perimelt_physics::thermal::conductivity::AnyConductivity;
use schemars::{Schema, SchemaGenerator, schema_for};

use super::Done;
use crate::{case::schema, library};

#[derive(clap::Args, Debug)]
pub struct ListArgs {
    /// Print instead, as a Markdown table, what may happen to the points of a body on which each plugin acts
    #[arg(long)]
    support: bool,
}

pub fn run(args: &ListArgs) -> Done {
    let out = &mut crate::terminal::output();
    match args.support {
        true => Ok(write!(out, "{}", support())?),
        false => names(out),
    }
}

/// All names, in sections whose headings are not indented; sorted in each.
fn names(out: &mut impl Write) -> Done {
    writeln!(
        out,
        "Physics ([[physics]], type = ...; more by `perimelt explain <type>`)"
    )?;
    plugins::<dyn Physics>(out)?;
    writeln!(out, "\nCouplers ([[couplers]], type = ...)")?;
    plugins::<dyn Coupler>(out)?;
    for kind in LAWS {
        writeln!(
            out,
            "\nLaws ({}; more by `perimelt explain {}.<name>`)",
            kind.place(),
            kind.key
        )?;
        for (name, meaning) in (kind.names)() {
            row(out, name, &meaning)?;
        }
    }
    writeln!(out, "\nFields (the common ones; plugins may add their own)")?;
    let mut fields = keys::ALL.to_vec();
    fields.sort_by_key(|(name, ..)| *name);
    for (name, unit, meaning) in fields {
        row(out, name, &format!("[{unit}] {meaning}"))?;
    }
    writeln!(out, "\nMaterial properties ([materials.<name>])")?;
    for key in known_properties() {
        let directions = match key.has_directions {
            true => "; may differ by direction",
            false => "",
        };
        let about = format!("[{}] {}{directions}", key.unit, key.meaning);
        row(out, key.name, &about)?;
    }
    writeln!(
        out,
        "\nMaterials of the library (material = ..., or library = ... in [materials.<name>])"
    )?;
    for name in library::names() {
        let material = library::find(name);
        row(
            out,
            name,
            material
                .as_ref()
                .and_then(|m| m.description())
                .unwrap_or(""),
        )?;
    }
    Ok(())
}

/// A kind of law with the plugin that takes it.
pub(super) struct KindOfLaw {
    /// Key of the plugin.
    pub key: &'static str,
    plugin: &'static str,
    /// Schema of the key.
    pub schema: fn() -> Schema,
    /// Names and meanings.
    names: fn() -> Vec<(&'static str, String)>,
}

/// All kinds of laws.
pub(super) const LAWS: [KindOfLaw; 5] = [
    KindOfLaw::of::<dyn ElasticLaw>("mechanical"),
    KindOfLaw::of::<dyn FlowSweep>("mechanical"),
    KindOfLaw::of::<dyn StateLaw>("fluid"),
    KindOfLaw::of::<dyn ViscositySweep>("fluid"),
    KindOfLaw::of::<dyn AnyConductivity>("thermal"),
];

impl KindOfLaw {
    const fn of<P: LawKind + ?Sized>(plugin: &'static str) -> Self {
        KindOfLaw {
            key: P::KEY,
            plugin,
            schema: || schema_for!(Law<P>),
            names: names_of_laws::<P>,
        }
    }

    /// Where a case file gives a law of this kind.
    pub fn place(&self) -> String {
        let KindOfLaw { key, plugin, .. } = self;
        format!("{key}.<name> = {{ ... }} in `{plugin}`")
    }
}

fn names_of_laws<P: LawKind + ?Sized>() -> Vec<(&'static str, String)> {
    let one = |law: &LawRegistration<P>| {
        let mut generator = SchemaGenerator::default();
        let schema = (law.schema)(&mut generator).to_value();
        let root = serde_json::json!({ "$defs": generator.take_definitions(true) });
        (law.name, schema::one_line(&root, &schema))
    };
    P::registered().into_iter().map(one).collect()
}

/// The table of what may happen to points, by plugin.
pub(crate) fn support() -> String {
    let names = Change::ALL.map(Change::name).join(" | ");
    let rule = " --- |".repeat(Change::ALL.len() + 1);
    let physics = registered::<dyn Physics>();
    let physics = physics.iter().map(|r| (r.name, r.supports));
    let couplers = registered::<dyn Coupler>();
    let couplers = couplers.iter().map(|r| (r.name, r.supports));
    let rows = physics.chain(couplers).map(|(name, supports)| {
        let cells = Change::ALL.map(|change| match supports.contains(change) {
            true => "yes",
            false => "",
        });
        format!("| `{name}` | {} |\n", cells.join(" | "))
    });
    format!(
        "| plugin | {names} |\n|{rule}\n{}",
        rows.collect::<String>()
    )
}

/// A line for each plugin of one kind.
pub(super) fn plugins<P: ?Sized + 'static>(out: &mut impl Write) -> Done
where
    Registration<P>: inventory::Collect,
{
    for plugin in registered::<P>() {
        let schema = (plugin.schema)().to_value();
        row(out, plugin.name, &schema::one_line(&schema, &schema))?;
    }
    Ok(())
}

fn row(out: &mut impl Write, name: &str, text: &str) -> Done {
    Ok(writeln!(out, "  {name:<24} {text}")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_in_every_section() {
        let mut text = Vec::new();
        names(&mut text).expect("written");
        let text = String::from_utf8(text).expect("text");
        let sections: Vec<&str> = text.split("\n\n").collect();
        assert!(sections.len() > LAWS.len() + 4, "{text}");
        for section in sections {
            let rows = section.lines().filter_map(|row| row.strip_prefix("  "));
            let names: Vec<_> = rows.map(|row| row.split_whitespace().next()).collect();
            assert!(!names.is_empty() && names.is_sorted(), "{section}");
        }
    }

    #[test]
    fn the_guide_has_the_table_of_support() {
        let guide = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/guide/plugins.md");
        let guide = std::fs::read_to_string(guide).expect("the guide");
        // plugins of tests may be registered, too
        for row in support().lines() {
            assert!(guide.contains(row), "`perimelt list --support`: {row}");
        }
    }
}
