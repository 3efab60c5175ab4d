//! Values of a property by temperature: one for each row, or a formula between the rows.

use std::fmt;

use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{self, Deserializer, SeqAccess, Visitor};

use super::table::{Table, TableError};
use crate::formula::Formula;

/// Widest interval of a table that stands for a formula, K. The values between two rows then differ from those of the formula by an
/// eighth of its second derivative.
const WIDEST: f64 = 1.0;

/// Most rows of a table that stands for a formula.
const MOST_ROWS: f64 = 1e5;

/// The key `value` of a property.
#[derive(Debug)]
pub(super) enum Values {
    /// One value for each temperature.
    Rows(Vec<f64>),
    /// A formula in the temperature T (K), between the first temperature and the last one.
    Formula(Formula),
}

/// A mistake in the values by temperature.
#[derive(Debug, thiserror::Error)]
pub(super) enum ValuesError {
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(
        "`{formula}` is {value} at T = {temperature} K; expected a finite value at all temperatures of the table"
    )]
    NotFinite {
        formula: String,
        value: f64,
        temperature: f64,
    },
    #[error(
        "`{formula}` is given from {first} to {last} K; expected a range of at most {MOST_ROWS} K"
    )]
    Range {
        formula: String,
        first: f64,
        last: f64,
    },
}

impl Values {
    /// The table of a property whose rows have these temperatures (K), finite and increasing.
    pub(super) fn table(self, temperatures: Vec<f64>) -> Result<Table, ValuesError> {
        match self {
            Values::Rows(rows) => Ok(Table::new(temperatures, rows)?),
            Values::Formula(formula) => table_of(&formula, &temperatures),
        }
    }
}

/// Rows at the temperatures (K), and at equal distances of at most [`WIDEST`] between them.
fn table_of(formula: &Formula, temperatures: &[f64]) -> Result<Table, ValuesError> {
    let (first, last) = (temperatures[0], temperatures[temperatures.len() - 1]);
    let text = || formula.text().to_owned();
    if last - first > MOST_ROWS * WIDEST {
        let formula = text();
        return Err(ValuesError::Range {
            formula,
            first,
            last,
        });
    }
    let between = temperatures.windows(2).flat_map(|pair| {
        let parts = ((pair[1] - pair[0]) / WIDEST).ceil();
        let width = (pair[1] - pair[0]) / parts;
        (0..parts as usize).map(move |part| pair[0] + part as f64 * width)
    });
    let rows: Vec<f64> = between.chain([last]).collect();
    let values: Vec<f64> = rows.iter().map(|t| formula.of(&[*t])).collect();
    match values.iter().position(|value| !value.is_finite()) {
        Some(row) => Err(ValuesError::NotFinite {
            formula: text(),
            value: values[row],
            temperature: rows[row],
        }),
        None => Ok(Table::new(rows, values)?),
    }
}

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ValuesVisitor;
        impl<'de> Visitor<'de> for ValuesVisitor {
            type Value = Values;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list with one value for each temperature, or a formula in the temperature T (K)")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Values, E> {
                let formula = Formula::in_variables(text, &["T"]).map_err(E::custom)?;
                Ok(Values::Formula(formula))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, rows: A) -> Result<Values, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(rows)).map(Values::Rows)
            }
        }
        deserializer.deserialize_any(ValuesVisitor)
    }
}

#[cfg(test)]
mod tests {
    use crate::material::property::tests::read;

    /// Sutherland's law for air: 1.716e-5 Pa s at 273.15 K, 4.152e-5 at 1000 K; held outside of the range.
    #[test]
    fn a_formula_is_a_table_between_the_temperatures() {
        let sutherland =
            |t: f64| 1.716e-5 * (t / 273.15).powf(1.5) * (273.15 + 110.4) / (t + 110.4);
        let text = "{ temperature = [250, 1000.25], value = '1.716e-5 * (T / 273.15)^1.5 * (273.15 + 110.4) / (T + 110.4)' }";
        let viscosity = read(text).expect("valid");
        for t in [250.0, 273.15, 333.33, 500.5, 999.9, 1000.25] {
            let error = viscosity.at(t, 0.0) / sutherland(t) - 1.0;
            // the second derivative is below 6e-6 of the value
            assert!(error.abs() < 6e-6 / 8.0, "{t}: {error}");
        }
        assert!((viscosity.at(1000.0, 0.0) - 4.152e-5).abs() < 2e-8);
        assert_eq!(viscosity.at(100.0, 0.0), viscosity.at(250.0, 0.0));
        assert_eq!(viscosity.at(2000.0, 0.0), viscosity.at(1000.25, 0.0));
    }

    #[test]
    fn rows_that_are_given_are_rows_of_the_table() {
        let text = "{ temperature = [300, 300.5, 302.2], value = 'abs(T - 300.5)' }";
        let property = read(text).expect("valid");
        let rows = property.temperatures();
        assert_eq!(
            (rows.len(), rows[0], rows[1], rows[3]),
            (4, 300.0, 300.5, 302.2)
        );
        assert_eq!(property.at(300.5, 0.0), 0.0);
        let by_phase = "{ solid = { temperature = [300, 400], value = '2 * T' }, liquid = 1 }";
        assert_eq!(read(by_phase).expect("valid").at(350.5, 0.0), 701.0);
        // one temperature is a constant
        let one = read("{ temperature = [300], value = '2 * T' }").expect("valid");
        assert_eq!(one.at(900.0, 0.0), 600.0);
    }

    #[test]
    fn mistakes_are_explained() {
        for (value, message) in [
            (
                "'2 * t'",
                "`t` in the formula `2 * t` is unknown; known are T",
            ),
            ("'ln(T - 300)'", "`ln(T - 300)` is -inf at T = 300 K"),
            (
                "3",
                "expected a list with one value for each temperature, or a formula",
            ),
            ("[1, 'T']", "expected f64"),
        ] {
            let text = format!("{{ temperature = [300, 310], value = {value} }}");
            let error = read(&text).expect_err(&text).to_string();
            assert!(error.contains(message), "{value}: {error}");
        }
        let wide = "{ temperature = [0, 1e6], value = 'T' }";
        let error = read(wide).expect_err(wide).to_string();
        assert!(error.contains("at most 100000 K"), "{error}");
    }
}
