//! Numbers and units in their usual notation: `2.5 ms`, `W/m³`.

pub(crate) use perimelt_core::text::number;

/// A unit that suits the size of the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prefixed {
    /// the SI number times this is the number in `unit`
    pub factor: f64,
    /// the unit
    pub unit: &'static str,
}

/// The unit in which numbers of a size are shown.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub(crate) struct Rule {
    /// SI unit of the numbers
    pub si: &'static str,
    /// smallest size in the SI unit for which the rule holds
    pub from: f64,
    /// the SI number times this is the number in `unit`
    pub factor: f64,
    /// the unit that is shown
    pub unit: &'static str,
}

const fn rule(si: &'static str, from: f64, factor: f64, unit: &'static str) -> Rule {
    Rule {
        si,
        from,
        factor,
        unit,
    }
}

/// The first rule of an SI unit that holds applies. A size of zero counts as one; units without a rule are shown as
/// they are. Lengths are in millimetres for the sizes of workpieces.
pub(crate) const RULES: [Rule; 23] = [
    rule("m", 2.0, 1.0, "m"),
    rule("m", 5e-5, 1e3, "mm"),
    rule("m", 5e-7, 1e6, "µm"),
    rule("m", 0.0, 1e9, "nm"),
    rule("s", 0.1, 1.0, "s"),
    rule("s", 1e-4, 1e3, "ms"),
    rule("s", 1e-7, 1e6, "µs"),
    rule("s", 1e-10, 1e9, "ns"),
    rule("s", 1e-13, 1e12, "ps"),
    rule("s", 0.0, 1e15, "fs"),
    rule("rad", 0.0, 180.0 / std::f64::consts::PI, "°"),
    rule("m/s", 0.5, 1.0, "m/s"),
    rule("m/s", 0.0, 1e3, "mm/s"),
    rule("m2", 1e-2, 1.0, "m²"),
    rule("m2", 0.0, 1e6, "mm²"),
    rule("m3", 1e-3, 1.0, "m³"),
    rule("m3", 0.0, 1e9, "mm³"),
    rule("J", 1e4, 1e-3, "kJ"),
    rule("J/m", 1e4, 1e-6, "kJ/mm"),
    rule("J/m", 0.0, 1e-3, "J/mm"),
    rule("K/m", 1e3, 1e-3, "K/mm"),
    rule("Pa", 1e10, 1e-9, "GPa"),
    rule("Pa", 1e4, 1e-6, "MPa"),
];

/// The rule for numbers of this size.
fn rule_for(si: &str, largest: f64) -> Option<&'static Rule> {
    let size = if largest == 0.0 { 1.0 } else { largest.abs() };
    RULES.iter().find(|r| r.si == si && size >= r.from)
}

fn prefixed(si: &'static str, largest: f64) -> Prefixed {
    match rule_for(si, largest) {
        Some(&Rule { factor, unit, .. }) => Prefixed { factor, unit },
        // a size that is not a number
        None => Prefixed {
            factor: 1.0,
            unit: si,
        },
    }
}

/// For lengths (m) of this size.
pub(crate) fn length(largest: f64) -> Prefixed {
    prefixed("m", largest)
}

/// For times (s) of this size.
pub(crate) fn time(largest: f64) -> Prefixed {
    prefixed("s", largest)
}

/// For values of this size in an SI unit.
pub(crate) fn value(unit: &str, largest: f64) -> (f64, String) {
    match rule_for(unit, largest) {
        Some(rule) => (rule.factor, rule.unit.to_owned()),
        None => (1.0, pretty_unit(unit)),
    }
}

/// Conversion of values for display: times a factor, plus an offset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    factor: f64,
    offset: f64,
    /// the unit
    pub unit: String,
}

/// 0 degrees Celsius, K.
pub(crate) const ZERO_CELSIUS: f64 = 273.15;

impl Shown {
    /// The scale for values of this size in an SI unit; degrees Celsius for temperatures on request.
    pub(crate) fn new(si: &str, largest: f64, celsius: bool) -> Self {
        if celsius && si == "K" {
            return Self {
                factor: 1.0,
                offset: -ZERO_CELSIUS,
                unit: "°C".into(),
            };
        }
        let (factor, unit) = value(si, largest);
        Self {
            factor,
            offset: 0.0,
            unit,
        }
    }

    /// The scale for the largest of the finite ones of these values.
    pub(crate) fn for_values<'a>(
        si: &str,
        values: impl IntoIterator<Item = &'a f64>,
        celsius: bool,
    ) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let largest = finite.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        Self::new(si, largest, celsius)
    }

    /// The number that is shown for a value.
    pub(crate) fn of(&self, value: f64) -> f64 {
        value * self.factor + self.offset
    }

    /// The value for which a number is shown.
    pub(crate) fn inverse(&self, number: f64) -> f64 {
        (number - self.offset) / self.factor
    }
}

/// A number on a picture: like [`number`], with a minus sign (U+2212) instead of a hyphen.
pub(crate) fn signed_number(value: f64, digits: usize) -> String {
    number(value, digits).replace('-', "−")
}

/// `W/m3` as `W/m³`, the unit `1` as nothing.
pub(crate) fn pretty_unit(unit: &str) -> String {
    if unit == "1" {
        return String::new();
    }
    unit.chars()
        .map(|sign| match sign {
            '2' => '²',
            '3' => '³',
            '*' => '·',
            other => other,
        })
        .filter(|sign| *sign != '^')
        .collect()
}

/// `melt_pool` as `melt pool`.
pub(crate) fn pretty_name(name: &str) -> String {
    name.replace('_', " ")
}

/// A label: name with its unit, if it has one.
pub(crate) fn label(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    }
}

/// A length (m) as text with a suitable unit.
pub(crate) fn length_text(length: f64) -> String {
    let unit = self::length(length);
    format!("{} {}", number(length * unit.factor, 5), unit.unit)
}

/// A time (s) as text with a suitable unit.
pub(crate) fn time_text(time: f64) -> String {
    let unit = self::time(time);
    format!("{} {}", number(time * unit.factor, 5), unit.unit)
}

/// A size in bytes with its unit.
pub fn bytes(count: f64) -> String {
    match count {
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.2} GB", b / 1e9),
    }
}

/// A wall time in its two largest units.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_units_read_naturally() {
        assert_eq!(time_text(2.5), "2.5 s");
        assert_eq!(time_text(2.5e-3), "2.5 ms");
        assert_eq!(time_text(1.2e-14), "12 fs");
        assert_eq!(length_text(1.5e-3), "1.5 mm");
        assert_eq!(signed_number(-1.5e-7, 3), "−1.5e−7");
        assert_eq!(pretty_unit("W/m3"), "W/m³");
        assert_eq!(
            label("fraction of liquid", &pretty_unit("1")),
            "fraction of liquid"
        );
        assert_eq!(value("Pa", 2.3e8), (1e-6, "MPa".into()));
        assert_eq!(value("m3", 8e-8), (1e9, "mm³".into()));
        assert_eq!(value("J", 0.0), (1.0, "J".into()));
        assert_eq!(value("K", 300.0), (1.0, "K".into()));
        let celsius = Shown::new("K", 2000.0, true);
        assert_eq!((celsius.of(293.15), &*celsius.unit), (20.0, "°C"));
        assert_eq!(celsius.inverse(20.0), 293.15);
        assert_eq!(Shown::new("K/m", 10.0, true).unit, "K/m");
        let values = [1.0, f64::NAN, -2e8, f64::INFINITY];
        assert_eq!(Shown::for_values("Pa", &values, false).unit, "MPa");
        assert_eq!(length(f64::NAN).unit, "m");
        assert_eq!((length(0.0).unit, time(0.0).unit), ("mm", "s"));
        assert_eq!(length(0.05).unit, "mm");
        assert_eq!(length(3e-7).unit, "nm");
    }
}
