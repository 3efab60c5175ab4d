//! Bodies read from a table of points.

use super::{Body, BodyError, Points, bounded};
use crate::samples::NumberTable;
use crate::shape::Shape;

/// Columns of a table of points that describe the points; others are initial fields.
pub const POINT_COLUMNS: [&str; 5] = ["x", "y", "z", "volume", "spacing"];

/// Cells of points without a grid leave gaps: they are extended by this many spacings.
const SLACK: f64 = 0.25;

/// What can be wrong with a table of points.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PointTableError {
    /// A column that is missing.
    #[error(
        "the table of points has no column `{0}`: its first line names x, y, z and volume or spacing"
    )]
    Column(&'static str),
    /// A line that is not numbers.
    #[error("line {line} of the table of points: `{text}` is not {expected}")]
    Number {
        /// From 1.
        line: usize,
        /// Text at the place.
        text: String,
        /// Expected text.
        expected: &'static str,
    },
    /// No point inside the shape.
    #[error("no point of the table lies inside the shape")]
    Empty,
}

impl Body {
    /// The points of a table that lie inside `shape`. Its first line names the columns, separated
    /// by commas, semicolons, tabs or blanks: `x`, `y`, `z` (m; those of missing axes may be left out) and `volume` (m³) or
    /// `spacing` (m). Other columns are not read.
    ///
    /// # Errors
    /// [`BodyError::Table`] with the line at fault.
    pub fn from_table(
        name: &str,
        shape: &Shape,
        dimension: usize,
        thickness: f64,
        text: &str,
    ) -> Result<Body, BodyError> {
        let (min, max) = bounded(shape, dimension, thickness)?;
        let middle = 0.5 * (min + max);
        let depth = if dimension == 3 { 1.0 } else { thickness };
        let table = NumberTable::new(text);
        let column = |name: &'static str| table.find(name);
        let axes: Vec<usize> = ["x", "y", "z"][..dimension]
            .iter()
            .map(|axis| column(axis).ok_or(PointTableError::Column(axis)))
            .collect::<Result<_, _>>()?;
        let (volumes, size) = match (column("volume"), column("spacing")) {
            (Some(volume), _) => (true, volume),
            (None, Some(spacing)) => (false, spacing),
            (None, None) => return Err(PointTableError::Column("volume").into()),
        };
        let (mut positions, mut volumes_of, mut spacings) = (Vec::new(), Vec::new(), Vec::new());
        for (row, line) in table.lines().enumerate() {
            let number = |column: usize, expected: &'static str, least: f64| {
                let text = table.text(row, column);
                let value = text.parse::<f64>().ok();
                let value = value.filter(|v| v.is_finite() && *v > least);
                value.ok_or_else(|| PointTableError::Number {
                    line,
                    text: text.into(),
                    expected,
                })
            };
            let mut x = middle;
            for (axis, &column) in axes.iter().enumerate() {
                x[axis] = number(column, "a number", f64::NEG_INFINITY)?;
            }
            let size = number(size, "a number above 0", 0.0)?;
            let (volume, spacing) = if volumes {
                (size, (size / depth).powf(1.0 / dimension as f64))
            } else {
                (size.powi(dimension as i32) * depth, size)
            };
            if shape.contains(&x, 1e-6 * spacing) {
                positions.push(x);
                volumes_of.push(volume);
                spacings.push(spacing);
            }
        }
        if positions.is_empty() {
            return Err(PointTableError::Empty.into());
        }
        let points = Points {
            position: positions.into(),
            volume: volumes_of.into(),
            spacing: spacings.into(),
            horizon_factor: Vec::new(),
        };
        let (points, discretisation) = points.into_cloud(SLACK);
        Ok(Body::new(
            name,
            dimension,
            thickness,
            points,
            discretisation,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Face;
    use crate::shape::BoxShape;

    fn read(text: &str) -> Result<Body, BodyError> {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [1.0; 3],
        });
        Body::from_table("cloud", &shape, 2, 0.5, text)
    }

    #[test]
    fn points_have_volumes_and_spacings() {
        let body = read("x, y, volume\n0.2, 0.3, 0.02\n\n0.4, 0.3, 0.02\n5, 5, 1").expect("valid");
        assert_eq!(body.points.len(), 2);
        assert!((body.points.spacing[0] - 0.2).abs() < 1e-15);
        let body = read("spacing,y,x\n0.2,0.3,0.2").expect("valid");
        assert!((body.points.volume[0] - 0.02).abs() < 1e-15);
        assert_eq!(body.points.position.at(0).z, 0.5);
    }

    #[test]
    fn a_grid_in_a_table_has_the_surface_of_a_grid() {
        let mut text = "x,y,spacing\n".to_string();
        for i in 0..16 {
            let at = |c: usize| 0.125 + 0.25 * c as f64;
            text += &format!("{},{},0.25\n", at(i % 4), at(i / 4));
        }
        let body = read(&text).expect("valid");
        let area: f64 = body.surface(&Face::ALL).iter().map(|s| s.area).sum();
        assert!((area - 4.0 * 0.5).abs() < 1e-12, "{area}");
    }

    #[test]
    fn mistakes_name_their_line() {
        for (text, message) in [
            ("x,y\n0,0", "no column `volume`"),
            ("x,z,volume\n0,0", "no column `y`"),
            (
                "x,y,volume\n0.1,0.1,1\n0.1,up,1",
                "line 3 of the table of points: `up` is not a number",
            ),
            ("x,y,volume\n0.1,0.1,-1", "`-1` is not a number above 0"),
            (
                "x,y,volume\n7,7,1",
                "no point of the table lies inside the shape",
            ),
        ] {
            let error = read(text).expect_err("a mistake").to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
