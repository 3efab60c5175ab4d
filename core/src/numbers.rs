//! Ranges of the numbers that a case gives. A key that is left out is in every range; `unit` is empty for a plain number. Each check
//! returns the number. Also of vectors and lists of faces.

use crate::body::{Body, Face};
use crate::error::SetupError;

/// Refuses a number that is not above zero or not finite.
///
/// # Errors
/// Names the key, its value and the range.
pub fn check_positive<T: Into<Option<f64>> + Copy>(
    key: &str,
    value: T,
    unit: &str,
) -> Result<T, SetupError> {
    check_above(key, value, 0.0, unit)
}

/// Refuses a number that is not above `low` or not finite.
///
/// # Errors
/// Names the key, its value and the range.
pub fn check_above<T: Into<Option<f64>> + Copy>(
    key: &str,
    value: T,
    low: f64,
    unit: &str,
) -> Result<T, SetupError> {
    let is_valid = |value: f64| value > low && value.is_finite();
    let expected = || format!("a number above {}", with_unit(low, unit));
    check(key, value, is_valid, expected)
}

/// Refuses a number that is below `low` or not finite.
///
/// # Errors
/// Names the key, its value and the range.
pub fn check_at_least<T: Into<Option<f64>> + Copy>(
    key: &str,
    value: T,
    low: f64,
    unit: &str,
) -> Result<T, SetupError> {
    let is_valid = |value: f64| value >= low && value.is_finite();
    let expected = || format!("{} or more", with_unit(low, unit));
    check(key, value, is_valid, expected)
}

/// Refuses a number that is not a fraction, 0 to 1.
///
/// # Errors
/// Names the key, its value and the range.
pub fn check_fraction<T: Into<Option<f64>> + Copy>(key: &str, value: T) -> Result<T, SetupError> {
    check_within(key, value, 0.0, 1.0)
}

/// Refuses a number below `low` or above `high`.
///
/// # Errors
/// Names the key, its value and the range.
pub fn check_within<T: Into<Option<f64>> + Copy>(
    key: &str,
    value: T,
    low: f64,
    high: f64,
) -> Result<T, SetupError> {
    let is_valid = |value: f64| (low..=high).contains(&value);
    check(key, value, is_valid, || {
        format!("a number from {low} to {high}")
    })
}

/// Refuses a number that is not finite.
///
/// # Errors
/// Names the key and its value.
pub fn check_finite<T: Into<Option<f64>> + Copy>(key: &str, value: T) -> Result<T, SetupError> {
    check(key, value, f64::is_finite, || "a finite number".into())
}

/// Refuses a vector with a component that is not finite or along an axis that the body does not have.
///
/// # Errors
/// The first such component.
pub fn check_vector(key: &str, vector: [f64; 3], body: &Body) -> Result<(), SetupError> {
    for (axis, component) in vector.into_iter().enumerate() {
        check_finite(key, component)?;
        if axis >= body.dimension && component != 0.0 {
            let (name, axis) = (&body.name, ["x", "y", "z"][axis]);
            let message = format!(
                "`{key}` has the component {component} along {axis}, and body `{name}` has {} dimensions",
                body.dimension
            );
            return Err(SetupError::value(key, message, format!("0 along {axis}")));
        }
    }
    Ok(())
}

/// Refuses a list of faces in which one occurs twice.
///
/// # Errors
/// The first face that occurs again.
pub fn check_distinct(key: &str, faces: &[Face]) -> Result<(), SetupError> {
    match (1..faces.len()).find(|n| faces[..*n].contains(&faces[*n])) {
        None => Ok(()),
        Some(twice) => {
            let message = format!("face `{}` is given twice", faces[twice].name());
            Err(SetupError::value(key, message, "each face once"))
        }
    }
}

fn check<T: Into<Option<f64>> + Copy>(
    key: &str,
    value: T,
    is_valid: impl Fn(f64) -> bool,
    expected: impl Fn() -> String,
) -> Result<T, SetupError> {
    match value.into() {
        Some(value) if !is_valid(value) => {
            let message = format!("`{key}` is {value}");
            Err(SetupError::value(key, message, expected()))
        }
        _ => Ok(value),
    }
}

fn with_unit(number: f64, unit: &str) -> String {
    match unit {
        "" => number.to_string(),
        _ => format!("{number} {unit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_their_ends() {
        let check = |value: Option<f64>| {
            [
                check_positive("k", value, "s"),
                check_above("k", value, 0.5, ""),
                check_at_least("k", value, 0.0, "m"),
                check_fraction("k", value),
                check_finite("k", value),
            ]
            .map(|result| result.is_ok())
        };
        assert_eq!(check(None), [true; 5]);
        assert_eq!(check(Some(1.0)), [true; 5]);
        assert_eq!(check(Some(0.0)), [false, false, true, true, true]);
        assert_eq!(check(Some(0.5)), [true, false, true, true, true]);
        assert_eq!(check(Some(1.1)), [true, true, true, false, true]);
        assert_eq!(check(Some(-0.1)), [false, false, false, false, true]);
        for value in [f64::NAN, f64::INFINITY] {
            assert_eq!(check(Some(value)), [false; 5], "{value}");
        }
        for (result, expected) in [
            (
                check_positive("time", 0.0, "s"),
                "`time` is 0; expected a number above 0 s",
            ),
            (
                check_at_least("reach", 0.0, 1.0, ""),
                "`reach` is 0; expected 1 or more",
            ),
        ] {
            assert_eq!(result.expect_err("out of range").to_string(), expected);
        }
    }
}
