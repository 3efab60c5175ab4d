//! Checks of the keys of a deposit.

use perimelt_core::numbers::{check_at_least, check_positive};
use perimelt_core::{Face, SetupError};

use super::births::{Bead, Layers};
use super::{Deposit, DepositHeat};
use crate::toolpath::TimedPath;

impl Deposit {
    /// Refuses heat that comes from no source, or from one without an end.
    pub(super) fn check_heat(&self, path: Option<&TimedPath>) -> Result<(), SetupError> {
        check_positive("feed_temperature", self.feed_temperature, "K")?;
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
            None => "no source heats the layers",
        };
        let expected = "`source`, a heat source with a toolpath that ends, or `heat = \"added\"`";
        Err(SetupError::value("heat", message, expected))
    }
}

pub(super) fn check_bead(bead: &Bead) -> Result<(), SetupError> {
    check_positive("bead.width", bead.width, "m")?;
    check_positive("bead.height", bead.height, "m")?;
    Ok(())
}

pub(super) fn check_layers(layers: &Layers, spacing: f64) -> Result<(), SetupError> {
    let thickness = layers.height * f64::from(layers.at_once);
    if !(thickness >= spacing * (1.0 - 1e-6) && thickness.is_finite()) {
        let message = format!(
            "{} layers of {} m, which are added at once, are thinner than the spacing {spacing} m",
            layers.at_once, layers.height
        );
        let expected = "layers of one spacing or more, or a larger `at_once`";
        return Err(SetupError::value("layers.height", message, expected));
    }
    check_at_least("layers.interval", layers.interval, 0.0, "s")?;
    check_at_least("layers.first", layers.first, 0.0, "s")?;
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
