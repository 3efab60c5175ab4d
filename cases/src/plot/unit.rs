//! Numbers and units in their usual notation: `2.5 ms`, `W/m³`.

/// A unit that suits the size of the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prefixed {
    /// the SI number times this is the number in `unit`
    pub factor: f64,
    /// the unit
    pub unit: &'static str,
}

/// For lengths (m) of this size; millimetres for the sizes of workpieces.
pub(crate) fn length(largest: f64) -> Prefixed {
    let (factor, unit) = match largest.abs() {
        size if size >= 2.0 => (1.0, "m"),
        size if size >= 5e-5 || size == 0.0 => (1e3, "mm"),
        size if size >= 5e-7 => (1e6, "µm"),
        _ => (1e9, "nm"),
    };
    Prefixed { factor, unit }
}

/// For times (s) of this size.
pub(crate) fn time(largest: f64) -> Prefixed {
    let (factor, unit) = match largest.abs() {
        size if size >= 0.1 || size == 0.0 => (1.0, "s"),
        size if size >= 1e-4 => (1e3, "ms"),
        size if size >= 1e-7 => (1e6, "µs"),
        size if size >= 1e-10 => (1e9, "ns"),
        size if size >= 1e-13 => (1e12, "ps"),
        _ => (1e15, "fs"),
    };
    Prefixed { factor, unit }
}

/// For values of this size in an SI unit: lengths and stresses get a prefix.
pub(crate) fn value(unit: &str, largest: f64) -> (f64, String) {
    match (unit, largest.abs()) {
        ("m", size) => {
            let length = length(size);
            (length.factor, length.unit.to_owned())
        }
        ("m/s", size) if size > 0.0 && size < 0.5 => (1e3, "mm/s".to_owned()),
        ("J", size) if size >= 1e4 => (1e-3, "kJ".to_owned()),
        ("J/m", size) if size >= 1e4 => (1e-6, "kJ/mm".to_owned()),
        ("J/m", _) => (1e-3, "J/mm".to_owned()),
        ("K/m", size) if size >= 1e3 => (1e-3, "K/mm".to_owned()),
        ("Pa", size) if size >= 1e10 => (1e-9, "GPa".to_owned()),
        ("Pa", size) if size >= 1e4 => (1e-6, "MPa".to_owned()),
        (unit, _) => (1.0, pretty_unit(unit)),
    }
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

/// With at most `digits` significant digits and no trailing zeros.
pub(crate) fn number(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 {
            "0".into()
        } else {
            value.to_string()
        };
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&exponent) {
        let text = format!("{:.*e}", digits - 1, value);
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", trimmed(mantissa));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trimmed(&format!("{value:.decimals$}")).to_owned()
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    }
}

/// A time (s) as text with a suitable unit.
pub(crate) fn time_text(time: f64) -> String {
    let unit = self::time(time);
    format!("{} {}", number(time * unit.factor, 5), unit.unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_units_read_naturally() {
        assert_eq!(time_text(2.5), "2.5 s");
        assert_eq!(time_text(2.5e-3), "2.5 ms");
        assert_eq!(time_text(1.2e-14), "12 fs");
        assert_eq!(pretty_unit("W/m3"), "W/m³");
        assert_eq!(
            label("fraction of liquid", &pretty_unit("1")),
            "fraction of liquid"
        );
        assert_eq!(value("Pa", 2.3e8), (1e-6, "MPa".into()));
        assert_eq!(length(0.05).unit, "mm");
        assert_eq!(length(3e-7).unit, "nm");
        assert_eq!(number(1e-12, 3), "1e-12");
        assert_eq!(number(1234.567, 5), "1234.6");
        assert_eq!(number(-0.25, 5), "-0.25");
    }
}
