//! Numbers in messages.

/// With at most `digits` significant digits and no trailing zeros.
pub fn number(value: f64, digits: usize) -> String {
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

/// A position with at most 6 significant digits for each component: `[0.102, 0, 0.01]`.
pub fn position(position: impl Into<[f64; 3]>) -> String {
    format!("[{}]", position.into().map(|x| number(x, 6)).join(", "))
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_mean_something() {
        assert_eq!(number(1e-12, 3), "1e-12");
        assert_eq!(number(1234.567, 5), "1234.6");
        assert_eq!(number(-0.25, 5), "-0.25");
        assert_eq!(number(0.0, 3), "0");
        assert_eq!(number(f64::INFINITY, 3), "inf");
        assert_eq!(position([0.1 + 0.002, 0.0, -2.5e-5]), "[0.102, 0, -2.5e-5]");
    }
}
