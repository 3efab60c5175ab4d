//! Pulses of a source: its power alternates between the power of the toolpath and a base power.

use perimelt_core::SetupError;
use perimelt_core::numbers::{check_fraction, check_positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Switches closer together than this fraction of a period are one.
const ROUNDING: f64 = 1e-9;

/// Pulses of the power: a fraction `duty` of each period with the power of the toolpath, the rest with `base` of it. The mean power
/// is `duty + base (1 - duty)` of that of the toolpath.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pulse {
    /// Periods per second (Hz). They count from the first moment with power; during a wait of the toolpath they rest.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub frequency: f64,
    /// Fraction of a period with the power of the toolpath, above 0, at most 1; it comes first.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub duty: f64,
    /// Power in the rest of a period, as a fraction of that of the toolpath, 0 to 1; default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub base: f64,
}

impl Pulse {
    /// Refuses numbers out of their ranges.
    pub(crate) fn check(&self) -> Result<(), SetupError> {
        check_positive("pulse.frequency", self.frequency, "Hz")?;
        check_positive("pulse.duty", self.duty, "")?;
        check_fraction("pulse.duty", self.duty)?;
        check_fraction("pulse.base", self.base)?;
        Ok(())
    }
}

/// Pulses from a certain time on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pulses {
    pulse: Pulse,
    /// Start of the first period, s.
    start: f64,
}

impl Pulses {
    pub fn new(pulse: Pulse, start: f64) -> Self {
        Pulses { pulse, start }
    }

    /// Power at a time (s) as a fraction of that of the toolpath; constant between switches.
    pub fn factor(&self, time: f64) -> f64 {
        let periods = (time - self.start) * self.pulse.frequency;
        match periods - periods.floor() < self.pulse.duty {
            true => 1.0,
            false => self.pulse.base,
        }
    }

    /// The first switch after a time (s), which is no later than `event`; `event` itself where a switch coincides with it.
    pub fn next_switch(&self, after: f64, event: Option<f64>) -> Option<f64> {
        let Pulse {
            frequency,
            duty,
            base,
        } = self.pulse;
        if duty == 1.0 || base == 1.0 {
            return event;
        }
        let slack = ROUNDING / frequency;
        let period = ((after - self.start) * frequency).floor();
        let switches =
            [duty, 1.0, 1.0 + duty, 2.0].map(|part| self.start + (period + part) / frequency);
        let switch = switches.into_iter().find(|s| *s > after + slack);
        match (switch, event) {
            (Some(switch), Some(event)) if switch > event - slack => Some(event),
            (None, event) => event,
            (switch, _) => switch,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_power_switches_twice_in_a_period() {
        let pulse = Pulse {
            frequency: 4.0,
            duty: 0.4,
            base: 0.25,
        };
        let pulses = Pulses::new(pulse, 1.0);
        for (time, factor) in [
            (1.05, 1.0),
            (1.15, 0.25),
            (1.24, 0.25),
            (1.26, 1.0),
            (3.2, 0.25),
        ] {
            assert_eq!(pulses.factor(time), factor, "{time}");
        }
        let close = |found: Option<f64>, expected: f64| {
            assert!(
                (found.expect("a switch") - expected).abs() < 1e-15,
                "{found:?} {expected}"
            );
        };
        close(pulses.next_switch(1.0, None), 1.1);
        close(pulses.next_switch(1.1, None), 1.25);
        close(pulses.next_switch(1.25, Some(9.0)), 1.35);
        // the end of a move before the switch, and at it within rounding
        close(pulses.next_switch(1.25, Some(1.3)), 1.3);
        let event = 1.35 + 1e-12;
        assert_eq!(pulses.next_switch(1.25, Some(event)), Some(event));
        let event = 1.35 - 1e-12;
        assert_eq!(pulses.next_switch(1.25, Some(event)), Some(event));
        close(pulses.next_switch(event, None), 1.5);
        let whole = Pulses::new(Pulse { duty: 1.0, ..pulse }, 0.0);
        assert_eq!(whole.next_switch(0.0, None), None);
        assert_eq!(whole.factor(0.7), 1.0);
    }

    #[test]
    fn each_switch_comes_once_over_many_periods() {
        let pulse = Pulse {
            frequency: 123.7,
            duty: 0.3,
            base: 0.0,
        };
        pulse.check().expect("in range");
        let pulses = Pulses::new(pulse, 0.1);
        let mut at = 0.1;
        let mut on = 0.0;
        for switch in 0..20_000 {
            let next = pulses.next_switch(at, None).expect("a switch");
            let factor = pulses.factor(0.5 * (at + next));
            assert_eq!(factor, f64::from(u8::from(switch % 2 == 0)), "{switch}");
            on += factor * (next - at);
            at = next;
        }
        // 10,000 periods; rounding of 2e4 sums
        assert!((at - 0.1 - 1e4 / 123.7).abs() < 1e-9);
        assert!((on - 0.3e4 / 123.7).abs() < 1e-9);
    }

    #[test]
    fn values_out_of_range_are_named() {
        let pulse = |frequency, duty, base| Pulse {
            frequency,
            duty,
            base,
        };
        for (pulse, key) in [
            (pulse(0.0, 0.5, 0.0), "frequency"),
            (pulse(f64::NAN, 0.5, 0.0), "frequency"),
            (pulse(1.0, 0.0, 0.0), "duty"),
            (pulse(1.0, 1.1, 0.0), "duty"),
            (pulse(1.0, 0.5, -0.1), "base"),
            (pulse(1.0, 0.5, f64::NAN), "base"),
        ] {
            let found = pulse.check().expect_err(key).key;
            assert_eq!(found, format!("pulse.{key}"), "{pulse:?}");
        }
    }
}
