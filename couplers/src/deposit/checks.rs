//! Checks of the keys of a deposit.

use perimelt_core::{Face, SetupError};

use super::births::{Bead, Layers};
use super::{Deposit, DepositHeat};
use crate::toolpath::TimedPath;

impl Deposit {
    /// Refuses heat that comes from no source, or from one without an end.
    pub(super) fn check_heat(&self, path: Option<&TimedPath>) -> Result<(), SetupError> {
        if let Some(feed) = self
            .feed_temperature
            .filter(|t| !(*t > 0.0 && t.is_finite()))
        {
            let message = format!("`feed_temperature` is {feed} K");
            return Err(SetupError::value(
                "feed_temperature",
                message,
                "a temperature above 0 K",
            ));
        }
        if self.heat == DepositHeat::Added {
            return Ok(());
        }
        let message = match path {
            Some(_) if self.source.is_none() => {
                "the heat of the material comes from a source, but `source` is missing"
            }
            Some(path) if path.track().end().is_none() => {
                "the source that heats the material has a toolpath without an end"
            }
            Some(_) => return Ok(()),
            None => "the heat of layers comes from no source",
        };
        let expected = "`source`, a heat source with a toolpath that ends, or `heat = \"added\"`";
        Err(SetupError::value("heat", message, expected))
    }
}

pub(super) fn check_bead(bead: &Bead) -> Result<(), SetupError> {
    for (key, value) in [("width", bead.width), ("height", bead.height)] {
        if !(value > 0.0 && value.is_finite()) {
            let message = format!("the bead has a {key} of {value} m");
            return Err(SetupError::value(
                format!("bead.{key}"),
                message,
                "a length above 0 m",
            ));
        }
    }
    Ok(())
}

pub(super) fn check_layers(layers: &Layers, spacing: f64) -> Result<(), SetupError> {
    let thickness = layers.height * f64::from(layers.at_once);
    if !(thickness >= spacing * (1.0 - 1e-6) && thickness.is_finite()) {
        let message = format!(
            "{} layers of {} m at once are thinner than the spacing {spacing} m",
            layers.at_once, layers.height
        );
        let expected = "layers of one spacing or more, or more of them `at_once`";
        return Err(SetupError::value("layers.height", message, expected));
    }
    for (key, value) in [("interval", layers.interval), ("first", layers.first)] {
        if !(value >= 0.0 && value.is_finite()) {
            let message = format!("`{key}` is {value} s");
            let expected = "a time of 0 s or more";
            return Err(SetupError::value(
                format!("layers.{key}"),
                message,
                expected,
            ));
        }
    }
    Ok(())
}

/// The direction of build, if it lies within the dimensions of the body.
pub(super) fn direction(up: Option<Face>, dimension: usize) -> Result<Face, SetupError> {
    let usual = [Face::XMax, Face::YMax, Face::ZMax][dimension - 1];
    let up = up.unwrap_or(usual);
    if up.axis() >= dimension {
        let message = format!(
            "a {dimension}D body is not built up towards `{}`",
            up.name()
        );
        let expected = "a direction within the body's dimensions";
        return Err(SetupError::value("up", message, expected));
    }
    Ok(up)
}
