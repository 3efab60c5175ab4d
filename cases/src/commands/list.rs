//! `perimelt list`: everything that a case file can name.

use std::io::Write;

use perimelt_core::field::keys;
use perimelt_core::material::known_properties;
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Coupler, Physics};

use super::Done;
use crate::{case::schema, library};

pub fn run() -> Done {
    let out = &mut crate::terminal::output();
    writeln!(
        out,
        "Physics ([[physics]], type = ...; more by `perimelt explain <type>`)"
    )?;
    plugins::<dyn Physics>(out)?;
    writeln!(out, "\nCouplers ([[couplers]], type = ...)")?;
    plugins::<dyn Coupler>(out)?;
    writeln!(out, "\nFields (the common ones; plugins may add their own)")?;
    for (name, unit, meaning) in keys::ALL {
        row(out, name, &format!("[{unit}] {meaning}"))?;
    }
    writeln!(out, "\nMaterial properties ([materials.<name>])")?;
    for key in known_properties() {
        row(out, key.name, &format!("[{}] {}", key.unit, key.meaning))?;
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
