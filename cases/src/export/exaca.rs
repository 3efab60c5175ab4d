//! Solidification events for ExaCA, a cellular automaton of grain structure (Lawrence Livermore and Oak Ridge National
//! Laboratories): the format of its time-temperature history files. The first line names the columns, each further line is one
//! event of a point: x, y, z (m), times (s) at which its temperature rose above and fell below the liquidus, and the cooling
//! rate at the second (K/s).

use std::collections::HashMap;
use std::io::{self, Write};

use perimelt_core::log::LoggedCloud;

/// Fields of `thermal_history` that the events come from.
pub(super) const FIELDS: [&str; 4] = [
    "melting_time",
    "solidification_time",
    "cooling_rate",
    "solidifications",
];

/// A solidification of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    /// Position, m.
    position: [f64; 3],
    /// s.
    melted: f64,
    /// s.
    solidified: f64,
    /// Cooling rate, K/s.
    rate: f64,
}

/// The events of a body, state by state.
#[derive(Debug, Default)]
pub(super) struct Events {
    found: Vec<Event>,
    /// Number of solidifications of each point, by the bits of its position.
    counted: HashMap<[u64; 3], f64>,
    /// Number of events that another one followed before the next logged state.
    pub lost: u64,
}

impl Events {
    /// Takes the events since the state before; `None` without the fields of `thermal_history`.
    pub(super) fn take(&mut self, cloud: &LoggedCloud, positions: &[[f64; 3]]) -> Option<()> {
        let field = |name: &str| {
            let field = cloud.fields.iter().find(|field| field.name == name);
            field.map(|field| &field.values[..])
        };
        let [melted, solidified, rate, count] = FIELDS.map(field);
        let (melted, solidified, rate, count) = (melted?, solidified?, rate?, count?);
        for (point, &position) in positions.iter().enumerate() {
            let before = self.counted.entry(position.map(f64::to_bits)).or_default();
            let new = count[point] - *before;
            if new >= 1.0 {
                self.found.push(Event {
                    position,
                    melted: melted[point],
                    solidified: solidified[point],
                    rate: rate[point],
                });
                self.lost += new as u64 - 1;
                *before = count[point];
            }
        }
        Some(())
    }

    pub(super) fn write(&self, file: &mut impl Write) -> io::Result<()> {
        writeln!(file, "x,y,z,tm,tl,cr")?;
        for event in &self.found {
            let [x, y, z] = event.position;
            let (tm, tl, cr) = (event.melted, event.solidified, event.rate);
            writeln!(file, "{x},{y},{z},{tm},{tl},{cr}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::log::CloudField;

    use super::*;

    fn state(time: f64, values: [[f64; 2]; 4]) -> LoggedCloud {
        let field = |(name, values): (&str, [f64; 2])| CloudField {
            name: name.into(),
            unit: String::new(),
            components: 1,
            values: values.into(),
        };
        LoggedCloud {
            time,
            positions: vec![[0.0; 3], [1e-3, 0.0, 0.0]],
            fields: FIELDS.into_iter().zip(values).map(field).collect(),
        }
    }

    #[test]
    fn each_solidification_is_one_line_and_lost_ones_are_counted() {
        let mut events = Events::default();
        for state in [
            state(0.0, [[0.0; 2]; 4]),
            state(1.0, [[0.2, 0.0], [0.5, 0.0], [100.0, 0.0], [1.0, 0.0]]),
            // unchanged events, and the first of the other point
            state(2.0, [[0.2, 1.1], [0.5, 1.5], [100.0, 50.0], [1.0, 1.0]]),
            // again, after two that no state saw
            state(3.0, [[2.5, 1.1], [2.75, 1.5], [80.0, 50.0], [4.0, 1.0]]),
        ] {
            let positions = state.positions.clone();
            events.take(&state, &positions).expect("all fields");
        }
        let mut text = Vec::new();
        events.write(&mut text).expect("a Vec grows");
        let text = String::from_utf8(text).expect("text");
        let expected =
            "x,y,z,tm,tl,cr\n0,0,0,0.2,0.5,100\n0.001,0,0,1.1,1.5,50\n0,0,0,2.5,2.75,80\n";
        assert_eq!(text, expected);
        assert_eq!(events.lost, 2);
        let mut without = state(4.0, [[0.0; 2]; 4]);
        without.fields.pop();
        assert_eq!(events.take(&without, &[[0.0; 3]; 2]), None);
    }
}
