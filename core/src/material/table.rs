//! A value given at rows of increasing abscissa (temperature or time).

use thiserror::Error;

/// Piecewise linear function through rows (x, y), clamped to the first and last row outside.
///
/// Clamping is the reading of Wang (2025), section 7.3 for E(θ) (docs/theory/welding.md, "Errors in the publication"); a property
/// is never extrapolated.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    x: Vec<f64>,
    y: Vec<f64>,
}

/// What is wrong with the rows of a table. Rows count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TableError {
    /// No rows.
    #[error("the table is empty; give at least one row")]
    Empty,
    /// The two columns differ in length.
    #[error("the table has {x} abscissae but {y} values; give one value per row")]
    LengthsDiffer {
        /// Number of abscissae.
        x: usize,
        /// Number of values.
        y: usize,
    },
    /// An abscissa is not larger than the one before it.
    #[error("the table must increase from row to row, but row {row} is {value} after {previous}")]
    NotIncreasing {
        /// Row, from 1.
        row: usize,
        /// Abscissa of the row before.
        previous: f64,
        /// Abscissa of the row.
        value: f64,
    },
    /// Not a number, or infinite.
    #[error("row {row} of the table is {value}; only finite numbers are allowed")]
    NotFinite {
        /// Row, from 1.
        row: usize,
        /// The offending number.
        value: f64,
    },
}

/// Checks that `x` is finite, not empty and strictly increasing.
///
/// # Errors
/// The first row that is not.
pub(crate) fn check_increasing(x: &[f64]) -> Result<(), TableError> {
    if x.is_empty() {
        return Err(TableError::Empty);
    }
    check_finite(x)?;
    match x.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(i) => Err(TableError::NotIncreasing {
            row: i + 2,
            previous: x[i],
            value: x[i + 1],
        }),
        None => Ok(()),
    }
}

fn check_finite(column: &[f64]) -> Result<(), TableError> {
    match column.iter().position(|value| !value.is_finite()) {
        Some(i) => Err(TableError::NotFinite {
            row: i + 1,
            value: column[i],
        }),
        None => Ok(()),
    }
}

impl Table {
    /// A table of rows (`x[i]`, `y[i]`).
    ///
    /// # Errors
    /// [`TableError`] when there are no rows, the columns differ in length, a number is not
    /// finite, or `x` does not strictly increase.
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> Result<Self, TableError> {
        if x.len() != y.len() {
            return Err(TableError::LengthsDiffer {
                x: x.len(),
                y: y.len(),
            });
        }
        check_increasing(&x)?;
        check_finite(&y)?;
        Ok(Self { x, y })
    }

    /// Abscissae of the rows, strictly increasing.
    pub fn abscissae(&self) -> &[f64] {
        &self.x
    }

    /// Values of the rows.
    pub fn values(&self) -> &[f64] {
        &self.y
    }

    /// First and last abscissa.
    pub fn range(&self) -> (f64, f64) {
        (self.x[0], self.x[self.x.len() - 1])
    }

    /// Value at `x`: linear between rows, clamped outside. A NaN gives a NaN.
    pub fn at(&self, x: f64) -> f64 {
        let above = self.x.partition_point(|&row| row <= x);
        if above == 0 {
            return if x.is_nan() { x } else { self.y[0] };
        }
        let i = above - 1;
        if above == self.x.len() {
            return self.y[i];
        }
        let fraction = (x - self.x[i]) / (self.x[above] - self.x[i]);
        self.y[i] + fraction * (self.y[above] - self.y[i])
    }

    /// Value and slope at `x`.
    pub fn with_slope(&self, x: f64) -> (f64, f64) {
        (self.at(x), self.slope(x))
    }

    /// Slope at `x`; at a row that of the rows after it, zero where the value is clamped.
    pub fn slope(&self, x: f64) -> f64 {
        match self.x.partition_point(|&row| row <= x) {
            0 => 0.0,
            above if above == self.x.len() => 0.0,
            above => self.slope_before(above),
        }
    }

    /// Value at `x`, continued outside by the slopes of the first and the last two rows.
    pub fn continued(&self, x: f64) -> f64 {
        let (first, last) = self.range();
        let beyond = (x - last).max(0.0) + (x - first).min(0.0);
        self.at(x) + beyond * self.continued_slope(x)
    }

    /// Slope of [`Self::continued`] at `x`; zero for a table of one row.
    pub fn continued_slope(&self, x: f64) -> f64 {
        match self.x.len() {
            1 => 0.0,
            rows => {
                let above = self.x.partition_point(|&row| row <= x);
                self.slope_before(above.clamp(1, rows - 1))
            }
        }
    }

    /// Slope between a row and the one before it.
    fn slope_before(&self, row: usize) -> f64 {
        (self.y[row] - self.y[row - 1]) / (self.x[row] - self.x[row - 1])
    }

    /// Exact integral of the clamped function from `from` to `to`; negative when `to < from`.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        if to < from {
            return -self.integral(to, from);
        }
        let first = self.x.partition_point(|&row| row <= from);
        let last = self.x.partition_point(|&row| row < to).max(first);
        let mut left = from;
        let mut sum = 0.0;
        for &right in self.x[first..last].iter().chain([&to]) {
            sum += 0.5 * (self.at(left) + self.at(right)) * (right - left);
            left = right;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp() -> Table {
        Table::new(vec![1.0, 2.0, 4.0], vec![10.0, 30.0, 20.0]).expect("valid rows")
    }

    #[test]
    fn value_is_linear_between_rows_and_clamped_outside() {
        for (x, expected) in [
            (-5.0, 10.0),
            (1.0, 10.0),
            (1.25, 15.0),
            (2.0, 30.0),
            (3.0, 25.0),
            (4.0, 20.0),
            (1e30, 20.0),
        ] {
            assert_eq!(ramp().at(x), expected, "at {x}");
        }
        assert!(ramp().at(f64::NAN).is_nan());
    }

    #[test]
    fn slopes_are_those_of_the_rows_after() {
        for (x, clamped, continued, value) in [
            (0.0, 0.0, 20.0, -10.0),
            (1.0, 20.0, 20.0, 10.0),
            (1.5, 20.0, 20.0, 20.0),
            (2.0, -5.0, -5.0, 30.0),
            (4.0, 0.0, -5.0, 20.0),
            (6.0, 0.0, -5.0, 10.0),
        ] {
            let found = (
                ramp().slope(x),
                ramp().continued_slope(x),
                ramp().continued(x),
            );
            assert_eq!(found, (clamped, continued, value), "at {x}");
        }
        let one = Table::new(vec![300.0], vec![7.0]).expect("valid row");
        assert_eq!(
            (one.continued(9.0), one.continued_slope(9.0), one.slope(9.0)),
            (7.0, 0.0, 0.0)
        );
    }

    #[test]
    fn a_single_row_is_a_constant() {
        let table = Table::new(vec![300.0], vec![7.0]).expect("valid row");
        assert_eq!(
            (table.at(0.0), table.at(1e6), table.integral(1.0, 3.0)),
            (7.0, 7.0, 14.0)
        );
    }

    #[test]
    fn wrong_rows_are_named() {
        let cases = [
            (vec![], vec![], TableError::Empty),
            (vec![1.0], vec![], TableError::LengthsDiffer { x: 1, y: 0 }),
            (
                vec![1.0, 3.0, 3.0],
                vec![0.0; 3],
                TableError::NotIncreasing {
                    row: 3,
                    previous: 3.0,
                    value: 3.0,
                },
            ),
            (
                vec![1.0, 2.0],
                vec![0.0, f64::INFINITY],
                TableError::NotFinite {
                    row: 2,
                    value: f64::INFINITY,
                },
            ),
        ];
        for (x, y, expected) in cases {
            assert_eq!(Table::new(x, y), Err(expected));
        }
    }

    #[test]
    fn integral_of_the_whole_table_is_the_trapezoid_sum() {
        // 1 before + 20 + 50 inside + 1 after, all exact in binary
        assert_eq!(ramp().integral(0.0, 5.0), 10.0 + 20.0 + 50.0 + 20.0);
        assert_eq!(ramp().integral(5.0, 0.0), -100.0);
        assert_eq!(ramp().integral(2.5, 2.5), 0.0);
    }

    proptest! {
        #[test]
        fn integral_adds_over_adjoining_intervals(a in -2.0..7.0, b in -2.0..7.0, c in -2.0..7.0) {
            let table = ramp();
            let whole = table.integral(a, c);
            let parts = table.integral(a, b) + table.integral(b, c);
            // values below 30, lengths below 9: rounding of a few sums of size 300
            prop_assert!((whole - parts).abs() < 1e-12 * 300.0);
        }
    }
}
