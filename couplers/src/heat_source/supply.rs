//! Toolpath, voltage, current and pulses of a moving source.

use perimelt_core::{SetupError, shared_keys};

use crate::toolpath::{Pulse, Toolpath};

shared_keys! {
    /// Keys that every moving source has besides those of its shape.
    #[derive(Clone, Debug, PartialEq)]
    pub(super) struct Supply {
        /// Where the source is, which way it travels and how strong it is.
        pub toolpath: Toolpath,
        /// Voltage (V) of an arc or a beam; times `current` it is the power, instead of `power`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub voltage: Option<f64>,
        /// Current (A) of an arc or a beam; times `voltage` it is the power, instead of `power`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub current: Option<f64>,
        /// Pulses of the power; default none.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub pulse: Option<Pulse>,
    }
}

impl Supply {
    /// The power where the toolpath gives none (W), before efficiency: that of the shape, or voltage times current.
    ///
    /// # Errors
    /// A number out of its range, one of both alone, or two powers.
    pub fn power(&self, of_shape: Option<f64>) -> Result<Option<f64>, SetupError> {
        for (key, value, unit) in [
            ("power", of_shape, "W"),
            ("voltage", self.voltage, "V"),
            ("current", self.current, "A"),
        ] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v >= 0.0)) {
                let message = format!("`{key}` of the heat source is {value}");
                let expected = format!("a finite number, zero or greater, {unit}");
                return Err(SetupError::value(key, message, expected));
            }
        }
        match (of_shape, self.voltage, self.current) {
            (power, None, None) => Ok(power),
            (None, Some(voltage), Some(current)) => Ok(Some(voltage * current)),
            (None, Some(_), None) => Err(SetupError::value(
                "voltage",
                "`voltage` of the heat source is given without `current`",
                "both `voltage` and `current`, or `power`",
            )),
            (None, None, Some(_)) => Err(SetupError::value(
                "current",
                "`current` of the heat source is given without `voltage`",
                "both `voltage` and `current`, or `power`",
            )),
            (Some(_), ..) => Err(SetupError::value(
                "power",
                "`power` of the heat source is given besides its voltage or current",
                "`power` alone, or `voltage` and `current`",
            )),
        }
    }

    /// The pulses, if they are given.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn pulse(&self) -> Result<Option<Pulse>, SetupError> {
        if let Some((key, value, expected)) = self.pulse.and_then(|pulse| pulse.fault()) {
            let message = format!("`pulse.{key}` of the heat source is {value}");
            return Err(SetupError::value(format!("pulse.{key}"), message, expected));
        }
        Ok(self.pulse)
    }
}
